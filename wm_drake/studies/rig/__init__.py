"""Test a component of a machine, or of a file, on a bench.

Enters: options that name the component and its motions. Leaves: an `Answer` with force loops.
May import: `rigs` and the rooms before it; no pydrake.
"""
