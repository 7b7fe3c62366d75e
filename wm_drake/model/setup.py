"""A machine that is set up in a Context: numbers chosen, preloads solved, at its rest pose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydrake.systems.framework import Context

from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.bushing import SixComponentBushingParameters
from wm_drake.elements.friction_damper import FrictionDamperParameters
from wm_drake.elements.sensor import MEASURED_POINT
from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.elements.telescopic_damper import TelescopicDamperParameters
from wm_drake.model.placed_elements import PlacedElements
from wm_drake.parameters import MachineParameters, Sensor
from wm_drake.parameters.types import FloatArray

if TYPE_CHECKING:
    from wm_drake.model.machine import MachineSystems

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class TubPoints:
    """Points of the tub that are measured, by name, in T. [m]

    Attributes:
        sensors: Points of the displacement sensors, (3,) each.
        detergent: Point nearest the detergent box. (3,)
        accelerometers: Points of the vibration sensors, (3,) each.
    """

    sensors: dict[str, FloatArray]
    detergent: FloatArray
    accelerometers: dict[str, FloatArray]


@dataclass(frozen=True)
class Setup:
    """A machine set up in a Context: numbers chosen, preloads solved, at rest at its rest pose.

    Attributes:
        machine: The built machine.
        parameters: The numbers in force.
        context: Root Context of the diagram.
        elements: The elements at their frames.
        points: Measured points of the tub.
        rest_pose: Equilibrium of the empty machine: roll, pitch, yaw, x, y, z. (6,) [rad, m]
        residual: Moment about To and force on the tub that remain there, in W. (6,) [N m, N]
        tube_rest: Angles and position of each outer tube and extension of the damper at rest.
            (telescopic dampers, 7) [rad, m]
        carrier_rest: Angles and position of the drum carrier at rest with a compliant bearing, else
            empty. (6,) [rad, m]
    """

    machine: "MachineSystems"
    parameters: MachineParameters
    context: Context
    elements: PlacedElements
    points: TubPoints
    rest_pose: FloatArray
    residual: FloatArray
    tube_rest: FloatArray
    carrier_rest: FloatArray

    @property
    def plant_context(self) -> Context:
        """Return the plant's part of the Context."""
        return self.machine.plant.GetMyContextFromRoot(self.context)

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Return the displacement sensors by name."""
        return self.parameters.sensors

    @property
    def springs(self) -> dict[str, SpringStrutParameters]:
        """Return the placed springs by name."""
        return self.elements.springs

    @property
    def dampers(self) -> dict[str, FrictionDamperParameters]:
        """Return the placed friction dampers by name."""
        return self.elements.dampers

    @property
    def bushings(self) -> dict[str, SixComponentBushingParameters]:
        """Return the placed bushings by name, the gasket among them."""
        return self.elements.bushings

    @property
    def telescopes(self) -> dict[str, TelescopicDamperParameters]:
        """Return the placed telescopic dampers by name."""
        return self.elements.telescopes

    @property
    def bearing(self) -> SixComponentBushingParameters | None:
        """Return the compliant bearing between drum carrier and tub; None if it is rigid."""
        return self.elements.bearing

    @property
    def sensor_points(self) -> dict[str, FloatArray]:
        """Return the points of the displacement sensors in T. [m]"""
        return self.points.sensors

    @property
    def detergent_point(self) -> FloatArray:
        """Return the point of the tub nearest the detergent box, in T. [m]"""
        return self.points.detergent

    @property
    def accelerometer_points(self) -> dict[str, FloatArray]:
        """Return the points of the vibration sensors in T. [m]"""
        return self.points.accelerometers

    @property
    def measured_points(self) -> FloatArray:
        """Return the measured points, see `measured_points`."""
        return measured_points(self.parameters, self.points, self.rest_pose)


def measured_points(
    parameters: MachineParameters, points: TubPoints, rest: FloatArray
) -> FloatArray:
    """Return the measured points: the sensors, then the detergent point along x, y, z.

    Args:
        parameters: The machine, for the axes of its sensors.
        points: Points of the tub.
        rest: Rest pose: roll, pitch, yaw, x, y, z. (6,) [rad, m]

    Returns:
        (sensors + 3, `elements.sensor.POINT_SIZE`)
    """
    positions = np.array([*points.sensors.values(), *[points.detergent] * 3])
    axes = [*(AXES.index(sensor.axis) for sensor in parameters.sensors.values()), 0, 1, 2]
    rotation = np.reshape(rotation_from_rpy(*map(float, rest[:3])), (3, 3))
    at_rest = (positions @ rotation.T + rest[3:6])[range(len(axes)), axes]
    return np.array(
        [
            MEASURED_POINT.pack(p_ToM_T=position, direction_W=np.eye(3)[axis], at_rest=value)
            for position, axis, value in zip(positions, axes, at_rest, strict=True)
        ]
    )
