"""Verdict: whether the tub of a machine touches, how likely, what decides it, what to change.

Enters: a built machine and a vary file of its laundry. Leaves: runs with and without changes,
the page, and the exit code of the command. May import: `simulation` and the rooms before it, and
`studies.tolerance`.
"""
