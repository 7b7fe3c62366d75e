"""Calibration: a machine whose amplitudes are those that were measured, as near as bounds and priors let it."""
