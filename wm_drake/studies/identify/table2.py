"""`identify table2`: k1 and c1 of the Coulomb model fitted to each test, beside [C] Table 2.

[C] fits k1 and c1 of the Coulomb model to each test and prints how they drift with frequency and
amplitude. Here the tests are loops of the MSTV model with the numbers of [C] section 4.2, or
measured ones. Assumptions: both models have the same f_max and the same c2 ([C] Eq. (3) holds for
all laws); f_max is not printed.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table as TerminalTable
from scipy.optimize import brentq

from wm_drake.errors import input_error
from wm_drake.parameters import MeasuredLoop, load_component, read_loops
from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.recorded import ChannelNames
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Figure, Line, Mark, Points, in_grid
from wm_drake.report.page import Section, SectionedPage, picture
from wm_drake.report.table import Column, Columns, Table, line, table_of
from wm_drake.rigs import Harmonic, damper_bench, force_loops
from wm_drake.rigs.measured import HarmonicMotion, measured_motion
from wm_drake.studies.components import existing_files
from wm_drake.studies.executor import Executor
from wm_drake.studies.fitting.methods import least_squares
from wm_drake.studies.identify.figures import LAW_COLOURS
from wm_drake.studies.identify.inputs import units_of
from wm_drake.studies.identify.models import Given, damper_model
from wm_drake.studies.identify.options import IdentifyTable2Options
from wm_drake.studies.identify.problem import fit_problem
from wm_drake.studies.inputs import LOOP_WORDS, quantities_of
from wm_drake.studies.rig.figures import loop_panel
from wm_drake.studies.study import Facts, Result, Task

BOUNDS = {"sponge_stiffness": (50e3, 300e3), "sponge_damping": (0.0, 10e3)}
"""Bounds of [C] section 3.3. [N/m, N s/m]"""

MM = 1e-3
SAME = 0.02
"""Relative difference of frequency and amplitude up to which a test is one of the printed ones."""


def printed_table() -> pd.DataFrame:
    """Return [C] Table 2: frequency_hz, amplitude_mm, k1 (N/mm), c1 (N s/mm)."""
    return pd.read_csv(COMPONENTS_FOLDER / "mstv_table2_coulomb.csv", comment="#")


def mstv_motions(damper: DamperNumbers, motions: Sequence[Harmonic]) -> list[HarmonicMotion]:
    """Return loops of a damper as if they had been measured."""
    measured_loops = []
    for loop in force_loops(damper_bench(damper), motions):
        name = f"{loop.motion.frequency:g} Hz, {loop.motion.amplitude / MM:g} mm"
        measured = measured_motion(
            MeasuredLoop(name, name, loop.time, loop.displacement, loop.force, False)
        )
        assert isinstance(measured, HarmonicMotion)
        measured_loops.append(measured)
    return measured_loops


def coulomb_fits(
    motions: Sequence[HarmonicMotion],
    f_max: float,
    slider_damping: float,
    progress: Callable[[int], None] = lambda done: None,
) -> pd.DataFrame:
    """Return k1 and c1 of the Coulomb model of each test beside the printed ones, and their ratios.

    Units are those of [C], N/mm and N s/mm; a test that is not printed has NaN there.

    Args:
        motions: Measured tests.
        f_max: Friction force of the Coulomb model. [N]
        slider_damping: Its c2. [N s/m]
        progress: Called after each test with the number of tests that are done.
    """
    known = {"friction_force": f_max, "transition_velocity": 0.0, "slider_damping": slider_damping}
    printed, rows = printed_table(), []
    for measured in motions:
        model = damper_model("stv_sponge", [measured], Given(BOUNDS, known))
        fit = least_squares(fit_problem(model, [measured]), starts=3, screened=16)
        f, a = measured.motion.frequency, measured.motion.amplitude / MM
        near = (np.abs(printed.frequency_hz / f - 1.0) < SAME) & (
            np.abs(printed.amplitude_mm / a - 1.0) < SAME
        )
        same = printed[near]
        row = {"frequency_hz": f, "amplitude_mm": a}
        for name, field in (("k1", "sponge_stiffness"), ("c1", "sponge_damping")):
            value = float(same[name].iloc[0]) if len(same) else float("nan")
            fitted = fit[field].value * MM
            row |= {name: value, f"{name} fitted": fitted, f"{name} ratio": fitted / value}
        rows.append({**row, "RMSE/peak": fit.tests[0].normalised})
        progress(len(rows))
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class FrequencyTrend:
    """Peak force of MSTV loops of one amplitude over frequency, for [C] section 4.1.

    Attributes:
        frequencies: Rising. [Hz]
        printed: Peak force with the numbers of the damper. [N]
        without_dashpots: Peak force with c1 and c2 of nearly zero. [N]
        friction: f_max at each frequency with which the peak would be that of the lowest. [N]
    """

    frequencies: tuple[float, ...]
    printed: tuple[float, ...]
    without_dashpots: tuple[float, ...]
    friction: tuple[float, ...]


def frequency_trend(
    damper: DamperNumbers, frequencies: Sequence[float], amplitude: float
) -> FrequencyTrend:
    """Return how the peak force goes with frequency, and the friction that would keep it level.

    Without c1 and c2 the law depends on quotients of rates only, so its loops do not depend on the
    frequency; each dashpot makes the force grow. A force that falls with frequency, as [C] section
    4.1 says, needs a friction that falls with velocity.

    Args:
        damper: MSTV damper.
        frequencies: Rising. [Hz]
        amplitude: Of the motion. [m]
    """

    def peaks(**changes: float) -> tuple[float, ...]:
        bench = damper_bench(damper.model_copy(update=changes))
        motions = [Harmonic(f, amplitude) for f in frequencies]
        return tuple(float(np.max(np.abs(x.force))) for x in force_loops(bench, motions))

    printed = peaks()
    least = float(getattr(damper, "friction_force"))  # noqa: B009
    ends = 1e-3 * least, least
    friction = [
        float(brentq(lambda f, k=k: peaks(friction_force=f)[k] - printed[0], *ends, rtol=1e-3))
        for k in range(1, len(frequencies))
    ]
    return FrequencyTrend(
        tuple(frequencies),
        printed,
        peaks(sponge_damping=1e-3, slider_damping=1e-3),
        (least, *friction),
    )


def mstv_of_c() -> DamperNumbers:
    """Return the shipped damper of [C]."""
    parameters = load_component("mstv_damper").parameters
    assert isinstance(parameters, DamperNumbers)
    return parameters


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
class IdentifyTable2Result(Result):
    """Fits of the Coulomb model beside the printed ones, and the trend of the peak force.

    Attributes:
        fits: Table of `coulomb_fits`.
        trend: Trend over frequency.
        source: What was fitted, in words.
    """

    fits: pd.DataFrame
    trend: FrequencyTrend
    source: str

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

    def page(self, facts: Facts) -> str:
        """Return the page as text of one self-contained HTML file."""
        drift = picture(
            drift_figure(self.fits),
            "Fitted and printed k1 and c1 over frequency, one line per amplitude.",
            "k1 and c1 of the Coulomb model over frequency: fitted (lines) and printed in [C] "
            "Table 2 (crosses).",
        )
        claim = (
            '[C] section 4.1: "the friction forces decrease when the exciting frequencies become '
            'higher".'
        )
        return SectionedPage(
            "Coulomb model fitted to each test ([C] Table 2)",
            " ".join(sentences(self.fits, self.trend)),
            [
                Section("comparison", "Fitted against printed", (drift,)),
                Section("fits", "Fitted and printed values", tables=(fits_shown(self.fits),)),
                Section("trend", "Force over frequency", tables=(_trends(self.trend),), text=claim),
            ],
            facts.rows(),
            about=self.source,
        ).html()


class IdentifyTable2Task(Task):
    """The fits with checked options."""

    def __init__(self, options: IdentifyTable2Options) -> None:
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

    def run(self, executor: Executor) -> IdentifyTable2Result:
        """Fit each test, and compute the trend."""
        numbers = self._number("friction_force"), self._number("slider_damping")
        with executor.progress(len(self.motions), "fits") as progress:
            fits = coulomb_fits(self.motions, *numbers, progress)
        trend = frequency_trend(self.damper, FREQUENCIES, AMPLITUDE)
        return IdentifyTable2Result(fits, trend, self.source)


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
    motions, names = [], ChannelNames(units=units_of(units), words=LOOP_WORDS)
    for loop in read_loops(existing_files(files), names):
        motion = measured_motion(loop)
        if not isinstance(motion, HarmonicMotion) or loop.rotates:
            raise input_error(
                "is no sine of displacement; [C] Table 2 is of sines", where=loop.path
            )
        motions.append(motion)
    return motions
