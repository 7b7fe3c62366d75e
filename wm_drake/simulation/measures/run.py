"""What measures read of a run, whether it comes from a record or from a batch."""

import functools
from abc import ABC, abstractmethod
from typing import Literal, TypeAlias

import numpy as np

from wm_drake.model.scene import Gap, Path, Scene
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.displacements import amplitudes, filtered
from wm_drake.simulation.feet import FeetLoaded, foot_measures

Need: TypeAlias = Literal["sensors", "shapes", "tub", "mounts", "feet", "springs", "stops"]
"""Groups of inputs that cost time, so that a batch computes them only for measures that name them:

    sensors   `Run.displacement`, `Run.filtered` and `Run.amplitudes`
    shapes    `Run.gap`, `Run.scene` and `Run.poses`
    tub       `Run.tub_motion`, `Run.tub_acceleration`, `Run.gravity`, `Run.accelerometer_points`
    mounts    `Run.mount_sums`
    feet      `Run.feet`
    springs   `Run.smallest_tensions` and `Run.smallest_elongations`
    stops     `Run.approaches`
"""


class Run(ABC):
    """One run up to its end or to where it diverged, with n samples. All in SI units.

    Attributes:
        period: Time between samples. [s]
        path: Poses of the tub, as for `Scene.smallest_gap`, if they have bounds already.
    """

    profile: SpinProfile
    period: float
    path: Path | None = None

    @property
    @abstractmethod
    def time(self) -> FloatArray:
        """Return the time of each sample. (n,) [s]"""

    @property
    @abstractmethod
    def drum_angle(self) -> FloatArray:
        """Return the angle of the drum against the tub. (n,) [rad]"""

    @property
    @abstractmethod
    def drum_speed(self) -> FloatArray:
        """Return the speed of the drum against the tub. (n,) [rad/s]"""

    @property
    @abstractmethod
    def motor_torque(self) -> FloatArray:
        """Return the torque of the motor on the drum. (n,) [N m]"""

    @property
    @abstractmethod
    def largest(self) -> FloatArray:
        """Return the largest absolute values of the run, one row for each of D, F and M of [B].

        The rows are the displacement of the tub point nearest to the detergent box [m], force [N]
        and moment [N m] of the gasket on the housing; the columns are the axes. (3, 3)
        """

    @property
    @abstractmethod
    def displacement(self) -> FloatArray:
        """Return the displacements at the sensors, along their axes. (n, sensors) [m]"""

    @functools.cached_property
    def filtered(self) -> FloatArray:
        """Return the displacements at the sensors, filtered to `pass_band`. (n, sensors) [m]"""
        return filtered(self.displacement, self.period, pass_band(self.profile, self.period))

    @functools.cached_property
    def amplitudes(self) -> tuple[FloatArray, np.ndarray]:
        """Return the largest value of the envelopes of each sensor [m], and its sample."""
        return amplitudes(self.filtered)

    @property
    @abstractmethod
    def poses(self) -> FloatArray:
        """Return the poses of the tub: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]"""

    @property
    @abstractmethod
    def rest_pose(self) -> FloatArray:
        """Return the pose of the tub at rest. (6,) [rad, m]"""

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Return the shapes of the machine."""

    @functools.cached_property
    def gap(self) -> Gap | None:
        """Return the smallest gap; None if there is none to measure."""
        return self.scene.smallest_gap(self.time, self.poses, self.rest_pose, self.path)

    @property
    @abstractmethod
    def tub_motion(self) -> FloatArray:
        """Return roll, pitch, yaw, x, y, z of the tub, drum angle, and the rates of the pose.

        (n, >= 13), the rates are angular velocity and velocity of To in W. [rad, m, rad/s, m/s]
        """

    @property
    @abstractmethod
    def tub_acceleration(self) -> FloatArray:
        """Return angular acceleration of the tub, acceleration of To. (n, 6) [rad/s^2, m/s^2]"""

    @property
    @abstractmethod
    def accelerometer_points(self) -> FloatArray:
        """Return the points of the accelerometers in T. (k, 3) [m]"""

    @property
    @abstractmethod
    def gravity(self) -> float:
        """Return the acceleration of free fall. [m/s^2]"""

    @property
    @abstractmethod
    def mount_sums(self) -> FloatArray:
        """Return the sums over all samples that `measure_mounts_lanes` writes, of one run."""

    @property
    @abstractmethod
    def feet(self) -> FeetLoaded:
        """Return what loads the feet of the cabinet."""

    @functools.cached_property
    def foot_measures(self) -> dict[str, FloatArray]:
        """Return the measures of the feet by name; see `wm_drake.simulation.feet`."""
        return foot_measures(self.feet, self.profile, self.period)

    @property
    @abstractmethod
    def smallest_tensions(self) -> FloatArray:
        """Return the smallest tension of each spring, NaN without samples. (springs,) [N]"""

    @property
    @abstractmethod
    def smallest_elongations(self) -> FloatArray:
        """Return the smallest elongation of each spring; NaN if it is unknown. (springs,) [m]"""

    @property
    @abstractmethod
    def approaches(self) -> tuple[FloatArray, FloatArray]:
        """Return compression of each stop, below 0 without contact, and its rate.

        (n, stops) [m, m/s]
        """

    @property
    @abstractmethod
    def mass_left(self) -> FloatArray:
        """Return the mass of the load with the water left in it. (n,) [kg]"""
