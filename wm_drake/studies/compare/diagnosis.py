"""Find what explains a recording that is not like its prediction: a few discrete causes are tried.

Compared are the complex amplitudes of order 1 of all sensors, which have the phases between them,
and the means of accelerometers, which show gravity. Each cause changes what is predicted, or which
channel belongs to which sensor; one that is named has been tried on the data, and fits.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np

from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.orders import order_vectors
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.studies.compare.pairs import Pair

GRAVITY = 9.81
"""Size by which a difference of means is divided. [m/s^2]"""

UNLIKE = 0.3
"""Misfit of order 1 of a sensor that is said also if no cause explains it: an assumption, more than
tilts, gains and most models are off by."""

DOUBTFUL = 0.1
"""Misfit of order 1 of a sensor from which causes are tried, which are named only if they explain
it: sensors along one axis are much alike, and so are their channels if they are exchanged."""

UNLIKE_MEAN = 0.1
"""Difference of the means of an accelerometer, by gravity, from which causes are tried."""

TILTED = 0.07
"""Part of the vibration along the other axes that a sensor may show: 4 degrees, twice the deviation
of a tilt in fits to records."""

EXPLAINS, EXPLAINED = 0.4, 0.4
"""Largest misfit with a cause, by that without, and in all: an assumption."""

SURE = 0.1
"""Misfit with a single cause up to which no other run is tried."""

MOST_CAUSES = 3
"""Most causes that are tried together."""

ALIKE = 1.5
"""Largest ratio of the misfit of a cause that is named to that of the best one."""

LEAST_GAIN = 0.85
"""Largest ratio of the misfit with a further cause to that without it: one of three like causes
leaves sqrt(2 / 3)."""

NEARLY = 1.05
"""Largest ratio of the misfit of the first cause that is taken to that of the best one: the plain
ones come first."""

REMAINS = 0.5
"""Largest misfit of any sensor with the causes that are named."""

CORNERS = (0.16, 0.5, 1.6, 5.0)
"""Corners of AC couplings that are tried. [Hz]"""

FACTORS = {"g": 9.80665, "mg": 9.80665e-3, "in": 0.0254, "mm": 1e-3, "a half": 0.5, "a tenth": 0.1}
"""Factors of units that are tried, and their reciprocals."""

SHIFTS = 0.002 * np.arange(-10, 11)
"""Shifts of the clock that are allowed for. [s]"""

MISFIT = Quantity("misfit", Share(), 0)


@dataclass(frozen=True)
class Variant:
    """What a sensor may be other than declared.

    Attributes:
        words: What it is, and how a test declares it.
        sensor: The sensor.
    """

    words: str
    sensor: RecordedSensor


@dataclass(frozen=True)
class Explanation:
    """A cause, or several together, and how well they fit.

    Attributes:
        causes: In words.
        misfit: Root mean square of the misfits of the sensors.
    """

    causes: tuple[str, ...]
    misfit: float

    def __str__(self) -> str:
        """Return the causes with their misfit."""
        return f"{' and '.join(self.causes)} (misfit {MISFIT.text(self.misfit)})"


@dataclass(frozen=True)
class Diagnosis:
    """What was tried, and what explains a recording.

    Attributes:
        misfit: Root mean square of the misfits of the sensors as they are declared.
        vibrations, means: Misfits of each sensor, of order 1 and of the mean.
        explanations: What explains it, best first.
        shift: Shift of the clock that fits best as declared. [s]
    """

    misfit: float
    vibrations: Mapping[str, float]
    means: Mapping[str, float]
    explanations: tuple[Explanation, ...] = ()
    shift: float = 0.0

    @property
    def unlike(self) -> list[str]:
        """Return the sensors whose vibration is unlike its prediction."""
        return [name for name, value in self.vibrations.items() if value > UNLIKE]

    @property
    def doubtful(self) -> list[str]:
        """Return the sensors for whose vibration causes are tried."""
        return [name for name, value in self.vibrations.items() if value > DOUBTFUL]

    @property
    def shifted(self) -> list[str]:
        """Return the sensors whose mean is not that of gravity."""
        return [name for name, value in self.means.items() if value > UNLIKE_MEAN]

    @property
    def is_sure(self) -> bool:
        """Whether one cause explains the recording so well that no other run is worth trying."""
        best = self.explanations[0] if self.explanations else None
        return best is not None and len(best.causes) == 1 and best.misfit <= SURE

    @property
    def text(self) -> str:
        """Return what explains the recording, or that nothing does."""
        names = ", ".join(dict.fromkeys([*(self.unlike or self.doubtful), *self.shifted]))
        head = f"is not like its prediction in {names} (misfit {MISFIT.text(self.misfit)})"
        if self.explanations:
            return f"{head}; what explains it: {'; or '.join(map(str, self.explanations))}"
        return f"{head}; tried: {TRIED}: none of these explains it"


TRIED = (
    "exchanged channels, polarity, axis, gravity, AC coupling, unit, direction of rotation, other "
    "loads"
)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is compared of signals.

    Attributes:
        vectors: Complex amplitudes of order 1 (windows, signals).
        means: Means (signals).
        speed: Drum speed of the windows (windows). [rad/s]
    """

    vectors: np.ndarray
    means: FloatArray
    speed: FloatArray


@dataclass(frozen=True)
class _Trial:
    """Which channel each sensor has, which variant it is, and by what it is multiplied."""

    channels: tuple[int, ...]
    variants: tuple[int, ...]
    factors: tuple[float, ...]
    causes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Suspect:
    """A run that a recording may be of.

    Attributes:
        words: What is other about it; "" for the run as declared.
        pair: The recording on the times of the run.
        sensors, points: Sensors by name, and their positions in T. [m]
        across: Least power by which a difference is divided (k,).
    """

    words: str
    pair: Pair
    sensors: Mapping[str, RecordedSensor]
    points: Mapping[str, FloatArray]
    variants: tuple[tuple[Variant, ...], ...] = field(init=False)
    measured: _Seen = field(init=False)
    predicted: tuple[_Seen, ...] = field(init=False)
    across: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Compute what is compared, once."""
        run, put = self.pair.run, object.__setattr__
        variants = tuple(tuple(variants_of(sensor)) for sensor in self.sensors.values())
        put(self, "variants", variants)
        put(self, "measured", _seen(self.pair.measured, self.pair))
        predicted = []
        for name, of_sensor in zip(self.sensors, variants, strict=True):
            columns = [recorded_signal(run, v.sensor, self.points[name]) for v in of_sensor]
            predicted.append(_seen(np.stack(columns, axis=1), self.pair))
        put(self, "predicted", tuple(predicted))
        powers = [np.nansum(np.abs(seen.vectors) ** 2, axis=0).max() for seen in predicted]
        put(self, "across", np.maximum((TILTED / UNLIKE) ** 2 * np.array(powers), 1e-300))

    @property
    def declared(self) -> _Trial:
        """Return the trial with all sensors as declared."""
        count = len(self.sensors)
        causes = (self.words,) if self.words else ()
        return _Trial(tuple(range(count)), (0,) * count, (1.0,) * count, causes)

    def misfits(self, trial: _Trial) -> tuple[FloatArray, FloatArray, float]:
        """Return misfits of order 1 and of the means of the sensors (k,) each, and the shift. [s]

        Order 1 may be turned by the unknown angle of the drum at the start, and by a small shift of
        the clock; its difference is divided by the larger of both, or by what makes a tilt of a
        sensor with little vibration of its own alike.
        """
        columns = list(trial.channels)
        chosen = list(zip(self.predicted, trial.variants, trial.factors, strict=True))
        measured = self.measured.vectors[:, columns]
        computed = np.stack([factor * seen.vectors[:, v] for seen, v, factor in chosen], axis=1)
        known = np.isfinite(measured) & np.isfinite(computed)
        m, c = np.where(known, measured, 0.0), np.where(known, computed, 0.0)
        powers = np.sum(np.abs(m) ** 2, axis=0), np.sum(np.abs(c) ** 2, axis=0)
        size = np.maximum(np.maximum(*powers), self.across)
        turns = np.exp(1j * np.outer(SHIFTS, self.measured.speed))
        alike = (turns @ (m * np.conj(c))) / size  # shift, sensor
        start = np.exp(-1j * np.angle(alike.sum(axis=1)))[:, None]
        squares = (powers[0] + powers[1]) / size - 2.0 * np.real(alike * start)
        best = int(np.argmin(squares.sum(axis=1)))
        means = np.array([factor * seen.means[v] for seen, v, factor in chosen])
        is_shown = [sensor.quantity == "acceleration" for sensor in self.sensors.values()]
        unit = GRAVITY * np.maximum(np.abs(trial.factors), 1.0)
        apart = np.abs(self.measured.means[columns] - means) / unit * np.array(is_shown)
        return np.sqrt(np.maximum(squares[best], 0.0)), apart, float(SHIFTS[best])

    def total(self, trial: _Trial) -> float:
        """Return the root mean square of the misfits of all sensors.

        An opposite vibration is no worse than none: else a wrong factor of 0 would be a gain.
        """
        vibrations, means, _ = self.misfits(trial)
        squares = np.minimum(vibrations, 1.0) ** 2 + np.minimum(means, 2.0) ** 2
        return float(np.sqrt(np.mean(squares)))

    def further(self, trial: _Trial) -> Iterator[_Trial]:
        """Yield a trial with one more cause, about sensors that are unlike; plain causes first."""
        vibrations, means, _ = self.misfits(trial)
        names = list(self.sensors)
        wrong = [int(k) for k in np.flatnonzero((vibrations > DOUBTFUL) | (means > UNLIKE_MEAN))]
        for k in wrong:
            for number, sign in product(range(len(self.variants[k])), (1.0, -1.0)):
                if number == trial.variants[k] and sign > 0.0:
                    continue
                texts = [self.variants[k][number].words if number else ""]
                texts.append("it has the other sign (polarity: negative)" if sign < 0.0 else "")
                words = f"{names[k]}: {' and '.join(filter(None, texts))}"
                yield _changed(trial, {k: (number, sign)}, words)
        for i, j in combinations(range(len(names)), 2):
            one, other = (self.sensors[names[k]] for k in (i, j))
            if (i in wrong or j in wrong) and one.quantity == other.quantity:
                yield from _exchanged(trial, names, i, j)
        if len(names) > 1:
            every = {k: (trial.variants[k], -1.0) for k in range(len(names))}
            yield _changed(trial, every, "all sensors have the other sign")
        for unit, factor in FACTORS.items():
            for size in (factor, 1.0 / factor):
                words = f"are larger than declared by the factor {size:.4g} ({unit})"
                for group in {tuple(wrong), *((k,) for k in wrong)} - {()}:
                    changes = {k: (trial.variants[k], size) for k in group}
                    said = ", ".join(names[k] for k in group)
                    yield _changed(trial, changes, f"the units of {said} {words}")


def variants_of(sensor: RecordedSensor) -> Iterator[Variant]:
    """Yield a sensor as declared, and as it may be."""
    yield Variant("as declared", sensor)
    for axis in "xyz":
        if axis != sensor.axis:
            turned = sensor.model_copy(update={"axis": axis})
            yield Variant(f"its axis is {axis}, not {sensor.axis} (axis: {axis})", turned)
    if sensor.shows_gravity:
        without = sensor.model_copy(update={"gravity": "removed"})
        yield Variant("gravity is taken out of it (gravity: removed)", without)
        for corner in CORNERS:
            text = f"it is AC-coupled at about {corner:g} Hz (ac_coupling: {corner:g} Hz)"
            yield Variant(text, sensor.model_copy(update={"ac_coupling": corner}))


def diagnosed(declared: Suspect, others: Sequence[Suspect] = ()) -> Diagnosis:
    """Return what explains a recording.

    Causes are tried one by one, and on top of the best one further ones.

    Args:
        declared: The run as declared.
        others: Other runs that it may be of.
    """
    vibrations, means, shift = declared.misfits(declared.declared)
    misfit = declared.total(declared.declared)
    names = list(declared.sensors)
    result = Diagnosis(
        misfit,
        dict(zip(names, vibrations.tolist(), strict=True)),
        dict(zip(names, means.tolist(), strict=True)),
        shift=shift,
    )
    if not (result.doubtful or result.shifted):
        return result
    tested = list[Explanation]()
    for suspect in (declared, *others):
        tried = [(suspect.total(suspect.declared), suspect.declared)]
        if not suspect.words:
            tried.clear()
        trial, least = suspect.declared, suspect.total(suspect.declared)
        while len(trial.causes) < MOST_CAUSES and not _is_like(suspect, trial):
            more = [(suspect.total(t), t) for t in suspect.further(trial)]
            lowest = min((value for value, _ in more), default=np.inf)
            if lowest > LEAST_GAIN * least:
                break
            least, trial = next(each for each in more if each[0] <= NEARLY * lowest + 0.005)
            tried += [(least, trial), *sorted(more, key=lambda each: each[0])[:3]]
        tested += [Explanation(t.causes, v) for v, t in tried if _remains(suspect, t) <= REMAINS]
    limit = min(EXPLAINED, EXPLAINS * misfit)
    fitting = [each for each in dict.fromkeys(tested) if each.misfit <= limit]
    fitting.sort(key=lambda e: round(_cost(e), 2))
    best = fitting[0].misfit if fitting else 0.0
    kept = [e for e in fitting[:3] if e.misfit <= ALIKE * best + 0.005]
    return replace(result, explanations=tuple(kept))


def _cost(explanation: Explanation) -> float:
    """Return the misfit of an explanation, more for each cause."""
    count = len(explanation.causes)
    return explanation.misfit * (1.0 + 0.2 * count) + 0.01 * count


def _is_like(suspect: Suspect, trial: _Trial) -> bool:
    vibrations, means, _ = suspect.misfits(trial)
    return bool((vibrations <= DOUBTFUL).all() and (means <= UNLIKE_MEAN).all())


def _remains(suspect: Suspect, trial: _Trial) -> float:
    return float(np.max(suspect.misfits(trial)[0]))


def _exchanged(trial: _Trial, names: Sequence[str], i: int, j: int) -> Iterator[_Trial]:
    """Yield a trial with two channels exchanged, also with the other sign of either of them."""
    channels = list(trial.channels)
    channels[i], channels[j] = channels[j], channels[i]
    words = f"the channels of {names[i]} and {names[j]} are exchanged"
    swapped = replace(trial, channels=tuple(channels))
    yield replace(swapped, causes=(*trial.causes, words))
    for k in (i, j):
        text = f"{words}, and {names[k]} has the other sign, as of a sensor turned by 90 degrees"
        yield _changed(swapped, {k: (trial.variants[k], -1.0)}, text)


def _changed(trial: _Trial, changes: Mapping[int, tuple[int, float]], words: str) -> _Trial:
    """Return a trial with the variant, and a further factor, of some sensors."""
    variants, factors = list(trial.variants), list(trial.factors)
    for k, (variant, factor) in changes.items():
        variants[k] = variant
        factors[k] *= factor
    causes = (*trial.causes, words)
    return replace(trial, variants=tuple(variants), factors=tuple(factors), causes=causes)


def _seen(signals: FloatArray, pair: Pair) -> _Seen:
    """Return order 1 and means of signals (n, c) at the times of a run."""
    run = pair.run
    angle, time = run.drum_angle.values, run.time.values
    vectors = order_vectors(signals, angle, time, np.array([1.0])).isel(order=0)
    valid = np.isfinite(signals)
    sums, counts = np.where(valid, signals, 0.0).sum(axis=0), np.maximum(valid.sum(axis=0), 1)
    return _Seen(vectors.values, sums / counts, np.abs(vectors.speed.values))
