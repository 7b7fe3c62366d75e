"""Judgement of a fit to measured loops: what the law misses, against the noise of the loops."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion
from wm_drake.studies.fitting.fit import FAIR, Fit, FitVerdict, verdict_of
from wm_drake.studies.fitting.problem import rmse

CHANCE = 0.01
"""Probability that noise alone shows as lack of fit."""

IN_PHASE = 0.03
"""Part of the force against which work and stiffness of a loop count as zero: about 2 degrees of
delay between the sensors."""

NOISE_FREEDOM = 0.19
"""Degrees of freedom of `noise_of` by the number of samples: 18/35 for the squares of these
differences (Gasser, Sroka, Jennen-Steinmetz 1986), times 0.37 for a median in place of a mean."""


def two_digits(size: float) -> str:
    """Return a number with two digits, or more above 100."""
    return f"{size:.0f}" if size >= 10.0 else f"{size:.2g}"


LACK = Quantity("lack of fit", Share(), form=two_digits)


@dataclass(frozen=True)
class LoopJudgement:
    """Judgement of one measured loop; moments in place of forces in a rotation.

    Attributes:
        force: Root mean square of the measured force without offset and drift. [N; N m]
        residual: Root mean square of measured less fitted force. [N; N m]
        noise: Standard deviation of the noise of the measured force. [N; N m]
        work: Work that the measured motion does on the component in a period; NaN for a motion
            that is no sine. [J]
        in_phase, out_of_phase: Amplitudes of the measured force in phase with the displacement and
            with the velocity: by least squares, at the largest of both. [N; N m]
    """

    name: str
    force: float
    residual: float
    noise: float
    samples: int
    work: float
    in_phase: float
    out_of_phase: float

    @property
    def lack(self) -> float:
        """Lack of fit: the part of the residual that noise does not explain. [N; N m]"""
        if self.residual <= self.noise * self._largest_by_chance:
            return 0.0
        return float(np.sqrt(self.residual**2 - self.noise**2))

    @property
    def missed(self) -> float:
        """Lack of fit as a part of the measured force."""
        return self.lack / self.force if self.force > 0.0 else 0.0

    @property
    def gives_energy(self) -> bool:
        """Whether the component gives energy in a period, which no passive one does."""
        return self.out_of_phase < -self._zero

    @property
    def is_reversed(self) -> bool:
        """Whether force and displacement seem to have opposite signs."""
        falls = self.in_phase < -self._zero
        return (self.gives_energy and self.in_phase <= self._zero) or (
            falls and abs(self.out_of_phase) <= self._zero
        )

    @property
    def _zero(self) -> float:
        by_noise = 4.0 * self.noise * float(np.sqrt(2.0 / self.samples))
        return max(IN_PHASE * float(np.hypot(self.in_phase, self.out_of_phase)), by_noise)

    @property
    def _largest_by_chance(self) -> float:
        freedom = max(NOISE_FREEDOM * self.samples, 1.0)
        return float(np.sqrt(fisher.isf(CHANCE, self.samples, freedom)))


@dataclass(frozen=True)
class Judgement:
    """Judgement of a fit.

    Attributes:
        loops: Judgement of each loop.
        quantity: What was measured: "force" or "moment".
    """

    loops: tuple[LoopJudgement, ...]
    quantity: str = "force"

    @property
    def missed(self) -> float:
        """Lack of fit over all samples, as a part of the measured force."""
        return self._part("lack")

    @property
    def noise(self) -> float:
        """Noise over all samples, as a part of the measured force."""
        return self._part("noise")

    @property
    def verdict(self) -> FitVerdict:
        """Whether the law fits the loops."""
        return verdict_of(self.missed)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict in words, then hints on its cause and on single loops."""
        missed, noise = LACK.text(self.missed), LACK.text(self.noise)
        known = (
            f"the lack of fit is {missed} of the measured {self.quantity} (root mean square), "
            f"the noise {noise}"
        )
        if not self.missed:
            known = (
                f"no lack of fit shows above the noise, {noise} of the measured {self.quantity} "
                "(root mean square)"
            )
        sentences = [
            {
                "good": f"Good fit: {known}.",
                "fair": f"Fair fit: {known}. The 95 % intervals hold only if the law is right; it "
                "is so in part.",
                "poor": f"Poor fit: {known}. The law does not describe these loops: do not use its "
                "values or their intervals.",
            }[self.verdict]
        ]
        if self.verdict != "poor":
            sentences += self._poor_loops()
        return (*sentences, *self.hints)

    @property
    def hints(self) -> tuple[str, ...]:
        """Hints on errors of the measurement: a reversed sign, a delay."""
        backwards = [loop.name for loop in self.loops if loop.is_reversed]
        gives = [loop.name for loop in self.loops if loop.gives_energy and not loop.is_reversed]
        hints, count = [], len(self.loops)
        if backwards:
            hints.append(
                f"The {self.quantity} seems to have the wrong sign in {_named(backwards, count)}: "
                "it pushes along with the motion, and no damper or rubber does. Reverse the sign "
                "of one of the two columns."
            )
        if gives:
            hints.append(
                f"The component gives energy in {_named(gives, count)}, and no damper or rubber "
                f"does: the {self.quantity} lags the motion. Check the delay between the two "
                "signals."
            )
        return tuple(hints)

    def _poor_loops(self) -> list[str]:
        poor = [loop.name for loop in self.loops if loop.missed > FAIR]
        if not poor:
            return []
        return [
            f"The law misses more than {LACK.text(FAIR)} of the {self.quantity} in {len(poor)} "
            f"of {len(self.loops)} loops: {_named(poor, len(self.loops))}."
        ]

    def _part(self, name: str) -> float:
        samples = np.array([loop.samples for loop in self.loops])
        part, whole = (
            float(np.sum(samples * np.square([getattr(loop, key) for loop in self.loops])))
            for key in (name, "force")
        )
        return float(np.sqrt(part / whole)) if whole > 0.0 else 0.0


MOST_NAMED = 3
"""Largest number of loops that a sentence names."""


def _named(names: Sequence[str], total: int) -> str:
    if 1 < total == len(names):
        return f"all {total} loops"
    more = len(names) - MOST_NAMED
    text = ", ".join(names[:MOST_NAMED])
    return f"{text} and {more} more" if more > 0 else text


def judge(fit: Fit, motions: Sequence[MeasuredMotion]) -> Judgement:
    """Return the judgement of a fit to measured loops, in the order of its tests."""
    loops = []
    for where, measured, amounts in zip(fit.problem.slices, motions, fit.baselines, strict=True):
        force = measured.loop.force - measured.baseline @ amounts
        in_phase, out_of_phase = _parts(measured, force)
        is_sine = isinstance(measured, HarmonicMotion)
        loops.append(
            LoopJudgement(
                name=measured.loop.name,
                force=float(rmse(force)),
                residual=float(rmse(measured.loop.force - fit.computed[where])),
                noise=noise_of(
                    measured.phase if isinstance(measured, HarmonicMotion) else measured.loop.time,
                    force,
                ),
                samples=len(force),
                work=np.pi * measured.stroke * out_of_phase if is_sine else float("nan"),
                in_phase=in_phase,
                out_of_phase=out_of_phase,
            )
        )
    return Judgement(tuple(loops), "moment" if motions[0].loop.rotates else "force")


def noise_of(phase: FloatArray, values: FloatArray) -> float:
    """Return the standard deviation of the noise of a periodic signal, without a model of it.

    Each sample is compared with the straight line through its neighbours in phase. Samples of other
    periods are neighbours, so noise that is slow in time counts if there are two periods or more.
    The median does not see the few samples at a jump of the force.

    Args:
        phase: Phase of each sample, in any order, or its time if the signal is not periodic (n,).
        values: The signal (n,).
    """
    order = np.argsort(phase, kind="stable")
    at, y = phase[order], values[order]
    if len(y) < 4:
        return 0.0
    width = at[2:] - at[:-2]
    left = np.where(width > 0.0, (at[2:] - at[1:-1]) / np.where(width > 0.0, width, 1.0), 0.5)
    difference = left * y[:-2] + (1.0 - left) * y[2:] - y[1:-1]
    size = np.abs(difference) / np.sqrt(1.0 + np.square(left) + np.square(1.0 - left))
    return float(np.median(size)) / NORMAL_MEDIAN


NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""


def _parts(measured: MeasuredMotion, force: FloatArray) -> tuple[float, float]:
    """Return the amplitudes of a force in phase with displacement and velocity."""
    position, rate = measured.position / measured.stroke, measured.rate / measured.fastest
    columns = np.stack([position, rate, np.ones_like(rate)], axis=1)
    amounts = np.linalg.lstsq(columns, force, rcond=None)[0]
    return float(amounts[0]), float(amounts[1])
