"""Which machine moves as the one that was measured in [B]? Finds it, tests what it predicts, and writes it down.

Searches the free quantities of reference_free.yaml for the 36 amplitudes of [B] Tables 1 and 3. With --write the best machine
goes into wm_drake/machines/reference.yaml and its SDF model, each number with its uncertainty beside it. The report page and
all tables: `wm-drake calibrate` with the command that is printed.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from wm_drake.batch.ledger import open_ledger
from wm_drake.cli.progress import progress_bar
from wm_drake.model.bodies import sdf_path
from wm_drake.model.machine import build_machine
from wm_drake.model.sdf_text import sdf_with
from wm_drake.parameters import load_machine, machine_file_with, machine_path, measured_amplitudes
from wm_drake.parameters.free import FreeFile, load_free
from wm_drake.studies.calibration.calibration import Calibration, Plan, calibrate, identity_of
from wm_drake.studies.calibration.outcome import mean_and_largest, solved_machine
from wm_drake.studies.calibration.prediction import Prediction, predict
from wm_drake.studies.calibration.targets import targets_of

FREE = Path(__file__).with_name("reference_free.yaml")
LEFT_OUT = (("back", "front"), ("middle",), ("counter",), ("back",), ("front",))
WEIGHTS = {"middle:Yf": 1.3}
"""Of amplitudes that stay off most without; without gasket it is 1.1 mm, at a kink."""
PLAN = Plan(method="basin-hopping", starts=3, iterations=2, deviation=0.025)
PREDICTION = replace(PLAN, starts=1, iterations=8)
"""Without the starting values of the free file, which had seen all loads: eight hops from what is expected."""


def main() -> None:
    """Calibrates, says how good it is, and writes the machine if asked to."""
    arguments = _arguments()
    machine = build_machine(load_machine("reference"))
    free, plan, blind, left_out = load_free(FREE), PLAN, PREDICTION, LEFT_OUT
    if arguments.quick:
        few = dict(list(free.quantities.items())[:3])
        free, left_out = FreeFile(quantities=few), LEFT_OUT[:1]
        plan = blind = Plan(starts=1, iterations=1)
    targets = targets_of(machine.parameters, measured_amplitudes(machine.parameters)).weighted(
        WEIGHTS
    )
    ledger_path = arguments.out.with_suffix(".sqlite")
    with open_ledger(ledger_path, identity_of(machine, free, targets, plan), resume=True) as ledger:
        with progress_bar(plan.starts, "searches") as done:
            calibration = calibrate(
                machine, free, targets, plan, ledger, report=lambda start, *_: done(start)
            )
        if arguments.write:
            _write(calibration)
        predictions = []
        with progress_bar(len(left_out), "predictions") as done:
            for number, group in enumerate(left_out, start=1):
                predictions += predict(machine, free, calibration, [group], ledger, plan=blind)
                done(number)
        ledger.mark_finished()
    text = "\n".join(_lines(calibration, predictions))
    print(text)
    arguments.out.write_text(text + "\n", encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="three quantities, one step: only to see that it runs"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("calibrate_reference.txt"),
        help="text; evaluations go beside it",
    )
    parser.add_argument(
        "--write", action="store_true", help="put the best machine into the shipped files"
    )
    return parser.parse_args()


def _lines(calibration: Calibration, predictions: list[Prediction]) -> list[str]:
    targets, best = calibration.targets, calibration.solutions[0]
    errors = 100.0 * best.errors(targets)
    lines = [
        f"{len(calibration.ended)} searches, {len(calibration.solutions)} distinct good solutions"
    ]
    for (load, gasket), row in zip(targets.loads, errors, strict=True):
        shown = "  ".join(
            f"{name} {value:+5.1f}" for name, value in zip(targets.sensors, row, strict=True)
        )
        lines.append(
            f"{load:8s} {'with' if gasket else 'without':7s} gasket, difference in %: {shown}"
        )
    with_gasket = [gasket for _, gasket in targets.loads]
    for name, part in (("all", errors), ("with gasket", errors[with_gasket])):
        mean, largest = mean_and_largest(part)
        lines.append(f"{name}: {mean:.1f} % in the mean, {largest:.1f} % at most")
    for prediction in predictions:
        parts = (prediction.calibrated, prediction.predicted, prediction.seen)
        texts = [
            "{:.1f} % in the mean, {:.1f} % at most".format(*mean_and_largest(100.0 * part))
            for part in parts
        ]
        lines.append(
            f"{', '.join(prediction.loads)}: calibrated {texts[0]}; predicted {texts[1]} (the others: {texts[2]})"
        )
    return lines


def _write(calibration: Calibration) -> None:
    solved = solved_machine(calibration.parameter_map, calibration.solutions[0])
    path, model = machine_path("reference"), sdf_path(solved.model)
    keys = [".".join(value.path) for value in calibration.parameter_map.values]
    own = [key for key in dict.fromkeys(keys) if not key.startswith(("bodies.", "frames."))]
    texts = {
        path: machine_file_with(path, solved, own),
        model: sdf_with(model.read_text(encoding="utf-8"), solved),
    }
    for file, text in texts.items():
        file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
