"""Which machine moves like the Adams model of [B]?

The script fits the free quantities of reference_free.yaml to half of the printed amplitudes of the
Adams model, measured ones where it has none, and to all of [B] Table 5: means, effects and
contributions. With --predict it repeats the fit three times, without all tables of the counter
load, without those of the middle load, and without the amplitudes of back and front, from machines
drawn from the priors, and says what each fit predicts of what it has not seen. That takes
about an hour of processor time.
It prints the errors of the best machine and of the predictions.
With --write, the best machine is written to its file in wm_drake/data/machines, and its masses and
places to its SDF model, with the uncertainty beside each number. `wm-drake calibrate` makes a
report page of such a fit. Tables of the predictions are written beside the result;
write_validation.py reads them as reference_held_out.csv and reference_held_out_study.csv.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import pandas as pd
from analysis_tools.gasket_study import LOADS, agreement, screening_of
from analysis_tools.ledgers import calibration_identity, kept_in
from analysis_tools.sdf_text import sdf_with
from analysis_tools.study_targets import study_targets

from wm_drake.batch.ledger import open_ledger
from wm_drake.model.bodies import sdf_path
from wm_drake.model.build import build_machine
from wm_drake.parameters import MachineParameters, load_machine, machine_file_with, machine_path
from wm_drake.parameters.measured import EXPERIMENT, measured_amplitudes
from wm_drake.parameters.published import published_results
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.progress import progress_bar, progress_bars
from wm_drake.studies.calibrate.prediction import FITS, Prediction, predict
from wm_drake.studies.calibrate.response_targets import with_deviations
from wm_drake.studies.calibrate.results import predictions_of
from wm_drake.studies.calibrate.solutions import Solution, sizes_text, solved_machine
from wm_drake.studies.calibrate.study import (
    Calibration,
    SearchPlan,
    calibrate,
)
from wm_drake.studies.calibrate.targets import Targets, targets_of
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket.screening import published_for

REFERENCE = "reference"
ADAMS_SOURCE = "Adams model of [B]"
HELD_OUT = (("counter",), ("middle",), ("back", "front"))
"""Loads that are held out together, one group per prediction."""

PLAN = SearchPlan(starts=1, iterations=1, deviation=0.04)
"""The start of the vary file is the end of a wide search; it is only evaluated."""

DEVIATIONS = {
    "effect": 0.03,
    "contribution": 0.1,
    "displacement": 0.05,
    "force": 0.05,
    "moment": 0.05,
}
"""Relative standard deviations of results of the Adams model, which have no noise: how far a model
of the same class may miss them. Effects: fractions of the mean; contributions: of the variance."""

PREDICTION = replace(PLAN, starts=3, iterations=30, start_draws=500)
"""Plan of a prediction: searches from and near the expected values. The starting values of the free
file are not used, because they come from a fit to all loads."""

QUICK_DRAWS = 8
"""Machines drawn for the intervals of a prediction with --quick."""


def main() -> None:
    """Run the calibration and the predictions, print the errors, and write the machine."""
    arguments = _arguments()
    machine = build_machine(load_machine(REFERENCE))
    free, plan, held_out = _searched(arguments)
    targets = _targets_for(arguments, machine.parameters)
    prediction_plan = replace(plan, draws=QUICK_DRAWS) if arguments.quick else PREDICTION
    ledger_path = arguments.out.with_suffix(".sqlite")
    with open_ledger(
        ledger_path, calibration_identity(machine, free, targets, plan), resume=True
    ) as ledger:
        experiment = Experiment(machine, (), kept_in(ledger))
        with progress_bars(["searches"]) as show:
            calibration = calibrate(
                experiment, free, targets, plan, lambda done, least: show(0, done)
            )
        if arguments.write:
            _write(calibration)
        predictions = []
        with progress_bar(len(held_out), "predictions") as done:
            for number, group in enumerate(held_out, start=1):
                predictions += predict(experiment, free, calibration, [group], prediction_plan)
                done(number)
        ledger.mark_finished()
    tables = {
        "held_out": LabelledTable("held_out", predictions_of(predictions)).frame(),
        "held_out_study": _study_table(predictions) if arguments.predict else pd.DataFrame(),
    }
    for name, table in tables.items():
        if len(table):
            path = arguments.out.with_name(f"{arguments.out.stem}_{name}.csv")
            table.to_csv(path, index=False, float_format="%.2f")
    text = "\n".join(_lines(calibration, predictions))
    print(text)
    arguments.out.write_text(text + "\n", encoding="utf-8")


def _searched(
    arguments: argparse.Namespace,
) -> tuple[VaryFile, SearchPlan, tuple[tuple[str, ...], ...]]:
    """Return free quantities, plan of the search, and groups of loads that are held out."""
    free = load_vary(Path(__file__).with_name(f"{REFERENCE}_free.yaml"))
    if arguments.quick:
        few = dict(list(free.vary.items())[:3])
        return VaryFile(vary=few), SearchPlan(starts=1, iterations=1), (("back", "front"),)
    return free, PLAN, HELD_OUT if arguments.predict else ()


def _targets_for(arguments: argparse.Namespace, parameters: MachineParameters) -> Targets:
    if arguments.quick:
        return targets_of(parameters, measured_amplitudes(parameters))
    return adams_targets(parameters)


def adams_targets(parameters: MachineParameters) -> Targets:
    """Return amplitudes of the Adams model, measured ones where it has none, and all of Table 5."""
    table = measured_amplitudes(parameters)
    table = table.sort_values("source", key=lambda source: source != ADAMS_SOURCE, kind="stable")
    table = table.drop_duplicates(["load", "gasket"]).assign(source=EXPERIMENT)
    responses = with_deviations(study_targets(parameters), DEVIATIONS)
    return replace(targets_of(parameters, table), responses=responses)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="use three quantities, the amplitudes alone and one step, to test the script",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("calibrate_reference.txt"),
        help="file for the result; the ledger of evaluations is written beside it",
    )
    parser.add_argument(
        "--predict",
        action="store_true",
        help="predict tables that a fit has not seen",
    )
    parser.add_argument(
        "--write", action="store_true", help="write the best machine to the shipped files"
    )
    arguments = parser.parse_args()
    if arguments.predict and arguments.quick:
        parser.error("--predict and --quick cannot be combined; leave out one of them")
    if arguments.quick and arguments.write:
        parser.error("--quick cannot be written to the shipped files; leave out --quick or --write")
    return arguments


def _lines(calibration: Calibration, predictions: list[Prediction]) -> list[str]:
    targets, best = calibration.targets, calibration.solutions[0]
    errors = best.errors
    lines = [
        f"searches: {len(calibration.ended)}, distinct good solutions: {len(calibration.solutions)}"
    ]
    for (load, gasket), row in zip(targets.loads, errors, strict=True):
        shown = "  ".join(
            f"{name} {100.0 * value:+5.1f}"
            for name, value in zip(targets.sensors, row, strict=True)
        )
        lines.append(
            f"{load:8s} {'with' if gasket else 'without':7s} gasket, difference in %: {shown}"
        )
    with_gasket = [gasket for _, gasket in targets.loads]
    lines += [f"all: {sizes_text(errors)}", f"with gasket: {sizes_text(errors[with_gasket])}"]
    if targets.responses:
        lines += _lines_of_study(best)
    lines += [
        f"{relation.name}: ratio {float(relation.at(best.point[None])[0]):.2f}"
        for relation in calibration.parameter_map.relations
    ]
    for prediction in predictions:
        for kind in prediction.kinds():
            texts = [sizes_text(getattr(kind, fit)) for fit in FITS]
            lines.append(
                f"{', '.join(prediction.loads)}, {kind.name}: calibrated {texts[0]}; held out "
                f"{texts[1]} (other loads: {texts[2]}); 95 % intervals contain "
                f"{100.0 * kind.is_covered.mean():.0f} %"
            )
    return lines


def _study_table(predictions: list[Prediction]) -> pd.DataFrame:
    """Return how well the gasket studies of held-out loads agree with [B], fitted and predicted."""
    rows = []
    for prediction in predictions:
        loads = [load for load in prediction.loads if load in LOADS]
        fits = {"calibrated": prediction.with_all, "predicted": prediction.without}
        for fit, solution in fits.items() if loads else ():
            machine = solved_machine(solution)
            screening = screening_of(machine, loads=loads)
            published = published_for(published_results(machine.published), screening)
            row = {"held_out": " ".join(loads), "fit": fit}
            rows.append(row | agreement(screening, published).row())
    return pd.DataFrame(rows)


def _lines_of_study(best: Solution) -> list[str]:
    errors = best.response_errors
    return [
        *(
            f"{target.load:8s} {target.response.name} ({target.of}), difference in %: {value:+5.1f}"
            for target, value in zip(best.targets.responses, 100.0 * errors, strict=True)
        ),
        f"results of the gasket study: {sizes_text(errors)}",
    ]


def _write(calibration: Calibration) -> None:
    solved = solved_machine(calibration.solutions[0])
    path, model = machine_path(solved.name), sdf_path(solved.model)
    keys = dict.fromkeys(key for key, _, _ in calibration.parameter_map.varying.origins())
    kept = [key for key in keys if not key.startswith(("bodies.", "frames."))]
    texts = {
        model: sdf_with(model.read_text(encoding="utf-8"), solved),
        path: machine_file_with(path, solved, kept),
    }
    for file, text in texts.items():
        file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
