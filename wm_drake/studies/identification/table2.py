"""`identify table2`: the Coulomb model fitted to each test, as in [C] Table 2."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table as TerminalTable

from wm_drake.errors import input_error
from wm_drake.parameters import read_loops
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Figure, Line, Mark, Points, in_grid
from wm_drake.report.page import Section, SectionedPage, picture
from wm_drake.report.table import Column, Columns, Table, line, table_of
from wm_drake.rigs import Harmonic
from wm_drake.rigs.measured import HarmonicMotion, measured_motion
from wm_drake.studies.components import existing_files
from wm_drake.studies.identification.drift import (
    MM,
    FrequencyTrend,
    coulomb_fits,
    frequency_trend,
    mstv_motions,
    mstv_of_c,
    printed_table,
)
from wm_drake.studies.identification.figures import LAW_COLOURS
from wm_drake.studies.identification.inputs import units_of
from wm_drake.studies.identification.options import Table2Options
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.rig.figures import loop_panel
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Facts, Result, Task


def table2_page(result: "Table2Result", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    drift = picture(
        drift_figure(result.fits),
        "Fitted and printed k1 and c1 over frequency, one line per amplitude.",
        "k1 and c1 of the Coulomb model over frequency: fitted (lines) and printed in [C] Table 2 "
        "(crosses).",
    )
    claim = (
        '[C] section 4.1: "the friction forces decrease when the exciting frequencies become '
        'higher".'
    )
    return SectionedPage(
        "Coulomb model fitted to each test ([C] Table 2)",
        " ".join(sentences(result.fits, result.trend)),
        [
            Section("comparison", "Fitted against printed", (drift,)),
            Section("fits", "Fitted and printed values", tables=(fits_shown(result.fits),)),
            Section("trend", "Force over frequency", tables=(_trends(result.trend),), text=claim),
        ],
        facts.rows(),
        about=result.source,
    ).html()


def sentences(fits: pd.DataFrame, trend: FrequencyTrend) -> list[str]:
    """Return what the fits and the trends say, in words."""
    texts = []
    known = fits.dropna(subset=["k1", "c1"])
    if len(known):
        ratios = {
            name: float(np.exp(np.mean(np.log(known[f"{name} ratio"].clip(lower=1e-6)))))
            for name in ("k1", "c1")
        }
        texts.append(
            f"Over {len(known)} printed tests the fitted k1 is {ratios['k1']:.3g} times and c1 "
            f"{ratios['c1']:.3g} times the printed one (geometric mean)."
        )
    rise, free = (peaks[-1] / peaks[0] - 1.0 for peaks in (trend.printed, trend.without_dashpots))
    low, high = (f"{f:g} Hz" for f in (trend.frequencies[0], trend.frequencies[-1]))
    texts.append(
        "[C] section 4.1 says that the friction force falls with frequency. With its printed "
        f"numbers the peak force grows by {100 * rise:.2g} % from {low} to {high} at 1 mm, because "
        f"c1 and c2 do; without them it changes by {100 * free:.1g} %, because the MSTV friction "
        "depends on a quotient of velocities only. Even a level peak needs a friction that falls "
        f"with velocity: f_max from {trend.friction[0]:.3g} N at {low} to "
        f"{trend.friction[-1]:.3g} N at {high}."
    )
    return texts


COLUMNS = {
    "frequency_hz": Column("frequency", "Hz"),
    "amplitude_mm": Column("amplitude", "mm"),
    "k1": Column("k1 printed", "N/mm", 1),
    "k1 fitted": Column("k1 fitted", decimals=1),
    "k1 ratio": Column("ratio", decimals=2),
    "c1": Column("c1 printed", "N s/mm", 2),
    "c1 fitted": Column("c1 fitted", decimals=2),
    "c1 ratio": Column("ratio", decimals=2),
    "RMSE/peak": Column("RMSE / peak", decimals=3),
}
"""Columns of the fits."""


def fits_shown(fits: pd.DataFrame) -> Table:
    """Return the fit of each test beside the printed one."""
    caption = (
        "Each test fitted alone, within the bounds of [C] section 3.3: k1 from 50 to 300 N/mm, c1 "
        "from 0 to 10 N s/mm."
    )
    return table_of(fits, caption, COLUMNS)


def _trends(trend: FrequencyTrend) -> Table:
    rows = {
        "peak force, printed numbers": trend.printed,
        "peak force, c1 and c2 nearly zero": trend.without_dashpots,
        "f_max for the peak of the first": trend.friction,
    }
    columns = (Column(f"{f:g} Hz", decimals=1) for f in trend.frequencies)
    heads: Columns = ("loops of 1 mm, N", *columns)
    groups = tuple(line(name, values) for name, values in rows.items())
    return Table("Peak force of the MSTV damper over frequency.", heads, groups)


def drift_figure(fits: pd.DataFrame) -> Figure:
    """Return fitted and printed k1 and c1 over frequency."""
    rounded = fits.assign(amplitude_mm=fits.amplitude_mm.round(3))
    panels = []
    for name, unit in (("k1", "N/mm"), ("c1", "N s/mm")):
        marks: list[Mark] = []
        for k, (amplitude, rows) in enumerate(rounded.groupby("amplitude_mm")):
            color, key = LAW_COLOURS[k % len(LAW_COLOURS)], f"{amplitude:g} mm"
            ordered = rows.sort_values("frequency_hz")
            x, fitted = ordered.frequency_hz.to_numpy(), ordered[f"{name} fitted"].to_numpy()
            marks.append(Line(x, fitted, color=color, symbol="circle", size=5.0, key=key))
            printed = ordered[name].to_numpy()
            marks.append(Points(x, printed, color=color, symbol="x-thin", size=9.0, key=key))
        panels.append(loop_panel("", marks, "frequency, Hz", f"{name}, {unit}"))
    return Figure(panels=in_grid(panels, 2), height=230.0, key_title="amplitude")


FREQUENCIES = (1.0, 3.0, 6.67, 10.0)
"""Frequencies of [C] Table 1. [Hz]"""

AMPLITUDE = 1e-3
"""Amplitude of [C] Fig. 7. [m]"""


@dataclass(frozen=True)
class Table2Result(Result):
    """Fits of the Coulomb model beside the printed ones, and the trend of the peak force.

    Attributes:
        fits: Table of `coulomb_fits`.
        trend: Trend over frequency.
        source: What was fitted, in words.
    """

    fits: pd.DataFrame
    trend: FrequencyTrend
    source: str
    page = table2_page

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the fits."""
        return {"table2": self.fits}

    def as_json(self) -> dict[str, Any]:
        """Return fits and trend for JSON."""
        rows = json.loads(self.fits.to_json(orient="records", double_precision=15))
        return {"tests": rows, "peak_force_over_frequency": asdict(self.trend)}

    def terminal(self) -> list[TerminalTable | str]:
        """Return the fits, and what they and the trend say."""
        return [fits_shown(self.fits).terminal(self.source), *sentences(self.fits, self.trend)]


class Table2Task(Task):
    """The fits with checked options."""

    def __init__(self, options: Table2Options) -> None:
        """Read the tests."""
        self.damper = _damper(options.friction_force)
        if units_of(options.units) and not options.files:
            raise input_error("is about measured files; give at least one", where="--units")
        force = f"f_max = {self._number('friction_force'):g} N."
        if options.files:
            self.source = f"{len(options.files)} measured tests, {force}"
            self.motions = _measured_motions(options.files, options.units)
        else:
            self.source = f"Loops of the MSTV damper of [C] section 4.2, {force}"
            table = printed_table()
            pairs = zip(table.frequency_hz, table.amplitude_mm, strict=True)
            self.motions = mstv_motions(self.damper, [Harmonic(f, a * MM) for f, a in pairs])

    def _number(self, name: str) -> float:
        return float(getattr(self.damper, name))

    def run(self, executor: Executor) -> Table2Result:
        """Fit each test, and compute the trend."""
        numbers = self._number("friction_force"), self._number("slider_damping")
        with executor.progress(len(self.motions), "fits") as progress:
            fits = coulomb_fits(self.motions, *numbers, progress)
        trend = frequency_trend(self.damper, FREQUENCIES, AMPLITUDE)
        return Table2Result(fits, trend, self.source)


def _damper(friction_force: str | None) -> DamperNumbers:
    """Return the MSTV damper of [C], with f_max of the option `--friction-force` if it is given."""
    damper = mstv_of_c()
    if friction_force is None:
        return damper
    force = quantities_of(friction_force, Unit("N", "N"), "--friction-force")[0]
    if not force > 0.0:
        raise input_error(f"is {force:g} N; allowed is > 0", where="--friction-force")
    return damper.model_copy(update={"friction_force": force})


def _measured_motions(files: Sequence[Path], units: str | None) -> list[HarmonicMotion]:
    """Return the motions of measured files, which have to be sines of displacement."""
    motions = []
    for loop in read_loops(existing_files(files), units_of(units)):
        motion = measured_motion(loop)
        if not isinstance(motion, HarmonicMotion) or loop.rotates:
            raise input_error(
                "is no sine of displacement; [C] Table 2 is of sines", where=loop.path
            )
        motions.append(motion)
    return motions
