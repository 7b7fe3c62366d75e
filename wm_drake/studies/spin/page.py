"""Page of spin runs: the answer, pictures of each load, tables of all measures."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from wm_drake.elements.motor import evaluate_motor, packed_limit
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.plausibility import unusual_numbers
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import (
    MISSING,
    MM_PER_M,
    RPM_PER_RAD_S,
    number,
    percent,
    slack_warning,
)
from wm_drake.report.page import Picture, Section, SectionedPage, picture, versions_of
from wm_drake.report.table import Group, Row, Table
from wm_drake.report.terminal import Printed
from wm_drake.simulation.balance import balance_of, rings_of
from wm_drake.simulation.displacements import band_of
from wm_drake.simulation.drive import CAPTURE_LAG, CAPTURE_TIME, over_revolutions
from wm_drake.simulation.measures.as_json import as_json
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.simulation.mounts import POINT
from wm_drake.simulation.records import profile_of
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.studies.modes.page import natural_modes_table
from wm_drake.studies.spin import figures, tables
from wm_drake.studies.spin.balance import (
    balance_as_json,
    balance_frame,
    balance_section,
    ball_table,
)
from wm_drake.studies.spin.figures import revolution_starts
from wm_drake.studies.spin.floor import floor_section, floor_warnings
from wm_drake.studies.spin.study import CaseResult, ComparedCases, SpinRuns, band_text
from wm_drake.studies.spin.tables import amplitude_table
from wm_drake.studies.spin.vibration import vibration_pictures
from wm_drake.studies.study import Facts, Result

AXES = (
    "Axes: for a person who faces the door, x points to the right, y along the drum axis from "
    "front to rear, and z up. The origin is on the drum axis at drum mid-depth, with the tub at "
    "rest."
)

ONE_VIBRATION = (
    "Mount forces, accelerations and spectra are drawn for this load only, that with the largest "
    "amplitude; the option --detail draws them for every load."
)

MODES = (
    "With load {} in a drum that stands still. The command 'wm-drake study modes' has the mode "
    "shapes, the Campbell diagram, critical speeds and sensitivities; 'wm-drake study response' "
    "has the steady response."
)

VERDICT = (
    "'wm-drake verdict' adds random laundry to these loads, and finds what decides the gap and "
    "what to change."
)
"""How the verdict differs from this page."""


@dataclass(frozen=True)
class SpinResult(Result):
    """Spin runs of one machine, as they are shown."""

    runs: SpinRuns
    float_format: ClassVar[str | None] = "%.4f"

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the amplitudes, and of a machine with rings of balls what they do."""
        runs, shown = self.runs, {"amplitudes": tables.banded_amplitudes(self.runs)}
        if rings_of(runs.parameters) and any(c.record.sizes["time"] for c in runs.results):
            shown |= {"balance": balance_frame(runs), "balls": ball_table(runs)}
        return shown

    def as_json(self) -> dict[str, Any]:
        """Return the measures of each case."""
        runs = self.runs
        return {
            "machine": runs.parameters.name,
            "engine": runs.engine,
            "cases": cases_as_json(runs),
        }

    def terminal(self) -> Printed:
        """Return the amplitudes, and lines with the other measures of each case."""
        runs = self.runs
        title = f"Displacement amplitudes of machine '{runs.parameters.name}', in mm"
        lines = [line for case in runs.results for line in tables.case_lines(runs.parameters, case)]
        amplitudes = tables.amplitude_lines(title, self.tables()["amplitudes"])
        return [amplitudes, *runs.measured_notes(), *lines]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return spin_page(self.runs, facts)

    def write(self, folder: Path) -> None:
        """Write the amplitudes and the files of the cases."""
        super().write(folder)
        self.runs.write_cases(folder)

    def warnings(self) -> list[str]:
        """Return a warning of springs that go slack, if any do."""
        return slack_springs_warning(self.runs)

    def failures(self) -> list[str]:
        """Return a line for each case that diverged."""
        return self.runs.failures()


def cases_as_json(runs: SpinRuns) -> list[dict[str, Any]]:
    """Return the measures of each case as objects for JSON."""
    return [
        case_as_json(case)
        | {"balance": balance_as_json(balance_of(case.case, runs.parameters, case.record))}
        for case in runs.results
    ]


def spin_page(result: SpinRuns, facts: Facts | None = None) -> str:
    """Return the page of spin runs as text of one self-contained HTML file."""
    table, made = amplitude_table(result), facts or Facts()
    gaps = _gaps_pictures(result)
    drive, floor, modes = drive_section(result), floor_section(result), result.modes
    balance = balance_section(result)
    more = tuple(tables.variable_table(result, variable) for variable in tabulated())
    sections = [
        *_case_sections(result, table),
        Section("gap", "Smallest gaps", gaps, text=VERDICT if gaps else ""),
        replace(balance, tables=()),
        Section("floor", "Feet over time", floor.pictures),
        Section(
            "drive", "Speed and torque", drive.pictures, text=drive.text if drive.pictures else ""
        ),
        Section("amplitudes", "Amplitudes", tables=(tables.comparison(result, table),)),
        Section("speeds", "Critical speeds", tables=(tables.critical_speeds(result),)),
        Section("smallest", "Smallest gap", tables=(tables.smallest_gaps(result),)),
        Section("forces", "Detergent box and gasket", tables=(tables.largest_values(result),)),
        Section(
            "mounts",
            "Mounts and accelerations",
            tables=(*tables.mount_force_tables(result), tables.accelerations(result)),
            is_folded=True,
        ),
        Section("remaining", "Remaining unbalance", tables=balance.tables),
        replace(floor, pictures=(), is_folded=True),
        replace(drive, pictures=(), text="" if drive.pictures else drive.text),
        Section("springs", "Springs", tables=(tables.smallest_tensions(result),)),
        Section("more", "More measures", tables=more),
    ]
    if modes:
        shown = (natural_modes_table(modes).table(),)
        sections.append(
            Section("modes", "Natural modes", tables=shown, text=MODES.format(modes.load))
        )
    changed = (tables.changed_parameters(result, case) for case in result.results)
    return SectionedPage(
        f"Spin run of machine {result.parameters.name}",
        summary(result, table),
        sections,
        facts_of_run(result, made),
        result.parameters,
        [*made.warnings, *warnings_of(result)],
        method=f"{AXES} {drive_in_short(result)}",
        tables=(*filter(None, changed), tables.loads(result), tables.profiles(result)),
    ).html()


def _case_sections(result: SpinRuns, table: pd.DataFrame) -> list[Section]:
    """Return a section for each case; that with the largest amplitude has its vibration too."""
    main, sections = max(result.results, key=lambda case: _peak(case)[0]), []
    for index, case in enumerate(result.results, start=1):
        title, file = case.title, result.replay_of(case)
        words = f"3D replay of load {title} around its largest amplitude"
        text = _case_facts(case)
        pictures = [_envelopes_picture(case, table), _orbits_picture(case), _gasket_picture(case)]
        if (result.files.detail or case is main) and case.record.sizes["time"] > 1:
            pictures += vibration_pictures(result, case)
        if case is main and not result.files.detail and len(result.results) > 1:
            text = f"{text} {ONE_VIBRATION}"
        shown, links = tuple(filter(None, pictures)), [(file, words)] if file else []
        sections.append(Section(f"case-{index}", f"Load {title}", shown, text=text, links=links))
    return sections


def summary(result: SpinRuns, table: pd.DataFrame) -> str:
    """Return one paragraph about the cases that reached their end."""
    ended = [case for case in result.results if not case.record.attrs["diverged"]]
    count, diverged = len(result.results), len(result.results) - len(ended)
    cases = "1 case was" if count == 1 else f"{count} cases were"
    fastest = max(case.case.profile.highest_speed for case in result.results)
    speed = number(RPM_PER_RAD_S * fastest, 0)
    opening = f"{cases} run with the {result.engine} engine, at drum speeds up to {speed} rpm."
    if not ended:
        return f"{opening} Every run diverged, so there is no result to summarize."
    if diverged:
        excluded = "1 run diverged and is" if diverged == 1 else f"{diverged} runs diverged and are"
        opening += f" {excluded} excluded from this summary."
    return " ".join(
        filter(
            None,
            [
                _contact_sentence(ended),
                opening,
                _largest_amplitude_sentence(ended),
                _agreement_sentence(result, ended, table),
            ],
        )
    )


def _largest_amplitude_sentence(cases: list[CaseResult]) -> str:
    case = max(cases, key=lambda case: _peak(case)[0])
    size, sensor, speed = _peak(case)
    return (
        f"The largest amplitude occurs with load {case.title}: {number(size)} mm at sensor "
        f"{sensor}, at {number(speed, 0)} rpm."
    )


def _peak(case: CaseResult) -> tuple[float, str, float]:
    """Return the largest amplitude [mm], its sensor, and the drum speed there [rpm].

    The amplitude is 0 if the run was too short for the filter.
    """
    amplitude = case.measures.amplitude.fillna(0.0)
    index = int(np.argmax(amplitude.values))
    speed = float(case.measures.critical_speed.values[index])
    return (
        MM_PER_M * float(amplitude.values[index]),
        str(amplitude.sensor.values[index]),
        RPM_PER_RAD_S * speed,
    )


def _contact_sentence(cases: list[CaseResult]) -> str:
    """Return whether the tub touches, the smallest gap and where it is, and that of each load."""
    gaps = [(gap, case) for case in cases if (gap := case.measures.smallest_gap)]
    if not gaps:
        return "The SDF has no shapes on both tub and housing, so contact cannot be judged."
    gap, case = min(gaps, key=lambda pair: pair[0].distance)
    place = (
        f"between {gap.parts}, with load {case.title} at {number(case.speed_rpm(gap.time), 0)} rpm"
    )
    size = f"smallest gap {number(MM_PER_M * gap.distance)} mm"
    does = "does not touch"
    if gap.distance <= 0.0:
        size, does = f"overlap of {number(-MM_PER_M * gap.distance)} mm", "touches"
    loads = [f"{c.title} {number(MM_PER_M * g.distance)} mm" for g, c in gaps]
    per_load = f" Smallest gap per load: {', '.join(loads)}." if len(gaps) > 1 else ""
    return f"The tub {does} the housing: {size}, {place}.{per_load}"


def _case_facts(case: CaseResult) -> str:
    size, sensor, speed = _peak(case)
    facts = "The run is too short for the band-pass filter, so it has no amplitudes."
    if _has_envelopes(case):
        facts = (
            f"Largest amplitude: {number(size)} mm at sensor {sensor}, at {number(speed, 0)} rpm."
        )
    gap = case.gap_text
    return f"{facts} Smallest gap to the housing: {gap}." if gap else facts


def _agreement_sentence(result: SpinRuns, cases: list[CaseResult], table: pd.DataFrame) -> str:
    changes = [
        change
        for case in cases
        for change in tables.differences(table, case)
        if np.isfinite(change.percent)
    ]
    if not changes:
        return _why_not_compared(result)
    mean = float(np.mean([abs(change.percent) for change in changes]))
    worst = max(changes, key=lambda change: abs(change.percent))
    return (
        f"{len(changes)} amplitudes can be compared with the experiment. The mean absolute "
        f"difference is {number(mean, 0)} %. The largest difference is {percent(worst.percent)}, "
        f"at sensor {worst.sensor} with load {worst.case}."
    )


def _why_not_compared(result: SpinRuns) -> str:
    if not result.parameters.measured:
        return "The machine file has no measured amplitudes."
    if result.comparison is ComparedCases.NONE:
        return (
            "There is no comparison with the measured amplitudes of the machine file, because its "
            "numbers were changed."
        )
    if not any(result.is_compared(case) for case in result.results):
        return (
            "There is no comparison with the measured amplitudes of the machine file, because they "
            "belong to other loads or to another spin profile."
        )
    return "The machine file has no measured amplitudes for these cases."


def warnings_of(result: SpinRuns) -> list[str]:
    """Return warnings about unusual numbers, divergence, overlaps, and springs that go slack."""
    warnings = [
        f"{problem.key}: {problem.message}." for problem in unusual_numbers(result.parameters)
    ]
    for case in result.results:
        gap, title = case.measures.smallest_gap, case.title
        if case.record.attrs["diverged"]:
            warnings.append(
                f"Load {title}: {case.record.attrs['diverged']}. The results below cover the time "
                "before that."
            )
        if gap is not None and gap.distance <= 0.0:
            warnings.append(
                f"Load {title}: {gap.parts} overlap by {number(-MM_PER_M * gap.distance)} mm. The "
                "model has no contact forces. In the real machine these parts would collide, and "
                "the motion after that is not valid."
            )
    return (
        warnings + slack_springs_warning(result) + floor_warnings(result) + capture_warnings(result)
    )


def slack_springs_warning(result: SpinRuns) -> list[str]:
    """Return a warning of the springs that go slack, or none."""
    return slack_warning(
        {c.title: slack_springs(c.measures.smallest_tension) for c in result.results}, "load"
    )


def facts_of_run(result: SpinRuns, made: Facts) -> list[tuple[str, str]]:
    """Return what was run and with which software, as pairs of heading and text."""
    attrs = result.results[0].record.attrs
    times = [f"{case.title} {number(case.wall_s)} s" for case in result.results]
    return [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        ("Engine", f"{result.engine}, {result.stepping_text}"),
        ("Versions", versions_of(attrs)),
        ("Computing time", "; ".join(times)),
        *replace(made, step=0.0).rows(),  # the line of the engine has the step
    ]


def _has_envelopes(case: CaseResult) -> bool:
    return not bool(case.measures.amplitude.isnull().any())


def _envelopes_picture(case: CaseResult, table: pd.DataFrame) -> Picture | None:
    if not _has_envelopes(case):
        return None
    measured = tables.experiment_mm(table, case)
    amplitude = case.measures.amplitude
    largest = ", ".join(
        f"{name} {number(MM_PER_M * float(amplitude.sel(sensor=name)))} mm"
        for name in amplitude.sensor.values
    )
    caption = (
        f"Displacement at each sensor over time, in the band {band_text(case)}. The shaded area "
        "extends from the lower to the upper envelope. The dot marks the largest absolute value; "
        "the top of the panel gives this value and its drum speed. All panels have the same scale."
    )
    if measured is not None:
        caption += " Dashed lines: measured amplitude, on both sides of zero."
    alternative = f"Envelopes of the displacement over time, load {case.title}. Largest: {largest}."
    return picture(figures.envelopes_figure(case.record, measured), alternative, caption)


def _orbits_picture(case: CaseResult) -> Picture | None:
    if case.record.sizes["time"] < 2:
        return None
    depths = case.record.sensor_point.sel(axis="y")
    ends = float(depths.min()), float(depths.max())
    is_one = figures.have_one_orbit(*ends)
    planes = "plane of the sensors" if is_one else "planes of the foremost and the rearmost sensor"
    caption = (
        f"Path of the drum axis in the {planes}, seen from the front of the machine. Dot and dark "
        "line: the moment of the largest amplitude of all sensors, and the drum revolution around "
        "it. Pale line: the revolutions before and after."
    )
    orbits = "Orbit of the drum axis" if is_one else "Orbits of the drum axis, front and rear"
    alternative = f"{orbits}, around the largest amplitude, load {case.title}."
    return picture(figures.orbits_figure(case.record, *ends), alternative, caption)


def _gasket_picture(case: CaseResult) -> Picture | None:
    if not case.has_gasket or case.record.sizes["time"] < 2:
        return None
    force, moment = (
        np.asarray(values) for values in (case.measures.gasket_force, case.measures.gasket_moment)
    )
    caption = (
        "Force (upper row, N) and moment (lower row, N m) of the gasket on the housing over time. "
        "The shaded area extends from the smallest to the largest value within each drum "
        "revolution. The dot marks the largest absolute value."
    )
    alternative = (
        f"Gasket force and moment over time, load {case.title}. Largest force "
        f"{number(float(force.max()))} N, largest moment {number(float(moment.max()), 2)} N m."
    )
    return picture(figures.gasket_figure(case.record), alternative, caption)


def _gaps_pictures(result: SpinRuns) -> tuple[Picture, ...]:
    cases = [case for case in result.results if case.measures.smallest_gap]
    if len(cases) < 2:
        return ()
    caption = (
        "Smallest gap for each load, the two parts between which it occurs, and the drum speed at "
        "that time."
    )
    words = "Smallest gap between tub and housing per load; the numbers are in the table below."
    return (picture(figures.gaps_figure(cases), words, caption),)


def drive_section(result: SpinRuns) -> Section:
    """Return the section: measures, and speed and torque over time of each load with a motor."""
    drive, pictures = motor_of(result.parameters.drive), tuple[Picture, ...]()
    text = (
        "The drum follows the spin profile exactly, whatever torque that takes. The option "
        "--drive motor shows what a motor with a torque limit does."
    )
    if drive is not None:
        n = drive.belt_ratio
        text = (
            "A motor with a torque limit and a PI speed controller turns the drum by a belt of "
            f"ratio {n:g}. Torques are those at the drum; at the motor's shaft they are {n:g} "
            "times smaller. None of the motor's numbers is published: see their sources in the "
            "table of parameters."
        )
        shown = [case for case in result.results if case.record.sizes["time"] > 1]
        pictures = tuple(_picture(result, case) for case in shown)
    return Section("torques", "Drive", pictures, (drive_table(result),), text)


def drive_in_short(result: SpinRuns) -> str:
    """Return one sentence about the drive."""
    if motor_of(result.parameters.drive) is None:
        return "The drum follows the spin profile exactly; the motor torque has no limit."
    return "A motor turns the drum; the spin profile is the speed that its controller wants."


def capture_warnings(result: SpinRuns) -> list[str]:
    """Return a warning for each case in which the drum is caught below the wanted speed."""
    return [
        f"Load {case.title}: caught at {number(RPM_PER_RAD_S * caught.speed, 0)} rpm "
        f"from {number(caught.begin)} s to {number(caught.end)} s with a mean torque of "
        f"{number(caught.torque, 2)} N m. The drive is too weak to pass (Sommerfeld effect), or to "
        "lift the unbalance."
        for case in result.results
        if (caught := case.measures.drive.capture)
    ]


def drive_table(result: SpinRuns) -> Table:
    """Return the measures of the drive for each load."""
    groups = []
    for case in result.results:
        drive = case.measures.drive
        caught = drive.capture
        cells = (
            number(drive.peak_torque),
            number(drive.mean_torque, 2),
            number(RPM_PER_RAD_S * drive.mean_torque_speed, 0),
            number(drive.peak_power, 0),
            number(drive.energy, 0),
            number(100.0 * drive.speed_ripple),
            f"{number(RPM_PER_RAD_S * caught.speed, 0)} rpm, {number(caught.torque, 2)} N\u00a0m"
            if caught
            else MISSING,
        )
        row = Row(cells, "alarm" if caught else "")
        groups.append(Group(case.title, (row,)))
    caption = (
        "Torque of the motor on the drum: largest value, and largest average over a revolution "
        "with its speed; largest power; work over the run. Ripple: largest difference between "
        "highest and lowest speed in a revolution, in parts of the mean, from 60 rpm on. Caught: "
        f"mean speed and torque of a drum that stays for {CAPTURE_TIME:g} s or longer more than "
        f"{100.0 * CAPTURE_LAG:g} % below the wanted speed."
    )
    header = (
        "load",
        "largest torque, N\u00a0m",
        "over a revolution, N\u00a0m",
        "at, rpm",
        "largest power, W",
        "work, J",
        "speed ripple, %",
        "caught at",
    )
    return Table(caption, header, tuple(groups))


def _picture(result: SpinRuns, case: CaseResult) -> Picture:
    drive = case.measures.drive
    caption = (
        f"Load {case.title}. Upper panel: speed of the drum, and the wanted one (dashed). "
        "Lower panel: torque of the motor on the drum, from the smallest to the largest in each "
        "revolution, its average over a revolution (line), and the limit (dashed)."
    )
    alternative = (
        f"Speed and torque over time, load {case.title}: up to {number(drive.peak_torque)} N m."
    )
    return picture(drive_figure(result, case), alternative, caption)


def drive_figure(result: SpinRuns, case: CaseResult) -> fig.Figure:
    """Return speed and torque of a drive with a motor over time."""
    record, time = case.record, case.record.time.values
    torque, speed = record.motor_torque.values, record.drum_speed.values
    starts = revolution_starts(record)
    target = RPM_PER_RAD_S * np.asarray(profile_of(record).speed_at(time))
    above: list[fig.Mark] = [
        fig.Line(time, RPM_PER_RAD_S * speed, width=1.4, key="speed of the drum"),
        fig.Line(time, target, color=fig.MARK, width=1.4, dash="dashed", key="wanted"),
    ]
    if caught := case.measures.drive.capture:
        above.insert(0, fig.Span(caught.begin, caught.end, color=fig.MEASURED, opacity=0.12))
        x, y = 0.5 * (caught.begin + caught.end), RPM_PER_RAD_S * caught.speed
        text = f"caught at {number(y, 0)} rpm"
        above.append(fig.Text(x, y, text, color=fig.MEASURED, up="top", shift=(0.0, -8.0)))
    low, high = (side.reduceat(torque, starts) for side in (np.minimum, np.maximum))
    mean = over_revolutions(time, record.drum_angle.values, torque)
    key = "torque, average over a revolution"
    below: list[fig.Mark] = [
        fig.band(time[starts], low, high, opacity=0.25),
        fig.Line(time, mean, key=key),
    ]
    limit = _limit(result, speed[starts])
    if np.abs(limit).min() < 4.0 * np.abs(torque).max():  # else it would hide the torque
        below.append(fig.Line(time[starts], limit, color=fig.QUIET, dash="dashed", key="limit"))
    x_axis = fig.Axis(label="time, s", range=(0.0, float(time[-1])))
    labels = {"speed, rpm": above, "torque at the drum, N\u00a0m": below}
    panels = [
        fig.Panel(name=label.split(",")[0], marks=tuple(marks), x=x_axis, y=fig.Axis(label=label))
        for label, marks in labels.items()
    ]
    return fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=200.0)


def _limit(result: SpinRuns, speed: FloatArray) -> FloatArray:
    """Return the torque limit at the drum at speeds of the drum (n,). [N m]"""
    drive = motor_of(result.parameters.drive)
    assert drive is not None
    packed, of_motor, limit = packed_limit(drive), np.empty(2), np.empty(len(speed))
    for index, rate in enumerate(drive.belt_ratio * speed):
        evaluate_motor(np.array([0.0, rate]), packed, of_motor)
        limit[index] = drive.belt_ratio * of_motor[1]
    return limit


def case_as_json(case: CaseResult) -> dict[str, Any]:
    """Return the measures of a case as an object for JSON."""
    measures = case.measures
    tree = as_json(measures.table)
    tree["cabinet_wrench"]["about"] = POINT
    if not measures.has_cabinet:
        tree["feet"] = None
    walk = measures.walk
    return {
        "load": case.case.name,
        "gasket": case.has_gasket,
        **tree,
        "walk": walk
        and {
            "distance_mm": Unit("m", "mm").from_si(walk.distance),
            "turn_deg": Unit("rad", "deg").from_si(walk.turn),
        },
        "displacement_band_hz": list(band_of(case.record)),
        "diverged": case.record.attrs["diverged"] or None,
        "wall_s": case.wall_s,
    }
