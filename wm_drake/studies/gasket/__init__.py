"""Screen the factors of the gasket by a designed experiment ([B] section 4).

Enters: a machine, factors and a design. Leaves: a labelled dataset with the responses of all trials
and the analysis of the variance of each response, a fitted model, and one proposed setting.
`screening`, `figures` and `tables` use no machine. May import: `studies.doe`, `simulation` and the
rooms before them.
"""
