"""Run a case of a machine and label what comes out.

Enters: a built `Machine` and a `Case`. Leaves: a `Record` (xarray, SI), and from it `Measures`: amplitudes, largest
forces, smallest gap, RMS per region. May import: `engines`, `model` and the rooms above them.
"""
