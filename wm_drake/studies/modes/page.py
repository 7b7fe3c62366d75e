"""Report of the modes of a machine: one self-contained HTML file, and tables for CSV files."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from rich import table as terminal

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.model.scene import Scene
from wm_drake.report.formatting import MISSING, MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.table import Group, Row, Table, parameter_table
from wm_drake.simulation.records import versions
from wm_drake.studies.modes.figures import (
    TITLES,
    amplitude_figure,
    campbell_figure,
    energy_figure,
    sensitivity_figure,
    shapes_figure,
)
from wm_drake.studies.modes.sensitivity import Sensitivity
from wm_drake.studies.modes.study import SLIDING, STUCK, MachineModes, NaturalModes
from wm_drake.studies.study import Facts


def modes_page(result: MachineModes, facts: Facts, replays: Mapping[str, str]) -> str:
    """Return the page as text of one self-contained HTML file.

    Args:
        result: Modes of a machine.
        facts: How they were computed.
        replays: Names of the files with a 3D animation, by name of the mode.
    """
    outlines = Scene(result.parameters).tub_outlines()
    return render(
        Path(__file__).with_name("page.html"),
        title=f"Modes of machine {result.parameters.name}",
        about=result.parameters.about,
        summary=summary(result),
        warnings=list(facts.warnings),
        modes=natural_modes_table(result),
        critical=_critical_table(result),
        campbell=_campbell_picture(result),
        amplitude=_amplitude_picture(result),
        shapes=[
            picture(
                shapes_figure(result.modes[name], outlines),
                f"Outlines of the tub in each mode, {TITLES[name]}.",
                f"Mode shapes, {TITLES[name]}. Grey: at rest. Blue and vermilion: both ends of "
                "the motion, enlarged. Rows: seen from the front, from the right, from above.",
            )
            for name in (SLIDING, STUCK)
        ],
        participation=_participation_table(result),
        energy=picture(
            energy_figure(result),
            "Bars with the shares of the elements in strain energy and dissipation of each mode.",
            "Share of each element in the strain energy and in the dissipated energy of each mode. "
            "Negative shares, which preload can cause, are not drawn; modes.csv has them.",
        ),
        sensitivity=[_sensitivity_picture(result, q) for q in ("frequency", "damping")],
        replays=list(replays.items()),
        facts=_facts(result, facts.command),
        numbers=parameter_table(result.parameters),
    )


def summary(result: MachineModes) -> str:
    """Return one paragraph about the modes."""
    sliding, stuck = result.modes[SLIDING], result.modes[STUCK]
    critical = ", ".join(number(RPM_PER_RAD_S * speed, 0) for speed in result.critical_speeds)
    load = f"with load {result.load}" if result.load else "with an empty drum"
    sentences = [
        f"{len(sliding)} modes of the machine {load}"
        f"{'' if result.gasket else ' without gasket'}: "
        f"{number(sliding[0].frequency_hz, 2)} to {number(sliding[-1].frequency_hz, 2)} Hz while "
        f"friction slides, {number(stuck[0].frequency_hz, 2)} to "
        f"{number(stuck[-1].frequency_hz, 2)} Hz while it sticks.",
        f"With sliding friction the unbalance meets them at {critical} rpm."
        if critical
        else "With sliding friction the unbalance meets none of them.",
    ]
    return " ".join(sentences)


def terminal_table(result: MachineModes) -> terminal.Table:
    """Return natural frequencies and damping ratios for the terminal."""
    table = terminal.Table(title=f"Modes of machine '{result.parameters.name}'")
    for head in ("friction", "mode", "frequency, Hz", "damping ratio"):
        table.add_column(head, justify="left" if head in ("friction", "mode") else "right")
    at_amplitude = f"{MM_PER_M * result.amplitude:g} mm"
    for friction, modes in (
        (STUCK, result.modes[STUCK]),
        (at_amplitude, result.at_amplitude),
        (SLIDING, result.modes[SLIDING]),
    ):
        for mode in modes:
            values = ((mode.frequency_hz, 3), (mode.damping_ratio, 4))
            cells = (MISSING if one is None else f"{one:.{digits}f}" for one, digits in values)
            table.add_row(friction, mode.name, *cells)
    return table


def natural_modes_table(result: MachineModes | NaturalModes) -> Table:
    """Return the table of natural frequencies and damping ratios of all linearisations."""
    groups = []
    at_amplitude = {value.name: value for value in result.at_amplitude}
    for mode in result.modes[STUCK]:
        sliding = next((m for m in result.modes[SLIDING] if m.name == mode.name), None)
        value = at_amplitude[mode.name]
        cells = [number(mode.frequency_hz, 3), number(mode.damping_ratio, 4)]
        cells += [
            MISSING if one is None else number(one, digits)
            for one, digits in ((value.frequency_hz, 3), (value.damping_ratio, 4))
        ]
        cells += (
            [number(sliding.frequency_hz, 3), number(sliding.damping_ratio, 4)]
            if sliding
            else [MISSING, MISSING]
        )
        groups.append(Group(mode.name, (Row(tuple(cells)),)))
    amplitude = number(MM_PER_M * result.amplitude, 1)
    caption = (
        "Natural frequency and damping ratio of each mode. Sticks: friction holds, so that the "
        f"sponges of dampers are springs. {amplitude} mm: harmonic balance of the free motion at "
        "this amplitude; its mode continues the one that sticks. Slides: friction is saturated, "
        "only dashpots damp; its mode is the one of the same name. "
        "Roll, pitch and yaw turn about x, y and z."
    )
    heads = [
        f"{when}, {what}"
        for when in ("sticks", f"{amplitude} mm", "slides")
        for what in ("Hz", "damping ratio")
    ]
    return Table(caption, ("mode", *heads), tuple(groups))


def _critical_table(result: MachineModes) -> Table:
    groups = []
    for name in (SLIDING, STUCK):
        rows = [
            Row(
                (
                    result.modes[name][critical.mode].name,
                    f"{critical.order:g}×",
                    number(RPM_PER_RAD_S * critical.speed, 1),
                    number(critical.damping_ratio, 4),
                )
            )
            for critical in result.critical[name]
        ]
        if rows:
            groups.append(Group(TITLES[name], tuple(rows)))
    caption = (
        "Critical speeds: an order of the drum speed equals a natural frequency. The names are "
        "those of a drum that stands still."
    )
    header = ("linearisation", "mode", "order", "speed, rpm", "damping ratio")
    return Table(caption, header, tuple(groups), text_columns=3)


def _campbell_picture(result: MachineModes) -> Picture:
    caption = (
        "Campbell diagram. The gyroscopic effect of the drum bends the curves. Circles: critical "
        "speeds of the orders 1 and 2, with the speed in rpm for order 1."
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
        "displacement of the middle of the tub, with angles times 250 mm. A curve ends where the "
        "motion cannot be followed."
    )
    return picture(amplitude_figure(result), "Frequency and damping over amplitude.", caption)


def _participation_table(result: MachineModes) -> Table:
    groups = []
    for name in (SLIDING, STUCK):
        rows = tuple(
            Row((mode.name, *(number(100.0 * float(share), 0) for share in mode.participation)))
            for mode in result.modes[name]
        )
        groups.append(Group(TITLES[name], rows))
    caption = (
        "Participation of each coordinate of the tub, in percent. A mode has the name of a "
        "coordinate with a large part in it; no two have the same."
    )
    return Table(caption, ("linearisation", "mode", *COORDINATES), tuple(groups), text_columns=2)


def _sensitivity_picture(result: MachineModes, quantity: str) -> Picture:
    words = "frequency" if quantity == "frequency" else "damping ratio"
    return picture(
        sensitivity_figure(result, SLIDING, quantity),
        f"Sorted bars of the numbers that change the {words} of each mode most.",
        f"Numbers of the machine file that change the {words} most, {TITLES[SLIDING]}. A table is "
        "scaled as a whole. sensitivities.csv has all numbers and both linearisations.",
    )


def _facts(result: MachineModes, command: str) -> list[tuple[str, str]]:
    return [
        ("Command", command),
        ("Load", result.load or "empty drum"),
        ("Gasket", "yes" if result.gasket else "no"),
        ("Software", ", ".join(f"{name} {text}" for name, text in versions().items())),
    ]


def modes_table(result: MachineModes) -> pd.DataFrame:
    """Return the modes with shapes, participation and shares of the elements, for a CSV file."""
    rows = []
    for name in (STUCK, SLIDING):
        for mode in result.modes[name]:
            row = {
                "linearisation": name,
                "mode": mode.name,
                "frequency_Hz": mode.frequency_hz,
                "damping_ratio": mode.damping_ratio,
            }
            for coordinate, value in zip(COORDINATES, mode.shape, strict=True):
                unit = "rad" if coordinate in COORDINATES[:3] else "m"
                row[f"shape_{coordinate}_real_{unit}"] = float(value.real)
                row[f"shape_{coordinate}_imag_{unit}"] = float(value.imag)
            for coordinate, share in zip(COORDINATES, mode.participation, strict=True):
                row[f"participation_{coordinate}"] = float(share)
            for kind in ("strain_energy", "dissipation"):
                for element, share in zip(result.elements, getattr(mode, kind), strict=True):
                    row[f"{kind} {element}"] = float(share)
            rows.append(row)
    return pd.DataFrame(rows)


def amplitudes_table(result: MachineModes) -> pd.DataFrame:
    """Return the modes over their amplitude, for a CSV file."""
    return pd.DataFrame(
        [
            {
                "mode": mode.name,
                "amplitude_mm": MM_PER_M * amplitude,
                "frequency_Hz": frequency,
                "damping_ratio": ratio,
            }
            for mode in result.over_amplitude
            for amplitude, frequency, ratio in zip(
                mode.amplitude, mode.frequency_hz, mode.damping_ratio, strict=True
            )
        ],
        columns=["mode", "amplitude_mm", "frequency_Hz", "damping_ratio"],
    )


def campbell_table(result: MachineModes) -> pd.DataFrame:
    """Return the Campbell diagrams, for a CSV file."""
    rows = []
    for name, diagram in result.diagrams.items():
        for index, speed in enumerate(diagram.speed):
            for mode, frequency in enumerate(diagram.frequency_hz[index]):
                rows.append(
                    {
                        "linearisation": name,
                        "rpm": RPM_PER_RAD_S * float(speed),
                        "mode": result.modes[name][mode].name,
                        "frequency_Hz": float(frequency),
                        "damping_ratio": float(diagram.damping_ratio[index, mode]),
                        "mac": float(diagram.mac[index, mode]),
                    }
                )
    return pd.DataFrame(rows)


def sensitivities_table(result: MachineModes) -> pd.DataFrame:
    """Return the sensitivities of all modes to all numbers, for a CSV file."""
    rows = []
    for name, entries in result.sensitivities.items():
        for entry in entries:
            for index, mode in enumerate(result.modes[name]):
                rows.append(_sensitivity_row(name, mode.name, entry, index))
    return pd.DataFrame(rows)


def _sensitivity_row(name: str, mode: str, entry: Sensitivity, index: int) -> dict[str, object]:
    return {
        "linearisation": name,
        "mode": mode,
        "key": entry.key,
        "per": entry.unit.shown if entry.per_unit else "relative change",
        "relative_change_of_frequency": float(entry.frequency[index]),
        "change_of_damping_ratio": float(entry.damping[index]),
    }
