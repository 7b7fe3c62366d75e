"""Which reader a recorded file needs, by what it contains; MDF, TDMS and UFF 58.

The packages asammdf, npTDMS and pyuff are extras (`wm-drake[lab]`); the other formats need none.
"""

import logging
import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wm_drake.errors import InputError, InputNotice, input_error, shortened
from wm_drake.parameters.recorded.matlab import hdf5_signals, matlab_signals
from wm_drake.parameters.recorded.signal import TIME, Abscissa, Signal, real_signal
from wm_drake.parameters.recorded.text import text_signals
from wm_drake.parameters.text_files import check_regular
from wm_drake.parameters.types import FloatArray

LARGEST = 1 << 30
"""Largest size of a file of recorded channels. [byte]"""


@dataclass(frozen=True)
class Format:
    """A format of recorded files.

    Attributes:
        read: Yields the channels.
        package: Package that reads it, for messages.
        suffixes: Usual suffixes.
    """

    read: Callable[[Path], Iterator[Signal]]
    package: str
    suffixes: tuple[str, ...]


def read_signals(path: Path) -> list[Signal]:
    """Return the numeric channels of a file as its format has them.

    Raises:
        InputError: The file is missing or damaged, of no known format, or its package is not
            installed.
    """
    check_regular(path, largest=LARGEST)
    form = format_of(path)
    if form is TEXT:
        return _checked(path, list(form.read(path)))
    try:
        with _without_remarks():
            signals = list(form.read(path))
    except ImportError:
        raise input_error(
            f"needs the package {form.package}: pip install 'wm-drake[lab]'", where=str(path)
        ) from None
    except InputError:
        raise
    except Exception as error:  # each library raises errors of its own on a damaged file
        reason = shortened(" ".join(str(error).split()) or type(error).__name__, 120)
        raise input_error(f"cannot be read by {form.package} ({reason})", where=str(path)) from None
    return _checked(path, signals)


def _checked(path: Path, signals: list[Signal]) -> list[Signal]:
    if not signals:
        raise input_error("has no numeric channel", where=str(path))
    return signals


@contextmanager
def _without_remarks() -> Iterator[None]:
    """Keep remarks of the libraries off the terminal: a damaged file makes hundreds of them."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", InputNotice)
            yield
    finally:
        logging.disable(before)


def format_of(path: Path) -> Format:
    """Return the format of a file: by its first bytes, else by its suffix, else text.

    Raises:
        InputError: it is a workbook, an archive or a sound, which is read after an export.
    """
    with path.open("rb") as file:
        start = file.read(2048)
    for sign, form in _SIGNS.items():
        if start.startswith(sign):
            return form
    if HDF5_SIGN in (start[at : at + 8] for at in (0, 512, 1024)):
        return HDF5
    if [line.strip() for line in start.splitlines()[:1]] == [b"-1"]:
        return UFF
    for sign, (what, way) in _REFUSED.items():
        if start.startswith(sign):
            raise input_error(f"is {what}; {way}", where=str(path))
    suffix = path.suffix.lower()
    form = next((form for form in FORMATS if suffix in form.suffixes), TEXT)
    if form in _SIGNS.values() and form is not MAT:  # MAT of version 4 has no sign
        raise input_error(
            f"is not in the format of its suffix {suffix}: {form.package} cannot read it",
            where=str(path),
        )
    return form


def numbers(values: Any) -> np.ndarray | None:
    """Return values as a row of floats, or complex numbers; None if they are none.

    Dates become seconds after the first one.
    """
    array = np.asarray(values)
    if array.dtype.kind == "M" and array.size:
        since = (array - array.reshape(-1)[0]).astype("timedelta64[ns]")
        array = np.where(np.isnat(array), np.nan, since.astype(np.int64) * 1e-9)
    if array.dtype.kind not in "fiubc" or array.size < 2 or array.size != max(array.shape):
        return None
    row = array.reshape(-1)
    return row if row.dtype.kind == "c" else row.astype(float)


_SYNC = {
    2: "an angle (sync type 2)",
    3: "a distance (sync type 3)",
    4: "a count of samples (sync type 4)",
}
"""What the master of a group of MDF is, if it is no time."""


def _mdf(path: Path) -> Iterator[Signal]:
    from asammdf import MDF

    with MDF(path) as mdf:
        labels = [_group_label(group) for group in mdf.groups]
        for number, content in enumerate(mdf.groups):
            place = mdf.masters_db.get(number)
            master = content.channels[place] if place is not None else None
            group = labels[number]
            if not group or labels.count(group) > 1:
                group = f"{group or 'group'} {number}"
            for index, described in enumerate(content.channels):
                if index == place:
                    continue
                signal = mdf.get(group=number, index=index, ignore_invalidation_bits=True)
                values = numbers(signal.samples)
                if values is None:
                    continue
                if signal.invalidation_bits is not None:
                    values = np.where(np.asarray(signal.invalidation_bits, bool), np.nan, values)
                axis = Abscissa(kind="the file has no master channel for this group")
                if master is not None:
                    sync = getattr(master, "sync_type", 1)
                    stamps = np.asarray(signal.timestamps, dtype=float)
                    kind = _SYNC.get(sync, TIME)
                    axis = Abscissa(stamps, master.name, master.unit or "", kind)
                yield real_signal(
                    Signal(described.name, values, signal.unit or "", axis, group=group)
                )


def _group_label(group: Any) -> str:
    """Return the name of a group of MDF; "" if it has none."""
    about = group.channel_group
    name = getattr(about, "acq_name", "") or ""
    return str(name).strip()


_TDMS_UNITS = ("unit_string", "NI_UnitDescription", "unit", "units", "Unit", "Units")
"""Properties with the unit of a channel, of LabVIEW, DAQmx and others."""


def _tdms(path: Path) -> Iterator[Signal]:
    from nptdms import TdmsFile

    for group in TdmsFile.read(path).groups():
        for channel in group.channels():
            about = channel.properties
            values = numbers(channel[:])
            if values is None:
                continue
            unit = next((str(about[key]) for key in _TDMS_UNITS if about.get(key)), "")
            axis, start = _waveform(about, len(values))
            first = np.asarray(channel[:1])
            if first.dtype.kind == "M":
                start, unit = _nanoseconds(first[0]), "s"
            yield real_signal(Signal(channel.name, values, unit, axis, start, group.name))


def _nanoseconds(stamp: Any) -> int | None:
    """Return a date as nanoseconds since 1970; None if it is none, or before."""
    if stamp is None or np.isnat(np.datetime64(stamp)):
        return None
    count = int(np.datetime64(stamp, "ns").astype(np.int64))
    return count if count > 0 else None


def _waveform(about: Any, count: int) -> tuple[Abscissa, int | None]:
    """Return abscissa and start time of a waveform of TDMS."""
    step = float(about.get("wf_increment", math.nan))
    if not step > 0.0:
        return Abscissa(), None
    begin = float(about.get("wf_start_offset", 0.0))
    unit = str(about.get("wf_xunit_string", "") or "")
    name = str(about.get("wf_xname", "") or "")
    stamps: FloatArray = begin + step * np.arange(count, dtype=float)
    axis = Abscissa(stamps, name or "time", unit, "" if unit else TIME)
    if not unit and name and any(word in name.lower() for word in _NO_TIME):
        axis = Abscissa(stamps, name, unit, "which is no time")
    return axis, _nanoseconds(about.get("wf_start_time"))


_NO_TIME = ("freq", "angle", "winkel", "weg", "distance", "order", "ordnung")
"""Parts of a name of an abscissa without a unit that is no time."""

_UFF_TYPES = {
    8: "a displacement",
    11: "a velocity",
    12: "an acceleration",
    18: "a frequency",
    19: "a drum speed",
    20: "an order",
}
"""Kinds of an abscissa of UFF 58 that are no time, by their numbers."""

_UFF_FUNCTIONS = {
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response",
    5: "transmissibility",
    6: "coherence",
    7: "auto correlation",
    8: "cross correlation",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
    27: "order function",
}
_DIRECTIONS = ("", "X", "Y", "Z", "RX", "RY", "RZ")


def _uff(path: Path) -> Iterator[Signal]:
    import pyuff

    file = pyuff.UFF(str(path))
    places = [int(at) for at in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    for at in places:
        data = file.read_sets(at)
        values = numbers(data["data"])
        if values is None:
            continue
        name, count = _uff_text(data, "id1") or f"set {at + 1}", int(data["num_pts"])
        if count > len(values):
            raise input_error(
                f"ends early: {len(values)} of {count} values", where=str(path), key=name
            )
        axis = _uff_axis(data)
        assert axis.values is not None
        signal = Signal(
            name,
            values[:count],  # zeros fill the last line
            _uff_text(data, "ordinate_axis_units_lab"),
            replace(axis, values=axis.values[:count]),
            node=_uff_node(data),
        )
        yield real_signal(signal)


def _uff_text(data: dict[str, Any], key: str) -> str:
    text = str(data.get(key, "") or "").strip()
    return "" if text.upper() == "NONE" else text


def _uff_node(data: dict[str, Any]) -> str:
    """Return node and direction of a response, such as ``2+Z``; "" if there is no node."""
    node, direction = int(data.get("rsp_node", 0) or 0), int(data.get("rsp_dir", 0) or 0)
    if not node:
        return ""
    sign = "-" if direction < 0 else "+"
    known = 0 < abs(direction) < len(_DIRECTIONS)
    return f"{node}{sign}{_DIRECTIONS[abs(direction)]}" if known else str(node)


def _uff_axis(data: dict[str, Any]) -> Abscissa:
    """Return the abscissa of a set of UFF 58."""
    kind = int(data.get("abscissa_spec_data_type", 0) or 0)
    function = int(data.get("func_type", 0) or 0)
    unit = _uff_text(data, "abscissa_axis_units_lab")
    words = _UFF_TYPES.get(kind, TIME if kind == 17 or (function == 1 and not unit) else "")
    if function in _UFF_FUNCTIONS:
        words = f"{_UFF_TYPES.get(kind, 'no time')}: its function is {_UFF_FUNCTIONS[function]}"
    if not words and not unit:
        words = f"which the file does not name (abscissa of type {kind})"
    name = _uff_text(data, "abscissa_axis_lab")
    return Abscissa(np.asarray(data["x"], dtype=float).reshape(-1), name, unit, words)


MDF_FORMAT = Format(_mdf, "asammdf", (".mf4", ".mdf", ".mf3"))
TDMS = Format(_tdms, "npTDMS", (".tdms",))
UFF = Format(_uff, "pyuff", (".uff", ".unv", ".uf"))
MAT = Format(matlab_signals, "scipy", (".mat",))
HDF5 = Format(hdf5_signals, "h5py", (".h5", ".hdf5", ".hdf", ".nc"))
TEXT = Format(text_signals, "text", (".csv", ".txt", ".tsv", ".asc", ".dat"))
FORMATS = (TEXT, MDF_FORMAT, TDMS, UFF, MAT, HDF5)
SUFFIXES = tuple(suffix for form in FORMATS for suffix in form.suffixes)
"""Usual suffixes of recorded files."""

HDF5_SIGN = b"\x89HDF\r\n\x1a\n"
_SIGNS = {
    b"MDF ": MDF_FORMAT,
    b"UnFinMF": MDF_FORMAT,
    b"TDSm": TDMS,
    b"MATLAB 5.0 MAT-file": MAT,
}
"""First bytes of binary formats."""

_REFUSED = {
    b"PK\x03\x04": ("a workbook or another archive", "save the sheet as CSV, or unpack it"),
    b"\xd0\xcf\x11\xe0": ("a workbook", "save the sheet as CSV"),
    b"\x1f\x8b": ("compressed", "unpack it"),
    b"RIFF": ("a sound file", "export it as CSV, MAT or UFF 58, with its unit"),
}
"""First bytes of files that are read after an export: what they are, and what to do."""
