"""Turn a law into machine code: compilation and its cache, SIMD lanes, elementary functions, small vectors.

Enters: scalar Python functions. Leaves: the same functions compiled for floats and for SIMD lanes, and interpreted for
other scalars such as AutoDiffXd. Imports no other room.
"""
