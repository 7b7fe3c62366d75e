"""Calibrate a machine to recordings of its sensors.

Enters: recorded files of one test, its sensors, a machine, keys of unknown numbers. Leaves: values
with confidence intervals, residuals, and the machine with the values.
May import: `studies.compare`, `studies.fitting`, `simulation` and the rooms before them.
"""
