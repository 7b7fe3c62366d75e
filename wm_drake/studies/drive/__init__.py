"""Find the weakest drive that passes every critical speed, and estimate unbalance from the drive.

Enters: a machine with a motor, and a function that runs cases. Leaves: smallest torque limit of
each load, a map over torque limit and unbalance, errors of the estimated unbalance.
May import: `batch` and the rooms before it.
"""
