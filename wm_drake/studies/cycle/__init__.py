"""Show a whole cycle of a machine: unbalance, speed, swing, gap and loads of the feet.

Enters: a machine, a load that may dry, a spin profile. Leaves: their course over the cycle, and
their extremes in each part of it.
May import: `batch` and the rooms before it.
"""
