"""Studies: one folder for each question about a machine, and tools that several studies share.

Enters: machine parameters, and what a study varies or measures. Leaves: results such as modes, an
ANOVA table, a fit or a calibration. Questions: `spin`, `description`, `gasket`, `gasket_damping`,
`spin_cycle`, `spin_identification`, `identification`, `calibration`. Shared: `doe`, `fitting`; they
take a function of parameters and need no engine.
May import: `rigs`, `batch` and the rooms before them.
"""
