"""Machines with a compliant bearing of the drum, for tests."""

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
    """Return a machine with a compliant bearing."""
    tree = parameters.model_dump(exclude_unset=True)
    imperfections = {**tree.get("imperfections", {}), "bearing": BEARING | numbers}
    return MachineParameters.model_validate(tree | {"imperfections": imperfections, "step": step})


def stiffer(share):
    """Return the numbers of a stiffer bearing with the same damping ratio.

    Args:
        share: Factor of all stiffnesses.
    """
    powers = {"stiffness": share, "damping": share**0.5}
    return {key: value * powers[key.split("_")[1]] for key, value in BEARING.items() if key != "y"}
