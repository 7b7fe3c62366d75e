"""Run cases of a machine over spin profiles and show records, measures and their differences.

Enters: machine parameters and cases. Leaves: `SpinRuns`, and an `Answer` that shows them.
May import: `studies.modes`, `simulation` and the rooms before it.
"""
