"""Answer one question about a machine per folder; share designs of experiments and fits.

Enters: machine parameters, and what a study varies or measures. Leaves: results such as modes, an
ANOVA table, a fit or a calibration. `study.py` declares a study, `run.py` runs any of them. Shared:
`doe`, `fitting`; they take a function of parameters and need no engine.
May import: `report` and the rooms before it.
"""
