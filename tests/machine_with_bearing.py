"""Machines whose drum can whirl in its bearing, and what their tests share."""

from wm_drake.parameters import MachineParameters

BEARING = {
    "radial_stiffness": 4e6,
    "axial_stiffness": 6e6,
    "tilting_stiffness": 5e4,
    "radial_damping": 600.0,
    "axial_damping": 500.0,
    "tilting_damping": 8.0,
    "y": 0.15,  # towards the rear
}
UNITS = dict(
    zip(BEARING, ("N/m", "N/m", "N m/rad", "N s/m", "N s/m", "N m s/rad", "m"), strict=True)
)


def with_bearing(parameters, step=2.5e-4, **numbers):
    """A machine with a bearing that gives."""
    tree = parameters.model_dump(exclude_unset=True)
    imperfections = {**tree.get("imperfections", {}), "bearing": BEARING | numbers}
    return MachineParameters.model_validate(tree | {"imperfections": imperfections, "step": step})


def stiffer(share):
    """A bearing so many times as stiff, with as much of critical damping."""
    powers = {"stiffness": share, "damping": share**0.5}
    return {key: value * powers[key.split("_")[1]] for key, value in BEARING.items() if key != "y"}
