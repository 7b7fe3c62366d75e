"""A machine that meets a stop within one step of the default size."""

import wm_drake as wm
from wm_drake.parameters import SpinProfile


def stopped(stiffness):
    """Return a machine that swings against a stop at its rear through the resonance."""
    reference = wm.load_machine("reference").model_dump(exclude_unset=True)
    frames = {"foot": {"attached_to": "housing", "position": (0.08, 0.18, 0.42)}}
    ends = {"tub_frame": "sensor_Zr", "housing_frame": "foot"}
    stop = {"stiffness": stiffness, "gap": 6e-3, "loss": 0.8, "friction": 0.2}
    changed = {"frames": frames, "elements": {"bump": {"kind": "stop", **ends, **stop}}}
    return wm.parameters.MachineParameters.model_validate(reference | changed)


RUN_UP = SpinProfile(time=(0.0, 16.0), speed=(0.0, 20.1))
"""Run-up to 192 rpm, past the resonance in which the stop is met."""
