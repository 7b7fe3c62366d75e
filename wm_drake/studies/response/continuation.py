"""Branch of periodic motions over the drum's speed, followed around folds by its arc length.

A step goes along the tangent of the branch. If it reaches the next speed of the grid, the motion is
solved at that speed; else on the plane across the tangent (Keller 1977). The matrix of one
linearisation serves all corrections of a step that converge fast (chord method). Floquet
multipliers tell whether a motion is stable.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED
from wm_drake.studies.response.balance import HarmonicBalance
from wm_drake.studies.response.condensed import Corrections

LENGTH = 5e-3
"""Displacement that counts as much in the arc length as `SPEEDS` of the range of speeds. [m]"""

SPEEDS = 0.05
"""Part of the range of speeds that counts as much as `LENGTH`."""

TOLERANCE = 1e-9
"""Largest last correction of a motion. [m]"""

STALLED = 1e-8
"""Size of a correction that need not shrink any further: friction bends the forces, so that the
corrections may stop to converge there. [m]"""

NEAR = 1e-6
"""Size of a correction below which it is made in part if corrections do not shrink. [m]"""

STUCK = 5e-6
"""Size of a correction at which a first motion is accepted although no part of the correction makes
the residual smaller: a sample is at a reversal of friction. [m]"""

SMALLEST_SHARE = 0.01
"""Smallest part of a correction that is tried."""

MOST_CORRECTIONS, MOST_CHORDS = 12, 6
"""Largest number of corrections of a step, and of those with one matrix."""

FAST = 0.3
"""Largest ratio of two corrections at which the matrix is kept."""

SHORTEST_STEP = 1e-4
"""Shortest arc length of a step, in units of `LENGTH`."""

LEAST_COSINE = 0.6
"""Cosine of the largest bend of the branch in a step, about 50 degrees."""

MOST_POINTS = 20
"""Largest number of points of a branch, as a multiple of the number of speeds."""

Progress = Callable[[float], None]


@dataclass(frozen=True)
class BranchPoint:
    """Periodic motion on a branch.

    Attributes:
        speed: Of the drum. [rad/s]
        coefficients: Of its Fourier series. (2 N + 1, n)
        stable: Whether all Floquet multipliers are inside the unit circle.
        multiplier: The largest of their absolute values.
        on_grid: Whether the speed is one of those asked for.
        back: Whether the branch goes to lower speeds here.
        spins: Rate of each spin of `Kinematics`. [rad/s]
    """

    speed: float
    coefficients: FloatArray
    stable: bool
    multiplier: float
    on_grid: bool
    back: bool
    spins: FloatArray


@dataclass
class _Place:
    """A motion with the tangent of the branch: direction of coefficients and speed."""

    coefficients: FloatArray
    speed: float
    along: FloatArray
    speed_along: float


def first_motion(
    balance: HarmonicBalance, speed: float, guesses: Iterator[FloatArray]
) -> FloatArray:
    """Return the periodic motion at a speed, from the first guess that leads to one.

    Raises:
        InputError: no guess does.
    """
    for guess in guesses:
        solved = _at_speed(balance, guess, speed)
        if solved is not None:
            return solved
    raise input_error(
        f"no periodic motion was found at {SPEED.unit.from_si(speed):.4g} {SPEED.unit.label}; "
        "choose another first speed, or more harmonics",
        key="speeds",
    )


def follow(
    balance: HarmonicBalance,
    speeds: FloatArray,
    first: FloatArray,
    progress: Progress = lambda fraction: None,
) -> list[BranchPoint]:
    """Return the periodic motions along the branch through a first one.

    Args:
        speeds: Speeds in rising or falling order, at least two; the branch is followed from the
            first to the last. [rad/s]

    Returns:
        A point at each crossing of a speed, and some between them where the branch bends. Behind a
        fold the speed changes the other way. If the branch cannot be followed to its end, the
        points up to there.
    """
    metric = _Metric(balance, float(np.ptp(speeds)))
    way = 1.0 if speeds[-1] > speeds[0] else -1.0
    place = metric.place(first, float(speeds[0]), way)
    points = [_point(balance, place, True, way)]
    step, low, high = np.inf, min(speeds), max(speeds)
    keep_speed = np.zeros(first.shape), 1.0
    while len(points) < MOST_POINTS * len(speeds):
        target = _next_speed(speeds, place.speed, place.speed_along)
        if target is None:
            break
        reach = (target - place.speed) / place.speed_along if place.speed_along else np.inf
        landing = reach <= step
        length = reach if landing else step
        begin = place.coefficients + length * place.along
        ahead = target if landing else place.speed + length * place.speed_along
        across = keep_speed if landing else metric.row(place.along, place.speed_along)
        reached = _step(metric, place, length, (begin, ahead), across)
        if (
            reached is not None
            and not landing
            and (reached[0].speed - target) * place.speed_along > 0
        ):
            # the branch reached the speed of the grid before its tangent did: stop there first
            share = (target - place.speed) / (reached[0].speed - place.speed)
            begin = place.coefficients + share * (reached[0].coefficients - place.coefficients)
            landing = True
            reached = _step(metric, place, length, (begin, target), keep_speed)
        if reached is None:
            step = 0.5 * min(step, reach, 4.0)
            if step < SHORTEST_STEP:
                break
            continue
        place, quick = reached
        if quick:
            step *= 2.0
        if not low - 1e-9 <= place.speed <= high + 1e-9:
            break
        points.append(_point(balance, place, landing, way))
        progress(abs(place.speed - speeds[0]) / (high - low))
        if landing and target == speeds[-1]:
            break
    return points


def _next_speed(speeds: FloatArray, speed: float, direction: float) -> float | None:
    """Return the next speed of the grid in a direction; None beyond its ends."""
    ahead = (speeds - speed) * np.sign(direction or 1.0)
    beyond = np.flatnonzero(ahead > 1e-9 * np.max(np.abs(speeds)))
    return float(speeds[beyond[np.argmin(ahead[beyond])]]) if beyond.size else None


class _Metric:
    """Size of a step along a branch."""

    def __init__(self, balance: HarmonicBalance, span: float) -> None:
        self.balance = balance
        self.weights = (balance.scale / LENGTH) ** 2
        self.speed_weight = 1.0 / (SPEEDS * span) ** 2

    def row(self, along: FloatArray, speed_along: float) -> tuple[FloatArray, float]:
        """Return the coefficients of the plane across a tangent: of a motion and of its speed."""
        return along * self.weights, speed_along * self.speed_weight

    def unit(self, along: FloatArray, speed_along: float) -> tuple[FloatArray, float]:
        """Return a direction scaled to an arc length of 1."""
        size = np.sqrt(
            np.sum(along * along * self.weights) + speed_along * speed_along * self.speed_weight
        )
        return along / size, float(speed_along / size)

    def place(self, coefficients: FloatArray, speed: float, way: float) -> _Place:
        """Return a motion with the tangent of its branch, which begins with rising speed or not.

        Args:
            coefficients, speed: The motion.
            way: 1 for rising speed, -1 for falling speed.
        """
        at, row = self.balance.linearised(coefficients, speed), np.zeros(coefficients.shape)
        along, speed_along = Corrections(self.balance, at, row, way)(None, 1.0)
        return _Place(coefficients, speed, *self.unit(along, speed_along))


def _step(
    metric: _Metric,
    place: _Place,
    length: float,
    guess: tuple[FloatArray, float],
    row: tuple[FloatArray, float],
) -> tuple[_Place, bool] | None:
    """Return the next place along a branch, and whether it was found at once; None if not found.

    Args:
        place: Where the step begins.
        length: Arc length of the step.
        guess: First guess of the motion and its speed.
        row: Last equation of the corrections: the speed is kept, or the motion is on the plane
            across the tangent.
    """
    solved = _solved(metric.balance, *guess, row)
    if solved is None:
        return None
    coefficients, speed, solve, corrections = solved
    if metric.balance.extent(coefficients - guess[0]) / LENGTH > 0.5 * max(length, 0.05):
        return None
    ahead = _turned(metric, place, coefficients, speed, solve)
    if ahead is None:
        return None
    beyond, forwards = ahead
    return beyond, corrections < 5 and forwards > 0.9


def _solved(
    balance: HarmonicBalance, begin: FloatArray, speed: float, row: tuple[FloatArray, float]
) -> tuple[FloatArray, float, Corrections, int] | None:
    """Return a motion, its speed, factors near it, and the number of corrections; None if none.

    Args:
        begin, speed: First guess of the motion and its speed.
        row: Last equation of the corrections.
    """
    coefficients, solve, last, count = begin.copy(), None, np.inf, 0
    corrections = 0
    while corrections < MOST_CORRECTIONS:
        corrections += 1
        if solve is None:
            solve, count = _corrections(balance, coefficients, speed, row), 0
            if solve is None:
                return None
            residual = solve.at.residual
        else:
            residual = balance.residual(coefficients, speed)
        change, faster = solve(residual, 0.0)
        size = balance.extent(change)
        if not np.all(np.isfinite(change)):
            return None
        if count == 0 and FAST * last < size < NEAR:
            share = _share(balance, (coefficients, speed), residual, (change, faster))
            change, faster = share * change, share * faster
        coefficients = coefficients + change
        speed += faster
        count += 1
        if size < TOLERANCE or FAST * last < size < STALLED:
            break
        if size > FAST * last or count >= MOST_CHORDS:
            solve = None
        last = size
    else:
        return None
    return None if solve is None else (coefficients, speed, solve, corrections)


def _corrections(
    balance: HarmonicBalance, coefficients: FloatArray, speed: float, row: tuple[FloatArray, float]
) -> Corrections | None:
    """Return the corrections at a motion, for a last equation; None if there are none."""
    at = balance.linearised(coefficients, speed)
    try:
        return Corrections(balance, at, *row)
    except np.linalg.LinAlgError:
        return None


def _turned(
    metric: _Metric, place: _Place, coefficients: FloatArray, speed: float, solve: Corrections
) -> tuple[_Place, float] | None:
    """Return the next place, and the cosine of the bend; None if the branch bends too much.

    Args:
        coefficients, speed: The next motion.
        solve: Factors near it.
    """
    along, speed_along = metric.unit(*solve(None, 1.0))
    forwards = float(np.sum(along * place.along * metric.weights))
    forwards += speed_along * place.speed_along * metric.speed_weight
    if forwards < 0.0:
        along, speed_along = -along, -speed_along
    if abs(forwards) < LEAST_COSINE:
        return None
    return _Place(coefficients, speed, along, speed_along), abs(forwards)


def _share(
    balance: HarmonicBalance,
    motion: tuple[FloatArray, float],
    residual: FloatArray,
    correction: tuple[FloatArray, float],
) -> float:
    """Return the part of a correction that makes the residual smaller.

    Where a sample of the drum's turn is at a reversal of friction, the force bends so sharply
    that whole corrections go to and fro across the bend for ever.

    Args:
        motion: Coefficients and speed before the correction.
        residual: Their residual.
        correction: Correction of the coefficients and of the speed.
    """
    (coefficients, speed), (change, faster) = motion, correction
    share, before = 1.0, float(np.linalg.norm(residual))
    while share > SMALLEST_SHARE:
        there = coefficients + share * change, speed + share * faster
        if np.linalg.norm(balance.residual(*there)) < (1.0 - 0.1 * share) * before:
            break
        share *= 0.5
    return share


def _point(balance: HarmonicBalance, place: _Place, on_grid: bool, way: float) -> BranchPoint:
    # Between the samples of the balance: one of them may be exactly at a reversal of friction, and
    # its steep slope would count for the whole distance to the next.
    phase = balance.series.phase + np.pi / balance.series.samples
    states = balance.states(place.coefficients, place.speed, phase)
    rates, slopes = balance.derivative.with_slopes(states)
    multipliers = floquet_multipliers(slopes, 2.0 * np.pi / abs(place.speed))
    return BranchPoint(
        place.speed,
        place.coefficients,
        is_stable(multipliers),
        float(np.max(np.abs(multipliers))),
        on_grid,
        place.speed_along * way < 0.0,
        balance.kinematics.spin_rates(place.coefficients[0], rates.mean(axis=0)),
    )


def _at_speed(balance: HarmonicBalance, guess: FloatArray, speed: float) -> FloatArray | None:
    """Return the motion at a speed by Newton's method with halved steps; None if it fails."""
    coefficients, last = guess.copy(), np.inf
    for _ in range(60):
        solve = _corrections(balance, coefficients, speed, (np.zeros(guess.shape), 1.0))
        if solve is None:
            return None
        residual = solve.at.residual
        change, _ = solve(residual, 0.0)
        size = balance.extent(change)
        if not np.isfinite(size):
            return None
        share = _share(balance, (coefficients, speed), residual, (change, 0.0))
        if share <= SMALLEST_SHARE and size < STUCK:
            return coefficients
        coefficients = coefficients + share * change
        if size < TOLERANCE or FAST * last < size < STALLED:
            return coefficients
        last = size
    return None


UNIT_CIRCLE = 1e-3
"""How far outside the unit circle a multiplier may be of a motion that is called stable.

The spin of a damper's tube has the multiplier 1 exactly; rounding moves it."""


def floquet_multipliers(slopes: FloatArray, period: float) -> FloatArray:
    """Return the Floquet multipliers of a periodic motion. (n,) complex

    A small departure from a periodic motion obeys d' = J(t) d, with the slopes J of the compiled
    right-hand side along the motion. Over a period it becomes Phi d; the eigenvalues of Phi are the
    Floquet multipliers. The motion is stable if all are inside the unit circle. Phi is the product
    of the steps of the midpoint rule, which is stable for every motion that decays:

        Phi = product of (1 - h/2 J_j)^-1 (1 + h/2 J_j) = product of 2 (1 - h/2 J_j)^-1 - 1

    The trapezoidal rule has the same factors in another order, and the same eigenvalues.

    Args:
        slopes: (samples, n, n) slopes of the time derivative at equal distances over the period,
            by each number k.
        period: [s]
    """
    samples, n, _ = slopes.shape
    matrices = np.eye(n) - (0.5 * period / samples) * slopes.transpose(0, 2, 1)
    steps = 2.0 * np.linalg.inv(matrices)
    steps -= np.eye(n)
    while len(steps) > 1:
        if len(steps) % 2:
            steps = np.concatenate([steps[:-2], (steps[-1] @ steps[-2])[None]])
        else:
            steps = steps[1::2] @ steps[0::2]
    return np.linalg.eigvals(steps[0])


def is_stable(multipliers: FloatArray) -> bool:
    """Return whether a motion with these multipliers is stable."""
    return bool(np.max(np.abs(multipliers)) < 1.0 + UNIT_CIRCLE)
