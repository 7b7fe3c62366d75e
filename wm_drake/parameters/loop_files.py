"""Measured loops: recorded files of time, displacement (or angle) and force (or moment)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.recorded import (
    ChannelNames,
    ChannelUse,
    Recording,
    Signal,
    Synchronous,
    read_recording,
)
from wm_drake.parameters.recorded.signal import word_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import LARGEST_NUMBER, Unit

FEWEST = 20
"""Smallest number of samples of a loop."""

_LENGTH, _ANGLE, _FORCE, _TORQUE = (
    Unit("m", "mm"),
    Unit("rad", "deg"),
    Unit("N", "N"),
    Unit("N*m", "N*mm"),
)
_UNITS = {"displacement": _LENGTH, "angle": _ANGLE, "force": _FORCE, "moment": _TORQUE}
"""Words of the channels of a loop, with the units to which they are converted."""

_ROLES = {
    "displacement": {
        "displacement": "displacement",
        "d": "displacement",
        "x": "displacement",
        "angle": "angle",
    },
    "force": {
        "force": "force",
        "f": "force",
        "moment": "moment",
        "torque": "moment",
        "m": "moment",
    },
}
"""Names that the channels of a loop may have in a file, and the word of each."""


SMALLEST_RANGE = 1e-12
"""Smallest range of a displacement and of a force: below it, a signal is constant. [m; rad; N]"""


@dataclass(frozen=True, eq=False)
class MeasuredLoop:
    """A force-displacement loop that was recorded on a bench, in SI units.

    Attributes:
        name: Name of the file, without the suffix.
        path: Path of the file, for messages.
        time: (n,) strictly increasing. [s]
        displacement: (n,) displacement or angle of the driven end. [m; rad]
        force: (n,) force or moment on the component at the driven end. [N; N m]
        rotates: Whether displacement and force are an angle and a moment.
        gaps: Begin and end of the spans in which samples are missing (k, 2). [s]
    """

    name: str
    path: str
    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    rotates: bool
    gaps: FloatArray = field(default_factory=lambda: np.empty((0, 2)))


def read_loop(path: Path, names: ChannelNames | None = None) -> MeasuredLoop:
    """Read a measured loop.

    The channels have names such as ``time [s]``, ``displacement [mm]`` and ``force [N]``, or
    ``time_s``, ``displacement_mm`` and ``force_N``; for rotations ``angle`` and ``moment``. Or
    `names` says which they are. Other channels are ignored. Samples with equal time stamps are
    averaged, samples that a channel lacks are left out.

    Args:
        path: CSV file, or file of another format of `wm_drake.parameters.recorded`.
        names: Name in the file of ``time``, ``displacement`` or ``angle``, ``force`` or
            ``moment``; units of channels whose file has none.

    Raises:
        InputError: channels or units are missing or wrong, the time falls, a signal is constant,
            or there are too few samples. The message names file and line or channel.
    """
    recording = read_recording(path, names)
    picked = dict([_picked(recording, role) for role in _ROLES])
    rotates = "angle" in picked
    if rotates != ("moment" in picked):
        raise input_error(
            "mixes a rotation with a translation: angle goes with moment, displacement with force",
            where=str(path),
        )
    uses = {word: ChannelUse(signal, _UNITS[word]) for word, signal in picked.items()}
    channels = recording.synchronous(uses, time_unit="")
    whole = channels.whole()
    _check_loop(whole, picked)
    displacement, force = whole.values.values()
    return MeasuredLoop(
        path.stem, str(path), whole.time, displacement, force, rotates, channels.gaps
    )


def _picked(recording: Recording, role: str) -> tuple[str, Signal]:
    """Return word and channel of a role: the one that the user names, else that of a word.

    Raises:
        InputError: there is none, or there are several.
    """
    words = _ROLES[role]
    for word in dict.fromkeys(words.values()):
        signal = recording.word(word)
        if signal is not None:
            return word, signal
    fitting = recording.worded(words)
    if len(fitting) == 1:
        signal = next(iter(fitting.values()))
        return words[word_of(signal.name)[0]], signal
    message = (
        f"has several channels of {role}: {', '.join(fitting)}"
        if fitting
        else f"has no channel of {role}; its channels are {recording.listed()}"
    )
    raise input_error(f"{message}; choose one: --channels {role}=NAME", where=str(recording.path))


def _check_loop(channels: Synchronous, signals: dict[str, Signal]) -> None:
    """Check number, size and range of the samples of a loop."""
    path, count = str(channels.path), len(channels.time)
    if count < FEWEST:
        raise input_error(f"has {count} samples; a loop needs at least {FEWEST}", where=path)
    for word, values in channels.values.items():
        size, name = float(np.max(np.abs(values))), signals[word].title or signals[word].name
        if size > LARGEST_NUMBER:
            raise input_error(
                f"has a number of size {size:g}; allowed are sizes up to {LARGEST_NUMBER:g} in SI",
                where=path,
                key=name,
            )
        if np.ptp(values) < SMALLEST_RANGE:
            raise input_error(f"is constant ({values[0]:g} in SI)", where=path, key=name)


def read_loops(paths: Sequence[Path], names: ChannelNames | None = None) -> list[MeasuredLoop]:
    """Read several loops, either all of displacement and force or all of angle and moment.

    Args:
        names: As for `read_loop`.

    Raises:
        InputError: a file is wrong (the error has all problems of all files), or some files contain
            angles and others displacements.
    """
    loops: list[MeasuredLoop] = []
    problems: list[Problem] = []
    for path in paths:
        try:
            loops.append(read_loop(path, names))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    for loop in loops:
        if loop.rotates != loops[0].rotates:
            kinds = ("angles and moments", "displacements and forces")
            first, other = kinds if loops[0].rotates else kinds[::-1]
            raise input_error(
                f"holds {other}, {loops[0].path} {first}; all files of a fit must be of one kind",
                where=loop.path,
            )
    return loops
