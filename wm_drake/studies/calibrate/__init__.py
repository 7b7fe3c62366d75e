"""Calibrate a machine: fit free quantities so that computed amplitudes approach measured ones.

Enters: a built machine, a free file (bounds and priors) and measured amplitudes. Leaves: a
`Calibration` with the distinct solutions, and predictions of held-out loads.
Search and solutions use no machine; `targets` runs it with `simulate_many`.
May import: `batch` and the rooms before it.
"""
