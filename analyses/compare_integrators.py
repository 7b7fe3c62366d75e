"""Which of Drake's integrators is accurate enough, and what does it cost?

The run-up of `reference`, load `middle`, four times as fast, by each scheme of Drake and with
several accuracies or steps, against the finest run. With `--machines`, the engines `drake` and
`drake-accurate` on each shipped machine. The processor time is the least of some repeats in turn,
so that other work on the computer raises it little; only ratios count.

    python analyses/compare_integrators.py --picture docs/pictures/integrators.png
"""

import argparse
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from analysis_tools.spin_profiles import faster_profile

import wm_drake as wm
from wm_drake.engines.drake import ACCURACY, ACCURATE, LARGEST_STEPS, run_drake
from wm_drake.model.machine import Machine
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.files import shipped_machines
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import COLOURS, MARK, OURS, Axis, Figure, Line, Panel, Points, in_grid

FASTER = 4.0
"""How much faster the run-up of the first table is: [B] takes 70 s."""

SHORT = 15.0
"""Longest run of the table of machines. [s]"""


class Setting(NamedTuple):
    """How Drake integrates: scheme, accuracy (None for fixed steps), largest step [s]."""

    scheme: str
    accuracy: float | None
    largest: float

    @property
    def name(self) -> str:
        """Return scheme and kind of control."""
        return f"{self.scheme}, {'error control' if self.accuracy else 'fixed steps'}"

    @property
    def words(self) -> str:
        """Return accuracy and steps."""
        if self.accuracy is None:
            return f"{1e3 * self.largest:g} ms"
        return f"{self.accuracy:g}, to {1e3 * self.largest:g} ms"


USUAL = Setting("runge_kutta3", ACCURACY, 2.5e-3 * LARGEST_STEPS)
CAREFUL = Setting("runge_kutta3", ACCURATE, 2.5e-3)
FINEST = Setting("runge_kutta3", 1e-7, 1.25e-3)
SETTINGS = (
    *(Setting("runge_kutta3", accuracy, 5e-3) for accuracy in (1e-3, 3e-4, 1e-4, 3e-5)),
    CAREFUL,
    *(Setting("runge_kutta3", None, step) for step in (5e-3, 2.5e-3, 1.25e-3)),
    *(Setting("runge_kutta2", None, step) for step in (2.5e-3, 1.25e-3, 0.625e-3)),
    *(Setting("runge_kutta5", None, step) for step in (5e-3, 2.5e-3)),
    *(Setting("bogacki_shampine3", accuracy, 5e-3) for accuracy in (1e-3, 1e-4)),
)


def run(
    machine: Machine, load: str, profile: SpinProfile, setting: Setting
) -> tuple[float, np.ndarray]:
    """Return processor time [s] and largest displacements of the tub (6,) [rad, m] of a run."""
    setup = machine.set_up(load)
    factor = 1.0 if setting.accuracy is None else LARGEST_STEPS
    start = time.process_time()
    motion = run_drake(
        setup,
        profile,
        setting.largest / factor,
        lambda _: None,
        scheme=setting.scheme,
        accuracy=setting.accuracy,
        largest=LARGEST_STEPS,
    )
    spent = time.process_time() - start
    tub = np.asarray(motion.state)[:, :6]
    return spent, np.abs(tub - tub[0]).max(axis=0)


def error(sizes: np.ndarray, true: np.ndarray) -> float:
    """Return the largest relative error of the displacements of the tub along x, y, z."""
    return float(np.abs(sizes / true - 1.0)[3:].max())


def schemes(factor: float, repeats: int) -> Iterator[tuple[Setting, float, float]]:
    """Yield setting, processor time [s] and error of each scheme."""
    machine = wm.build_machine("reference")
    profile = faster_profile(machine.parameters.profile, factor)
    true = run(machine, "middle", profile, FINEST)[1]
    runs = [[run(machine, "middle", profile, each) for each in SETTINGS] for _ in range(repeats)]
    for setting, *of_setting in zip(SETTINGS, *runs, strict=True):
        yield setting, min(spent for spent, _ in of_setting), error(of_setting[0][1], true)


def machines() -> Iterator[str]:
    """Yield the row of each shipped machine: errors and the ratio of times."""
    yield "| machine | load | `drake`: error, % | `drake-accurate` | ratio of times |"
    yield "|---|---|---|---|---|"
    for name in shipped_machines():
        machine = wm.build_machine(name)
        load, step = next(iter(machine.parameters.loads)), machine.parameters.step
        whole = machine.parameters.profile
        profile = faster_profile(whole, max(whole.duration / SHORT, 1.0))
        settings = (
            Setting("runge_kutta3", ACCURACY, LARGEST_STEPS * step),
            Setting("runge_kutta3", ACCURATE, step),
            Setting("runge_kutta3", FINEST.accuracy, 0.5 * step),
        )
        (usual, first), (careful, second), (_, true) = (
            run(machine, load, profile, each) for each in settings
        )
        percents = (f"{1e2 * error(sizes, true):.2g}" for sizes in (first, second))
        yield f"| {name} | {load} | {' | '.join(percents)} | {usual / careful:.2f} |"


def figure(found: list[tuple[Setting, float, float]]) -> Figure:
    """Return the processor time over the error of the peaks."""
    marks: list[Line | Points] = []
    names = dict.fromkeys(setting.name for setting, *_ in found)
    for name, color in zip(names, COLOURS, strict=False):
        rows = [(1e2 * wrong, spent) for setting, spent, wrong in found if setting.name == name]
        x, y = np.array(sorted(rows)).T
        marks.append(Line(x, y, key=name, color=color, symbol="circle"))
    for setting, name, color in ((USUAL, "engine drake", OURS), (CAREFUL, "drake-accurate", MARK)):
        rows = [(1e2 * wrong, spent) for each, spent, wrong in found if each == setting]
        x, y = np.array(rows).T
        marks.append(Points(x, y, key=name, color=color, size=13.0, is_open=True))
    panel = Panel(
        marks=tuple(marks),
        x=Axis(label="error of the largest displacements, %", is_log=True),
        y=Axis(label="processor time, s"),
    )
    return Figure(panels=in_grid([panel], 1), height=420.0)


def main() -> None:
    """Print the table of schemes, or of machines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a run-up of a second")
    parser.add_argument("--machines", action="store_true", help="all shipped machines")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--picture", type=Path, help="draw the time over the error")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", wm.errors.InputNotice)
    found: list[tuple[Setting, float, float]] = []
    if arguments.machines:
        text = list(machines())
    else:
        factor, repeats = (70.0, 1) if arguments.quick else (FASTER, 3)
        found = list(schemes(factor, repeats))
        text = ["| scheme | accuracy or step | error of peaks, % | time, s |", "|---|---|---|---|"]
        text += [
            f"| {setting.scheme} | {setting.words} | {1e2 * wrong:.2g} | {spent:.2f} |"
            for setting, spent, wrong in found
        ]
    print("\n".join(text))
    if arguments.out:
        arguments.out.write_text("\n".join(text) + "\n", encoding="utf-8")
    if arguments.picture:
        matplotlib_of(figure(found)).savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
