"""How far is the error that a run estimates of its steps from its true error?

Machines of each kind run with their default step and with shorter ones, without repetition. The
true error is the largest relative difference of a measure (displacements, forces and moments of the
gasket, amplitudes, mounts) from a step eight times as short as the shortest shown, by the rule that
compares repeated runs. The script prints a row for each run and draws the estimate over the error.

    python analyses/check_step_error.py --picture docs/pictures/step_error.png
"""

import argparse
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from choose_step import DAMPERS, machine_with, machine_with_tubes

import wm_drake as wm
from wm_drake.engines.trajectory import Estimates
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import OURS, QUIET, Axis, Figure, Line, Panel, Points, in_grid
from wm_drake.simulation.convergence import Attempt, difference

STOP = Path(__file__).with_name("hard_stop.yaml")
MEASURES = ("extremes", "amplitudes", "mounts")
FINER = 8
"""How much shorter the step of the true value is than the shortest one shown."""


def run_up(rpm: float, seconds: float, hold: float = 3.0) -> SpinProfile:
    """Return a run-up and a hold."""
    speed = rpm * np.pi / 30.0
    return SpinProfile(time=(0.0, seconds, seconds + hold), speed=(0.0, speed, speed))


@dataclass(frozen=True)
class Row:
    """A machine and how it is run.

    Attributes:
        name, machine, load: Words for it, its name, file or parameters, and its load.
        steps: Steps, the longest first. [ms]
        changes: New values by key path.
        profile: Spin profile; None for its own.
    """

    name: str
    machine: str | Path | MachineParameters
    steps: tuple[float, ...] = (2.5, 1.25, 0.625)
    changes: dict[str, Any] = field(default_factory=dict)
    profile: SpinProfile | None = None
    load: str = "middle"


RUBBER = {
    "gasket.maxwell_stiffness_x": "2 N/mm", "gasket.maxwell_damping_x": "0.04 N*s/mm",
    "gasket.dahl_force_z": "8 N", "gasket.dahl_displacement_z": "1 mm",
}  # fmt: skip
TYPE = "damper_types.friction."
ROWS = (
    Row("reference", "reference"),
    Row("reference, counter", "reference", load="counter"),
    *(
        Row(f"stop of {k} N/mm", STOP, changes={"elements.bump.stiffness": f"{k} N/mm"})
        for k in (80, 300, 1000)
    ),
    Row(
        "friction full at 50 mm/s, 1400 rpm",
        "reference",
        (1.25, 0.625, 0.3125),
        {TYPE + "full_friction_velocity": "50 mm/s"},
        run_up(1400.0, 40.0),
    ),
    Row("1400 rpm", "reference", (1.25, 0.625), {}, run_up(1400.0, 40.0)),
    Row(
        "springs go slack", "reference", changes={"gravity": "1.5 m/s^2"}, profile=run_up(320.0, 27)
    ),
    Row("steep friction, four derivatives", "reference", (2.5, 1.25), {
        TYPE + "full_friction_velocity": "5 mm/s", "integrator": "runge_kutta"}),
    Row("light_cabinet, feet lift", "light_cabinet"),
    Row("heavy_cabinet", "heavy_cabinet"),
    Row("motor", "motor"),
    Row("liquid_rings", "liquid_rings", (1.0, 0.5), {}, run_up(600.0, 20.0)),
    Row("ball_rings", "ball_rings", (0.25, 0.125), {}, run_up(600.0, 20.0)),
    Row("ball_rings, own profile", "ball_rings", (0.25, 0.125)),
    Row("rubber gasket", "reference", (2.5, 1.25), RUBBER),
    Row("Coulomb friction", machine_with(DAMPERS["Coulomb"]), (2.5, 1.25, 0.625)),
    Row("free_stroke, midpoint", "free_stroke", (0.25, 0.125), {}, run_up(350.0, 25), "front"),
    Row("MSTV, midpoint", machine_with_tubes(DAMPERS["MSTV"]), (0.25, 0.125), {},
        run_up(350.0, 25), "rear"),
)  # fmt: skip


def runs(row: Row) -> Iterator[tuple[float, float, float]]:
    """Yield step [ms], estimate and true error of each run of a row."""
    given = row.machine
    drawn = given if isinstance(given, MachineParameters) else wm.load_machine(given)
    parameters = wm.with_values(drawn, {"accuracy": 1.0} | row.changes)
    machine = wm.build_machine(parameters)
    case = wm.case_of(parameters, row.load)
    case = replace(case, profile=row.profile or case.profile)
    tables = {
        step: wm.simulate_many(machine, [case], measures=MEASURES, step=1e-3 * step)
        for step in (row.steps[-1] / FINER, *row.steps)
    }
    true, *others = (_attempt(table) for table in tables.values())
    for table, run in zip(list(tables.values())[1:], others, strict=True):
        yield 1e3 * table.step.item(), table.error.item(), difference(run, true)


def _attempt(table: xr.Dataset) -> Attempt:
    values = {str(name): array.values[0] for name, array in table.drop_vars("diverged").items()}
    size = float(np.abs(values["detergent_displacement"]).max())
    return Attempt(Estimates(0.0, 0.0), 0.0, 0, table.diverged.item(), values, size)


def figure(found: np.ndarray) -> Figure:
    """Return the estimate over the true error of runs (n, 2), in percent."""
    ends = np.array([1e-5, 1e3])
    allowed = wm.load_machine("reference").accuracy
    marks = (
        Line(ends, ends, key="estimate = error", color=QUIET),
        Line(ends, 0.5 * ends, key="half of it", color=QUIET, dash="dashed"),
        Line(ends, np.full(2, 1e2 * allowed), key="accepted below", color=QUIET, dash="dotted"),
        Points(1e2 * np.maximum(found[:, 0], 1e-7), 1e2 * found[:, 1], key="runs", color=OURS),
    )
    x, y = Axis(label="true error, %", is_log=True), Axis(label="estimate, %", is_log=True)
    panel = Panel(marks=marks, x=x, y=y)
    return Figure(panels=in_grid([panel], 1), height=420.0)


def main() -> None:
    """Print a table of estimates and errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one machine")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--picture", type=Path, help="draw the estimate over the error")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", wm.errors.InputNotice)
    text, found = ["| machine | step, ms | estimate, % | error, % |", "|---|---|---|---|"], []
    print("\n".join(text))
    for row in ROWS[:1] if arguments.quick else ROWS:
        for step, estimate, error in runs(row):
            found.append((error, estimate))
            text.append(f"| {row.name} | {step:.4g} | {1e2 * estimate:.2g} | {1e2 * error:.2g} |")
            print(text[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(text) + "\n", encoding="utf-8")
    if arguments.picture:
        matplotlib_of(figure(np.array(found))).savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
