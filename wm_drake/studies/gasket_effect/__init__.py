"""Run a machine without and with its gasket, and compare both ([B] section 2.2).

Enters: a machine and loads. Leaves: a `GasketEffect` with both results and tables of their
differences, in the transient and in the steady state.
May import: `studies.spin`, `simulation` and the rooms before them.
"""
