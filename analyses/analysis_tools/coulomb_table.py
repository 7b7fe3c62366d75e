"""[C] Table 2: k1 and c1 of the Coulomb model fitted to each test, and the trend with frequency.

[C] fits k1 and c1 of the Coulomb model to each test and prints how they drift with frequency and
amplitude. Here the tests are loops of the MSTV model with the numbers of [C] section 4.2.
Assumptions: both models have the same f_max and the same c2 ([C] Eq. (3) holds for all laws);
f_max is not printed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from wm_drake.parameters import MeasuredLoop, load_component
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.rigs import Harmonic, damper_bench, force_loops
from wm_drake.rigs.measured import HarmonicMotion, measured_motion
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.identify.models import Given, damper_model
from wm_drake.studies.identify.problem import fit_problem

BOUNDS = {"sponge_stiffness": (50e3, 300e3), "sponge_damping": (0.0, 10e3)}
"""Bounds of [C] section 3.3. [N/m, N s/m]"""

MM = 1e-3
SAME = 0.02
"""Relative difference of frequency and amplitude up to which a test is one of the printed ones."""


def printed_table() -> pd.DataFrame:
    """Return [C] Table 2: frequency_hz, amplitude_mm, k1 (N/mm), c1 (N s/mm)."""
    return pd.read_csv(Path(__file__).parents[1] / "mstv_table2_coulomb.csv", comment="#")


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
    motions: Sequence[HarmonicMotion], f_max: float, slider_damping: float
) -> pd.DataFrame:
    """Return k1 and c1 of the Coulomb model of each test beside the printed ones, and their ratios.

    Units are those of [C], N/mm and N s/mm; a test that is not printed has NaN there.

    Args:
        motions: Measured tests.
        f_max: Friction force of the Coulomb model. [N]
        slider_damping: Its c2. [N s/m]
    """
    known = {"friction_force": f_max, "transition_velocity": 0.0, "slider_damping": slider_damping}
    printed, rows = printed_table(), []
    for measured in motions:
        model = damper_model("stv_sponge", [measured], Given(BOUNDS, known))
        fit = identify(fit_problem(model, [measured]), starts=3, screened=16)
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


FREQUENCIES = (1.0, 3.0, 6.67, 10.0)
"""Frequencies of [C] Table 1. [Hz]"""

AMPLITUDE = 1e-3
"""Amplitude of [C] Fig. 7. [m]"""


def trend_text() -> str:
    """Return how the peak force of the MSTV model of [C] changes with frequency."""
    trend = frequency_trend(mstv_of_c(), FREQUENCIES, AMPLITUDE)
    rise, free = (peaks[-1] / peaks[0] - 1.0 for peaks in (trend.printed, trend.without_dashpots))
    low, high = FREQUENCIES[0], FREQUENCIES[-1]
    return (
        f"The peak force grows by {rise:.2g} of its value from {low:g} to {high:g} Hz at 1 mm, "
        f"because of c1 and c2; without them it changes by {free:.1g}. For a level peak f_max has "
        f"to fall from {trend.friction[0]:.3g} N to {trend.friction[-1]:.3g} N."
    )
