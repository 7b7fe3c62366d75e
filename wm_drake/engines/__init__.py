"""Integrate the motion of a machine that is set up over a spin profile.

Enters: a `Setup` from `wm_drake.model`, a `SpinProfile`, a step size. Leaves: a `Trajectory`, the
sampled states. `drake` steps the Drake diagram with an integrator of pydrake's `Simulator`; it is
the reference. `compiled` runs the same machine as compiled code, several runs at a time.
May import: `model`, `elements`, `systems` and the rooms before them.
"""

DEFAULT_ENGINE = "compiled"
"""Name of the engine of all runs that name no other one."""
