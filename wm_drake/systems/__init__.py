"""Wrap each element as a Drake LeafSystem: ports, parameters, state; each calls one law.

Enters: packed parameters of an element. Leaves: a LeafSystem with named ports, for float and
AutoDiffXd. Also the spin profile, the speed source of the drum, the sensors and an external force.
May import: `elements` and the rooms above it, and pydrake.
"""
