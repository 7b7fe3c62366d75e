"""The shipped machine with telescopic dampers, and variants of it for tests."""

import numpy as np

from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.parameters.spin import Region

RUN_UP = SpinProfile(
    time=(0.0, 0.501, 5.0, 6.0),
    speed=(5.0, 7.0, 28.0, 28.0),
    regions=(Region(name="A", begin=1.0, end=3.0), Region(name="B", begin=3.0, end=6.0)),
)
OUTER_TUBES = ("damper_left_outer", "damper_right_rear_outer", "damper_right_front_outer")


def telescopic():
    """Return the shipped machine with telescopic dampers."""
    return load_machine("free_stroke")


def changed(parameters, **parts):
    """Return a machine with some of its top-level parts replaced."""
    return MachineParameters.model_validate(parameters.model_dump(exclude_unset=True) | parts)


def with_bushing(parameters, **numbers):
    """Return a machine with some numbers of the bushings of its tubes replaced."""
    kind = parameters.bushing_types["connecting"].model_dump() | numbers
    return changed(parameters, bushing_types={"connecting": kind})


def with_tubes(parameters, built, outer_mass, about_axis, inner_mass=None):
    """Return a machine whose tubes have other masses; their inertias scale with the mass.

    Args:
        parameters, built: The machine.
        outer_mass, inner_mass: Masses; the inner one is 0.75 times the outer one if None. [kg]
        about_axis: Inertia of the outer tube about the damper's axis, if given. [kg m^2]
    """
    bodies = {}
    for name in parameters.telescopic_dampers:
        for part, mass in (
            ("outer", outer_mass),
            ("inner", outer_mass * 0.75 if inner_mass is None else inner_mass),
        ):
            body = built.plant.GetBodyByName(f"damper_{name}_{part}")
            inertia = body.default_spatial_inertia()
            share = mass / inertia.get_mass()
            central = (
                inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3() * share
            )
            axis = built.set_up().telescopes[name].axis
            if part == "outer" and about_axis is not None:
                central = central + (about_axis - axis @ central @ axis) * np.outer(axis, axis)
            keys = {
                key: float(central["xyz".index(key[0]), "xyz".index(key[1])])
                for key in ("xx", "yy", "zz", "xy", "xz", "yz")
            }
            bodies[body.name()] = {"mass": mass, "inertia": keys}
    return changed(parameters, bodies=bodies)
