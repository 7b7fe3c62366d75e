"""Prediction of held-out loads: calibrate without some loads, then compute their amplitudes."""

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
    """Errors of a group of held-out loads.

    Attributes:
        loads: Names of the held-out loads.
        calibrated: (case, sensor) relative errors of their amplitudes in the calibration with all
            loads.
        predicted: (case, sensor) relative errors of their amplitudes in the calibration without
            them.
        seen: (case, sensor) relative errors of the other loads in the calibration without them.
    """

    loads: tuple[str, ...]
    calibrated: FloatArray
    predicted: FloatArray
    seen: FloatArray


def predict(
    machine: Machine,
    free: FreeFile,
    calibration: Calibration,
    held_out: Sequence[Sequence[str]],
    ledger: Ledger,
    *,
    plan: Plan | None = None,
    workers: int | None = None,
    report: Callable[[int, int, float], None] = lambda start, evaluations, best: None,
) -> list[Prediction]:
    """Repeat a calibration once for each group of held-out loads.

    These searches start at or around the expected values. The start values of the free file are not
    used, because they may come from a calibration with all loads.

    Args:
        machine: A built machine.
        free: Quantities that may change, with bounds and priors.
        calibration: Calibration with all loads.
        held_out: Groups of names of loads.
        ledger: The open ledger of this calibration.
        plan: Settings of these searches; None for those of the calibration.
        workers: Number of threads; None for the number of cores.
        report: Called with the number of the start, the number of points it has evaluated and its
            lowest cost so far.

    Returns:
        One prediction for each group.

    Raises:
        InputError: a load was not measured, or a group contains all loads.
    """
    check_held_out(calibration.targets, held_out)
    targets, plan, found = calibration.targets, plan or calibration.plan, []
    for loads in map(tuple, held_out):
        seen = targets.without(*loads)
        without_loads = calibrate(
            machine, free.without_starts(), seen, plan, ledger, workers=workers, report=report
        )
        cases = targets.of(*loads)
        calibrated, predicted = (
            best.amplitude[cases] / targets.amplitude[cases] - 1.0
            for best in (calibration.solutions[0], without_loads.solutions[0])
        )
        errors_seen = without_loads.solutions[0].errors(seen)[~cases]
        found.append(Prediction(loads, calibrated, predicted, errors_seen))
    return found


def check_held_out(targets: Targets, held_out: Sequence[Sequence[str]]) -> None:
    """Check that each group of loads can be held out.

    Raises:
        InputError: a load was not measured, or a group contains all loads.
    """
    known = {name for name, _ in targets.loads}
    for loads in held_out:
        for name in loads:
            if list(loads).count(name) > 1:
                raise input_error(f"'{name}' is given twice", key="leave-out")
            if name not in known:
                raise input_error(
                    f"no measured load '{name}'{nearest_names(name, known)}", key="leave-out"
                )
        if known <= set(loads):
            raise input_error("leaves no load to calibrate with; name fewer loads", key="leave-out")
