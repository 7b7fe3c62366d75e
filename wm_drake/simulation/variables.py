"""The variables of a record: dimensions, unit and words of each."""

from typing import TypeAlias

from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.mounts import POINT

Variables: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str, str]]
"""For each variable name: dimensions, values, unit and description."""

IN_BEARING = "in the tub's frame, y along the drum axis"

DECLARED = {
    "tub_angle": ("time angle", "rad", "roll, pitch, yaw of T in W (3-2-1 Euler angles)"),
    "tub_position": ("time axis", "m", "position of To in W"),
    "tub_angular_velocity": ("time axis", "rad/s", "angular velocity of T in W"),
    "tub_velocity": ("time axis", "m/s", "velocity of To in W"),
    "tub_angular_acceleration": ("time axis", "rad/s^2", "angular acceleration of T in W"),
    "tub_acceleration": ("time axis", "m/s^2", "acceleration of To in W"),
    "drum_angle": ("time", "rad", "angle of the drum against the tub"),
    "drum_speed": ("time", "rad/s", "speed of the drum against the tub"),
    "displacement": ("time sensor", "m", "displacement at the sensors, along their axes"),
    "sensor_point": ("sensor axis", "m", "points of the sensors in T"),
    "accelerometer_point": ("accelerometer axis", "m", "points of the vibration sensors in T"),
    "detergent_displacement": (
        "time axis",
        "m",
        "displacement of the point nearest the detergent box",
    ),
    "damper_deformation": ("time damper", "m", "deformation of the damper's sponge"),
    "tube_angle": ("time tube angle", "rad", "roll, pitch, yaw of the outer tubes in W"),
    "tube_position": (
        "time tube axis",
        "m",
        "displacement of the link frames of the outer tubes in W",
    ),
    "tube_extension": ("time tube", "m", "extension of the damper beyond its length in the SDF"),
    "branch_stretch": (
        "time branch",
        "m, rad about an axis",
        "stretch of the friction or the Maxwell spring of a bushing of rubber",
    ),
    "cabinet_angle": (
        "time angle",
        "rad",
        "roll, pitch, yaw of the cabinet in W (3-2-1 Euler angles)",
    ),
    "cabinet_position": ("time axis", "m", "displacement of the cabinet in W"),
    "cabinet_angular_velocity": ("time axis", "rad/s", "of the cabinet, in W"),
    "cabinet_velocity": ("time axis", "m/s", "velocity of the cabinet in W"),
    "floor_force": ("time foot axis", "N", "force of the floor on each foot"),
    "foot_slip": ("time foot axis", "m", "how far each foot has slid on the floor, in W"),
    "drum_displacement": (
        "time axis",
        "m",
        f"displacement of the drum axis in the bearing, {IN_BEARING}",
    ),
    "drum_tilt": (
        "time axis",
        "rad",
        f"rotation vector of the drum's bearing against the tub, {IN_BEARING}",
    ),
    "bearing_force": (
        "time axis",
        "N",
        f"force of the drum on the tub in the bearing, {IN_BEARING}",
    ),
    "bearing_moment": (
        "time axis",
        "N m",
        f"moment of the drum on the tub in the bearing, {IN_BEARING}",
    ),
    "mass_left": ("time unbalance", "kg", "mass of each unbalance with the water left in it"),
    "motor_current": ("time", "A", "current of the motor"),
    "motor_torque": ("time", "N m", "torque of the motor on the drum"),
    "spring_tension": ("time spring", "N", "spring tension"),
    "damper_tension": ("time damper", "N", "damper tension"),
    "bushing_force": ("time bushing axis", "N", "force of gasket and bushings on the housing"),
    "bushing_moment": ("time bushing axis", "N m", "moment of gasket and bushings on the housing"),
    "mount_force": (
        "time mount axis",
        "N",
        "force of each spring, damper and bushing on the cabinet",
    ),
    "cabinet_force": ("time axis", "N", "force of all mounts on the cabinet"),
    "cabinet_moment": ("time axis", "N m", f"moment of all mounts on the cabinet about {POINT}"),
}
"""Dimensions, unit and words of each variable by name; elements of other packages add theirs."""


def declared(**values: FloatArray) -> Variables:
    """Return variables by their names, with what is declared of each."""
    return {
        name: (tuple(dims.split()), array, unit, words)
        for name, array in values.items()
        for dims, unit, words in [DECLARED[name]]
    }
