"""Show a calibration: agreement, certainty of the quantities, predictions of held-out loads."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, machine_yaml
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import number
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity, quantity_of, text_of
from wm_drake.simulation.displacements import band_of
from wm_drake.simulation.records import Record
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.calibrate.figures import errors_figure, modes_figure, quantities_figure
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.results import (
    COVERED,
    amplitudes_of,
    differences_of,
    effects_of,
    intervals_of,
    motion_of,
    predictions_of,
    quantities_of,
    relations_of,
    responses_of,
    searches_of,
    solutions_of,
)
from wm_drake.studies.calibrate.solutions import BEYOND, LIMIT, sizes_text, solved_machine
from wm_drake.studies.calibrate.study import BEYOND_LIMIT, Calibration
from wm_drake.studies.calibrate.targets import AMPLITUDE, GASKET, case_title
from wm_drake.studies.fitting.page import correlations_part
from wm_drake.studies.modes.shapes import ANGLE_ARM
from wm_drake.studies.spin.figures import envelopes_figure

ARM = Quantity("arm of an angle", Unit("m", "m"), 2)


def calibrate_answer(
    calibration: Calibration,
    predictions: Sequence[Prediction],
    machine: MachineParameters,
    records: Sequence[Record],
    modes: Mapping[str, xr.Dataset],
) -> Answer:
    """Return the answer of a calibration.

    Args:
        machine: Machine of the best solution.
        records: Its runs, of the measured cases.
        modes: Its natural modes in each state that is shown, by title.
    """
    titles = [case_title(*case) for case in calibration.targets.loads]
    motion = motion_of(machine, titles, records)
    amplitudes = amplitudes_of(calibration)
    differences = differences_of(amplitudes)
    envelopes = [
        _envelopes(record, title, amplitudes.sel(load=load, gasket=GASKET[gasket]))
        for record, title, (load, gasket) in zip(
            records, titles, calibration.targets.loads, strict=True
        )
    ]
    held_out = predictions_of(predictions)
    return Answer(
        f"Calibration of machine {machine.name}",
        summary(calibration, held_out),
        machine,
        (
            Part("Errors of the amplitudes", (_errors(differences.difference),)),
            Part(
                "Certainty of the quantities",
                (_certainty(calibration),),
                text="A quantity is determined by the data if they reduce its standard deviation "
                "to less than half of that of the prior. It is determined by the prior only if "
                "more than nine tenths of the prior standard deviation remain. A quantity is at a "
                "bound if the search was stopped by the bound.",
                facts=certainty(calibration),
            ),
            Part("Modes", (_modes(modes),)),
            Part("Envelopes", envelopes),
            Part("Amplitudes", _amplitude_tables(amplitudes, differences)),
            Part("Other responses", _responses(calibration)),
            Part("Effect of the gasket", _effects(calibration)),
            _prediction(calibration, predictions, held_out),
            Part("Quantities", _quantity_tables(calibration)),
            correlations_part(calibration.solutions[0].fit),
            Part("Critical speeds and smallest gaps", _motion_tables(motion)),
            Part("Searches", (_searches(calibration),)),
        ),
        _details(calibration),
        _method(calibration),
        {
            f"machine_{number}.yaml": machine_yaml(solved_machine(solution, number))
            for number, solution in enumerate(calibration.solutions, start=1)
        },
        tuple(warnings_of(motion)),
    )


def _details(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    counted = sum(end.fit.log.evaluations for end in calibration.ended)
    searches = f"{len(calibration.ended)} starts, seed {calibration.plan.seed}"
    return (
        ("Method", f"least squares, {searches}"),
        ("Machines tried", f"{counted}, each with {len(calibration.targets.loads)} runs"),
    )


def _method(calibration: Calibration) -> str:
    """Return sentences on the cost that the searches minimize."""
    limits = ", ".join(
        f"{name} {LIMIT.text(limit)}" for name, limit in calibration.targets.limits.items()
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
        "It includes the preloads of the springs and the relations if the vary file gives them. "
        "The standard deviations after the fit are those of a normal distribution about the "
        "solution, for which the logarithms of the amplitudes are linear in the quantities. They "
        "do not describe other minima of the cost; the distinct solutions show those."
    )


def summary(calibration: Calibration, held_out: xr.Dataset) -> str:
    """Return one paragraph about the agreement and the certainty of the best solution.

    Args:
        held_out: As of `predictions_of`.
    """
    targets, best = calibration.targets, calibration.solutions[0]
    errors = best.errors
    case, sensor = np.unravel_index(int(np.nanargmax(np.abs(errors))), errors.shape)
    count = len(calibration.solutions)
    searches, quantities = len(calibration.ended), len(calibration.parameter_map.names)
    determined = int(np.sum(best.fit.linear.directions() > 1.0))
    text = (
        f"The best machine is compared with {np.isfinite(errors).sum()} measured amplitudes. "
        f"Absolute differences: {sizes_text(errors)}. The largest is "
        f"{BEYOND.text(errors[case, sensor])}, at sensor {targets.sensors[sensor]} with load "
        f"{case_title(*targets.loads[case])}. "
        f"{searches} {'search' if searches == 1 else 'searches'} found {count} distinct good "
        f"{'solution' if count == 1 else 'solutions'}. The data determine {determined} of "
        f"{quantities} independent combinations of the free quantities better than the priors do."
    )
    if targets.responses:
        text += (
            f" Absolute differences of {len(targets.responses)} other responses: "
            f"{sizes_text(best.response_errors)}."
        )
    if beyond := best.values_beyond():
        text += f" Beyond their limits: {', '.join(beyond)}."
    return text + _about_predictions(held_out)


def _about_predictions(held_out: xr.Dataset) -> str:
    if not held_out.sizes["row"]:
        return ""
    of_amplitudes = held_out.isel(row=held_out.what.values == AMPLITUDE)
    worst = of_amplitudes.isel(row=int(np.argmax(of_amplitudes.predicted_mean.values)))
    covered = held_out.in_intervals.weighted(held_out["values"]).mean(keep_attrs=True)
    return (
        " Amplitudes of held-out loads are predicted with a mean absolute difference of at most "
        f"{text_of(worst.predicted_mean)} (worst case: {worst.held_out.item()}). The 95 % "
        f"intervals contain {text_of(covered)} of the held-out values."
    )


def warnings_of(motion: xr.Dataset) -> list[str]:
    """Return a warning for each load with which tub and housing overlap."""
    if "overlap" not in motion:
        return []
    overlapping = (motion.isel(load=k) for k in np.flatnonzero(motion.overlap))
    return [
        f"Load {one['load'].item()}: {one.moving.item()} and {one.fixed.item()} overlap by "
        f"{quantity_of(motion.gap).text(-one.gap)}. The model has no contact forces. If the "
        "measured machine did not collide there, it moves less or its housing is wider than in the "
        "model."
        for one in overlapping
    ]


def certainty(calibration: Calibration) -> list[tuple[str, str]]:
    """Return which quantities the data determine, and which only the priors: heading and text."""
    best, names = calibration.solutions[0], calibration.parameter_map.names
    verdicts = best.verdicts()
    sizes = best.fit.linear.directions()
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


def _amplitude_tables(amplitudes: xr.DataArray, differences: xr.Dataset) -> list[LabelledTable]:
    return [
        LabelledTable(
            "amplitudes",
            xr.Dataset({"amplitude": amplitudes}),
            "Amplitudes",
            "Amplitude of the displacement at each sensor: the largest absolute value of its "
            "envelopes.",
            across="sensor",
        ),
        LabelledTable(
            "differences",
            differences,
            "Differences from the experiment",
            "(amplitude − experiment) / experiment, [B] Eq. (1).",
            across="sensor",
        ),
    ]


def _responses(calibration: Calibration) -> list[LabelledTable]:
    if not calibration.targets.responses:
        return []
    return [
        LabelledTable(
            "responses",
            responses_of(calibration),
            "Other responses",
            "Responses that are no amplitudes of sensors, each in its unit. A response without a "
            "difference was not used.",
            across="solution",
            words={"solution_1": "calibrated machine"},
        )
    ]


def _effects(calibration: Calibration) -> list[LabelledTable]:
    effects = effects_of(calibration)
    if not effects.sizes["load"]:
        return []
    caption = (
        "Change of each amplitude by the gasket, of the amplitude without gasket ([B] Eq. (1))."
    )
    data = xr.Dataset({"effect": effects})
    return [LabelledTable("effects", data, "Effect of the gasket", caption, across="sensor")]


def _prediction(
    calibration: Calibration, predictions: Sequence[Prediction], held_out: xr.Dataset
) -> Part:
    if not predictions:
        return Part("Prediction")
    of_groups = [
        LabelledTable(
            f"intervals_{'_'.join(prediction.loads)}",
            xr.Dataset({"amplitude": intervals_of(calibration, prediction)}),
            f"Held out: {', '.join(prediction.loads)}",
            "Predicted amplitudes with their 95 % intervals. They allow for the uncertainty of the "
            f"free quantities and for a scatter of {COVERED.text(prediction.scatter)} of "
            "an amplitude.",
            across="sensor",
        )
        for prediction in predictions
    ]
    errors = LabelledTable(
        "predictions",
        held_out,
        "Held-out loads",
        "Absolute differences from the targets. Calibrated: these loads in the calibration above, "
        "which used them. Predicted: these loads when they were held out. Seen: the remaining "
        "loads in the calibration without them.",
        is_in_terminal=True,
    )
    return Part(
        "Prediction",
        (errors, *of_groups),
        "A calibrated machine is reliable only if it also predicts loads that were not used for "
        "the calibration. For each row, the named loads are held out: the machine is calibrated "
        "with the other loads only, starting from the expected value of each quantity, and then "
        "the held-out loads are computed. An interval comes from machines that are drawn from the "
        "posterior around each distinct good solution of the calibration without these loads. A "
        "wide interval means that the other loads do not determine the amplitude.",
    )


def _quantity_tables(calibration: Calibration) -> list[LabelledTable]:
    quantities = LabelledTable(
        "estimates",
        quantities_of(calibration),
        "Quantities",
        "Free quantities of the best solution (machine_1.yaml), each in its unit, with their 95 % "
        "intervals and their standard deviations before and after the fit. There is no interval "
        "if the value is at a bound.",
        is_in_terminal=True,
    )
    solutions = LabelledTable(
        "solutions",
        solutions_of(calibration),
        "Solutions" if len(calibration.solutions) > 1 else "",
        "Free quantities of each distinct good solution (machine_1.yaml and others).",
        across="solution",
    )
    if not calibration.parameter_map.relations:
        return [quantities, solutions]
    relations = LabelledTable(
        "relations",
        relations_of(calibration),
        "Relations",
        "Ratios of free quantities to what physics gives for them (vary file), and those of the "
        "calibrated machine.",
    )
    return [quantities, solutions, relations]


def _motion_tables(motion: xr.Dataset) -> list[LabelledTable]:
    speeds = LabelledTable(
        "critical_speeds",
        motion[["critical_speed"]],
        "Critical speeds",
        "The drum speed at which the displacement of each sensor is largest.",
        across="sensor",
    )
    gaps = motion.drop_dims("sensor")
    if not gaps:
        return [speeds]
    of_gaps = LabelledTable(
        "gaps",
        gaps,
        "Smallest gaps",
        "Smallest gap between the housing and the parts that move with the tub, over all samples. "
        "A negative gap means that the parts overlap. x (to the right), y (to the rear), z (up): "
        "position of the nearest point of the moving part, from drum mid-depth at rest.",
        marked=("overlap", "alarm"),
    )
    return [speeds, of_gaps]


def _searches(calibration: Calibration) -> LabelledTable:
    return LabelledTable(
        "searches",
        searches_of(calibration),
        "Searches",
        "End point of each search. A solution is good if its mean error is close to that of the "
        "best solution. It is distinct if it differs from every better solution by at least half a "
        "prior standard deviation (root mean square over the quantities).",
        is_in_terminal=True,
    )


def _errors(differences: xr.DataArray) -> Plot:
    others = [name for name in differences.source.values if not name.startswith("solution ")]
    caption = "Percent differences from the experiment. Blue dots: calibrated machine."
    if others:
        caption += f" Grey diamonds: {', '.join(others)}."
    return Plot(errors_figure(differences), "The numbers are in the table below.", caption)


def _certainty(calibration: Calibration) -> Plot:
    return Plot(
        quantities_figure(calibration),
        "The numbers are in the table below.",
        "Free quantities between their bounds. Orange tick and grey bar: expected value and one "
        "standard deviation of the prior. Blue dot and line: best solution and one standard "
        "deviation after the fit. Grey ticks: other solutions.",
    )


def _modes(modes: Mapping[str, xr.Dataset]) -> Plot:
    alternative = "; ".join(
        f"{title}: {', '.join(map(text_of, state.frequency))}" for title, state in modes.items()
    )
    return Plot(
        modes_figure(modes),
        f"Natural frequencies {alternative}.",
        "Rigid-body modes of the empty tub without dampers and with the drum at rest: natural "
        "frequency, drum speed of the same frequency, and mode shape. Angles are multiplied by "
        f"{ARM.text(ANGLE_ARM)}. The largest component of each shape is 1.",
    )


def _envelopes(record: Record, title: str, amplitudes: xr.DataArray) -> Plot:
    """Return the envelopes of a run of the best machine, with the measured amplitudes.

    Args:
        amplitudes: Amplitudes of the case over source and sensor. [m]
    """
    low, high = band_of(record)
    return Plot(
        envelopes_figure(record, amplitudes.sel(source=EXPERIMENT)),
        f"Envelopes, load {title}.",
        f"Load {title}: displacement in the band {low:g}–{high:.3g} Hz. The shaded area extends "
        "from the lower to the upper envelope. Dashed lines: measured amplitude.",
    )
