"""What the study of modes shows: files, JSON, terminal and page."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.model.scene import Scene
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, listed, number, plain
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Group, Row, Table, line, table_of
from wm_drake.report.terminal import Printed
from wm_drake.studies.modes.figures import (
    TITLES,
    amplitude_figure,
    campbell_figure,
    energy_figure,
    sensitivity_figure,
    shapes_figure,
)
from wm_drake.studies.modes.shapes import (
    ANGLE_ARM,
    UNDAMPED,
    Mode,
    Nearness,
    about_nearness,
    nearness,
    parts,
)
from wm_drake.studies.modes.study import (
    AMPLITUDE,
    SLIDING,
    STUCK,
    AmplitudeValue,
    MachineModes,
    NaturalModes,
    modes_frame,
)
from wm_drake.studies.study import Facts, Result


def damping_text(ratio: float) -> str:
    """Return a damping ratio for reading; a word where there is none but errors of rounding."""
    return number(ratio, 4) if abs(ratio) > UNDAMPED else "undamped"


MODE = {
    "mode": Column("mode"),
    "name": Column("name"),
    "frequency_Hz": Column("frequency", "Hz", 3),
    "damping_ratio": Column("damping ratio", form=damping_text),
    "order": Column("order"),
    "rpm": Column("speed", "rpm", 1),
}
"""Columns of tables of modes by their names in files."""

AXES = (
    "Axes: for a person who faces the door, x points to the right, y along the drum axis from "
    "front to rear, and z up. Sway is along x, fore-aft along y, bounce along z; roll, pitch and "
    "yaw turn about x, y and z."
)


@dataclass(frozen=True)
class ModesResult(Result):
    """Modes, and the pages of their animations by name of the mode."""

    modes: MachineModes
    replays: dict[str, str]

    float_format = "%.8g"

    @cached_property
    def scene(self) -> Scene:
        """Shapes of the machine."""
        return Scene(self.modes.parameters)

    @cached_property
    def gaps(self) -> dict[str, Nearness | None]:
        """Return how near the modes bring the tub to the housing, by linearisation."""
        result = self.modes
        return {
            name: nearness(self.scene, result.rest_pose, result.modes[name], result.amplitude)
            for name in (SLIDING, STUCK)
        }

    def summary(self) -> str:
        """Return one paragraph about the modes."""
        sentences = [summary(self.modes), about_damping(self.modes)]
        sliding = self.gaps[SLIDING]
        if sliding is not None:
            sentences.append(about_nearness(sliding))
        return " ".join(filter(None, sentences))

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return modes, amplitudes, Campbell diagram and sensitivities."""
        return {
            "modes": self._modes_frame(),
            "amplitudes": amplitudes_frame(self.modes),
            "campbell": campbell_frame(self.modes),
            "sensitivities": sensitivities_frame(self.modes),
        }

    def write(self, folder: Path) -> None:
        """Write the tables, and the animations."""
        super().write(folder)
        for name, text in self.replays.items():
            (folder / replay_file(name)).write_text(text, encoding="utf-8")

    def as_json(self) -> dict[str, Any]:
        """Return the modes for JSON."""
        result = self.modes
        campbell = {name: _campbell_as_json(result, name) for name in (SLIDING, STUCK)}
        shown = {
            "machine": result.parameters.name,
            "load": result.load,
            "gasket": result.gasket,
            "amplitude_mm": MM_PER_M * result.amplitude,
            "smallest_gap_mm": {
                name: {mode: MM_PER_M * gap.distance for mode, gap in near.of_mode.items()}
                for name, near in self.gaps.items()
                if near is not None
            },
            "modes": {
                name: frame.drop(columns="friction").to_dict("records")
                for name, frame in linearisations(result).groupby("friction", sort=False)
            },
            "critical_rpm": RPM_PER_RAD_S * result.critical_speeds,
            "critical": {name: critical_rows(result, name) for name in result.critical},
            "campbell": campbell[SLIDING],
            "campbell_stuck": campbell[STUCK],
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return natural frequencies and damping ratios, and a summary."""
        result = self.modes
        frame = linearisations(result).replace({AMPLITUDE: f"{MM_PER_M * result.amplitude:g} mm"})
        title = f"Modes of machine '{result.parameters.name}'"
        columns = ["friction", "name", "frequency_Hz", "damping_ratio"]
        shown = table_of(frame[columns], columns={**MODE, "name": Column("mode")})
        return [shown.terminal(title), self.summary()]

    def page(self, facts: Facts) -> str:
        """Return the page: frequencies, shapes, sensitivities, tables."""
        result = self.modes
        outlines = self.scene.tub_outlines()
        shapes = [
            picture(
                shapes_figure(result.modes[name], outlines),
                f"Outlines of the tub in each mode, {TITLES[name]}.",
                f"Mode shapes, {TITLES[name]}. Grey: at rest. Blue and vermilion: both ends of "
                "the motion, enlarged. Rows: seen from the front, from the right, from above.",
            )
            for name in (SLIDING, STUCK)
        ]
        energy = picture(
            energy_figure(result),
            "Bars with the shares of the elements in strain energy and dissipation of each mode.",
            "Share of each element in the strain energy and in the dissipated energy of each mode. "
            "Negative shares, which preload can cause, are not drawn; modes.csv has them.",
        )
        links = [(replay_file(name), f"Animation of {name} in 3D") for name in self.replays]
        over_speed = (_campbell_picture(result), _amplitude_picture(result))
        causes = [_sensitivity_picture(result, name) for name in ("frequency", "damping")]
        tables = (natural_modes_table(result), _critical_table(result), _participation(result))
        return SectionedPage(
            f"Modes of machine {result.parameters.name}",
            self.summary(),
            [
                Section("campbell", "Frequencies over speed and amplitude", over_speed),
                Section("shapes", "Mode shapes", [*shapes, energy], links=links),
                Section("sensitivity", "Sensitivity: what moves a mode", causes),
                Section("modes", "Modes", tables=tables[:1]),
                Section("critical", "Critical speeds", tables=tables[1:2]),
                Section("gaps", "Gap to the housing", tables=self._gap_tables()),
                Section("participation", "Participation", tables=tables[2:]),
            ],
            [
                ("Load", result.load or "empty drum"),
                ("Gasket", "yes" if result.gasket else "no"),
                *facts.rows(),
            ],
            result.parameters,
            facts.warnings,
            method=AXES,
        ).html()

    def _modes_frame(self) -> pd.DataFrame:
        """Return the modes with the smallest gap over the cycle of each."""
        frame = modes_frame(self.modes)
        if any(near is None for near in self.gaps.values()):
            return frame
        column = [
            MM_PER_M * near.of_mode[mode.name].distance
            for name in (STUCK, SLIDING)  # order of the rows
            for mode in self.modes.modes[name]
            if (near := self.gaps[name]) is not None
        ]
        return frame.assign(smallest_gap_mm=column)

    def _gap_tables(self) -> list[Table]:
        """Return the table of the smallest gap in each mode; none without shapes to measure."""
        groups = tuple(
            Group(
                TITLES[name],
                tuple(
                    Row(
                        (mode, parts(gap), MM_PER_M * gap.distance),
                        kind="ours" if is_nearest else "",
                    )
                    for mode, gap in near.of_mode.items()
                    for is_nearest in [mode == near.nearest]
                ),
            )
            for name, near in self.gaps.items()
            if near is not None
        )
        caption = (
            "Smallest distance between tub and housing over the cycle of each mode, all at an "
            f"amplitude of {number(MM_PER_M * self.modes.amplitude, 1)} mm, with angles times "
            f"{MM_PER_M * ANGLE_ARM:g} mm. Bold: the mode that brings them nearest. How large a "
            "mode becomes in a run depends on load and speed."
        )
        columns = ("linearisation", "mode", "between", Column("smallest gap", "mm", 2))
        return [Table(caption, columns, groups, text_columns=3)] if groups else []


def replay_file(name: str) -> str:
    """Return the name of the file with the animation of a mode."""
    return f"replay_{re.sub('[^a-z]', '_', name)}.html"


def linearisations(result: NaturalModes) -> pd.DataFrame:
    """Return name, natural frequency and damping ratio of the modes of each linearisation."""
    modes: dict[str, Sequence[Mode | AmplitudeValue]] = {
        STUCK: result.modes[STUCK],
        SLIDING: result.modes[SLIDING],
        AMPLITUDE: result.at_amplitude,
    }
    return pd.DataFrame(
        {
            "friction": friction,
            "frequency_Hz": mode.frequency_hz,
            "damping_ratio": mode.damping_ratio,
            "name": mode.name,
        }
        for friction, of_friction in modes.items()
        for mode in of_friction
    )


def critical_rows(result: MachineModes, name: str) -> list[dict[str, Any]]:
    """Return order, mode, speed and damping ratio of the critical speeds of a linearisation."""
    return [
        {
            "order": critical.order,
            "name": result.name_at(name, critical.mode, critical.speed),
            "rpm": RPM_PER_RAD_S * critical.speed,
            "damping_ratio": critical.damping_ratio,
        }
        for critical in result.critical[name]
    ]


def _campbell_as_json(result: MachineModes, name: str) -> dict[str, Any]:
    computed = result.diagrams[name]
    return {
        "rpm": RPM_PER_RAD_S * computed.speed,
        "frequency_Hz": computed.frequency_hz.T,
        "damping_ratio": computed.damping_ratio.T,
        "name": [list(of_curve) for of_curve in zip(*result.names[name], strict=True)],
    }


def summary(result: MachineModes) -> str:
    """Return one paragraph about the modes."""
    sliding, stuck = (
        [number(mode.frequency_hz, 2) for mode in result.modes[name]] for name in (SLIDING, STUCK)
    )
    critical = ", ".join(number(RPM_PER_RAD_S * speed, 0) for speed in result.critical_speeds)
    load = f"with load {result.load}" if result.load else "with an empty drum"
    meets = f"them at {critical} rpm" if critical else "none of them"
    return (
        f"{len(sliding)} modes of the machine {load}{'' if result.gasket else ' without gasket'}: "
        f"{sliding[0]} to {sliding[-1]} Hz while friction slides, {stuck[0]} to {stuck[-1]} Hz "
        f"while it sticks. With sliding friction the unbalance meets {meets}."
    )


def about_damping(result: NaturalModes) -> str:
    """Return the sentence on modes without damping; "" if all modes have some."""
    when = {SLIDING: "while friction slides", STUCK: "while it sticks"}
    cases = []
    for name, words in when.items():
        modes = result.modes[name]
        undamped = [mode.name for mode in modes if abs(mode.damping_ratio) <= UNDAMPED]
        if undamped:
            which = "all modes" if len(undamped) == len(modes) else listed(undamped)
            cases.append(f"{which} {words}")
    if not cases:
        return ""
    return f"Undamped, as no damper and no gasket dissipates energy in them: {listed(cases)}."


def natural_modes_table(result: NaturalModes) -> Table:
    """Return the table of natural frequencies and damping ratios of all linearisations."""
    amplitude = number(MM_PER_M * result.amplitude, 1)
    frame = linearisations(result).set_index(["friction", "name"])
    both = frame.unstack("friction")  # NaN where a linearisation does not have the mode
    groups = (
        line(
            mode.name,
            [
                both[what, friction][mode.name]
                for friction in (STUCK, AMPLITUDE, SLIDING)
                for what in ("frequency_Hz", "damping_ratio")
            ],
        )
        for mode in result.modes[STUCK]
    )
    caption = (
        "Natural frequency and damping ratio of each mode. Sticks: friction holds, so that the "
        f"sponges of dampers are springs. {amplitude} mm: harmonic balance of the free motion at "
        "this amplitude; its mode continues the one that sticks. Slides: friction is saturated, "
        "only dashpots damp; its mode is the one of the same name. "
        "Roll, pitch and yaw turn about x, y and z."
    )
    columns = tuple(
        column
        for when in ("sticks", f"{amplitude} mm", "slides")
        for column in (Column(when, "Hz", 3), Column(f"{when}, damping ratio", form=damping_text))
    )
    return Table(caption, ("mode", *columns), tuple(groups))


def _critical_table(result: MachineModes) -> Table:
    groups = []
    for name in (SLIDING, STUCK):
        rows = [
            Row((row["name"], f"{row['order']:g}×", row["rpm"], row["damping_ratio"]))
            for row in critical_rows(result, name)
        ]
        if rows:
            groups.append(Group(TITLES[name], tuple(rows)))
    caption = (
        "Critical speeds: an order of the drum speed equals a natural frequency. A mode has the "
        "name of its shape at this speed."
    )
    columns = tuple(MODE[key] for key in ("mode", "order", "rpm", "damping_ratio"))
    return Table(caption, ("linearisation", *columns), tuple(groups), text_columns=3)


def _campbell_picture(result: MachineModes) -> Picture:
    caption = (
        "Campbell diagram. The gyroscopic effect of the drum bends the curves. Names at the left: "
        "shapes of a drum that stands still; at the right: shapes at the highest speed. Where two "
        "curves come near each other, they exchange their shapes. Whirl: roll and yaw together, "
        "the axis of the drum goes round with the drum (forward) or against it (backward). "
        "Circles: critical speeds of the orders 1 and 2, with the speed in rpm for order 1."
    )
    if result.run_up is not None:
        caption += (
            " Triangles: speeds at which a sensor has its largest amplitude in a run-up with one "
            "of the machine's loads, computed with all forces."
        )
    return picture(campbell_figure(result), "Natural frequencies over the drum speed.", caption)


def _amplitude_picture(result: MachineModes) -> Picture:
    caption = (
        "Frequency and damping ratio over the amplitude, by harmonic balance of the free motion. "
        "Small amplitudes: friction sticks. Between: it dissipates most. The amplitude is the "
        f"displacement of the middle of the tub, with angles times {MM_PER_M * ANGLE_ARM:g} mm. "
        "A curve ends where the motion cannot be followed."
    )
    return picture(amplitude_figure(result), "Frequency and damping over amplitude.", caption)


def _participation(result: MachineModes) -> Table:
    groups = tuple(
        Group(
            TITLES[name],
            tuple(Row((m.name, *(100.0 * m.participation).tolist())) for m in result.modes[name]),
        )
        for name in (SLIDING, STUCK)
    )
    caption = (
        "Participation of each coordinate of the tub, in percent. A mode has the name of a "
        "coordinate with a large part in it; no two have the same."
    )
    columns = tuple(Column(name, decimals=0) for name in COORDINATES)
    return Table(caption, ("linearisation", "mode", *columns), groups, text_columns=2)


def _sensitivity_picture(result: MachineModes, quantity: str) -> Picture:
    words = "frequency" if quantity == "frequency" else "damping ratio"
    return picture(
        sensitivity_figure(result, SLIDING, quantity),
        f"Sorted bars of the numbers that change the {words} of each mode most.",
        f"Numbers of the machine file that change the {words} most, {TITLES[SLIDING]}. A table is "
        "scaled as a whole. sensitivities.csv has all numbers and both linearisations.",
    )


def amplitudes_frame(result: MachineModes) -> pd.DataFrame:
    """Return the modes over their amplitude."""
    frames = (
        pd.DataFrame(
            {
                "mode": mode.name,
                "amplitude_mm": MM_PER_M * mode.amplitude,
                "frequency_Hz": mode.frequency_hz,
                "damping_ratio": mode.damping_ratio,
            }
        )
        for mode in result.over_amplitude
    )
    return pd.concat(frames, ignore_index=True)


def campbell_frame(result: MachineModes) -> pd.DataFrame:
    """Return the Campbell diagrams."""
    return pd.DataFrame(
        {
            "linearisation": name,
            "rpm": RPM_PER_RAD_S * speed,
            "curve": column + 1,
            "mode": result.names[name][index][column],
            "frequency_Hz": diagram.frequency_hz[index, column],
            "damping_ratio": diagram.damping_ratio[index, column],
            "mac": diagram.mac[index, column],
        }
        for name, diagram in result.diagrams.items()
        for index, speed in enumerate(diagram.speed)
        for column in range(diagram.value.shape[1])
    )


def sensitivities_frame(result: MachineModes) -> pd.DataFrame:
    """Return the sensitivities of all modes to all numbers."""
    return pd.DataFrame(
        {
            "linearisation": name,
            "mode": mode.name,
            "key": entry.key,
            "per": entry.unit.shown if entry.per_unit else "relative change",
            "relative_change_of_frequency": entry.frequency[index],
            "change_of_damping_ratio": entry.damping[index],
        }
        for name, entries in result.sensitivities.items()
        for entry in entries
        for index, mode in enumerate(result.modes[name])
    )
