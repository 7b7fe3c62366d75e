"""Turn a law into machine code: compilation and its cache, SIMD lanes, elementary functions.

Also small vectors and matrices, and named packed layouts of the numbers that laws read. Enters:
scalar Python functions. Leaves: the same functions compiled for floats and SIMD lanes, and
interpreted for other scalars such as AutoDiffXd. Imports no other room.
"""
