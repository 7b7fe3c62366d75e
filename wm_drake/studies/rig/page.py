"""Page and tables of a bench test."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MM_PER_M, number
from wm_drake.report.page import Picture, picture
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.report.table import Group, Row, Table
from wm_drake.rigs import ForceLoop, RigRun
from wm_drake.studies.rig.figures import (
    DEG_PER_RAD,
    amplitude_text,
    force_scale,
    frequency_text,
    friction_law_figure,
    motion_scale,
    overlaid_figure,
    time_figure,
)
from wm_drake.studies.study import Facts

if TYPE_CHECKING:
    from wm_drake.studies.rig.study import RigResult

SAMPLES_KEPT = 4
"""Step between the samples of a loop that are written to its file."""


METHOD = (
    "The driven end moves as A sin(2 π f t). The loop shown is the steady state, in which every "
    "cycle is the same. The force is the force of the actuator on the component, positive in the "
    "direction of the displacement. A positive displacement lengthens a damper."
)


def rig_page(result: "RigResult", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    run = result.run
    return SectionedPage(
        f"Bench test: {run.title}",
        f"{_summary(run)} {result.effect}".strip(),
        [
            Section("loops", "Loops", tuple(_pictures(run))),
            Section("measures", "Derived quantities", tables=(_measures(run),)),
            Section("parameters", "Parameters", tables=(_numbers(run),)),
        ],
        [("Component", run.title), ("Loops", str(len(run.loops))), *facts.rows()],
        warnings=result.beyond,
        about="Steady-state force loops under harmonic motion, computed with the force laws.",
        method=METHOD,
    ).html()


def masses_table(run: RigRun, massless: RigRun) -> pd.DataFrame:
    """Return the effect of masses on each loop: differences from the loop without masses. [N]"""
    return pd.DataFrame(masses_rows(run, massless))


def masses_rows(run: RigRun, massless: RigRun) -> list[dict[str, Any]]:
    """Return the rows of `masses_table`."""
    rows = []
    for loop, bare in zip(run.loops, massless.loops, strict=True):
        difference = loop.force - bare.force
        peak = float(np.max(np.abs(bare.force)))
        rows.append(
            {
                "frequency_hz": loop.motion.frequency,
                "amplitude_mm": MM_PER_M * loop.motion.amplitude,
                "peak_force_without_N": peak,
                "peak_force_N": float(np.max(np.abs(loop.force))),
                "rms_difference_N": float(np.sqrt(np.mean(np.square(difference)))),
                "largest_difference_N": float(np.max(np.abs(difference))),
                "largest_difference_by_peak": float(np.max(np.abs(difference))) / peak
                if peak
                else float("nan"),
            }
        )
    return rows


def masses_sentence(run: RigRun, massless: RigRun) -> str:
    """Return a sentence on the loop that masses change most."""
    rows: list[dict[str, Any]] = masses_rows(run, massless)
    worst = max(rows, key=lambda row: row["largest_difference_N"])
    return (
        f"The masses change the force by up to {worst['largest_difference_N']:.3g} N, "
        f"{100.0 * worst['largest_difference_by_peak']:.2g} % of the peak without them "
        f"({worst['frequency_hz']:.3g} Hz, {worst['amplitude_mm']:.3g} mm; there "
        f"{worst['rms_difference_N']:.2g} N root mean square)."
    )


def loop_file(loop: ForceLoop) -> str:
    """Return the file name of a loop, made of its frequency and amplitude."""
    return f"loop_{frequency_text(loop)}_{amplitude_text(loop)}.csv".replace(" ", "")


def loop_table(loop: ForceLoop) -> pd.DataFrame:
    """Return a loop as a table that `wm-drake identify` reads, with units in the column heads."""
    factor, name, unit = motion_scale(loop.rotates)
    force, newton = force_scale(loop.rotates)
    columns = {
        "time_s": loop.time,
        f"{name}_{unit}": factor * loop.displacement,
        f"{'rate' if loop.rotates else 'velocity'}_{unit}_s": factor * loop.velocity,
        f"{force}_{newton.replace(' ', '')}": loop.force,
    }
    return pd.DataFrame({head: values[::SAMPLES_KEPT] for head, values in columns.items()})


def measures_table(run: RigRun) -> pd.DataFrame:
    """Return the quantities derived from each loop, with units in the column names.

    All values are in SI except frequency, amplitude and loss angle.
    """
    rotates = run.bench.rotates
    factor, _, unit = motion_scale(rotates)
    rows = []
    for loop, m in zip(run.loops, run.measures, strict=True):
        forces = (
            {
                "peak_moment_Nm": m.peak_force,
                "energy_per_cycle_J": m.energy_per_cycle,
                "equivalent_damping_Nms_per_rad": m.equivalent_damping,
                "dynamic_stiffness_Nm_per_rad": m.dynamic_stiffness,
            }
            if rotates
            else {
                "peak_force_N": m.peak_force,
                "energy_per_cycle_J": m.energy_per_cycle,
                "equivalent_damping_Ns_per_m": m.equivalent_damping,
                "dynamic_stiffness_N_per_m": m.dynamic_stiffness,
            }
        )
        motion = {
            "frequency_hz": loop.motion.frequency,
            f"amplitude_{unit}": factor * loop.motion.amplitude,
        }
        rows.append({**motion, **forces, "loss_angle_deg": DEG_PER_RAD * m.loss_angle})
    return pd.DataFrame(rows)


def measures_header(run: RigRun) -> tuple[str, ...]:
    """Return the column heads for the cells of `measures_cells`."""
    rotates = run.bench.rotates
    if rotates:
        units = (
            "peak moment, N\u00a0m",
            "energy per cycle, mJ",
            "equivalent damping, N\u00a0m\u00a0s/rad",
            "dynamic stiffness, N\u00a0m/rad",
        )
    else:
        units = (
            "peak force, N",
            "energy per cycle, mJ",
            "equivalent damping, N\u00a0s/mm",
            "dynamic stiffness, N/mm",
        )
    return ("frequency, Hz", f"amplitude, {motion_scale(rotates)[2]}", *units, "loss angle, deg")


def measures_cells(run: RigRun) -> list[tuple[str, ...]]:
    """Return the quantities derived from each loop as text, one tuple of cells per loop."""
    cells: list[tuple[str, ...]] = []
    per = 1.0 if run.bench.rotates else 1.0 / MM_PER_M
    for loop, m in zip(run.loops, run.measures, strict=True):
        cells.append(
            (
                f"{loop.motion.frequency:.3g}",
                amplitude_text(loop).split()[0],
                number(m.peak_force, 2),
                f"{1e3 * m.energy_per_cycle:.4g}",
                number(per * m.equivalent_damping, 3),
                number(per * m.dynamic_stiffness, 2),
                number(DEG_PER_RAD * m.loss_angle, 1),
            )
        )
    return cells


def _measures(run: RigRun) -> Table:
    caption = (
        "Quantities derived from each loop. Energy: area of the loop. Equivalent damping: "
        "coefficient of the viscous damper that dissipates the same energy per cycle. Dynamic "
        "stiffness and loss angle: amplitude ratio and phase lead of the fundamental of the force "
        "with respect to the motion."
    )
    groups = tuple(Group(cells[0], (Row(cells[1:]),)) for cells in measures_cells(run))
    return Table(caption, measures_header(run), groups)


def _numbers(run: RigRun) -> Table:
    groups = tuple(Group(key, (Row((value, source or "–")),)) for key, value, source in run.numbers)
    caption = "Parameters of the component."
    return Table(caption, ("key", "value", "source"), groups, text_columns=3)


def _pictures(run: RigRun) -> list[Picture]:
    largest = max(run.loops, key=lambda loop: (loop.motion.amplitude, -loop.motion.frequency))
    which = f"{frequency_text(largest)}, {amplitude_text(largest)}"
    pictures = [
        picture(
            time_figure(largest),
            f"Motion and force over one period, and the loop, at {which}.",
            f"One period at {which}: motion and force over time, and the force over displacement "
            "and over velocity (form of [A] Figs. 5, 8, 12 and [C] Figs. 4, 5).",
        )
    ]
    frequencies = _distinct(run.loops, frequency_text)
    amplitudes = _distinct(run.loops, amplitude_text)
    if len(run.loops) > 1:
        pictures += [
            picture(
                overlaid_figure(run.loops, panel=frequency_text, line=amplitude_text, over=over),
                f"Force over {over}, one panel per frequency.",
                f"Force over {over} for all amplitudes, one panel per frequency (form of [C] Fig. "
                "6).",
            )
            for over in ("displacement", "velocity")
        ]
    shared = [a for a in amplitudes if sum(amplitude_text(loop) == a for loop in run.loops) > 1]
    if len(frequencies) > 1 and shared:
        loops = [loop for loop in run.loops if amplitude_text(loop) in shared]
        pictures.append(
            picture(
                overlaid_figure(
                    loops, panel=amplitude_text, line=frequency_text, over="displacement"
                ),
                "Force over displacement, one panel per amplitude.",
                "Force over displacement for all frequencies, one panel per amplitude (form of [C] "
                "Figs. 7 and 14).",
            )
        )
    law = friction_law_figure(run)
    if law is not None:
        pictures.append(
            picture(
                law,
                "Friction force over sliding velocity at several deformation rates.",
                "MSTV law: friction force over the sliding velocity of the sponge, at constant "
                "deformation rates (form of [C] Fig. 12).",
            )
        )
    return pictures


def _distinct(loops: Sequence[ForceLoop], text: Callable[[ForceLoop], str]) -> list[str]:
    return list(dict.fromkeys(map(text, loops)))


def _summary(run: RigRun) -> str:
    force, unit = force_scale(run.bench.rotates)
    peaks = [m.peak_force for m in run.measures]
    energies = [1e3 * m.energy_per_cycle for m in run.measures]
    if len(run.loops) == 1:
        loop = run.loops[0]
        return (
            f"At {frequency_text(loop)} and {amplitude_text(loop)}, the peak {force} is "
            f"{number(peaks[0], 2)} {unit}, and the energy per cycle is "
            f"{number(energies[0], 2)} mJ."
        )
    first, last = peaks.index(min(peaks)), peaks.index(max(peaks))
    at = [f"{frequency_text(run.loops[k])}, {amplitude_text(run.loops[k])}" for k in (first, last)]
    return (
        f"{len(run.loops)} loops were computed. The peak {force} ranges from "
        f"{number(peaks[first], 2)} {unit} ({at[0]}) to {number(peaks[last], 2)} {unit} ({at[1]}). "
        f"The energy per cycle ranges from {number(min(energies), 2)} to "
        f"{number(max(energies), 2)} mJ."
    )
