"""Find the weakest drive that passes every critical speed.

Enters: a machine with a motor, and a function that runs cases. Leaves: smallest torque limit of
each load, a map over torque limit and unbalance.
May import: `batch` and the rooms before it.
"""
