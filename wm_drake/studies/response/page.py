"""What the study of the steady response shows: files, JSON, terminal and page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wm_drake.model.scene import Scene
from wm_drake.parameters.types import BoolArray, FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, listed, number, percent, plain
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Group, Row, Table, table_of
from wm_drake.report.terminal import Printed
from wm_drake.simulation.mounts import KINDS
from wm_drake.studies.response.figures import (
    deflection_figure,
    forces_figure,
    mounts_figure,
    response_figure,
    sweep_figure,
)
from wm_drake.studies.response.study import ResponseCase, ResponseStudy
from wm_drake.studies.study import Facts, Result

DEG_PER_RAD = Unit("rad/s", "deg/s").from_si(1.0)

LEAST_SPIN = 0.05
"""Least spin of a telescopic damper that a page tells. [deg per revolution]"""

METHOD = (
    "The steady motion has the period of a drum revolution. Its stability follows from its Floquet "
    "multipliers. A machine moves in a motion that is stable and in which the tub does not touch "
    "the housing. It leaves an unstable motion for another one, and the model has no forces of "
    "contact. Telescopic dampers "
    "that spin about their axes make the motion vary slowly; then the values hold for dampers near "
    "the angle at which they are built."
)


class ResponseVariable(NamedTuple):
    """Variable of a response in files.

    Attributes:
        name: Name of the variable, and of its columns in a CSV file.
        dim: Its dimension beside the points of the branch; "" for none.
        in_json: Name in JSON, with the unit.
        unit: Unit in names of columns.
        factor: Its factor from SI units.
    """

    name: str
    dim: str
    in_json: str
    unit: str = "N"
    factor: float = 1.0


QUANTITIES = (
    ResponseVariable("amplitude", "sensor", "amplitudes_mm", "mm", MM_PER_M),
    ResponseVariable("detergent_displacement", "axis", "detergent_box_mm", "mm", MM_PER_M),
    ResponseVariable("gasket_force", "axis", "gasket_force_N"),
    ResponseVariable("gasket_moment", "axis", "gasket_moment_Nm", "Nm"),
    ResponseVariable("spring_tension", "spring", "spring_tension_N"),
    ResponseVariable("damper_tension", "damper", "damper_tension_N"),
    ResponseVariable("smallest_gap", "", "smallest_gap_mm", "mm", MM_PER_M),
    ResponseVariable("damper_spin", "spinning", "damper_spin_deg_s", "deg_s", DEG_PER_RAD),
)
MOUNT_FORCES = tuple(ResponseVariable(f"mount_force_{kind}", "mount", kind) for kind in KINDS)
"""Force of each mount on the cabinet: peak and RMS; in JSON below `mount_force_N`."""


@dataclass(frozen=True)
class ResponseResult(Result):
    """Result of the study."""

    study: ResponseStudy

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the responses and, if computed, the sweeps."""
        shown = {"response": response_frame(self.study)}
        return shown if self.study.sweeps is None else shown | {"sweeps": sweeps_frame(self.study)}

    def as_json(self) -> dict[str, Any]:
        """Return the responses for JSON."""
        study = self.study
        shown = {
            "machine": study.parameters.name,
            "harmonics": study.cases[0].response.attrs["harmonics"],
            "cases": [_case_as_json(case) for case in study.cases],
            "wall_s": study.wall_s,
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return the largest amplitude of each sensor, and a summary."""
        title = (
            f"Largest steady amplitudes of machine '{self.study.parameters.name}', in mm, stable "
            "and without contact"
        )
        return [largest_table(self.study).terminal(title), summary(self.study)]

    def page(self, facts: Facts) -> str:
        """Return the page: responses of each load, forces, sweeps, peaks."""
        study = self.study
        first = [case for case in study.cases if case.gasket == study.cases[0].gasket]
        forces = picture(
            forces_figure(first),
            "Displacement of the box and gasket forces over the drum speed.",
            f"Largest value of the axes, {_gasket(first[0])}. A line has gaps where no steady "
            "motion is stable and without contact.",
        )
        mounts = picture(
            mounts_figure(first),
            "Force of each mount on the cabinet over the drum speed.",
            f"Size of the force of each mount on the cabinet in a revolution, {_gasket(first[0])}: "
            "peak (line), and RMS without the mean (dashed). The peak has the weight that it "
            "carries.",
        )
        sweep = _sweep_picture(study)
        attributes = study.cases[0].response.attrs
        return SectionedPage(
            f"Steady response of machine {study.parameters.name}",
            summary(study),
            [
                *_load_sections(study),
                Section("forces", "Detergent box, gasket and mounts", (forces, mounts)),
                Section("sweep", "Sweep rate", (sweep,)) if sweep else None,
                Section("peaks", "Peaks", tables=(_peaks_table(study),)),
            ],
            [
                ("Harmonics", f"{attributes['harmonics']}, {attributes['samples']} samples"),
                ("Time", f"{number(study.wall_s, 1)} s"),
                *facts.rows(),
            ],
            study.parameters,
            [*facts.warnings, *_warnings(study)],
            method=METHOD,
        ).html()


def _case_as_json(case: ResponseCase) -> dict[str, Any]:
    mounts = _by_label(case, MOUNT_FORCES)
    return {
        "load": case.load,
        "gasket": case.gasket,
        "rpm": RPM_PER_RAD_S * case.response.speed.values,
        **_by_label(case, QUANTITIES),
        "mount_force_N": {
            mount: {kind: mounts[kind][mount] for kind in KINDS} for mount in mounts[KINDS[0]]
        },
        "stable": case.response.stable.values,
        "wall_s": case.wall_s,
    }


def _along_branch(case: ResponseCase, quantity: ResponseVariable) -> dict[str, FloatArray]:
    """Return a quantity along the branch by label; that of a quantity without any is ""."""
    values = quantity.factor * case.response[quantity.name]
    if not quantity.dim:
        return {"": values.values}
    labels = case.response[quantity.dim].values
    return {str(label): values.sel({quantity.dim: label}).values for label in labels}


def _by_label(case: ResponseCase, quantities: Sequence[ResponseVariable]) -> dict[str, Any]:
    """Return quantities along the branch, by name in JSON and label."""
    return {
        q.in_json: of_label if q.dim else of_label[""]
        for q in quantities
        for of_label in [_along_branch(case, q)]
    }


def _load_sections(study: ResponseStudy) -> list[Section]:
    """Return a section for each load: responses, and deflection shapes at the peaks."""
    outlines = Scene(study.parameters).tub_outlines()
    sections = []
    for index, load in enumerate(dict.fromkeys(case.load for case in study.cases), start=1):
        cases = [case for case in study.cases if case.load == load]
        pictures = [_response_picture(load, cases)]
        shapes = deflection_figure(cases[0], outlines)
        if shapes is not None:
            caption = (
                f"Operating deflection shapes of load {load} at the peaks of its largest "
                f"amplitude, {_gasket(cases[0])}: the ends of the tub at eight angles of the drum, "
                "enlarged. Grey: at rest."
            )
            pictures.append(picture(shapes, "Outlines of the tub at the peaks.", caption))
        sections.append(Section(f"load-{index}", f"Load {load}", pictures))
    return sections


def _gasket(case: ResponseCase) -> str:
    return "with gasket" if case.gasket else "without gasket"


def summary(study: ResponseStudy) -> str:
    """Return one paragraph: what can be reached, where the tub touches, what is unstable."""
    speeds = RPM_PER_RAD_S * np.concatenate([case.response.speed.values for case in study.cases])
    folded = [c for c in study.cases if np.any(np.diff(c.response.speed.values) < 0.0)]
    count = len(study.cases)
    sentences = [
        *(_reachable_sentence(cases) for cases in _by_gasket(study)),
        *(_contact_sentence(case) for case in study.cases if (case.stable & case.touches).any()),
        _unstable_sentence(study),
        f"{count} steady response{'s' if count > 1 else ''} from {number(speeds.min(), 0)} to "
        f"{number(speeds.max(), 0)} rpm, by harmonic balance of the forces of all elements.",
        "No branch folds back." if not folded else f"{len(folded)} fold back, with jumps.",
    ]
    return " ".join(sentences)


def _by_gasket(study: ResponseStudy) -> list[list[ResponseCase]]:
    """Return the cases with the gasket, then those without it, as far as there are any."""
    of_kind = ([c for c in study.cases if c.gasket is kind] for kind in (True, False))
    return [cases for cases in of_kind if cases]


def _reachable_sentence(cases: Sequence[ResponseCase]) -> str:
    """Return the largest amplitude of cases that a machine reaches."""
    known = [case for case in cases if case.reachable.any()]
    where = _gasket(cases[0]).capitalize()
    if not known:
        return f"{where} no steady motion is stable and without contact."
    case = max(known, key=lambda case: float(case.largest()[0].max()))
    size, speed = case.largest()
    sensor = int(np.argmax(size))
    return (
        f"{where} the largest steady amplitude that is stable and without contact is "
        f"{number(MM_PER_M * size[sensor])} mm at sensor {case.response.sensor.values[sensor]} "
        f"with load {case.load}, at {number(RPM_PER_RAD_S * speed[sensor], 0)} rpm."
    )


def _contact_sentence(case: ResponseCase) -> str:
    """Return at which speeds the tub touches the housing in stable motions of a case."""
    inside = case.stable & case.touches
    depth = -MM_PER_M * float(case.response.smallest_gap.values[inside].min())
    return (
        f"With load {case.load}, {_gasket(case)}, the tub touches the housing at "
        f"{_speeds(case, inside)}, with an overlap of up to {number(depth)} mm."
    )


def _unstable_sentence(study: ResponseStudy) -> str:
    """Return which branches are unstable, where, and how large their motions are."""
    unstable = [case for case in study.cases if not case.stable.all()]
    if not unstable:
        return "All motions are stable."
    texts = []
    for case in unstable:
        at = _speeds(case, ~case.stable)
        size = MM_PER_M * float(case.response.amplitude.values[~case.stable].max())
        texts.append(f"load {case.load}, {_gasket(case)}, at {at}, up to {number(size)} mm")
    return f"Unstable motions, which a machine leaves for another motion: {'; '.join(texts)}."


def _speeds(case: ResponseCase, which: BoolArray) -> str:
    """Return the speeds of some points of a branch in words, such as "60 to 70 and 82 rpm"."""
    rpm = [number(value, 0) for value in RPM_PER_RAD_S * case.response.speed.values]
    changes = np.flatnonzero(np.diff(np.pad(which, 1).astype(int)))
    ranges = []
    for begin, end in zip(changes[::2], changes[1::2] - 1, strict=True):
        ends = dict.fromkeys([rpm[begin], rpm[end]])
        ranges.append(" to ".join(ends))
    return f"{listed(ranges)} rpm"


def largest_table(study: ResponseStudy) -> Table:
    """Return the largest reachable amplitude of each sensor, and the speed of the largest."""
    rows = []
    for case in study.cases:
        size, speed = case.largest()
        at = int(np.nan_to_num(size).argmax())
        gasket = "yes" if case.gasket else "no"
        rows.append((case.load, gasket, *(MM_PER_M * size), RPM_PER_RAD_S * speed[at]))
    sensors = list(map(str, study.cases[0].response.sensor.values))
    columns = {name: Column(name, decimals=1) for name in sensors} | {"rpm": Column("rpm", "", 0)}
    return table_of(pd.DataFrame(rows, columns=["load", "gasket", *columns]), columns=columns)


def _warnings(study: ResponseStudy) -> list[str]:
    texts = [_spin_warning(case) for case in study.cases]
    return [text for text in texts if text] + [
        f"Load {case.load}, {_gasket(case)}: the branch could be followed only up to "
        f"{number(RPM_PER_RAD_S * float(case.response.speed.values[-1]), 0)} rpm. More harmonics "
        "or samples may help."
        for case in study.cases
        if not bool(case.response.on_grid.values[-1])
    ]


def _spin_warning(case: ResponseCase) -> str:
    """Return a text about telescopic dampers that spin; "" if none does."""
    turns = spin_per_revolution(case)
    if not turns.size or np.max(np.abs(turns)) < LEAST_SPIN:
        return ""
    point, number_of = np.unravel_index(int(np.argmax(np.abs(turns))), turns.shape)
    rpm = RPM_PER_RAD_S * float(case.response.speed.values[point])
    return (
        f"Load {case.load}, {_gasket(case)}: damper {case.response.spinning.values[number_of]} "
        f"spins about its axis by {number(abs(float(turns[point, number_of])), 1)}° in a drum "
        f"revolution at {number(rpm, 0)} rpm. The motion is then not periodic: the amplitudes "
        "hold for dampers near the angle at which they are built, and vary by some percent as "
        "they turn."
    )


def spin_per_revolution(case: ResponseCase) -> FloatArray:
    """Return by how much telescopic dampers spin in a drum revolution. (points, dampers) [deg]"""
    rates = case.response.damper_spin.values / case.response.speed.values[:, None]
    return np.asarray(360.0 * rates)


def _peaks_table(study: ResponseStudy) -> Table:
    groups = []
    for case in study.cases:
        steady, speed = case.largest()
        rows = [
            _row("steady, mm", MM_PER_M * steady, 1, "ours"),
            _row("at, rpm", RPM_PER_RAD_S * speed, 0),
        ]
        if case.run_up is not None:
            size = np.maximum(np.abs(case.run_up.upper), np.abs(case.run_up.lower))
            run = size.max("time")
            changes = map(percent, 100.0 * (run.values / steady - 1.0))
            rows += [
                _row("run, mm", MM_PER_M * run, 1),
                _row("at, rpm", RPM_PER_RAD_S * case.run_up.speed[size.argmax("time").values], 0),
                Row(("run less steady", *changes), "difference"),
            ]
        groups.append(Group(f"{case.load}, {_gasket(case)}", tuple(rows)))
    sensors = [str(name) for name in study.cases[0].response.sensor.values]
    caption = (
        "Largest amplitude at each sensor and its speed: steady motion, stable and without "
        "contact, and the run over the spin profile of the machine at the speeds of the response, "
        "whose displacements are band-passed as by the command spin."
    )
    return Table(caption, ("load", "", *sensors), tuple(groups), text_columns=2)


def _row(words: str, values: Iterable[float], decimals: int, kind: str = "") -> Row:
    return Row((words, *(number(float(value), decimals) for value in values)), kind)


def _response_picture(load: str, cases: list[ResponseCase]) -> Picture:
    caption = (
        f"Load {load}: largest deviation from the mean at each sensor over the drum speed. Pale: "
        "the tub touches the housing. Dotted: unstable; larger motions are cut off. Dashed: "
        "envelope of the run over the spin profile of the machine, while its speed rises."
    )
    return picture(response_figure(cases), f"Amplitudes of load {load} over the speed.", caption)


def _sweep_picture(study: ResponseStudy) -> Picture | None:
    if study.sweeps is None:
        return None
    caption = (
        "Sweeps at a constant rate, up and down, computed by the compiled engine. A faster sweep "
        "passes a resonance later. A single resonance is also passed lower; where the machine "
        "still moves in one mode when the next one is met, the sum of both may be above the steady "
        "peak. For each load the sensor with its largest steady amplitude is shown. Where two "
        "peaks are about as high, a sweep may prefer the other one."
    )
    return picture(sweep_figure(study), "Shift and height of peaks over the sweep rate.", caption)


def response_frame(study: ResponseStudy) -> pd.DataFrame:
    """Return all responses, a row for each point of a branch."""
    parts = []
    for case in study.cases:
        response = case.response
        columns: dict[str, object] = {
            "load": case.load,
            "gasket": "yes" if case.gasket else "no",
            "rpm": RPM_PER_RAD_S * response.speed.values,
            "stable": response.stable.values,
            "largest_multiplier": response.multiplier.values,
        }
        for quantity in (*QUANTITIES, *MOUNT_FORCES):
            for label, values in _along_branch(case, quantity).items():
                name = "_".join(filter(None, [quantity.name, label, quantity.unit]))
                columns[name] = values
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def sweeps_frame(study: ResponseStudy) -> pd.DataFrame:
    """Return the peaks of the sweeps."""
    assert study.sweeps is not None
    table = study.sweeps.to_dataframe().reset_index()
    return pd.DataFrame(
        {
            "load": table["load"],
            "gasket": np.where(table["gasket"], "yes", "no"),
            "rate_rpm_s": RPM_PER_RAD_S * table["rate"],
            "direction": table["direction"],
            "sensor": table["sensor"],
            "amplitude_mm": MM_PER_M * table["amplitude"],
            "rpm": RPM_PER_RAD_S * table["speed"],
        }
    )
