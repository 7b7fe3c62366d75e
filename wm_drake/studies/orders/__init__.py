"""Orders of a record or of a measurement: waterfall and order map of each signal.

Enters: a file with signals and the speed of the drum. Leaves: maps, an `Answer`.
May import: `simulation`, `report` and the rooms before them.
"""
