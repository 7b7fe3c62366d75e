"""Screen the factors of the gasket by a designed experiment ([B] section 4).

Enters: a machine, factors and a design. Leaves: a `Screening` with the responses of all trials and
an analysis of variance for each response, and its tables.
`screening` and `tables` use no machine. May import: `studies.doe`, `simulation` and the rooms
before them.
"""
