"""Say where rings of balls help and where they hurt, over unbalance, ball mass and damping.

Enters: a machine with rings of balls, and a function that runs cases. Leaves: amplitudes with free
balls and with the same balls locked, and the speed from which free balls pay.
May import: `batch` and the rooms before it.
"""
