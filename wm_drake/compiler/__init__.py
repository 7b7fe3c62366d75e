"""Compile laws to machine code: cache, SIMD lanes, elementary functions, small vectors.

Enters: scalar Python functions. Leaves: the same functions compiled for floats and for SIMD lanes,
and interpreted for other scalars such as AutoDiffXd. `packed` declares the layout of arrays of
named numbers. May import: no other room; no pydrake.
"""
