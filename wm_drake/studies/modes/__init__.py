"""Modes of a machine, critical speeds, and what moves them.

A built machine enters; modes of three linearisations, a Campbell diagram and sensitivities leave.
The only home of linearisation: `machine show` takes its natural frequencies from here.
"""
