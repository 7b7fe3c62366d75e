"""The reference machine on a cabinet that moves, with feet of any kind."""

from wm_drake.parameters import MachineParameters, load_machine

INERTIA = {"xx": 3.0, "yy": 3.2, "zz": 2.4, "xy": 0.05, "xz": -0.1, "yz": 0.08}  # kg m^2
# N/m, N s/m
FEET = {
    "vertical_stiffness": 200e3,
    "vertical_damping": 800.0,
    "horizontal_stiffness": 60e3,
    "horizontal_damping": 300.0,
}


def with_moving_cabinet(parameters=None, *, foot_type=None, **changes):
    """Return a machine whose cabinet moves on feet of 200 N/mm, with other values in its place."""
    dumped = (parameters or load_machine("reference")).model_dump()
    cabinet = dumped["cabinet"] | {"moves": True, "inertia": INERTIA} | changes
    cabinet["foot_type"] = FEET | (foot_type or {})
    return MachineParameters.model_validate(dumped | {"cabinet": cabinet})
