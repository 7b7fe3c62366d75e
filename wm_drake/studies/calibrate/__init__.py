"""Calibrate a machine: fit free quantities to measured amplitudes, or to records of its sensors.

Enters: a built machine, a vary file (bounds and priors) and measured amplitudes. Leaves: a
`Calibration` with the distinct solutions, and predictions of held-out loads.
Or enters: a machine, unknowns, and recordings, `recorded`. Leaves: a fit of `records`.
Both state a problem of `studies.fitting`, whose machines run in an experiment.
May import: `studies.compare`, `studies.fitting` and the rooms before them.
"""
