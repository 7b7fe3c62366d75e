"""Variants of the reference machine with each kind of element, for comparisons of both engines."""

import functools

import pytest
from machine_with_bearing import with_bearing
from moving_cabinet import with_moving_cabinet
from pydantic import TypeAdapter

from wm_drake.parameters import DamperType, MachineParameters, load_machine

# N m/rad, N m s/rad, N m
END_BUSHING = {"stiffness": 90.0, "damping": 0.2, "friction_torque": 0.4, "full_friction_rate": 0.8}
# m, N
LINEAR_TABLE = {
    "displacement": (-0.05, -0.01, 0.0, 0.01, 0.04),
    "force": (-900.0, -50.0, 0.0, 60.0, 300.0),
}
TORQUE_TABLE = {"angle": (-0.5, -0.1, 0.0, 0.2), "torque": (-60.0, -9.0, 0.0, 30.0)}  # rad, N m
SPONGE = {
    "displacement": (-0.02, -0.01, -0.003, 0.003, 0.01, 0.02),
    "force": (-130.0, -40.0, 0.0, 0.0, 40.0, 130.0),
}
DAMPERS = {
    "coulomb": {"friction_force": 60.0, "damping": 20.0},
    "stv": {"friction_force": 60.0, "transition_velocity": 0.2, "damping": 20.0},
    "havsin": {"friction_force": 60.0, "full_friction_velocity": 0.2, "damping": 20.0},
    "mstv": {"friction_force": 60.0, "friction_damping": 30.0, "sponge_stiffness": 176e3, "sponge_damping": 90.0, "slider_damping": 400.0},
    "stv_sponge": {
        "friction_force": 60.0,
        "transition_velocity": 0.1,
        "sponge_stiffness": 176e3,
        "sponge_damping": 90.0,
        "slider_damping": 400.0,
    },
    "free_stroke": {
        "friction_force": 35.0,
        "friction_damping": 60.0,
        "basic_friction_force": 10.5,
        "basic_full_friction_velocity": 0.09,
        "sponge": SPONGE,
    },
}  # fmt: skip
FRICTION = {f"friction_torque_{axis}": 0.5 for axis in "xyz"} | {
    f"full_friction_rate_{axis}": 1.5 for axis in "xyz"
}
# N, m; N m, rad; N/m, N s/m; N m/rad, N m s/rad; N/m, N/rad, N m/rad
RUBBER = {
    "dahl_force_x": 20.0,
    "dahl_displacement_x": 2e-3,
    "dahl_force_y": 10.0,
    "dahl_displacement_y": 5e-4,
    "dahl_torque_z": 1.0,
    "dahl_angle_z": 5e-3,
    "maxwell_stiffness_x": 3e3,
    "maxwell_damping_x": 60.0,
    "maxwell_stiffness_z": 2e3,
    "maxwell_damping_z": 30.0,
    "rotational_maxwell_stiffness_y": 50.0,
    "rotational_maxwell_damping_y": 2.0,
    "cross_stiffness_x_y": 300.0,
    "cross_stiffness_z_about_x": 20.0,
    "rotational_cross_stiffness_x_y": 5.0,
}
TABLES = {f"stiffness_{axis}": LINEAR_TABLE for axis in "xyz"} | {
    f"rotational_stiffness_{axis}": TORQUE_TABLE for axis in "xyz"
}


reference = functools.cache(functools.partial(load_machine, "reference"))


def changed(**parts):
    """Return the reference machine with some of its top-level parts replaced."""
    return MachineParameters.model_validate(reference().model_dump() | parts)


def damper_of(law, **changes):
    """Return a damper type of a law, with some of its numbers replaced."""
    return TypeAdapter(DamperType).validate_python({"law": law} | DAMPERS[law] | changes)


def names_of(machines):
    """Return the names of machines for tests; those of rubber have much to compile and are slow."""
    slow = pytest.mark.slow
    return [pytest.param(name, marks=slow) if "rubber" in name else name for name in machines]


@functools.cache
def machines_beside_rubber():
    """Return machines with tubes, a motor, a cabinet that moves or a compliant bearing, by name.

    Those with tubes, a motor and a cabinet are there with rubber too.
    """
    machines = {"tubes": load_machine("free_stroke"), "motor": load_machine("motor")}
    machines["cabinet"] = with_moving_cabinet(reference())
    for name, parameters in list(machines.items()):
        gasket = parameters.gasket.model_dump() | FRICTION | RUBBER
        machines[f"rubber and {name}"] = MachineParameters.model_validate(
            parameters.model_dump(exclude_unset=True) | {"gasket": gasket}
        )
    machines["motor on a cabinet"] = with_moving_cabinet(machines["motor"])
    crooked = {
        "drum": {"mass": 11.0, "centre_of_mass": (0.03, 0.05, -0.02)},
        "motor": {"mass": 3.0},
    }
    bearings = {
        "reference": reference(),
        "tubes": machines["tubes"],
        "crooked": changed(bodies=crooked),
    }
    return machines | {f"bearing, {name}": with_bearing(it) for name, it in bearings.items()}


@functools.cache
def machines_of_each_kind():
    """Return all variants by name."""
    machines = {"reference": reference()}
    drawn, end_bushing = reference().model_dump(), {"end_bushing": END_BUSHING}
    for law, numbers in DAMPERS.items():
        machines[law] = changed(
            damper_types={"friction": {"law": law, **numbers, **end_bushing}}, gasket=None
        )
    machines["springs only"] = changed(dampers={}, gasket=None)
    machines["spring tables"] = changed(
        spring_types={"suspension": {"stiffness": LINEAR_TABLE}}, dampers={}, gasket=None
    )
    machines["gasket tables"] = changed(gasket=drawn["gasket"] | TABLES | FRICTION, dampers={})
    second = drawn["gasket"] | {"stiffness_x": LINEAR_TABLE} | FRICTION
    machines["two bushings, five dampers of three laws"] = changed(
        bushings={"rear": second},
        damper_types={
            law: {"law": law, **DAMPERS[law], **end_bushing}
            for law in ("coulomb", "mstv", "free_stroke")
        },
        dampers={
            f"{place}_{law}": drawn["dampers"][place] | {"type": law}
            for place, law in (
                ("left", "mstv"),
                ("left", "coulomb"),
                ("right_rear", "free_stroke"),
                ("right_front", "mstv"),
                ("right_front", "free_stroke"),
            )
        },
    )
    machines["eight springs, seven dampers of two laws"] = changed(
        gasket=None,
        spring_types=drawn["spring_types"] | {"table": {"stiffness": LINEAR_TABLE}},
        springs={
            f"{name}_{k}": spring for k in range(2) for name, spring in drawn["springs"].items()
        }
        | {
            f"{name}_table": spring | {"type": "table"}
            for name, spring in list(drawn["springs"].items())[:2]
        },
        damper_types={
            law: {"law": law, **DAMPERS[law], **end_bushing} for law in ("mstv", "havsin")
        },
        dampers={
            f"{name}_{k}": damper | {"type": "mstv"}
            for k in range(2)
            for name, damper in drawn["dampers"].items()
        }
        | {
            f"{name}_havsin": damper | {"type": "havsin"}
            for name, damper in list(drawn["dampers"].items())[:1]
        },
    )
    rubber = drawn["gasket"] | {"stiffness_x": LINEAR_TABLE} | FRICTION | RUBBER
    machines["two bushings of rubber"] = changed(gasket=rubber, bushings={"rear": second | RUBBER})
    return machines
