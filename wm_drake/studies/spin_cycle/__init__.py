"""Run a spin cycle with many unbalances ([A] section 4).

Enters: a machine, a table of unbalance cases and a profile with regions; optionally measurements.
Leaves: an `Answer` with the RMS displacement per region, sensor and axis, and errors against a
measurement.
May import: `studies.spin`, `batch` and the rooms before it.
"""
