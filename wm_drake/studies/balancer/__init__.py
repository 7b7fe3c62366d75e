"""Say which balancer to fit, and where rings of balls help and hurt.

Enters: a machine, rings of balls and liquid, and a function that runs cases. Leaves: amplitudes
without a balancer, with balls and with liquid; free balls against the same balls locked, over
unbalance, ball mass and damping; the speed from which free balls pay.
May import: `batch` and the rooms before it.
"""
