"""Steady response over the drum's speed: harmonic balance, its stability, the influence of sweep.

A machine as it is set up enters, with speeds; amplitudes over speed leave. The forces are those of
the compiled right-hand side, so that no law is written twice. Imports models, engines, simulation
and batch.
"""
