"""What a calibration found, as labelled datasets."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, measured_amplitudes
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.parameters.units import Share
from wm_drake.report.labelled import rows_of
from wm_drake.report.quantity import CHANGE, SPEED, TIME, Quantity
from wm_drake.simulation.measures import measure
from wm_drake.simulation.records import Record
from wm_drake.studies.calibrate.prediction import FITS, Prediction
from wm_drake.studies.calibrate.solutions import COST, DIFFERENCE, VALUE, sizes_of
from wm_drake.studies.calibrate.study import Calibration
from wm_drake.studies.calibrate.targets import GASKET, MEASURED
from wm_drake.studies.fitting.page import estimates_of, of_unknowns

COVERED = Quantity("in the 95 % intervals", Share(), 0)
GAP = Quantity("gap", MEASURED.unit, 1)
PLACE = Quantity("place", MEASURED.unit, 0)
COUNT = Quantity("number", decimals=0)


def quantities_of(calibration: Calibration) -> xr.Dataset:
    """Return the free quantities at the best solution, each in its unit. [SI]

    Returns:
        Over `unknown`: `estimates_of` of `wm_drake.studies.fitting.page`, and what determines it,
        `held_by` (see `Solution.verdicts`); the prior, `expected` and `prior_deviation`.
    """
    best, m = calibration.solutions[0], calibration.parameter_map
    data = estimates_of(best.fit)
    held = xr.Variable("unknown", best.verdicts(), Quantity("determined by").attributes())
    units = {unknown.name: unknown.unit for unknown in m.unknowns}
    return data.drop_vars("remark").assign(
        expected=of_unknowns("expected", units, m.expected),
        prior_deviation=of_unknowns("± deviation", units, m.deviation),
        held_by=held,
    )


def solutions_of(calibration: Calibration) -> xr.Dataset:
    """Return `value`, standard `deviation` and what determines it of each solution (`held_by`).

    Over `unknown` and `solution`, each in its unit. [SI]
    """
    parts = [estimates_of(solution.fit) for solution in calibration.solutions]
    ranks = xr.Variable("solution", [str(n) for n in range(1, len(parts) + 1)])
    data = xr.concat(parts, ranks)
    held = [solution.verdicts() for solution in calibration.solutions]
    attributes = Quantity("determined by").attributes()
    return data[["value", "deviation"]].assign(held_by=(("solution", "unknown"), held, attributes))


def amplitudes_of(calibration: Calibration) -> xr.DataArray:
    """Return the amplitudes over load, gasket, source and sensor. [m]

    The sources are the experiment, others in the files of measured amplitudes, and each solution.
    """
    targets, solutions = calibration.targets, calibration.solutions
    sources = {EXPERIMENT: targets.amplitude, **_others(calibration)}
    sources |= {
        f"solution {n}": solution.amplitude for n, solution in enumerate(solutions, start=1)
    }
    return targets.labelled(sources, MEASURED)


def _others(calibration: Calibration) -> dict[str, np.ndarray]:
    """Return the amplitudes (case, sensor) of sources that are no experiment. [m]"""
    targets = calibration.targets
    table = measured_amplitudes(calibration.parameter_map.base)
    others = {}
    for source, rows in table[table["source"] != EXPERIMENT].groupby("source", sort=False):
        by_case = rows.drop_duplicates(["load", "gasket"]).set_index(["load", "gasket"])
        cases = [(load, GASKET[gasket]) for load, gasket in targets.loads]
        values = by_case.reindex(cases)[list(targets.sensors)].to_numpy(dtype=float)
        if np.isfinite(values).any():
            others[str(source)] = MEASURED.unit.to_si(values)
    return others


def differences_of(amplitudes: xr.DataArray) -> xr.Dataset:
    """Return `difference` from the experiment ([B] Eq. (1)) and its `mean_absolute` value.

    Args:
        amplitudes: As of `amplitudes_of`.
    """
    measured = amplitudes.sel(source=EXPERIMENT, drop=True)
    difference = (amplitudes / measured - 1.0).drop_sel(source=EXPERIMENT)
    mean = abs(difference).mean("sensor")
    return xr.Dataset(
        {
            "difference": DIFFERENCE.variable(_names(difference), difference),
            "mean_absolute": DIFFERENCE.named("mean absolute").variable(_names(mean), mean),
        },
        difference.coords,
    )


def _names(array: xr.DataArray) -> list[str]:
    return list(map(str, array.dims))


def responses_of(calibration: Calibration) -> xr.Dataset:
    """Return the targets that are no amplitudes, and those responses of each solution.

    A value is in the unit that the coordinate `unit` names. `difference` is that of the best
    solution, NaN for a response that was not used.
    """
    targets, solutions = calibration.targets.responses, calibration.solutions
    columns: dict[str, Any] = {
        "target": VALUE.named("target").variable("row", [t.value for t in targets]),
        "deviation": DIFFERENCE.named("deviation").variable("row", [t.deviation for t in targets]),
        "difference": DIFFERENCE.variable("row", solutions[0].response_errors),
        "found": VALUE.variable(
            ("row", "solution"), np.transpose([solution.responses for solution in solutions])
        ),
    }
    labels = {
        "load": [target.load for target in targets],
        "gasket": [GASKET[target.gasket] for target in targets],
        "of": [target.of for target in targets],
        "response": [target.response.name for target in targets],
        "unit": [target.unit_text for target in targets],
    }
    ranks = [f"solution_{number}" for number in range(1, len(solutions) + 1)]
    return rows_of(labels, **columns).assign_coords(solution=ranks)


def effects_of(calibration: Calibration) -> xr.DataArray:
    """Return the relative change of each amplitude by the gasket ([B] Eq. (1)).

    Over load, source (experiment, calibrated machine) and sensor. It has no load if none was
    measured both with and without gasket.
    """
    targets = calibration.targets
    by_source = {
        EXPERIMENT: targets.gasket_effects(targets.amplitude),
        "calibrated machine": targets.gasket_effects(calibration.solutions[0].amplitude),
    }
    loads = list(by_source[EXPERIMENT])
    shape = len(loads), len(by_source), len(targets.sensors)
    values = np.reshape([[of[load] for of in by_source.values()] for load in loads], shape)
    labels = {"load": loads, "source": list(by_source), "sensor": list(targets.sensors)}
    return xr.DataArray(CHANGE.named("change by the gasket").variable(list(labels), values), labels)


def relations_of(calibration: Calibration) -> xr.Dataset:
    """Return the relations of the vary file: `known` ratio, `deviation`, and the ratio `found`."""
    point, relations = calibration.solutions[0].point, calibration.parameter_map.relations
    ratio = Quantity("ratio", form="{:.3g}".format)
    numbers = {
        "known": [relation.ratio for relation in relations],
        "deviation": [relation.deviation for relation in relations],
        "found": [relation.at(point[None]).item() for relation in relations],
    }
    words = ["at most" if relation.is_limit else "expected" for relation in relations]
    names = [relation.name for relation in relations]
    return xr.Dataset(
        {name: ratio.named(name).variable("relation", values) for name, values in numbers.items()},
        {"relation": names, "kind": ("relation", words)},
    )


def predictions_of(predictions: Sequence[Prediction]) -> xr.Dataset:
    """Return the errors of each kind of values of each group of held-out loads.

    For each of `FITS` mean and largest absolute difference; the number of `values`, and the part of
    them `in_intervals`.
    """
    pairs = [(prediction, kind) for prediction in predictions for kind in prediction.kinds()]
    counts = [kind.predicted.size for _, kind in pairs]
    columns: dict[str, Any] = {"values": xr.Variable("row", counts, COUNT.attributes())}
    for fit in FITS:
        sizes = np.reshape([sizes_of(getattr(kind, fit)) for _, kind in pairs], (-1, 2))
        for name, values in zip(("mean", "largest"), sizes.T, strict=True):
            words = DIFFERENCE.named(f"{fit}: {name}")
            columns[f"{fit}_{name}"] = words.variable("row", values)
    covered = [np.mean(kind.is_covered) for _, kind in pairs]
    columns["in_intervals"] = COVERED.variable("row", covered)
    labels = {
        "held_out": [" ".join(prediction.loads) for prediction, _ in pairs],
        "what": [kind.name for _, kind in pairs],
    }
    return rows_of(labels, **columns)


def intervals_of(calibration: Calibration, prediction: Prediction) -> xr.DataArray:
    """Return measured and predicted amplitudes of held-out loads, with both ends of the interval.

    Over load, gasket, source and sensor. [m]
    """
    targets = calibration.targets
    names = ("measured", "predicted", "95 % from", "95 % to")
    every = targets.labelled(
        dict(zip(names, (targets.amplitude, *prediction.amplitude), strict=True)), MEASURED
    )
    held = [load for load in every["load"].values.tolist() if load in prediction.loads]
    return every.sel(load=held)


def searches_of(calibration: Calibration) -> xr.Dataset:
    """Return the end of each search: rank of the solution, cost, errors, machines tried."""
    ended = calibration.ended
    ranks = {solution.start: n for n, solution in enumerate(calibration.solutions, start=1)}
    sizes, others = (
        np.reshape([sizes_of(getattr(end, name)) for end in ended], (-1, 2)).T
        for name in ("errors", "response_errors")
    )
    numbers = {
        "solution": (Quantity("solution", decimals=0), [ranks.get(e.start, np.nan) for e in ended]),
        "cost": (COST, [end.cost for end in ended]),
        "data_cost": (COST.named("cost of the data"), [end.data_cost for end in ended]),
        "prior_cost": (COST.named("cost of the priors"), [end.prior_cost for end in ended]),
        "mean": (DIFFERENCE.named("mean error"), sizes[0]),
        "largest": (DIFFERENCE.named("largest error"), sizes[1]),
    }
    if calibration.targets.responses:
        numbers["mean_of_responses"] = (DIFFERENCE.named("mean error of responses"), others[0])
        numbers["largest_of_responses"] = (DIFFERENCE.named("largest of responses"), others[1])
    tried = [end.fit.log.evaluations for end in ended]
    numbers["evaluations"] = (COUNT.named("machines tried"), tried)
    return xr.Dataset(
        {name: q.variable("start", values) for name, (q, values) in numbers.items()},
        {"start": [end.start + 1 for end in ended]},
    )


def motion_of(
    parameters: MachineParameters, titles: Sequence[str], records: Sequence[Record]
) -> xr.Dataset:
    """Return critical speeds and the smallest gap of runs.

    Returns:
        Over `load` and `sensor`: `critical_speed` [rad/s]. Over `load`: `moving` and `fixed` part
        of the smallest gap, `gap` [m], `speed` [rad/s] and `time` [s] there, and `x`, `y`, `z`,
        the nearest point of the moving part [m]; whether the parts `overlap`. A machine without
        shapes has no gap.
    """
    scene = Scene(parameters)
    every = [measure(record, scene, ("amplitudes",)) for record in records]
    speeds = [one.critical_speed.values for one in every]
    data = xr.Dataset(
        {"critical_speed": SPEED.named("critical speed").variable(("load", "sensor"), speeds)},
        {"load": list(titles), "sensor": list(parameters.sensors)},
    )
    gaps = [one.smallest_gap for one in every if one.smallest_gap is not None]
    if len(gaps) < len(every):
        return data
    data["moving"] = "load", [gap.moving.replace("_", " ") for gap in gaps]
    data["fixed"] = "load", [gap.fixed.replace("_", " ") for gap in gaps]
    times = [gap.time for gap in gaps]
    numbers: dict[Quantity, Sequence[float]] = {
        GAP: [gap.distance for gap in gaps],
        SPEED: [
            float(np.interp(time, record.time, record.drum_speed))
            for time, record in zip(times, records, strict=True)
        ],
        TIME: times,
        **{PLACE.named(axis): [gap.point[k] for gap in gaps] for k, axis in enumerate("xyz")},
    }
    for quantity, values in numbers.items():
        data[quantity.words.replace(" ", "_")] = quantity.variable("load", values)
    return data.assign(overlap=("load", [gap.distance <= 0.0 for gap in gaps]))
