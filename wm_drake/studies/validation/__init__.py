"""Results of the shipped machines beside published numbers, with a verdict for each.

Enters: results of other studies. Leaves: `Row`s and a page in Markdown. Uses no engine.
May import: `studies.spin`, `studies.gasket`, `studies.spin_cycle` and the
rooms before them.
"""
