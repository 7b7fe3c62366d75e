"""Recorded channels in the formats of laboratories: MDF4, TDMS, UFF 58 and MAT files.

The packages asammdf, npTDMS and pyuff are extras (`wm-drake[lab]`); MAT files need scipy only.
"""

import logging
import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wm_drake.errors import InputError, input_error, shortened
from wm_drake.parameters.csv_files import read_csv, read_header
from wm_drake.parameters.text_files import check_regular
from wm_drake.parameters.types import FloatArray

LARGEST = 1 << 30
"""Largest size of a file of recorded channels. [byte]"""


@dataclass(frozen=True, eq=False)
class Channel:
    """A recorded channel.

    Attributes:
        unit: Text of its unit; "" if the file has none.
        values: Samples (n,).
        time: Time of each sample (n,), or None if the file has none for it. [s]
    """

    name: str
    unit: str
    values: FloatArray
    time: FloatArray | None


def is_lab_file(path: Path) -> bool:
    """Return whether the suffix of a file is that of a format of this module."""
    return path.suffix.lower() in _READERS


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric channels of a file.

    Raises:
        InputError: The file is missing or damaged, or its package is not installed.
    """
    check_regular(path, largest=LARGEST)
    read, package = _READERS[path.suffix.lower()]
    try:
        with _without_remarks():
            channels = [
                Channel(name, unit, values, None if time is None else np.asarray(time, dtype=float))
                for name, unit, samples, time in read(path)
                if (values := _numbers(samples)) is not None
            ]
    except ImportError:
        raise input_error(
            f"needs the package {package}: pip install 'wm-drake[lab]'", where=str(path)
        ) from None
    except InputError:
        raise
    except Exception as error:  # each library raises errors of its own on a damaged file
        reason = shortened(" ".join(str(error).split()) or type(error).__name__, 120)
        raise input_error(f"cannot be read by {package} ({reason})", where=str(path)) from None
    if not channels:
        raise input_error("has no numeric channel", where=str(path))
    return channels


@contextmanager
def _without_remarks() -> Iterator[None]:
    """Keep remarks of the libraries off the terminal: a damaged file makes hundreds of them."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def csv_channels(path: Path) -> list[Channel]:
    """Return the columns of a CSV file as channels; a header `Acc 1 [g]` has name and unit.

    A column without a number is left out; a value that is none is NaN.
    """
    import pandas as pd  # slow to import: CSV files

    table = read_csv(path, read_header(path))
    channels = []
    for text in table.columns:
        name, _, unit = str(text).partition("[")
        values = pd.to_numeric(table[text], errors="coerce").to_numpy(dtype=float)
        if np.isfinite(values).any():
            unit = unit.strip().removesuffix("]").strip()
            channels.append(Channel(name.strip(), unit, values, None))
    return channels


def chosen(channels: list[Channel], name: str, path: Path) -> Channel:
    """Return the channel of a name.

    Raises:
        InputError: There is none, or more than one.
    """
    same = [channel for channel in channels if channel.name == name]
    if len(same) == 1:
        return same[0]
    if same:
        raise input_error(f"has {len(same)} channels '{name}'; one is needed", where=str(path))
    names = shortened(", ".join(channel.name for channel in channels), 150)
    raise input_error(f"has no channel '{name}'; its channels are {names}", where=str(path))


def _numbers(values: Any) -> FloatArray | None:
    """Return values as a row of floats; None if they are none."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiub" or array.size < 2 or array.size != max(array.shape):
        return None
    return array.reshape(-1).astype(float)


RawChannel: TypeAlias = tuple[str, str, Any, Any]
"""Name, unit, samples and times of a channel as a library has them; the times may be None."""


def _mdf(path: Path) -> Iterator[RawChannel]:
    from asammdf import MDF

    with MDF(path) as mdf:
        for group, content in enumerate(mdf.groups):
            master = mdf.masters_db.get(group)
            for index, described in enumerate(content.channels):
                if index != master:
                    signal = mdf.get(group=group, index=index)
                    yield described.name, signal.unit or "", signal.samples, signal.timestamps


def _tdms(path: Path) -> Iterator[RawChannel]:
    from nptdms import TdmsFile

    for group in TdmsFile.read(path).groups():
        for channel in group.channels():
            samples, about = channel[:], channel.properties
            step = float(about.get("wf_increment", math.nan))
            begin = float(about.get("wf_start_offset", 0.0))
            time = begin + step * np.arange(len(samples)) if step > 0.0 else None
            yield channel.name, str(about.get("unit_string", "")), samples, time


def _uff(path: Path) -> Iterator[RawChannel]:
    import pyuff

    sets = pyuff.UFF(str(path)).read_sets()
    for data in sets if isinstance(sets, list) else [sets]:
        if data.get("type") == 58:
            unit = str(data.get("ordinate_axis_units_lab", "")).strip()
            unit = "" if unit.upper() == "NONE" else unit
            yield str(data["id1"]).strip(), unit, np.real(data["data"]), data["x"]


def _mat(path: Path) -> Iterator[RawChannel]:
    from scipy.io import loadmat

    for name, content in loadmat(path).items():
        if not name.startswith("__"):
            yield name, "", content, None


_READERS: dict[str, tuple[Callable[[Path], Iterator[RawChannel]], str]] = {
    ".mf4": (_mdf, "asammdf"),
    ".mdf": (_mdf, "asammdf"),
    ".tdms": (_tdms, "npTDMS"),
    ".uff": (_uff, "pyuff"),
    ".unv": (_uff, "pyuff"),
    ".mat": (_mat, "scipy"),
}
SUFFIXES = tuple(_READERS)
"""Suffixes of the files that this module reads."""
