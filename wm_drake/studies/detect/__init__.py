"""Detection of unbalance: whether the machine knows, before it spins, that the tub would touch.

Enters: a built machine, random laundry, and the signals that its controller reads. Leaves: an
estimate with its error, the threshold for a tolerated risk, what it costs, and the same estimate as
a system of Drake. May import: `simulation` and the rooms before it, and `studies.tolerance`.
"""
