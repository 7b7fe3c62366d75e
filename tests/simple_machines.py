"""Machines with a closed-form solution: one isotropic bushing, no gravity and no friction."""

from pathlib import Path

import numpy as np

from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine, with_values
from wm_drake.parameters.machine import BodyOverride, InertiaMatrix
from wm_drake.parameters.variation import number_at

SPONGES = Path(__file__).with_name("sponges.yaml")
"""File of a machine whose dampers have a sponge and whose gasket has constant stiffnesses."""

STIFFNESS = 7000.0  # N/m
DAMPING = 55.0  # N s/m
MASS = 6 * 7.0  # kg, six bodies

BODIES = (
    "tub", "drum", "motor", "upper_counterweight", "front_counterweight_left",
    "front_counterweight_right",
)  # fmt: skip
STEPS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # displacements of a gasket table, in its half range
HARDENING = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])  # forces there, in force of the half range


def isotropic_machine(stiffness=STIFFNESS, damping=DAMPING, rotational_stiffness=4000.0):
    """Return a machine with all centres of mass at To and one linear bushing there.

    Its translation is three equal oscillators along x, y and z.
    """
    reference = load_machine("reference")
    ball = BodyOverride(
        mass=7.0, centre_of_mass=(0.0, 0.0, 0.0), inertia=InertiaMatrix(xx=0.3, yy=0.3, zz=0.3)
    )
    origin = {"position": (0.0, 0.0, 0.0)}
    linear = {f"stiffness_{axis}": stiffness for axis in "xyz"} | {
        f"damping_{axis}": damping for axis in "xyz"
    }
    rotational = {f"rotational_stiffness_{axis}": rotational_stiffness for axis in "xyz"}
    tree = reference.model_dump() | {
        "gravity": 0.0,
        "bodies": dict.fromkeys(BODIES, ball.model_dump()),
        "frames": {"gasket_tub": origin, "gasket_housing": origin},
        "spring_types": {"suspension": {"stiffness": 0.0, "action": "tension-compression"}},
        "dampers": {},
        "gasket": {"tub_frame": "gasket_tub", "housing_frame": "gasket_housing"}
        | linear
        | rotational,
    }
    return type(reference).model_validate(tree)


def at_rest(parameters, name):
    """Return a stiffness of the gasket at rest, N/m or N m/rad."""
    return number_at(parameters, f"gasket.{name}").nominal


def with_gasket_tables(parameters):
    """Return a machine whose gasket gets stiffer with displacement and angle.

    Each stiffness becomes a table with the same slope up to half of its range, and twice as much
    beyond.
    """
    displacement, angle = 15e-3 * STEPS, 0.05 * STEPS
    tables = {}
    for axis in "xyz":
        force = at_rest(parameters, f"stiffness_{axis}") * 15e-3 * HARDENING
        torque = at_rest(parameters, f"rotational_stiffness_{axis}") * 0.05 * HARDENING
        tables[f"gasket.stiffness_{axis}"] = {
            "displacement": displacement.tolist(),
            "force": force.tolist(),
        }
        tables[f"gasket.rotational_stiffness_{axis}"] = {
            "angle": angle.tolist(),
            "torque": torque.tolist(),
        }
    return with_values(parameters, tables)


def unbalance(mass, radius=0.25, y=0.0, phase=0.0):
    """Return a load with one unbalance. [kg, m, m, rad]"""
    return Load(unbalances=(Unbalance(mass=mass, radius=radius, y=y, phase=phase),))


def constant_speed(speed, duration):
    """Return a spin profile of constant speed. [rad/s, s]"""
    return SpinProfile(time=(0.0, duration), speed=(speed, speed))
