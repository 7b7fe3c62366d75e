"""Wrap each element as a Drake LeafSystem with ports, parameters and state.

Enters: packed parameters of an element. Leaves: a LeafSystem with named ports, for float and
AutoDiffXd, that calls one function of `elements`. Also systems for the spin profile, the speed
source of the drum, the sensors and an external force.
May import: `elements` and the rooms before it; pydrake.
"""
