"""Report of the steady unbalance response: one HTML file, and tables for CSV files."""

from pathlib import Path

import numpy as np
import pandas as pd
from rich import table as terminal

from wm_drake.model.scene import Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, percent
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.table import Group, Row, Table, parameter_table
from wm_drake.simulation.mounts import KINDS
from wm_drake.simulation.records import versions
from wm_drake.studies.steady.figures import (
    deflection_figure,
    forces_figure,
    mounts_figure,
    response_figure,
    sweep_figure,
)
from wm_drake.studies.steady.study import SteadyCase, SteadyStudy
from wm_drake.studies.study import Facts


def response_page(study: SteadyStudy, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file.

    Args:
        study: Results with at least one case.
        facts: How they were computed.
    """
    loads = list(dict.fromkeys(case.load for case in study.cases))
    outlines = Scene(study.parameters).tub_outlines()
    sections = []
    for load in loads:
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
        sections.append((f"load-{loads.index(load) + 1}", load, pictures))
    first = [case for case in study.cases if case.gasket == study.cases[0].gasket]
    return render(
        Path(__file__).with_name("page.html"),
        title=f"Steady response of machine {study.parameters.name}",
        about=study.parameters.about,
        summary=summary(study),
        warnings=[*facts.warnings, *_warnings(study)],
        peaks=_peaks_table(study),
        forces=picture(
            forces_figure(first),
            "Displacement of the box and gasket forces over the drum speed.",
            f"Largest value of the axes, {_gasket(first[0])}.",
        ),
        mounts=picture(
            mounts_figure(first),
            "Force of each mount on the cabinet over the drum speed.",
            f"Size of the force of each mount on the cabinet in a revolution, {_gasket(first[0])}: "
            "peak (line), and RMS without the mean (dashed). The peak has the weight that it "
            "carries.",
        ),
        loads=sections,
        sweep=_sweep_picture(study),
        facts=_facts(study, facts.command),
        numbers=parameter_table(study.parameters),
    )


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


LEAST_SPIN = 0.05
"""Least spin of a telescopic damper that a page tells. [deg per revolution]"""


def terminal_table(study: SteadyStudy) -> terminal.Table:
    """Return the largest amplitude of each sensor for the terminal."""
    title = f"Largest steady amplitudes of machine '{study.parameters.name}', in mm"
    table = terminal.Table(title=title)
    for name in ("load", "gasket"):
        table.add_column(name, overflow="fold")
    for name in study.cases[0].response.sensor.values:
        table.add_column(str(name), justify="right")
    table.add_column("rpm", justify="right")
    for case in study.cases:
        largest = MM_PER_M * case.response.amplitude.values
        place = int(largest.max(axis=1).argmax())
        speed = RPM_PER_RAD_S * float(case.response.speed.values[place])
        cells = (f"{value:.1f}" for value in largest.max(axis=0))
        table.add_row(case.load, "yes" if case.gasket else "no", *cells, f"{speed:.0f}")
    return table


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
        speeds = RPM_PER_RAD_S * case.response.speed.values[at.values]
        rows = [
            Row(("steady, mm", *(number(MM_PER_M * float(v)) for v in steady)), "ours"),
            Row(("at, rpm", *(number(speed, 0) for speed in speeds))),
        ]
        if case.run_up is not None:
            size = np.maximum(np.abs(case.run_up.upper), np.abs(case.run_up.lower))
            run = size.max("time")
            when = RPM_PER_RAD_S * case.run_up.speed.values[size.argmax("time").values]
            change = 100.0 * (run.values / steady.values - 1.0)
            rows += [
                Row(("run, mm", *(number(MM_PER_M * float(v)) for v in run))),
                Row(("at, rpm", *(number(float(speed), 0) for speed in when))),
                Row(("run less steady", *(percent(float(v)) for v in change)), "difference"),
            ]
        groups.append(Group(f"{case.load}, {_gasket(case)}", tuple(rows)))
    sensors = [str(name) for name in study.cases[0].response.sensor.values]
    caption = (
        "Largest amplitude at each sensor and its speed: steady motion, and the run over the spin "
        "profile of the machine, whose displacements are band-passed as by the command spin."
    )
    return Table(caption, ("load", "", *sensors), tuple(groups), text_columns=2)


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


def _facts(study: SteadyStudy, command: str) -> list[tuple[str, str]]:
    response = study.cases[0].response
    return [
        ("Command", command),
        ("Harmonics", f"{response.attrs['harmonics']}, {response.attrs['samples']} samples"),
        ("Time", f"{number(study.wall_s, 1)} s"),
        ("Software", ", ".join(f"{name} {text}" for name, text in versions().items())),
    ]


def response_table(study: SteadyStudy) -> pd.DataFrame:
    """Return all responses as a table, for a CSV file."""
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
        for name, dim, factor, unit in (
            ("amplitude", "sensor", MM_PER_M, "mm"),
            ("detergent_displacement", "axis", MM_PER_M, "mm"),
            ("gasket_force", "axis", 1.0, "N"),
            ("gasket_moment", "axis", 1.0, "Nm"),
            ("spring_tension", "spring", 1.0, "N"),
            ("damper_tension", "damper", 1.0, "N"),
            ("damper_spin", "spinning", 180.0 / np.pi, "deg_s"),
            *((f"mount_force_{kind}", "mount", 1.0, "N") for kind in KINDS),
        ):
            for label in response[dim].values:
                values = factor * response[name].sel({dim: label}).values
                columns[f"{name}_{label}_{unit}"] = values
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def sweeps_table(study: SteadyStudy) -> pd.DataFrame:
    """Return the peaks of the sweeps as a table, for a CSV file."""
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
