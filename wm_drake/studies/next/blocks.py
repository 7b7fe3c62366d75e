"""Block on what to measure next, of the pages of `verdict` and `calibrate`."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wm_drake.studies.blocks import Extend, PageBlock

if TYPE_CHECKING:
    from wm_drake.parameters import SpinProfile
    from wm_drake.studies.answer import Answer
    from wm_drake.studies.executor import Executor
    from wm_drake.studies.next.knowledge import Knowledge


def _of_verdict(task: Any) -> Extend | None:
    """Return the block of a machine that is known from drawings and catalogues."""
    from wm_drake.studies.proposal import command_text
    from wm_drake.studies.verdict.task import VerdictTask

    if not isinstance(task, VerdictTask):  # several machines are compared
        return None
    (machine,) = task.options.machine
    command = command_text(f"wm-drake study next {machine}", task.options)

    def known() -> "Knowledge":
        from wm_drake.studies.next.knowledge import of_file
        from wm_drake.studies.next.task import UNMEASURED

        return of_file(task.machine, UNMEASURED)

    return lambda executor, answer: _with_block(
        executor, answer, known, command, task.cases[0].profile
    )


def _of_calibrate(task: Any) -> Extend | None:
    """Return the block of the best solution of a calibration to targets."""
    from wm_drake.studies.calibrate.task import CalibrateTask

    if not isinstance(task, CalibrateTask):
        return None
    words = ["wm-drake study next", task.options.machine, f"--vary {task.options.vary}"]

    def known() -> "Knowledge":
        from wm_drake.studies.next.knowledge import of_calibration

        calibration = task.calibration
        best = calibration.solutions[0]
        return of_calibration(calibration.parameter_map, best.point, best.fit.covariance)

    def extend(executor: "Executor", answer: "Answer") -> "Answer":
        command = " ".join([*words, f"--calibrated {executor.out or 'FOLDER'}"])
        profile, measured = task.machine.parameters.profile, task.targets.loads
        return _with_block(executor, answer, known, command, profile, measured)

    return extend


def _with_block(
    executor: "Executor",
    answer: "Answer",
    known: "Callable[[], Knowledge]",
    command: str,
    profile: "SpinProfile",
    measured: Collection[tuple[str, bool]] = (),
) -> "Answer":
    """Return an answer with the block; arguments as for `next_block`."""
    from wm_drake.studies.next.task import next_block  # slow to import

    part = next_block(executor, known, command, profile, measured)
    return replace(answer, parts=(*answer.parts, part))


OF_VERDICT = PageBlock("next of verdict", "verdict", _of_verdict)
OF_CALIBRATE = PageBlock("next of calibrate", "calibrate", _of_calibrate)
