"""Recorded files: channels of laboratories, loggers and spreadsheets as labelled signals.

Enters: a file in CSV, MDF, TDMS, UFF 58, MAT or HDF5, and what the user calls its channels. Leaves:
`Signal`s, each with its unit, its abscissa and its start time as the recorder gave them, and
`Synchronous` channels in SI units on one clock.

    formats.py    which reader a file needs; MDF, TDMS and UFF 58
    text.py       CSV
    matlab.py     MAT and HDF5
    signal.py     the labelled signal, and its time in seconds
    recording.py  choice of channels by name, group and node; units
    clock.py      several clocks become one

Each reader yields what its file says, and decides nothing. All that follows is the same for every
format: it stands in `recording.py` and `clock.py`.
"""

from wm_drake.parameters.recorded.clock import Synchronous, evenly, resampled
from wm_drake.parameters.recorded.recording import (
    ACCELERATION,
    SPEED,
    ChannelNames,
    ChannelUse,
    Recording,
    read_recording,
)
from wm_drake.parameters.recorded.signal import Abscissa, Signal

__all__ = [
    "ACCELERATION",
    "SPEED",
    "Abscissa",
    "ChannelNames",
    "ChannelUse",
    "Recording",
    "Signal",
    "Synchronous",
    "evenly",
    "read_recording",
    "resampled",
]
