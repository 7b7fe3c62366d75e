"""What to measure next: rank measurements by how much surer they make an answer about a machine.

Enters: a built machine, what is known of its numbers, and measurements that could be made. Leaves:
the uncertainty of the answer before and after each of them, singly, in pairs and one after the
other. May import: `simulation`, `rigs` and the rooms before them, `studies.tolerance`,
`studies.calibrate` and `studies.modes`.
"""
