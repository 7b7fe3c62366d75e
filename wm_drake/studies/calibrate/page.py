"""Page of a calibration."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.model.build import build_machine
from wm_drake.parameters import machine_yaml
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.report.formatting import MM_PER_M, number, percent
from wm_drake.report.page import Picture, Section, SectionedPage, picture, versions_of
from wm_drake.report.quantity import shown
from wm_drake.report.table import Column, Group, Row, Table, line
from wm_drake.report.terminal import Printed
from wm_drake.simulation.cases import case_of
from wm_drake.studies.calibrate.figures import errors_figure, modes_figure, quantities_figure
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.solutions import percents_of, solved_machine
from wm_drake.studies.calibrate.study import BEYOND_LIMIT, Calibration
from wm_drake.studies.calibrate.tables import (
    FITS,
    amplitude_rows,
    predictions_shown,
    quantities_shown,
    quantity_table,
    response_table,
    responses_shown,
)
from wm_drake.studies.modes.natural import natural_modes
from wm_drake.studies.spin.data import (
    OURS,
    amplitudes_of,
    differences_of,
    experiment_of,
    gaps_of,
    row_of,
)
from wm_drake.studies.spin.figures import envelopes_figure
from wm_drake.studies.spin.page import amplitude_tables, gaps_table, sensors_table
from wm_drake.studies.spin.study import (
    CaseResult,
    ComparedCases,
    SpinRuns,
    band_text,
    run_spin,
)
from wm_drake.studies.study import Facts, Result


@dataclass(frozen=True)
class CalibrateResult(Result):
    """A calibration, and predictions of held-out loads."""

    calibration: Calibration
    predictions: Sequence[Prediction] = ()
    float_formats: ClassVar[Mapping[str, str]] = {"amplitudes": "%.4f"}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return quantities, amplitudes, and, if there are any, other responses."""
        shown = {
            "quantities": quantity_table(self.calibration),
            "amplitudes": amplitude_rows(self.calibration),
        }
        if self.calibration.targets.responses:
            shown["responses"] = response_table(self.calibration)
        return shown

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
        }

    def terminal(self) -> Printed:
        """Yield the quantities, the errors and predictions."""
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

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return calibration_page(self, facts)


def calibration_page(result: CalibrateResult, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file.

    Spin runs and modes of the best solution are computed for it.
    """
    calibration = result.calibration
    solved = solved_machine(calibration.solutions[0])
    cases = [case_of(solved, name, gasket=gasket) for name, gasket in calibration.targets.loads]
    built = build_machine(solved)
    titles = {False: "without gasket", True: "with gasket"} if solved.gasket else {False: "modes"}
    modes = [(title, natural_modes(built, gasket=gasket)) for gasket, title in titles.items()]
    return drawn_page(result, run_spin(solved, cases), modes, facts)


def drawn_page(
    result: CalibrateResult, best: SpinRuns, modes: Sequence[tuple[str, xr.Dataset]], facts: Facts
) -> str:
    """Return the page with computed runs.

    Args:
        result: Result of the calibration.
        best: Spin runs of the machine of the best solution, for the measured cases.
        modes: Titles and natural modes of that machine, for each state that is shown.
        facts: How the result was computed.
    """
    best = replace(best, comparison=ComparedCases.ALL)  # the targets were named
    amplitudes = amplitudes_of(best)
    return SectionedPage(
        f"Calibration of machine {best.parameters.name}",
        summary(result.calibration, result.predictions),
        [
            *_picture_sections(result, best, modes, amplitudes),
            *_table_sections(result, best, amplitudes),
        ],
        _facts(result.calibration, best, facts),
        best.parameters,
        [*facts.warnings, *warnings_of(best)],
        method=_method(result.calibration),
    ).html()


def _picture_sections(
    result: CalibrateResult,
    best: SpinRuns,
    modes: Sequence[tuple[str, xr.Dataset]],
    amplitudes: xr.Dataset,
) -> list[Section]:
    calibration = result.calibration
    errors = _errors_picture(best, amplitudes)
    envelopes = tuple(_envelopes_picture(case, amplitudes) for case in best.results)
    return [
        Section("errors", "Errors of the amplitudes", (errors,)),
        Section(
            "certainty",
            "Certainty of the quantities",
            (_quantities_picture(calibration),),
            text="A quantity is determined by the data if they reduce its standard deviation to "
            "less than half of that of the prior. It is determined by the prior only if more than "
            "nine tenths of the prior standard deviation remain. A quantity is at a bound if the "
            "search was stopped by the bound.",
            facts=certainty(calibration),
        ),
        Section("motion", "Modes", (_modes_picture(modes),)),
        Section("envelopes", "Envelopes", envelopes),
    ]


def _table_sections(
    result: CalibrateResult, best: SpinRuns, amplitudes: xr.Dataset
) -> list[Section]:
    calibration, predictions = result.calibration, result.predictions
    effects, relations = effects_table(calibration), relations_table(calibration)
    responses = [responses_shown(calibration)] if calibration.targets.responses else []
    predicted = [predictions_shown(predictions)] if predictions else []
    predicted += [intervals_table(calibration, prediction) for prediction in predictions]
    quantities = [quantities_shown(calibration), *filter(None, [relations])]
    speeds = sensors_table(best).table(), gaps_table(gaps_of(best)).table()
    compared = [table.table() for table in amplitude_tables(best, amplitudes)]
    return [
        Section("amplitudes", "Amplitudes", tables=compared),
        Section("responses", "Other responses", tables=responses),
        Section("gasket", "Effect of the gasket", tables=[effects] if effects else []),
        Section(
            "prediction", "Prediction", tables=predicted, text=PREDICTION if predictions else ""
        ),
        Section("quantities", "Quantities", tables=quantities),
        Section("speeds", "Critical speeds and smallest gaps", tables=speeds),
        Section("searches", "Searches", tables=[searches_table(calibration)]),
    ]


PREDICTION = (
    "A calibrated machine is reliable only if it also predicts loads that were not used for the "
    "calibration. For each row, the named loads are held out: the machine is calibrated with the "
    "other loads only, starting from the expected value of each quantity, and then the held-out "
    "loads are computed. An interval comes from machines that are drawn from the posterior around "
    "each distinct good solution of the calibration without these loads. A wide interval means "
    "that the other loads do not determine the amplitude."
)


def _method(calibration: Calibration) -> str:
    """Return sentences on the cost that the searches minimize."""
    limits = ", ".join(
        f"{name} {number(100.0 * limit)} %" for name, limit in calibration.targets.limits.items()
    )
    beyond = (
        f" The part of a logarithm beyond its limit ({limits}) enters a second time, "
        f"{number(BEYOND_LIMIT, 0)} times as large."
        if limits
        else ""
    )
    return (
        "A search minimizes the cost, which is half the sum of two sums of squares. The first sum "
        "is over the amplitudes: ln(computed / measured) / s, where s combines the relative "
        f"deviation {number(calibration.plan.deviation, 3)} and the rounding of the measured "
        "value; other responses enter in the same way, each with its own deviation."
        f"{beyond} The second sum is over the free quantities: (quantity − expected) / deviation. "
        "It includes the preloads of the springs and the relations if the free file gives them. "
        "The standard deviations after the fit are those of a normal distribution about the "
        "solution, for which the logarithms of the amplitudes are linear in the quantities. They "
        "do not describe other minima of the cost; the distinct solutions show those."
    )


def summary(calibration: Calibration, predictions: Sequence[Prediction]) -> str:
    """Return one paragraph about the agreement and the certainty of the best solution."""
    targets, best = calibration.targets, calibration.solutions[0]
    errors = best.errors
    case, sensor = np.unravel_index(int(np.nanargmax(np.abs(errors))), errors.shape)
    name, gasket = targets.loads[case]
    count = len(calibration.solutions)
    searches, quantities = len(calibration.ended), len(calibration.parameter_map.names)
    determined = int(np.sum(best.posterior.directions() > 1.0))
    text = (
        f"The best machine is compared with {np.isfinite(errors).sum()} measured amplitudes. The "
        f"mean absolute difference is {number(percents_of(errors).mean)} %. The largest difference "
        f"is {percent(100 * errors[case, sensor])}, at sensor {targets.sensors[sensor]} with load "
        f"{name} ({'with' if gasket else 'without'} gasket). "
        f"{searches} {'search' if searches == 1 else 'searches'} found {count} distinct good "
        f"{'solution' if count == 1 else 'solutions'}. The data determine {determined} of "
        f"{quantities} independent combinations of the free quantities better than the priors do."
    )
    if targets.responses:
        others = percents_of(best.response_errors)
        text += (
            f" Of {len(targets.responses)} other responses, the mean absolute difference is "
            f"{number(others.mean)} % and the largest {number(others.largest)} %."
        )
    if beyond := best.values_beyond():
        text += f" Beyond their limits: {', '.join(beyond)}."
    if predictions:
        covered = float(np.mean([p.covered for p in predictions]))
        of_each = [percents_of(p.kinds()[0].predicted).mean for p in predictions]
        worst = int(np.argmax(of_each))
        text += (
            " Amplitudes of held-out loads are predicted with a mean absolute difference of at "
            f"most {number(of_each[worst])} % (worst case: {', '.join(predictions[worst].loads)}). "
            f"The 95 % intervals contain {number(100 * covered, 0)} % of the held-out values."
        )
    return text


def warnings_of(best: SpinRuns) -> list[str]:
    """Return a warning for each load with which tub and housing overlap."""
    gaps = [(case, case.measures.smallest_gap) for case in best.results]
    return [
        f"Load {case.title}: {gap.parts} overlap by "
        f"{number(-MM_PER_M * gap.distance)} mm. The model has no contact forces. If the measured "
        "machine did not collide there, it moves less or its housing is wider than in the model."
        for case, gap in gaps
        if gap is not None and gap.distance <= 0.0
    ]


def certainty(calibration: Calibration) -> list[tuple[str, str]]:
    """Return which quantities the data determine, and which only the priors: heading and text."""
    best, names = calibration.solutions[0], calibration.parameter_map.names
    verdicts = best.verdicts()
    sizes = best.posterior.directions()
    rows = [
        (
            "Combinations",
            f"the amplitudes determine {int(np.sum(sizes > 1.0))} independent combinations of the "
            f"{len(names)} quantities better than the priors do, the best one "
            f"{number(float(sizes[0]), 0)} times better",
        )
    ]
    for verdict, text in _VERDICTS.items():
        held = [
            name.replace("_", " ")
            for name, word in zip(names, verdicts, strict=True)
            if word == verdict
        ]
        rows.append((text, ", ".join(held) or "none"))
    return rows


_VERDICTS = {
    "data": "Determined by the data",
    "data and prior": "Determined by data and prior",
    "prior": "Determined by the prior only",
    "bound": "At a bound",
}


def effects_table(calibration: Calibration) -> Table | None:
    """Return the change of each amplitude due to the gasket, measured and computed.

    The result is None if no load was measured both with and without gasket.
    """
    targets = calibration.targets
    measured = targets.gasket_effects(targets.amplitude)
    computed = targets.gasket_effects(calibration.solutions[0].amplitude)
    if not measured:
        return None
    groups = [
        Group(
            name,
            (
                Row((EXPERIMENT, *(percent(100 * v) for v in measured[name])), "measured"),
                Row(("calibrated machine", *(percent(100 * v) for v in computed[name])), "ours"),
            ),
        )
        for name in measured
    ]
    caption = (
        "Change of each amplitude due to the gasket, in percent of the amplitude without gasket "
        "([B] Eq. (1))."
    )
    return Table(caption, ("load", "source", *targets.sensors), tuple(groups), text_columns=2)


def relations_table(calibration: Calibration) -> Table | None:
    """Return the relations of the free file and their ratios at the best solution."""
    parameter_map, best = calibration.parameter_map, calibration.solutions[0]
    if not parameter_map.relations:
        return None
    groups = [
        line(
            relation.name.replace("_", " "),
            [
                ("at most " if relation.is_limit else "expected ")
                + f"{relation.ratio:.3g} ± {relation.deviation:.2g}",
                f"{float(relation.at(best.point[None])[0]):.3g}",
            ],
        )
        for relation in parameter_map.relations
    ]
    caption = "Ratios of free quantities to what physics gives for them (free file)."
    return Table(caption, ("relation", "known", "calibrated machine"), tuple(groups), 2)


def intervals_table(calibration: Calibration, prediction: Prediction) -> Table:
    """Return the predicted amplitudes of held-out loads with their 95 % intervals. [mm]"""
    targets = calibration.targets
    cases = prediction.cases
    measured, predicted, lower, upper = (
        MM_PER_M * amplitude[cases] for amplitude in (targets.amplitude, *prediction.amplitude)
    )
    held = [case for case, is_held in zip(targets.loads, cases, strict=True) if is_held]
    groups = []
    for row, (load, gasket) in enumerate(held):
        ends = zip(lower[row], upper[row], strict=True)
        rows = (
            Row(("measured", *map(number, measured[row])), "measured"),
            Row(("predicted", *map(number, predicted[row])), "ours"),
            Row(("95 % interval", *(f"{number(low)} to {number(high)}" for low, high in ends)), ""),
        )
        groups.append(Group(f"{load}, {'with' if gasket else 'without'} gasket", rows))
    caption = (
        f"Held out: {', '.join(prediction.loads)}. Predicted amplitudes, mm. "
        f"The intervals contain {number(100 * np.mean(prediction.kinds()[0].is_covered), 0)} % "
        "of the measured ones. They allow for the uncertainty of the free quantities and for a "
        f"scatter of {number(100 * prediction.scatter, 0)} % of an amplitude."
    )
    return Table(caption, ("load", "source", *targets.sensors), tuple(groups), text_columns=2)


def searches_table(calibration: Calibration) -> Table:
    """Return the end point of every search."""
    ranks = {solution.start: n for n, solution in enumerate(calibration.solutions, start=1)}
    groups = tuple(
        line(
            str(end.start + 1),
            (
                ranks.get(end.start),
                end.data_cost,
                end.prior_cost,
                *percents_of(end.errors),
                end.evaluations,
            ),
        )
        for end in calibration.ended
    )
    columns = (
        Column("start", decimals=0),
        Column("solution", decimals=0),
        Column("cost of the data", decimals=1),
        Column("cost of the priors", decimals=1),
        Column("mean error", "%", 1),
        Column("largest error", "%", 1),
        Column("machines tried", decimals=0),
    )
    caption = (
        "End point of each search. A solution is good if its mean error is close to that of the "
        "best solution. It is distinct if it differs from every better solution by at least half a "
        "prior standard deviation (root mean square over the quantities)."
    )
    return Table(caption, columns, groups)


def _errors_picture(best: SpinRuns, amplitudes: xr.Dataset) -> Picture:
    differences = differences_of(amplitudes)
    others = [name for name in dict.fromkeys(differences.source.values.tolist()) if name != OURS]

    def errors(case: CaseResult, source: str) -> np.ndarray | None:
        row = row_of(differences, case, source)
        return None if row is None else shown(row.difference)

    rows = []
    for case in best.results:
        ours = errors(case, OURS)
        if ours is not None:
            of_others = (errors(case, source) for source in others)
            rows.append((case.title, ours, next((e for e in of_others if e is not None), None)))
    caption = "Percent differences from the experiment. Blue dots: calibrated machine."
    if others:
        caption += f" Grey diamonds: {', '.join(others)}."
    figure = errors_figure(rows, list(best.parameters.sensors))
    return picture(figure, "The numbers are in the table below.", caption)


def _quantities_picture(calibration: Calibration) -> Picture:
    caption = (
        "Free quantities between their bounds. Orange tick and grey bar: expected value and one "
        "standard deviation of the prior. Blue dot and line: best solution and one standard "
        "deviation after the fit. Grey ticks: other solutions."
    )
    return picture(quantities_figure(calibration), "The numbers are in the table below.", caption)


def _modes_picture(modes: Sequence[tuple[str, xr.Dataset]]) -> Picture:
    caption = (
        "Rigid-body modes of the empty tub without dampers and with the drum at rest: natural "
        "frequency, drum speed of the same frequency, and mode shape. Angles are multiplied by "
        "0.25 m. The largest component of each shape is 1."
    )
    alternative = "; ".join(
        f"{title}: {', '.join(number(f, 2) for f in shown.frequency.values)} Hz"
        for title, shown in modes
    )
    return picture(modes_figure(modes), f"Natural frequencies {alternative}.", caption)


def _envelopes_picture(case: CaseResult, amplitudes: xr.Dataset) -> Picture:
    caption = (
        f"Load {case.title}: displacement in the band {band_text(case)}. The shaded area "
        "extends from the lower to the upper envelope. Dashed lines: measured amplitude."
    )
    return picture(
        envelopes_figure(case.record, experiment_of(amplitudes, case)),
        f"Envelopes, load {case.title}.",
        caption,
    )


def _facts(calibration: Calibration, best: SpinRuns, facts: Facts) -> list[tuple[str, str]]:
    plan = calibration.plan
    counted = sum(end.evaluations for end in calibration.ended)
    return [
        ("Method", f"least squares, {len(calibration.ended)} starts, seed {plan.seed}"),
        ("Machines tried", f"{counted}, each with {len(calibration.targets.loads)} runs"),
        ("Versions", versions_of(best.results[0].record.attrs)),
        *facts.rows(),
    ]
