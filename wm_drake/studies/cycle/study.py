"""The course of a cycle: extremes in short windows of time, one after the other.

A cycle of a quarter of an hour at up to 1400 rpm has 720,000 samples. They are computed piece by
piece, and each piece is measured while the next one is integrated.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.engines.compiled.packing import pack
from wm_drake.engines.compiled.pieces import run_pieces
from wm_drake.engines.compiled.stepping import Stepping, choose_stepping
from wm_drake.engines.trajectory import Estimates, Trajectory
from wm_drake.model.machine import Machine, Setup
from wm_drake.model.scene import Scene
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import MASS, SPEED, STEP, TIME, Quantity, of_measure
from wm_drake.simulation.cases import Case
from wm_drake.simulation.convergence import Accuracy, Attempt, judged
from wm_drake.simulation.feet import foot_loads
from wm_drake.simulation.mounts import mount_wrenches
from wm_drake.simulation.outputs import tub_outputs

WINDOWS = 600
"""Number of windows of a cycle, as far as each has `SHORTEST`."""

SHORTEST = 0.75
"""Shortest window: a turn at 80 rpm. [s]"""

WINDOWS_OF_PIECE = 20
"""Windows that are computed at a time: some MB of samples."""

OF_LOAD = MASS.named("mass of the load", decimals=2)
UNBALANCE = Quantity("unbalance", Unit("kg*m", "g*m"), 0)
SWING = Quantity("half swing", Unit("m", "mm"), 1)
"""Half of the distance from the smallest to the largest displacement of a window; an amplitude is
that of the filtered displacement of a whole run (docs/theory/measures.md)."""
GAP = of_measure("smallest_gap")
FOOT = Quantity("load of a foot", Unit("N", "N"), 0)
SLIDING = Quantity("horizontal force on the floor", Unit("N", "N"), 0)


@dataclass(frozen=True)
class WindowExtremes:
    """What is measured of a piece.

    Attributes:
        setup: The machine at rest, with its load.
        scene: Its shapes.
        rows: Samples of a window.
    """

    setup: Setup
    scene: Scene
    rows: int

    def __call__(self, piece: Trajectory) -> xr.Dataset:
        """Return the extremes in each window of a piece; samples behind the last are left out."""
        setup, count = self.setup, len(piece.time) // self.rows
        whole = piece.part(slice(count * self.rows))
        at = whole.time.reshape(count, -1)
        displacement = tub_outputs(setup, whole)[0][:, : len(setup.sensors)]
        masses = self._masses(whole)[self.rows - 1 :: self.rows]
        values = {
            "drum_speed": SPEED.variable("time", self._windows(whole.state[:, 13]).mean(axis=1)),
            "mass": OF_LOAD.variable("time", masses.sum(axis=1)),
            "unbalance": UNBALANCE.variable("time", unbalance_of(setup, masses)),
            "half_swing": SWING.variable(
                ("time", "sensor"), 0.5 * np.ptp(self._windows(displacement), axis=1)
            ),
            "gap": GAP.variable("time", self._gaps(whole)),
        }
        time = TIME.variable("time", at.mean(axis=1))
        data = xr.Dataset(values, {"time": time, "sensor": list(setup.sensors)})
        return data.assign(self._floor(whole))

    def _windows(self, values: FloatArray) -> FloatArray:
        """Return samples (n, ...) by windows (windows, rows, ...)."""
        return values.reshape(-1, self.rows, *values.shape[1:])

    def _masses(self, piece: Trajectory) -> FloatArray:
        """Return the masses of the load over time. (n, masses) [kg]"""
        load = self.setup.load
        assert load is not None  # a cycle has one
        left = np.empty((len(piece.time), 0)) if piece.water is None else piece.water
        return load.masses(left)

    def _gaps(self, piece: Trajectory) -> FloatArray:
        """Return the smallest gap in each window, NaN without shapes. (windows,) [m]"""
        poses, rest = self._windows(piece.state[:, :6]), self.setup.rest_pose
        time = piece.time[: self.rows]  # which of them is not used
        gaps = [self.scene.smallest_gap(time, each, rest) for each in poses]
        return np.array([np.nan if gap is None else gap.distance for gap in gaps])

    def _floor(self, piece: Trajectory) -> dict[str, xr.Variable]:
        """Return the loads of the feet in each window; none without a cabinet that stands fast."""
        parameters = self.setup.parameters
        cabinet = parameters.cabinet
        if cabinet is None or parameters.cabinet_moves:
            return {}
        wrenches = mount_wrenches(self.setup, piece).reshape(len(piece.time), -1, WRENCH_SIZE)
        total = wrenches.sum(axis=1)
        loads = foot_loads(cabinet, parameters.gravity, total)
        normal = self._windows(loads.normal)
        sideways = self._windows(np.hypot(*total[:, 3:5].T))
        return {
            "foot_smallest": FOOT.named("smallest load of a foot").variable(
                "time", normal.min(axis=(1, 2))
            ),
            "foot_largest": FOOT.named("largest load of a foot").variable(
                "time", normal.max(axis=(1, 2))
            ),
            "sideways": SLIDING.variable("time", sideways.max(axis=1)),
        }


def unbalance_of(setup: Setup, masses: FloatArray) -> FloatArray:
    """Return the static unbalance of load and empty drum with some masses. [kg m]

    Args:
        setup: The machine with its load.
        masses: (n, masses) of the load. [kg]
    """
    load, imbalance = setup.load, setup.parameters.imperfections.residual_imbalance
    assert load is not None  # a cycle has one
    places = np.array([unbalance.position() for unbalance in load.unbalances]).reshape(-1, 3)
    moment = masses @ places + imbalance.mass * np.array(imbalance.position())
    if load.static is not None:
        moment = moment + load.static.vector()
    return np.asarray(np.hypot(moment[:, 0], moment[:, 2]))


class Cycle(NamedTuple):
    """A cycle that was run.

    Attributes:
        course: Over `time`, the middles of windows [s]: mean `drum_speed`, `mass` of the load and
            its static `unbalance` at the end of the window, `half_swing` of each sensor, half of
            the distance from the smallest to the largest displacement, smallest `gap`; with a
            fixed cabinet smallest and largest load of a foot, `foot_smallest` and `foot_largest`,
            and largest force along the floor, `sideways`.
        diverged: Why it stopped early; "" if it did not.
        integration: How it was integrated, in words.
        accuracy: How accurate it is.
    """

    course: xr.Dataset
    diverged: str
    integration: str
    accuracy: Accuracy


def run_cycle(machine: Machine, case: Case, scene: Scene | None = None) -> Cycle:
    """Run a cycle, and repeat it with shorter steps until it is accurate.

    Args:
        machine: Built machine.
        case: Load and profile.
        scene: Shapes of the machine; made here if None.
    """
    profile, parameters = case.profile, machine.parameters
    empty = machine.set_up(gasket=case.gasket)
    stepping = choose_stepping(empty, *pack(empty), profile, parameters.step, parameters.integrator)
    period = profile.sample_period(parameters.output_period)
    setup = machine.set_up(case.load, context=empty.context, gasket=case.gasket)
    scene, before, halvings = scene or Scene(parameters), None, 0
    while True:
        course, diverged, estimates = _course(setup, scene, profile, stepping, period)
        values = {"amplitude": course.half_swing.max("time"), "smallest_gap": course.gap.min()}
        arrays, size = {n: v.values for n, v in values.items()}, course.half_swing.max().item()
        attempt = Attempt(estimates, stepping.step, halvings, diverged, arrays, size)
        accuracy, finer = judged(attempt, before, parameters.accuracy)
        if finer is None:
            break
        before, halvings = attempt, halvings + finer.step
        stepping, period = stepping.halved(finer.step), period / 2**finer.period
    step, every = STEP.text(stepping.step), STEP.text(period)
    how = f"{stepping.integrator}, steps of {step}, samples every {every}, {accuracy.text}"
    return Cycle(course, diverged, how, accuracy)


def _course(
    setup: Setup, scene: Scene, profile: SpinProfile, stepping: Stepping, period: float
) -> tuple[xr.Dataset, str, Estimates]:
    """Return the course of a run, why it stopped early, "" if it did not, and its errors."""
    rows = max(2, round(max(profile.duration / WINDOWS, SHORTEST) / period))
    extremes = WindowExtremes(setup, scene, rows)
    courses, diverged, estimates = list[xr.Dataset](), "", None
    for piece in _ahead(run_pieces(setup, profile, stepping, period, rows * WINDOWS_OF_PIECE)):
        if len(piece.time) >= rows:
            courses.append(extremes(piece))
        diverged = piece.divergence.reason if piece.divergence else ""
        estimates = piece.estimates
    assert estimates is not None  # the compiled engine estimates its errors
    return xr.concat(courses, "time", combine_attrs="override"), diverged, estimates


def _ahead(pieces: Iterator[Trajectory]) -> Iterator[Trajectory]:
    """Yield pieces, each while a thread computes the next one."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(next, pieces, None)
        while (piece := future.result()) is not None:
            future = pool.submit(next, pieces, None)
            yield piece


OF_PART: dict[str, tuple[Quantity, Callable[[FloatArray], float]]] = {
    "drum_speed": (SPEED.named("highest speed"), lambda values: np.abs(values).max()),
    "mass": (OF_LOAD.named("mass at the end"), lambda values: values[-1]),
    "unbalance": (UNBALANCE.named("unbalance at the end"), lambda values: values[-1]),
    "half_swing": (SWING.named("largest half swing"), np.max),
    "gap": (GAP, np.min),
    "foot_smallest": (FOOT.named("smallest load of a foot"), np.min),
    "foot_largest": (FOOT.named("largest load of a foot"), np.max),
    "sideways": (SLIDING, np.max),
}
"""What is shown of each part of a cycle: quantity, and function of the values in its windows."""


def parts_of(course: xr.Dataset, case: Case) -> xr.Dataset:
    """Return the extremes in each region of the profile, over `part`; the whole cycle without any.

    Args:
        course: `course` of a `Cycle`.
    """
    regions = [(r.name, r.begin, r.end) for r in case.profile.regions]
    regions = regions or [("whole cycle", 0.0, case.profile.duration)]
    inside = {name: course.sel(time=slice(begin, end)) for name, begin, end in regions}
    inside = {name: part for name, part in inside.items() if part.sizes["time"]}
    shown = {name: OF_PART[name] for name in OF_PART if name in course}
    values = {
        name: quantity.variable("part", [of(part[name].values) for part in inside.values()])
        for name, (quantity, of) in shown.items()
    }
    return xr.Dataset(values, {"part": list(inside)})
