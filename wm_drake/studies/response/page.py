"""Show the steady response: figures, sentences and tables of its datasets."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import BoolArray
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, quantity_of, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.response.figures import (
    deflection_figure,
    forces_figure,
    load_of,
    mounts_figure,
    response_figure,
    sweep_figure,
    words_of_gasket,
)
from wm_drake.studies.response.quantities import AMPLITUDE, GAP, LARGEST_AT, TURN
from wm_drake.studies.response.study import GASKET, largest_of, peaks_of

LEAST_TURN = np.deg2rad(0.05)
"""Least spin of a telescopic damper in a drum revolution that a page tells. [rad]"""

LABELS = ("load", "gasket")
"""Labels of a case."""

METHOD = (
    "The steady motion has the period of a drum revolution. Its stability follows from its Floquet "
    "multipliers. A machine moves in a motion that is stable and in which the tub does not touch "
    "the housing. It leaves an unstable motion for another one, and the model has no forces of "
    "contact. Telescopic dampers "
    "that spin about their axes make the motion vary slowly; then the values hold for dampers near "
    "the angle at which they are built."
)


def response_answer(
    parameters: MachineParameters, cases: Sequence[xr.Dataset], sweeps: xr.Dataset | None
) -> Answer:
    """Return the answer of the study.

    Args:
        cases, sweeps: As of `run_response_study`.
    """
    attributes = cases[0].attrs
    return Answer(
        f"Steady response of machine {parameters.name}",
        summary(cases),
        parameters,
        (
            *_parts_of_loads(parameters, cases),
            _forces_part(cases),
            *([] if sweeps is None else [_sweep_part(cases, sweeps)]),
            Part("Peaks", (largest_table(parameters, cases), peaks_table(cases))),
        ),
        (("Harmonics", f"{attributes['harmonics']}, {attributes['samples']} samples"),),
        METHOD,
        warned=tuple(_warnings(cases)),
    )


def _parts_of_loads(parameters: MachineParameters, cases: Sequence[xr.Dataset]) -> Iterator[Part]:
    """Yield a part for each load: responses, and deflection shapes at the peaks."""
    outlines = Scene(parameters).tub_outlines()
    for load in dict.fromkeys(load_of(case) for case in cases):
        of_load = [case for case in cases if load_of(case) == load]
        plots = [
            Plot(
                response_figure(of_load),
                f"Amplitudes of load {load} over the speed.",
                f"Load {load}: largest deviation from the mean at each sensor over the drum speed. "
                "Pale: the tub touches the housing. Dotted: unstable; larger motions are cut off. "
                "Dashed: envelope of the run over the spin profile of the machine, while its speed "
                "rises.",
            )
        ]
        shapes = deflection_figure(of_load[0], outlines)
        if shapes is not None:
            caption = (
                f"Operating deflection shapes of load {load} at the peaks of its largest "
                f"amplitude, {words_of_gasket(of_load[0])}: the ends of the tub at eight angles of "
                "the drum, enlarged. Grey: at rest."
            )
            plots.append(Plot(shapes, "Outlines of the tub at the peaks.", caption))
        yield Part(f"Load {load}", plots)


def _forces_part(cases: Sequence[xr.Dataset]) -> Part:
    """Return forces of gasket and mounts, and for files all numbers of the branches."""
    first = [case for case in cases if case.gasket == cases[0].gasket]
    gasket = words_of_gasket(first[0])
    forces = Plot(
        forces_figure(first),
        "Displacement of the box and gasket forces over the drum speed.",
        f"Largest value of the axes, {gasket}. A line has gaps where no steady motion is stable "
        "and without contact.",
    )
    mounts = Plot(
        mounts_figure(first),
        "Force of each mount on the cabinet over the drum speed.",
        f"Size of the force of each mount on the cabinet in a revolution, {gasket}: peak (line), "
        "and RMS without the mean (dashed). The peak has the weight that it carries.",
    )
    return Part("Detergent box, gasket and mounts", (forces, mounts, branches_table(cases)))


def branches_table(cases: Sequence[xr.Dataset]) -> LabelledTable:
    """Return all responses, a row for each point of a branch, for files."""
    return LabelledTable("response", xr.concat(list(map(_numbers, cases)), "point"))


def _numbers(case: xr.Dataset) -> xr.Dataset:
    """Return the numbers of a case over its points, a variable for each sensor, axis or element."""
    branch, numbers = case.drop_vars("first_harmonic").drop_dims("time", errors="ignore"), {}
    for name, array in branch.items():
        quantity, others = quantity_of(array), [dim for dim in array.dims if dim != "point"]
        for label in array[others[0]].values.tolist() if others else ():
            values = array.sel({others[0]: label}).values
            named = quantity.named(f"{quantity.words}, {label}")
            numbers[f"{name}_{label}"] = named.variable("point", values)
        if not others:
            numbers[str(name)] = array.variable
    count = case.sizes["point"]
    labels = {name: ("point", [case[name].item()] * count) for name in LABELS}
    return xr.Dataset(numbers, {**labels, "speed": case.speed.variable})


def summary(cases: Sequence[xr.Dataset]) -> str:
    """Return one paragraph: what can be reached, where the tub touches, what is unstable."""
    speeds = np.concatenate([case.speed.values for case in cases])
    folded = sum(bool(np.any(np.diff(case.speed.values) < 0.0)) for case in cases)
    count = len(cases)
    touching = [case for case in cases if _contact(case).any()]
    sentences = [
        *(_reachable_sentence(of_kind) for of_kind in _by_gasket(cases)),
        *map(_contact_sentence, touching),
        _unstable_sentence(cases),
        f"{count} steady response{'s' if count > 1 else ''} from {SPEED.number(speeds.min())} to "
        f"{SPEED.text(speeds.max())}, by harmonic balance of the forces of all elements.",
        f"{folded} fold back, with jumps." if folded else "No branch folds back.",
    ]
    return " ".join(sentences)


def _by_gasket(cases: Sequence[xr.Dataset]) -> list[list[xr.Dataset]]:
    """Return the cases with the gasket, then those without it, as far as there are any."""
    of_kind = ([c for c in cases if c.gasket == GASKET[kind]] for kind in (True, False))
    return [chosen for chosen in of_kind if chosen]


def _reachable_sentence(cases: Sequence[xr.Dataset]) -> str:
    """Return the largest amplitude of cases that a machine reaches."""
    known = [largest_of(case) for case in cases if case.reachable.any()]
    where = words_of_gasket(cases[0]).capitalize()
    if not known:
        return f"{where} no steady motion is stable and without contact."
    largest = max(known, key=lambda peaks: float(peaks.amplitude.max()))
    peak = largest.isel(sensor=int(largest.amplitude.argmax("sensor")))
    return (
        f"{where} the largest steady amplitude that is stable and without contact is "
        f"{text_of(peak.amplitude)} at sensor {peak.sensor.item()} with load {load_of(peak)}, "
        f"at {text_of(peak.speed)}."
    )


def _contact(case: xr.Dataset) -> BoolArray:
    """Return in which stable motions of a case the tub touches the housing. (points,)"""
    return np.asarray(case.stable.values & ~case.reachable.values)


def _contact_sentence(case: xr.Dataset) -> str:
    """Return at which speeds the tub touches the housing in stable motions of a case."""
    inside = _contact(case)
    return (
        f"With load {load_of(case)}, {words_of_gasket(case)}, the tub touches the housing at "
        f"{_speeds(case, inside)}, with an overlap of up to "
        f"{GAP.text(-case.smallest_gap.values[inside].min())}."
    )


def _unstable_sentence(cases: Sequence[xr.Dataset]) -> str:
    """Return which branches are unstable, where, and how large their motions are."""
    unstable = [case for case in cases if not case.stable.all()]
    if not unstable:
        return "All motions are stable."
    texts = []
    for case in unstable:
        inside = ~case.stable.values
        size = AMPLITUDE.text(case.amplitude.values[inside].max())
        about = f"load {load_of(case)}, {words_of_gasket(case)}"
        texts.append(f"{about}, at {_speeds(case, inside)}, up to {size}")
    return f"Unstable motions, which a machine leaves for another motion: {'; '.join(texts)}."


def _speeds(case: xr.Dataset, which: BoolArray) -> str:
    """Return the speeds of some points of a branch in words, such as "60 to 70 and 82 rpm"."""
    texts = list(map(SPEED.number, case.speed.values))
    changes = np.flatnonzero(np.diff(np.pad(which, 1).astype(int)))
    ranges = []
    for begin, end in zip(changes[::2], changes[1::2] - 1, strict=True):
        ends = dict.fromkeys([texts[begin], texts[end]])
        ranges.append(" to ".join(ends))
    return f"{listed(ranges)} {SPEED.unit_text}"


def largest_table(parameters: MachineParameters, cases: Sequence[xr.Dataset]) -> LabelledTable:
    """Return the largest reachable amplitude of each sensor, and the speed of the largest."""
    rows = []
    for case in cases:
        peaks = largest_of(case).drop_vars(LABELS)
        at = int(np.nan_to_num(peaks.amplitude.values).argmax())
        rows.append(peaks.assign(speed=LARGEST_AT.variable((), peaks.speed.values[at])))
    return LabelledTable(
        "largest",
        _joined(cases, rows),
        f"Largest steady amplitudes of machine '{parameters.name}'",
        "Largest steady amplitude of each sensor, stable and without contact, and the speed of the "
        "largest of all.",
        across="sensor",
        is_in_terminal=True,
    )


def peaks_table(cases: Sequence[xr.Dataset]) -> LabelledTable:
    """Return the steady peak of each sensor, and that of the run over the spin profile."""
    return LabelledTable(
        "peaks",
        _joined(cases, list(map(peaks_of, cases))),
        "Steady and in a run",
        "Largest amplitude at each sensor and its speed: steady motion, stable and without "
        "contact, and the run over the spin profile of the machine at the speeds of the response, "
        "whose displacements are band-passed as by the command spin.",
    )


def _joined(cases: Sequence[xr.Dataset], rows: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return datasets of cases over `case`, which is named by load and gasket."""
    names = [f"{load_of(case)}, {words_of_gasket(case)}" for case in cases]
    return xr.concat(rows, xr.Variable("case", names))


def _warnings(cases: Sequence[xr.Dataset]) -> Iterator[str]:
    """Yield what limits the responses: dampers that spin, branches that end early."""
    for case in cases:
        text = _spin_warning(case)
        if text:
            yield text
    for case in cases:
        if not case.on_grid.values[-1]:
            yield (
                f"Load {load_of(case)}, {words_of_gasket(case)}: the branch could be followed "
                f"only up to {text_of(case.speed[-1])}. More harmonics or samples may help."
            )


def _spin_warning(case: xr.Dataset) -> str:
    """Return a text about telescopic dampers that spin; "" if none does."""
    turns = 2.0 * np.pi * abs(case.damper_spin / case.speed)  # (point, spinning) [rad]
    if not turns.size or turns.max() < LEAST_TURN:
        return ""
    most = turns.isel(turns.argmax(["point", "spinning"]))
    return (
        f"Load {load_of(case)}, {words_of_gasket(case)}: damper {most.spinning.item()} spins "
        f"about its axis by {TURN.text(most)} in a drum revolution at {text_of(most.speed)}. The "
        "motion is then not periodic: the amplitudes hold for dampers near the angle at which they "
        "are built, and vary by some percent as they turn."
    )


def _sweep_part(cases: Sequence[xr.Dataset], sweeps: xr.Dataset) -> Part:
    """Return how the sweep rate shifts the peaks."""
    plot = Plot(
        sweep_figure(cases, sweeps),
        "Shift and height of peaks over the sweep rate.",
        "Sweeps at a constant rate, up and down, computed by the compiled engine. A faster sweep "
        "passes a resonance later. A single resonance is also passed lower; where the machine "
        "still moves in one mode when the next one is met, the sum of both may be above the steady "
        "peak. For each load the sensor with its largest steady amplitude is shown. Where two "
        "peaks are about as high, a sweep may prefer the other one.",
    )
    return Part("Sweep rate", (plot, LabelledTable("sweeps", sweeps)))
