"""Run one case of a machine and label the outputs.

Enters: a built `Machine` and a `Case` (`cases`). Leaves: a `Record` (`records`; an xarray dataset
in SI units) and what is computed from it: the `Measures` (amplitudes, largest forces, smallest gap)
and the RMS displacement per region of the spin profile (`vibration`). `runs` holds `simulate`.
May import: `engines`, `model` and the rooms before them.
"""
