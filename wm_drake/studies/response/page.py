"""What the study of the steady response shows: files, JSON, terminal and page."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.model.scene import Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, percent, plain
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
from wm_drake.studies.response.study import SteadyCase, SteadyStudy
from wm_drake.studies.study import Facts, Result

DEG_PER_RAD = Unit("rad/s", "deg/s").from_si(1.0)

LEAST_SPIN = 0.05
"""Least spin of a telescopic damper that a page tells. [deg per revolution]"""

METHOD = (
    "The steady motion has the period of a drum revolution. Its stability follows from its Floquet "
    "multipliers; where it is unstable, the machine moves otherwise than drawn. Telescopic dampers "
    "that spin about their axes make the motion vary slowly; then the values hold for dampers near "
    "the angle at which they are built."
)


class Quantity(NamedTuple):
    """Variable of a response in files.

    Attributes:
        name: Name of the variable, and of its columns in a CSV file.
        dim: Its dimension beside the points of the branch.
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
    Quantity("amplitude", "sensor", "amplitudes_mm", "mm", MM_PER_M),
    Quantity("detergent_displacement", "axis", "detergent_box_mm", "mm", MM_PER_M),
    Quantity("gasket_force", "axis", "gasket_force_N"),
    Quantity("gasket_moment", "axis", "gasket_moment_Nm", "Nm"),
    Quantity("spring_tension", "spring", "spring_tension_N"),
    Quantity("damper_tension", "damper", "damper_tension_N"),
    Quantity("damper_spin", "spinning", "damper_spin_deg_s", "deg_s", DEG_PER_RAD),
)
MOUNT_FORCES = tuple(Quantity(f"mount_force_{kind}", "mount", kind) for kind in KINDS)
"""Force of each mount on the cabinet: peak and RMS; in JSON below `mount_force_N`."""


@dataclass(frozen=True)
class ResponseResult(Result):
    """Result of the study."""

    study: SteadyStudy

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
        title = f"Largest steady amplitudes of machine '{self.study.parameters.name}', in mm"
        return [largest_table(self.study).terminal(title), summary(self.study)]

    def page(self, facts: Facts) -> str:
        """Return the page: responses of each load, forces, sweeps, peaks."""
        study = self.study
        first = [case for case in study.cases if case.gasket == study.cases[0].gasket]
        forces = picture(
            forces_figure(first),
            "Displacement of the box and gasket forces over the drum speed.",
            f"Largest value of the axes, {_gasket(first[0])}.",
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


def _case_as_json(case: SteadyCase) -> dict[str, Any]:
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


def _by_label(case: SteadyCase, quantities: Sequence[Quantity]) -> dict[str, dict[str, FloatArray]]:
    """Return quantities along the branch, by name in JSON and label."""
    return {
        q.in_json: {
            str(label): q.factor * case.response[q.name].sel({q.dim: label}).values
            for label in case.response[q.dim].values
        }
        for q in quantities
    }


def _load_sections(study: SteadyStudy) -> list[Section]:
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


def _gasket(case: SteadyCase) -> str:
    return "with gasket" if case.gasket else "without gasket"


def summary(study: SteadyStudy) -> str:
    """Return one paragraph about the largest amplitude and about stability."""
    case = max(study.cases, key=lambda case: float(case.response.amplitude.max()))
    values = case.response.amplitude.values
    point, sensor = np.unravel_index(int(np.argmax(values)), values.shape)
    rpm = RPM_PER_RAD_S * float(case.response.speed.values[point])
    speeds = RPM_PER_RAD_S * case.response.speed.values
    unstable = [c for c in study.cases if not c.response.stable.values.all()]
    folded = [c for c in study.cases if np.any(np.diff(c.response.speed.values) < 0.0)]
    count = len(study.cases)
    return " ".join(
        [
            f"{count} steady response{'s' if count > 1 else ''} from {number(speeds.min(), 0)} to "
            f"{number(speeds.max(), 0)} rpm, by harmonic balance of the forces of all elements.",
            f"The largest amplitude is {number(MM_PER_M * values[point, sensor])} mm at sensor "
            f"{case.response.sensor.values[sensor]} with load {case.load}, {_gasket(case)}, at "
            f"{number(rpm, 0)} rpm.",
            "All motions are stable."
            if not unstable
            else f"{len(unstable)} of them have speeds without a stable motion of the drum's "
            "period on the branch.",
            "No branch folds back." if not folded else f"{len(folded)} fold back, with jumps.",
        ]
    )


def largest_table(study: SteadyStudy) -> Table:
    """Return the largest amplitude of each sensor, and the speed of the largest of all."""
    rows = []
    for case in study.cases:
        largest = MM_PER_M * case.response.amplitude.values
        place = int(largest.max(axis=1).argmax())
        speed = RPM_PER_RAD_S * float(case.response.speed.values[place])
        rows.append((case.load, "yes" if case.gasket else "no", *largest.max(axis=0), speed))
    sensors = list(map(str, study.cases[0].response.sensor.values))
    columns = {name: Column(name, decimals=1) for name in sensors} | {"rpm": Column("rpm", "", 0)}
    return table_of(pd.DataFrame(rows, columns=["load", "gasket", *columns]), columns=columns)


def _warnings(study: SteadyStudy) -> list[str]:
    texts = [_spin_warning(case) for case in study.cases]
    return [text for text in texts if text] + [
        f"Load {case.load}, {_gasket(case)}: the branch could be followed only up to "
        f"{number(RPM_PER_RAD_S * float(case.response.speed.values[-1]), 0)} rpm. More harmonics "
        "or samples may help."
        for case in study.cases
        if not bool(case.response.on_grid.values[-1])
    ]


def _spin_warning(case: SteadyCase) -> str:
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


def spin_per_revolution(case: SteadyCase) -> FloatArray:
    """Return by how much telescopic dampers spin in a drum revolution. (points, dampers) [deg]"""
    rates = case.response.damper_spin.values / case.response.speed.values[:, None]
    return np.asarray(360.0 * rates)


def _peaks_table(study: SteadyStudy) -> Table:
    groups = []
    for case in study.cases:
        steady = case.response.amplitude.max("point")
        at = case.response.amplitude.argmax("point")
        rows = [
            _row("steady, mm", MM_PER_M * steady, 1, "ours"),
            _row("at, rpm", RPM_PER_RAD_S * case.response.speed[at.values], 0),
        ]
        if case.run_up is not None:
            size = np.maximum(np.abs(case.run_up.upper), np.abs(case.run_up.lower))
            run = size.max("time")
            changes = map(percent, 100.0 * (run.values / steady.values - 1.0))
            rows += [
                _row("run, mm", MM_PER_M * run, 1),
                _row("at, rpm", RPM_PER_RAD_S * case.run_up.speed[size.argmax("time").values], 0),
                Row(("run less steady", *changes), "difference"),
            ]
        groups.append(Group(f"{case.load}, {_gasket(case)}", tuple(rows)))
    sensors = [str(name) for name in study.cases[0].response.sensor.values]
    caption = (
        "Largest amplitude at each sensor and its speed: steady motion, and the run over the spin "
        "profile of the machine, whose displacements are band-passed as by the command spin."
    )
    return Table(caption, ("load", "", *sensors), tuple(groups), text_columns=2)


def _row(words: str, values: xr.DataArray, decimals: int, kind: str = "") -> Row:
    return Row((words, *(number(float(value), decimals) for value in values)), kind)


def _response_picture(load: str, cases: list[SteadyCase]) -> Picture:
    caption = (
        f"Load {load}: largest deviation from the mean at each sensor over the drum speed. Dashed: "
        "envelope of the run over the spin profile of the machine, while its speed rises."
    )
    return picture(response_figure(cases), f"Amplitudes of load {load} over the speed.", caption)


def _sweep_picture(study: SteadyStudy) -> Picture | None:
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


def response_frame(study: SteadyStudy) -> pd.DataFrame:
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
        every = (*QUANTITIES, *MOUNT_FORCES)
        for quantity, by_label in zip(every, _by_label(case, every).values(), strict=True):
            for label, values in by_label.items():
                columns[f"{quantity.name}_{label}_{quantity.unit}"] = values
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def sweeps_frame(study: SteadyStudy) -> pd.DataFrame:
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
