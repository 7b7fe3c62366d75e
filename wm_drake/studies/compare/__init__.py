"""Compare recordings of a machine with the signals that its sensors would record of the model.

Enters: recorded files of one test, its sensors, a machine. Leaves: envelopes, orders, RMS by region
and their differences, beside the scatter of repeats.
May import: `simulation`, `report` and the rooms before them.
"""
