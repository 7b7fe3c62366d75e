"""Run cases of a machine over spin profiles and collect records and measures for the report.

Enters: machine parameters and cases. Leaves: a `SpinRuns`.
May import: `simulation` and the rooms before it.
"""
