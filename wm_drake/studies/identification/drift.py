"""[C] Table 2: k1 and c1 of the Coulomb model fitted to each test alone, beside the printed ones.

[C] fits k1 and c1 of the Coulomb model to each test and prints how they drift with frequency and
amplitude. Here the tests are loops of the MSTV model with the numbers of [C] section 4.2, or
measured ones. Assumptions: both models have the same f_max and the same c2 ([C] Eq. (3) holds for
all laws); f_max is not printed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wm_drake.elements.damper_law import law_of
from wm_drake.parameters import MeasuredLoop, load_component
from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.rigs import DamperBench, Harmonic, damper_bench, force_loops
from wm_drake.rigs.measured import HarmonicMotion, measured_motion
from wm_drake.studies.fitting import least_squares
from wm_drake.studies.identification.models import damper_model
from wm_drake.studies.identification.problem import fit_problem

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
    found = []
    for loop in force_loops(damper_bench(damper), motions):
        name = f"{loop.motion.frequency:g} Hz, {loop.motion.amplitude / MM:g} mm"
        measured = measured_motion(
            MeasuredLoop(name, name, loop.time, loop.displacement, loop.force, False)
        )
        assert isinstance(measured, HarmonicMotion)
        found.append(measured)
    return found


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
    known = {
        "friction_force": f_max,
        "transition_velocity": 0.0,
        "slider_damping": slider_damping,
    }
    printed, rows = printed_table(), []
    for measured in motions:
        model = damper_model("stv_sponge", [measured], BOUNDS, known)
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
    """Peak force of loops of one amplitude over frequency, for [C] section 4.1.

    Attributes:
        text: What is changed in the numbers of the damper.
        peaks: Peak force at each frequency. [N]
    """

    text: str
    peaks: tuple[float, ...]

    @property
    def change(self) -> float:
        """Change of the peak from the lowest to the highest frequency, as a part of it."""
        return self.peaks[-1] / self.peaks[0] - 1.0


def frequency_trends(
    damper: DamperNumbers, frequencies: Sequence[float], amplitude: float
) -> list[FrequencyTrend]:
    """Return how the peak force goes with frequency: as printed, without dashpots, and falling.

    Without c1 and c2 the law depends on quotients of rates only, so its loops do not depend on the
    frequency; each dashpot makes the force grow. It falls only if the friction itself falls with
    the velocity of the slider faster than c2 grows: friction_damping C_m below -c2, which no
    machine file may have. Below -(c1 + c2) the slider would be unstable.

    Args:
        damper: MSTV damper.
        frequencies: Rising. [Hz]
        amplitude: Of the motion. [m]
    """
    bench = damper_bench(damper)
    names = law_of(bench.packed).fields
    c1, c2 = (float(getattr(damper, name)) for name in ("sponge_damping", "slider_damping"))
    falling = -(c2 + 0.5 * c1)
    changes = {
        "as printed": {},
        "c1 and c2 nearly zero": {"sponge_damping": 1e-3, "slider_damping": 1e-3},
        f"C_m = {falling * MM:.3g} N s/mm": {"friction_damping": falling},
    }
    found = []
    for text, values in changes.items():
        packed = bench.packed.copy()
        for name, value in values.items():
            packed[1 + names.index(name)] = value
        motions = [Harmonic(f, amplitude) for f in frequencies]
        loops = force_loops(DamperBench(packed), motions)
        found.append(FrequencyTrend(text, tuple(float(np.max(np.abs(x.force))) for x in loops)))
    return found


def mstv_of_c() -> DamperNumbers:
    """Return the shipped damper of [C]."""
    parameters = load_component("mstv_damper").parameters
    assert isinstance(parameters, DamperNumbers)
    return parameters
