"""The report of a calibration: one HTML file that needs nothing else."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wm_drake.report import tables
from wm_drake.report.calibration.figures import errors_figure, modes_figure, quantities_figure
from wm_drake.report.figures import envelopes_figure
from wm_drake.report.page import Picture, picture, render, versions_of
from wm_drake.report.tables import EXPERIMENT, Group, Row, Table, amplitude_table, line
from wm_drake.report.wording import MISSING, MM_PER_M, case_title, number, percent
from wm_drake.studies.calibration.calibration import Calibration
from wm_drake.studies.calibration.outcome import mean_and_largest, quantity_table
from wm_drake.studies.calibration.prediction import Prediction
from wm_drake.studies.description.modal import Modes
from wm_drake.studies.spin.study import SpinResult


def calibration_report(
    calibration: Calibration,
    predictions: Sequence[Prediction],
    best: SpinResult,
    modes: Sequence[tuple[str, Modes]],
    command: str = "",
) -> str:
    """The report as text of one HTML file, with style and figures inside.

    Args:
        calibration: What came out.
        predictions: Of loads that were left out; none if that was not asked for.
        best: Spin runs of the best solution's machine with the measured cases.
        modes: Of that machine, by title.
        command: The command line that made it, to be shown.
    """
    table = amplitude_table(best)
    others = _other_models(table)
    return render(
        "calibration/page.html",
        title=f"Calibration of machine {best.parameters.name}",
        about=best.parameters.about,
        warnings=warnings_of(best),
        summary=summary(calibration, predictions),
        errors_picture=_errors_picture(best, table, others),
        comparison=tables.comparison(best, table),
        effects=effects_table(calibration),
        predictions=predictions_table(predictions) if predictions else None,
        knowledge=knowledge(calibration),
        quantities_picture=_quantities_picture(calibration),
        quantities=quantities_of(calibration),
        searches=searches_table(calibration),
        modes_picture=_modes_picture(modes),
        critical_speeds=tables.critical_speeds(best),
        smallest_gaps=tables.smallest_gaps(best),
        envelopes=[
            (case_title(case), _envelopes_picture(best, table, i))
            for i, case in enumerate(best.results)
        ],
        deviation=number(calibration.plan.deviation, 3),
        facts=_facts(calibration, best, command),
    )


def summary(calibration: Calibration, predictions: Sequence[Prediction]) -> str:
    """One paragraph, made from the numbers."""
    targets, best = calibration.targets, calibration.solutions[0]
    errors = best.errors(targets)
    mean, _ = mean_and_largest(errors)
    case, sensor = np.unravel_index(int(np.nanargmax(np.abs(errors))), errors.shape)
    name, gasket = targets.loads[case]
    count = len(calibration.solutions)
    searches = len(calibration.ended)
    text = (
        f"The best machine found differs from the {np.isfinite(errors).sum()} measured amplitudes by {number(100 * mean)} % "
        f"in the mean of absolute values and by {percent(100 * errors[case, sensor])} at most: sensor "
        f"{targets.sensors[sensor]}, load {name} {'with' if gasket else 'without'} gasket. "
        f"{searches} {'search' if searches == 1 else 'searches'} ended in {count} distinct good "
        f"{'solution' if count == 1 else 'solutions'}. Of {len(calibration.parameter_map.names)} free quantities the data determine "
        f"{int(np.sum(best.directions() > 1.0))} combinations better than what was expected of them; the others are held by "
        "their priors."
    )
    if predictions:
        worst = max(predictions, key=lambda p: mean_and_largest(p.predicted)[0])
        text += (
            " Loads that a calibration had not seen are predicted within "
            f"{number(100 * mean_and_largest(worst.predicted)[0])} % in the mean in the worst case ({', '.join(worst.loads)})."
        )
    return text


def warnings_of(best: SpinResult) -> list[str]:
    """What a reader must know before using the machine."""
    gaps = [(case, case.measures.smallest_gap) for case in best.results]
    return [
        f"Load {case_title(case)}: {gap.moving.replace('_', ' ')} and {gap.fixed.replace('_', ' ')} overlap by "
        f"{number(-MM_PER_M * gap.distance)} mm, and the model has no contact. The measured machine did not strike there, "
        "or its housing is wider than the drawn one."
        for case, gap in gaps
        if gap is not None and gap.distance <= 0.0
    ]


def knowledge(calibration: Calibration) -> list[tuple[str, str]]:
    """What the data say and what only the priors do, as pairs of word and text."""
    best, names = calibration.solutions[0], calibration.parameter_map.names
    column = quantity_table(calibration)["held_by_1"]
    sizes = best.directions()
    found = [
        (
            "Directions",
            f"the amplitudes know {int(np.sum(sizes > 1.0))} directions among the {len(names)} quantities better than the "
            f"priors do, the best of them {number(float(sizes[0]), 0)} times better",
        )
    ]
    for verdict, text in _VERDICTS.items():
        held = [
            name.replace("_", " ")
            for name, word in zip(names, column, strict=True)
            if word == verdict
        ]
        found.append((text, ", ".join(held) or "none"))
    return found


_VERDICTS = {
    "data": "Determined by the data",
    "data and prior": "By data and prior together",
    "prior": "By the prior only",
    "bound": "At a bound",
}


def effects_table(calibration: Calibration) -> Table | None:
    """What putting in the gasket does to each amplitude, measured and computed."""
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
    caption = "Change of each amplitude when the gasket is put in, as part of the amplitude without it ([B] Table 1)."
    return Table(caption, ("load", "source", *targets.sensors), tuple(groups), text_columns=2)


def predictions_table(predictions: Sequence[Prediction]) -> Table:
    """Errors of loads when they were part of the calibration and when they were not."""
    groups = []
    for prediction in predictions:
        kinds = (prediction.calibrated, prediction.predicted, prediction.seen)
        cells = [number(100 * v) for errors in kinds for v in mean_and_largest(errors)]
        groups.append(line(", ".join(prediction.loads), cells))
    errors = ("mean, %", "largest, %")
    header = (
        "loads left out",
        *(f"{kind}: {error}" for kind in ("calibrated", "predicted", "others") for error in errors),
    )
    caption = (
        "Absolute differences from the experiment: of the loads left out in the calibration above and where they were "
        "predicted, and of the others there."
    )
    return Table(caption, header, tuple(groups))


def quantities_of(calibration: Calibration) -> Table:
    """Every free quantity: prior, best solution, what holds it, and the other solutions."""
    table = quantity_table(calibration)
    others = range(2, len(calibration.solutions) + 1)
    groups = []
    for row in table.to_dict("records"):
        cells = [
            str(row["held_by_1"]),
            str(row["unit"]) or MISSING,
            f"{row['lower']:.4g} to {row['upper']:.4g}".replace("-", "−"),
            f"{row['expected']:.4g} ± {row['deviation']:.2g}".replace("-", "−"),
            f"{row['value_1']:.4g} ± {row['deviation_1']:.2g}".replace("-", "−"),
            *(f"{row[f'value_{n}']:.4g}".replace("-", "−") for n in others),
        ]
        groups.append(line(str(row["quantity"]), cells))
    header = (
        "quantity",
        "held by",
        "unit",
        "bounds",
        "expected",
        "solution 1",
        *(f"solution {n}" for n in others),
    )
    return Table(
        "Free quantities, with standard deviations before and after the fit.",
        header,
        tuple(groups),
        text_columns=3,
    )


def searches_table(calibration: Calibration) -> Table:
    """Where every search ended."""
    groups = []
    for end in calibration.ended:
        rank = next(
            (str(n) for n, s in enumerate(calibration.solutions, start=1) if s is end), MISSING
        )
        mean, largest = mean_and_largest(end.errors(calibration.targets))
        cells = [
            rank,
            *map(number, (end.data_cost, end.prior_cost, 100 * mean, 100 * largest)),
            str(end.evaluations),
        ]
        groups.append(line(str(end.start + 1), cells))
    header = (
        "start",
        "solution",
        "cost of the data",
        "of the priors",
        "mean error, %",
        "largest, %",
        "machines tried",
    )
    caption = (
        "Where each search ended. A solution counts as good if its mean error is near the best one's, and as distinct if it "
        "differs from every better one by half a prior deviation in the root mean square."
    )
    return Table(caption, header, tuple(groups))


def _other_models(table: pd.DataFrame) -> list[str]:
    return [s for s in dict.fromkeys(table["source"]) if s not in (EXPERIMENT, tables.OURS)]


def _errors_picture(best: SpinResult, table: pd.DataFrame, others: Sequence[str]) -> Picture:
    def errors(case: object, source: str) -> np.ndarray | None:
        changes = tables.differences(table, case, source)  # type: ignore[arg-type]
        return np.array([change.percent for change in changes]) if changes else None

    rows = []
    for case in best.results:
        ours = errors(case, tables.OURS)
        if ours is not None:
            rows.append(
                (
                    case_title(case),
                    ours,
                    next((e for o in others if (e := errors(case, o)) is not None), None),
                )
            )
    caption = "Percent differences from the experiment. Blue dots: the calibrated machine."
    if others:
        caption += f" Grey diamonds: {', '.join(others)}."
    return picture(
        errors_figure(rows, list(best.parameters.sensors)),
        "The numbers are in the table below.",
        caption,
    )


def _quantities_picture(calibration: Calibration) -> Picture:
    caption = (
        "Free quantities between their bounds. Grey bar and orange tick: expected value and one standard deviation. Blue dot "
        "and line: best solution and one standard deviation after the fit. Grey ticks: other solutions."
    )
    return picture(quantities_figure(calibration), "The numbers are in the table below.", caption)


def _modes_picture(modes: Sequence[tuple[str, Modes]]) -> Picture:
    caption = (
        "Rigid-body modes of the empty tub with free dampers and the drum at rest: natural frequency, the drum speed that "
        "meets it, and the shape; angles count at 0.25 m, the largest component is 1."
    )
    alternative = "; ".join(
        f"{title}: {', '.join(number(f, 2) for f in found.frequency_hz)} Hz"
        for title, found in modes
    )
    return picture(modes_figure(modes), f"Natural frequencies {alternative}.", caption)


def _envelopes_picture(best: SpinResult, table: pd.DataFrame, index: int) -> Picture:
    case = best.results[index]
    caption = "Displacement in the band 0.5–20 Hz, from the lower to the upper envelope. Dashed: measured amplitude."
    return picture(
        envelopes_figure(case.record, tables.experiment_mm(table, case)),
        f"Envelopes, load {case_title(case)}.",
        caption,
    )


def _facts(calibration: Calibration, best: SpinResult, command: str) -> list[tuple[str, str]]:
    plan = calibration.plan
    counted = sum(end.evaluations for end in calibration.ended)
    facts = [
        ("Method", f"{plan.method}, {len(calibration.ended)} starts, seed {plan.seed}"),
        ("Machines tried", f"{counted}, each with {len(calibration.targets.loads)} runs"),
        ("Versions", versions_of(best.results[0].record.attrs)),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]
