"""calibrate(machine, free, targets): searches from several starts, each evaluation remembered."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wm_drake.batch.ledger import Ledger, Result, key_of
from wm_drake.batch.remembered import model_version, sources_version
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.parameter_map import ParameterMap, turning_of
from wm_drake.studies.calibration.search import METHODS, SearchProblem
from wm_drake.studies.calibration.solutions import Solution, distinct
from wm_drake.studies.calibration.targets import Targets, amplitudes_at, preload_residuals

RELATIVE_DEVIATION = 0.05
"""Standard deviation of a measured amplitude about the computed one, as part of it: scatter of machines and what no rigid
body model can say. Weighs the data against the priors."""

RESOLUTION = 1e-4
"""Of the published amplitudes. [m]"""

ITERATIONS = {"least-squares": 60, "basin-hopping": 12, "evolution": 300}


@dataclass(frozen=True)
class Plan:
    """How to search.

    Attributes:
        method: Key of `METHODS`.
        starts: How many; the first is where the free file says, the others are drawn about it.
        seed: Of the draws.
        iterations: At most, from each start; hops of basin hopping. 0: as many as the method usually takes.
        deviation: Relative standard deviation of an amplitude.
        resolution: To which amplitudes are given; rounding adds its standard deviation, resolution / sqrt(12). [m]
    """

    method: str = "least-squares"
    starts: int = 8
    seed: int = 0
    iterations: int = 0
    deviation: float = RELATIVE_DEVIATION
    resolution: float = RESOLUTION

    def check(self) -> None:
        """Refuses what cannot be done."""
        if self.method not in METHODS:
            raise input_error(
                f"no method '{self.method}'{nearest_names(self.method, METHODS)}", key="method"
            )
        if self.starts < 1:
            raise input_error(f"{self.starts} starts; allowed is 1 or more", key="starts")
        if not self.deviation > 0.0:
            raise input_error(f"{self.deviation:g} is not above 0", key="deviation")
        if not self.resolution >= 0.0:
            raise input_error(f"{self.resolution:g} is below 0", key="resolution")

    def spread(self, amplitude: FloatArray) -> FloatArray:
        """Standard deviation of the logarithm of a measured amplitude."""
        return np.hypot(self.deviation, self.resolution / np.sqrt(12.0) / amplitude)


@dataclass(frozen=True)
class Calibration:
    """What came out.

    Attributes:
        turning, targets, plan: What was asked.
        solutions: The distinct good ones, best first.
        ended: Where every start ended, in their order.
    """

    turning: ParameterMap
    targets: Targets
    plan: Plan
    solutions: tuple[Solution, ...]
    ended: tuple[Solution, ...]


def identity_of(machine: Machine, free: FreeFile, targets: Targets, plan: Plan) -> dict[str, str]:
    """What makes a calibration this one and no other, for its ledger."""
    return {
        "study": "calibration",
        "machine": key_of(
            machine=machine.parameters.model_dump(exclude={"sources"}),
            model=model_version(machine.parameters),
        )[:8],
        "free": key_of(free=free)[:8],
        "targets": key_of(loads=targets.loads, amplitude=targets.amplitude, weight=targets.weight)[
            :8
        ],
        "plan": key_of(plan=plan)[:8],
        "sources": sources_version(),
    }


def calibrate(
    machine: Machine,
    free: FreeFile,
    targets: Targets,
    plan: Plan,
    ledger: Ledger,
    *,
    workers: int | None = None,
    report: Callable[[int, int, float], None] = lambda start, evaluations, best: None,
) -> Calibration:
    """Searches for machines that move as was measured.

    Each evaluation is in the ledger when it is used; a search that is begun again takes the same way, reads what is there and
    goes on where it was. The result does not depend on the number of workers.

    Args:
        machine: A built machine, from whose numbers those of the free file are turned.
        free: What may be turned.
        targets: Measured amplitudes.
        plan: How to search.
        ledger: Open, of this calibration.
        workers: Threads; as many as cores by default.
        report: Called with the number of the start, how many points it evaluated, and the least cost of it.

    Raises:
        InputError: free file and machine do not fit, or the plan is not possible.
    """
    plan.check()
    turning = turning_of(machine, free)
    amplitudes = _Remembered(machine, turning, targets, ledger, workers)
    ended = [
        _search(number, turning, targets, plan, amplitudes, report) for number in range(plan.starts)
    ]
    return Calibration(turning, targets, plan, tuple(distinct(ended, targets)), tuple(ended))


def _search(
    number: int,
    turning: ParameterMap,
    targets: Targets,
    plan: Plan,
    amplitudes: "_Remembered",
    report: Callable[[int, int, float], None],
) -> Solution:
    scale = np.sqrt(targets.weight) / plan.spread(targets.amplitude)

    def residuals(coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        computed = amplitudes(turning.expected + coordinates * turning.deviation)
        logarithms = np.log(computed / targets.amplitude) * scale
        hard, smooth = logarithms[..., targets.weight > 0.0]
        preloads = preload_residuals(
            amplitudes.machine, turning, turning.expected + coordinates * turning.deviation
        )
        return np.hstack([hard, preloads]), np.hstack([smooth, preloads])

    lower, upper = (
        (bound - turning.expected) / turning.deviation for bound in (turning.lower, turning.upper)
    )
    first = (turning.start - turning.expected) / turning.deviation
    problem = SearchProblem(
        residuals, lower, upper, first, lambda evaluations, best: report(number, evaluations, best)
    )
    iterations = plan.iterations or ITERATIONS[plan.method]
    found = METHODS[plan.method](
        problem, problem.start(number, plan.seed), iterations, plan.seed + number
    )
    point = turning.expected + found.point * turning.deviation
    measured = np.count_nonzero(
        targets.weight
    )  # residuals behind these are of preloads: what is expected, not data
    squares = residuals(found.point[None])[0][0] ** 2
    data, prior = (
        0.5 * float(np.sum(squares[:measured])),
        0.5 * float(np.sum(squares[measured:]) + np.sum(found.point**2)),
    )
    slopes = problem.jacobian(found.point)[:measured]
    return Solution(
        number,
        point,
        found.point,
        amplitudes(point[None])[0, 0],
        data,
        prior,
        slopes,
        problem.evaluations,
    )


_KINDS = ("amplitude", "power_mean")


class _Remembered:
    """Amplitudes at points, from the ledger where they are there."""

    def __init__(
        self,
        machine: Machine,
        turning: ParameterMap,
        targets: Targets,
        ledger: Ledger,
        workers: int | None,
    ) -> None:
        self.machine, self.turning, self.targets, self.ledger, self.workers = (
            machine,
            turning,
            targets,
            ledger,
            workers,
        )

    def __call__(self, points: FloatArray) -> FloatArray:
        """(2, points, case, sensor) as `amplitudes_at`."""
        keys = [key_of(point=point) for point in points]
        new = [index for index, key in enumerate(keys) if key not in self.ledger]
        if new:
            values = amplitudes_at(
                self.machine, self.turning, self.targets.loads, points[new], workers=self.workers
            )
            kept = {
                keys[i]: Result(dict(zip(_KINDS, values[:, place], strict=True)))
                for place, i in enumerate(new)
            }
            self.ledger.put_all(kept)
        found = [self.ledger.get(key).values for key in keys]
        return np.array([[values[kind] for values in found] for kind in _KINDS])
