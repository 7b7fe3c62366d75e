"""Run a whole machine as one compiled function, `WIDTH` runs side by side in the vector units.

Enters: a `Setup`. Leaves: a `Trajectory`. The numbers are packed from the built `Machine`, and the
laws are those of the Drake systems; only rigid-body mechanics and the integrator are defined here.
A single run is a batch of one that fills all lanes. The results of a run do not depend on the other
runs of its batch.
"""
