"""A machine on a page that runs it: its numbers, its measures, and the page itself.

Enters: the parameters of a machine. Leaves: an open machine whose numbers a page moves (`machine`,
`parts`, `state`, `measures`), the page (`static`, plain modules), and the page as one file with the
machine in it (`page_data`, `exported`). The studio serves the same page.
May import: rooms up to `report` (not its pages).
"""
