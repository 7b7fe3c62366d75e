"""`identify table2`: the Coulomb model fitted to each test, as in [C] Table 2."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from rich.table import Table

from wm_drake.errors import input_error
from wm_drake.parameters import read_loops
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.units import Unit
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
from wm_drake.studies.identification.inputs import units_of
from wm_drake.studies.identification.options import Table2Options
from wm_drake.studies.identification.table2_page import fits_shown, sentences, table2_page
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Result, Task

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

    def terminal(self) -> list[Table | str]:
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
