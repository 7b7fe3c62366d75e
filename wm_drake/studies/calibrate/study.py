"""Command `calibrate`: calibration, predictions, fits with fewer quantities, and their tables."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from rich.table import Table as TerminalTable

from wm_drake.errors import InputError, input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, located, machine_yaml
from wm_drake.parameters.free import load_free
from wm_drake.parameters.measured import EXPERIMENT, measured_amplitudes, measured_responses
from wm_drake.parameters.units import plain_number
from wm_drake.report.table import Column, Table, table_of
from wm_drake.studies.calibrate.calibration import (
    RELATIVE_DEVIATION,
    Calibration,
    Plan,
    Simpler,
    calibrate,
    check_counts,
    fit_with_fewer,
)
from wm_drake.studies.calibrate.computed import Runner
from wm_drake.studies.calibrate.options import CalibrateOptions
from wm_drake.studies.calibrate.parameter_map import parameter_map_of
from wm_drake.studies.calibrate.prediction import Prediction, check_held_out, predict
from wm_drake.studies.calibrate.response_targets import CONTRIBUTION, TRIALS, with_deviations
from wm_drake.studies.calibrate.solutions import percents_of, solved_machine
from wm_drake.studies.calibrate.targets import AMPLITUDE, MILLIMETRE, Targets, targets_of
from wm_drake.studies.inputs import existing_file, pairs_of, with_measured
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Facts, Result, Task


@dataclass(frozen=True)
class CalibrateResult(Result):
    """A calibration, predictions of held-out loads, and fits with fewer quantities."""

    calibration: Calibration
    predictions: Sequence[Prediction] = ()
    fewer: Sequence[Simpler] = ()
    float_formats: ClassVar[Mapping[str, str]] = {"amplitudes": "%.4f"}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return quantities, amplitudes, and, if there are any, other responses and fewer fits."""
        shown = {
            "quantities": quantity_table(self.calibration),
            "amplitudes": amplitude_rows(self.calibration),
        }
        if self.calibration.targets.responses:
            shown["responses"] = response_table(self.calibration)
        return shown | ({"fewer": fewer_table(self.fewer)} if self.fewer else {})

    def texts(self) -> dict[str, str]:
        """Return the machine of each solution."""
        return {
            f"machine_{number}.yaml": machine_yaml(solved_machine(solution, number))
            for number, solution in enumerate(self.calibration.solutions, start=1)
        }

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        calibration, targets = self.calibration, self.calibration.targets
        return {
            "searches": len(calibration.ended),
            "solutions": [
                {
                    "start": s.start,
                    "cost": s.cost,
                    "data_cost": s.data_cost,
                    **percents_of(s.errors).named(),
                    "other_responses": percents_of(s.response_errors).named()
                    if targets.responses
                    else None,
                }
                for s in calibration.solutions
            ],
            "quantities": json.loads(quantity_table(calibration).to_json(orient="records")),
            "predictions": [
                {"loads": list(p.loads)}
                | {fit: percents_of(getattr(p.kinds()[0], fit)).named() for fit in FITS}
                | {"covered_percent": 100 * p.covered}
                for p in self.predictions
            ],
            "fewer": json.loads(fewer_table(self.fewer).to_json(orient="records")),
        }

    def terminal(self) -> Iterator[TerminalTable | str]:
        """Yield the quantities, the errors, predictions, and fits with fewer quantities."""
        best = self.calibration.solutions[0]
        yield quantities_shown(self.calibration, is_short=True).terminal(
            "Best solution, machine_1.yaml"
        )
        yield (
            f"Searches: {len(self.calibration.ended)}. Distinct good solutions: "
            f"{len(self.calibration.solutions)}."
        )
        yield "Absolute differences of the amplitudes from the experiment:"
        yield f"  best solution: {percents_of(best.errors)}"
        if best.targets.responses:
            yield "Absolute differences of the other responses:"
            yield f"  best solution: {percents_of(best.response_errors)}"
        yield from (f"  beyond its limit: {text}" for text in best.values_beyond())
        if self.predictions:
            yield predictions_shown(self.predictions).terminal("Held-out loads")
        if self.fewer:
            yield fewer_shown(self.fewer).terminal("Cost against number of free quantities")

    def page(self, facts: Facts) -> str:
        """Return the page."""
        from wm_drake.studies.calibrate.page import calibration_page

        return calibration_page(self, facts)


class CalibrateTask(Task):
    """A calibration with checked options."""

    def __init__(self, options: CalibrateOptions, machine: Machine) -> None:
        """Read targets and free file, and check the settings of the searches.

        Raises:
            InputError: an option or a file is wrong.
        """
        self.held_out, self.counts = _groups(options.leave_out), _counts(options.fewer)
        measured = with_measured(machine.parameters, options.targets, "--targets")
        deviations = _fractions(options.deviation, "--deviation")
        amplitude = deviations.pop(AMPLITUDE, RELATIVE_DEVIATION)
        targets = _targets(measured, deviations).weighted(_numbers(options.weight, "--weight"))
        with problems_at("--limit", ""):
            self.targets = targets.limited(_fractions(options.limit, "--limit"))
        # the calibrated machine names the targets as its measurements
        self.machine = build_machine(measured) if options.targets else machine
        resolution = 1e-3 * options.resolution
        self.plan = Plan(
            options.method, options.starts, options.seed, options.iterations, amplitude, resolution
        )
        self.free = load_free(existing_file(options.free, "--free"))
        self.plan.check()
        check_held_out(self.targets, self.held_out)
        check_counts(self.counts, len(self.free.quantities))
        try:
            parameter_map_of(self.machine, self.free)
        except InputError as error:
            raise located(error, options.free) from None

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the searches beside the machine."""
        return {
            "free": self.free,
            "targets": self.targets,
            "plan": self.plan,
            "leave_out": "; ".join(map(",".join, self.held_out)),
            "fewer": ",".join(map(str, self.counts)),
        }

    def run(self, executor: Executor) -> CalibrateResult:
        """Calibrate, predict the held-out loads, and fit again with fewer quantities."""
        assert executor.ledger is not None  # the study is declared with runs
        runner = Runner(self.machine, executor.ledger, executor.workers)
        with _searches(executor, runner, self.plan.starts) as shown:
            calibration = calibrate(shown, self.free, self.targets, self.plan)
        with _searches(executor, runner, len(self.held_out) * self.plan.starts) as shown:
            predictions = predict(shown, self.free, calibration, self.held_out)
        fits: list[Simpler] = []
        if self.counts:
            with _searches(executor, runner, len(self.counts)) as shown:
                fits = fit_with_fewer(shown, calibration, self.counts)
        return CalibrateResult(calibration, predictions, fits)


@contextmanager
def _searches(executor: Executor, runner: Runner, searches: int) -> Iterator[Runner]:
    """Yield the runner with a progress bar of searches, machines and the least cost."""
    with executor.progress(searches, "searches") as bar:
        ended, last = 0, (0, 0)

        def report(search: int, evaluations: int, best: float) -> None:
            nonlocal ended, last
            if last[1] > evaluations or last[0] != search:  # another search has begun
                ended += 1
            last = search, evaluations
            bar(ended, f"{evaluations} machines, least cost {best:.1f}")

        yield replace(runner, report=report)


def _targets(parameters: MachineParameters, deviations: Mapping[str, float]) -> Targets:
    if not parameters.measured:
        raise input_error(
            f"machine '{parameters.name}' names no measured amplitudes of its own; name a CSV file",
            where="--targets",
        )
    targets = targets_of(
        parameters,
        measured_amplitudes(parameters),
        ", ".join(Path(name).name for name in parameters.measured),
        measured_responses(parameters),
    )
    with problems_at("--deviation", ""):
        return replace(targets, responses=with_deviations(targets.responses, deviations))


def _fractions(entries: Sequence[str], option: str) -> dict[str, float]:
    """Return the numbers of NAME=PERCENT entries; one without a name is that of all amplitudes."""
    plain = [entry for entry in entries if "=" not in entry]
    if len(plain) > 1:
        raise input_error(
            f"{' and '.join(plain)} are given; one number without a name is allowed, that of the "
            "amplitudes",
            where=option,
        )
    named = [entry for entry in entries if "=" in entry]
    named += [f"{AMPLITUDE}={entry}" for entry in plain]
    return {name: number / 100.0 for name, number in _numbers(named, option, zero=False).items()}


def _numbers(entries: Sequence[str], option: str, zero: bool = True) -> dict[str, float]:
    """Return the numbers of NAME=NUMBER entries, each finite and above 0, or 0 where allowed."""
    numbers: dict[str, float] = {}
    for name, text in pairs_of(entries, option):
        try:
            number = plain_number(text)
        except ValueError as error:
            raise input_error(str(error), where=option, key=name) from None
        if not 0.0 <= number < math.inf or (number == 0.0 and not zero):
            allowed = ">= 0" if zero else "> 0"
            raise input_error(
                f"'{text}' is not allowed; must be {allowed} and finite", where=option, key=name
            )
        if name in numbers:
            raise input_error("is given twice", where=option, key=name)
        numbers[name] = number
    return numbers


def _groups(entries: Sequence[str]) -> list[list[str]]:
    """Return the groups of loads that `--leave-out` names."""
    groups = [[name.strip() for name in entry.split(",")] for entry in entries]
    for names in groups:
        for name in names:
            if names.count(name) > 1:
                raise input_error(f"'{name}' is given twice", where="--leave-out")
    return groups


def _counts(entry: str | None) -> list[int]:
    """Return the numbers of free quantities that `--fewer` names."""
    texts = [text.strip() for text in entry.split(",")] if entry is not None else []
    for text in texts:
        if not (text.isascii() and text.isdigit() and len(text) < 6):
            raise input_error(
                f"'{text[:20]}' is not a whole number; write for example 30,20,10", where="--fewer"
            )
    return [int(text) for text in texts]


def quantity_table(calibration: Calibration) -> pd.DataFrame:
    """Return a table of the free quantities, each in its unit.

    It has bounds and prior, and for each solution the value, its standard deviation and what
    determines it (see `Solution.verdicts`).
    """
    parameter_map = calibration.parameter_map
    expected, deviation = map(parameter_map.in_units, parameter_map.prior)
    columns: dict[str, Any] = {
        "quantity": parameter_map.names,
        "unit": parameter_map.units,
        "lower": parameter_map.in_units(parameter_map.lower),
        "upper": parameter_map.in_units(parameter_map.upper),
        "expected": expected,
        "deviation": deviation,
    }
    for number, solution in enumerate(calibration.solutions, start=1):
        columns[f"value_{number}"] = parameter_map.in_units(solution.point)
        columns[f"deviation_{number}"] = solution.posterior.spread() * deviation
        columns[f"held_by_{number}"] = solution.verdicts()
    return pd.DataFrame(columns)


QUANTITIES = {
    "quantity": Column("quantity"),
    "held_by_1": Column("determined by"),
    "unit": Column("unit"),
    "value_1": Column("best solution"),
    "deviation_1": Column("± deviation"),
    "expected": Column("expected"),
    "deviation": Column("± deviation"),
}
"""Columns of the quantities on page and terminal."""

BOUNDS = {"lower": Column("lower bound"), "upper": Column("upper bound")}
"""Columns of the quantities on the page alone."""


def quantities_shown(calibration: Calibration, *, is_short: bool = False) -> Table:
    """Return prior and solutions of each free quantity; in the short form the best one alone."""
    others = range(2, len(calibration.solutions) + 1)
    columns = {**QUANTITIES}
    if not is_short:
        columns |= BOUNDS | {f"value_{n}": Column(f"solution {n}") for n in others}
    caption = "Free quantities, with their standard deviations before and after the fit."
    return table_of(quantity_table(calibration)[list(columns)], caption, columns)


def amplitude_rows(calibration: Calibration) -> pd.DataFrame:
    """Return measured amplitudes and those of each solution as one table of amplitudes. [mm]"""
    targets = calibration.targets
    rows = []
    for index, (load, gasket) in enumerate(targets.loads):
        sources = [(EXPERIMENT, targets.amplitude[index])]
        sources += [
            (f"solution {n}", solution.amplitude[index])
            for n, solution in enumerate(calibration.solutions, start=1)
        ]
        for source, values in sources:
            amplitudes = {
                name: MILLIMETRE.from_si(float(v))
                for name, v in zip(targets.sensors, values, strict=True)
            }
            rows.append(
                {"load": load, "gasket": "yes" if gasket else "no", "source": source, **amplitudes}
            )
    return pd.DataFrame(rows)


def response_table(calibration: Calibration) -> pd.DataFrame:
    """Return the targets that are no amplitudes, and those responses of each solution.

    Columns: load, gasket (yes, no), of (machine, design, factor at a level, factor), response,
    unit, target, deviation in percent, and one for each solution.
    """
    rows = [
        {
            "load": target.load,
            "gasket": "yes" if target.gasket else "no",
            "of": target.of,
            "response": target.response.name,
            "unit": "%" if target.statistic == CONTRIBUTION else target.response.unit_text,
            "target": target.value,
            "deviation_percent": 100.0 * target.deviation,
        }
        for target in calibration.targets.responses
    ]
    solutions = enumerate(calibration.solutions, start=1)
    return pd.DataFrame(rows).assign(**{f"solution_{n}": s.responses for n, s in solutions})


RESPONSES = {
    **{name: Column(name) for name in ("load", "gasket", "of", "response", "unit", "target")},
    "solution_1": Column("calibrated machine"),
    "difference": Column("difference", "%", 0),
}
"""Columns of the other responses on the page."""


def responses_shown(calibration: Calibration) -> Table:
    """Return the targets that are no amplitudes, beside those of the best solution."""
    frame = response_table(calibration)
    frame["difference"] = 100.0 * calibration.solutions[0].response_errors
    caption = (
        "Responses that are no amplitudes of sensors. A value of the design is the mean over "
        f"{TRIALS} trials of an orthogonal array of the gasket's factors ([B] section 4); one of a "
        "factor at a level is its effect, with the difference in percent of the mean; one of a "
        "factor alone is its contribution in percent of the variance, with the difference in "
        "points. A response without a difference was not used."
    )
    return table_of(frame[list(RESPONSES)], caption, RESPONSES)


FITS = ("calibrated", "predicted", "seen")
"""Errors of a kind of values in a prediction, by the names of its attributes."""


def prediction_table(predictions: Sequence[Prediction]) -> pd.DataFrame:
    """Return a table with a row for each kind of values of each group of held-out loads.

    Differences are in percent; those of effects in percent of the mean, those of contributions in
    points.
    """
    rows = []
    for prediction in predictions:
        for kind in prediction.kinds():
            row: dict[str, object] = {"held_out": " ".join(prediction.loads), "what": kind.name}
            row["values"] = kind.predicted.size
            for fit in FITS:
                row |= percents_of(getattr(kind, fit)).named(f"{fit}_")
            rows.append(row | {"in_intervals_percent": 100.0 * float(np.mean(kind.is_covered))})
    return pd.DataFrame(rows)


PREDICTIONS = {
    "held_out": Column("held-out loads"),
    "what": Column("values"),
    "values": Column("number", decimals=0),
    **{
        f"{fit}_{error}_percent": Column(f"{fit}: {error}", "%", 1)
        for fit in FITS
        for error in ("mean", "largest")
    },
    "in_intervals_percent": Column("in the 95 % intervals", "%", 0),
}
"""Columns of the predictions."""


def predictions_shown(predictions: Sequence[Prediction]) -> Table:
    """Return the errors of loads when they were used for the calibration and when held out."""
    caption = (
        "Absolute differences from the targets; those of effects in percent of the mean, those of "
        "contributions in points. Calibrated: these loads in the calibration above, which used "
        "them. Predicted: these loads when they were held out. Seen: the remaining loads in the "
        "calibration without them."
    )
    return table_of(prediction_table(predictions), caption, PREDICTIONS)


def fewer_table(fits: Sequence[Simpler]) -> pd.DataFrame:
    """Return a table with a row for each fit; differences in percent, names separated by blanks."""
    return pd.DataFrame(
        [
            {
                "free_quantities": fit.count,
                "cost": fit.cost,
                "cost_of_data": fit.data_cost,
                **fit.amplitudes.named("amplitudes_"),
                **fit.responses.named("responses_"),
                "set_to_expected": " ".join(fit.fixed),
            }
            for fit in fits
        ]
    )


FEWER = {
    "free_quantities": Column("free quantities", decimals=0),
    "cost": Column("cost"),
    "cost_of_data": Column("cost of the data"),
    "amplitudes_mean_percent": Column("amplitudes: mean error", "%", 1),
    "amplitudes_largest_percent": Column("largest", "%", 1),
    "responses_mean_percent": Column("other responses: mean error", "%", 1),
    "responses_largest_percent": Column("largest", "%", 1),
    "set_to_expected": Column("set to expected values here"),
}
"""Columns of the fits with fewer free quantities."""


def fewer_shown(fits: Sequence[Simpler]) -> Table:
    """Return what the fit loses with fewer free quantities."""
    caption = (
        "Best fit with fewer free quantities. Each row frees those of the row above but for the "
        "named ones, whose loss raises the cost least in the linearised fit."
    )
    return table_of(fewer_table(fits), caption, FEWER)
