"""An honest test: calibrate without some loads, then see how well their amplitudes come out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wm_drake.batch.ledger import Ledger
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.calibration import Calibration, Plan, calibrate
from wm_drake.studies.calibration.targets import Targets


@dataclass(frozen=True)
class Prediction:
    """Loads that a calibration had not seen.

    Attributes:
        loads: Their names.
        calibrated: Relative errors of their amplitudes in the calibration that had seen them. (case, sensor)
        predicted: The same in the calibration that had not. (case, sensor)
        seen: Of the loads which that calibration had seen. (case, sensor)
    """

    loads: tuple[str, ...]
    calibrated: FloatArray
    predicted: FloatArray
    seen: FloatArray


def predict(
    machine: Machine,
    free: FreeFile,
    calibration: Calibration,
    left_out: Sequence[Sequence[str]],
    ledger: Ledger,
    *,
    plan: Plan | None = None,
    workers: int | None = None,
    report: Callable[[int, int, float], None] = lambda start, evaluations, best: None,
) -> list[Prediction]:
    """Repeats a calibration once for each group of loads, without them.

    The searches begin at what is expected of each quantity, or about it: starting values of a free file may come from a
    calibration that had seen all loads.

    Args:
        machine, free, ledger, workers, report: As for `calibrate`.
        calibration: With all loads.
        left_out: Groups of names of loads.
        plan: How to search without them; as with all loads if None.

    Raises:
        InputError: a load that was not measured, or no load left.
    """
    check_left_out(calibration.targets, left_out)
    targets, plan, found = calibration.targets, plan or calibration.plan, []
    for loads in map(tuple, left_out):
        seen = targets.without(*loads)
        blind = calibrate(
            machine, free.without_starts(), seen, plan, ledger, workers=workers, report=report
        )
        cases = targets.of(*loads)
        calibrated, predicted = (
            best.amplitude[cases] / targets.amplitude[cases] - 1.0
            for best in (calibration.solutions[0], blind.solutions[0])
        )
        found.append(
            Prediction(loads, calibrated, predicted, blind.solutions[0].errors(seen)[~cases])
        )
    return found


def check_left_out(targets: Targets, left_out: Sequence[Sequence[str]]) -> None:
    """Refuses groups of loads that cannot be left out."""
    known = {name for name, _ in targets.loads}
    for loads in left_out:
        for name in loads:
            if name not in known:
                raise input_error(
                    f"no measured load '{name}'{nearest_names(name, known)}", key="left out"
                )
        if known <= set(loads):
            raise input_error("leaves no load to calibrate with", key="left out")
