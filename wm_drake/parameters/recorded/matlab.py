"""Channels in MAT files of every version and in HDF5: arrays, structures and their fields."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.recorded.signal import Abscissa, Signal, real_signal, split_title

MOST_CHANNELS = 100
"""Largest number of columns of an array that are taken as channels."""

DEEPEST = 8
"""Largest depth of structures in each other."""

_UNITS = ("unit", "units", "Unit", "Units", "unit_string")
"""Names of an attribute or a field with the unit of an array beside it."""

_WAY = (
    "which only MATLAB reads; save its columns as arrays or as fields of a structure, for a "
    "timetable T: s = table2struct(timetable2table(T), 'ToScalar', true); save('x.mat', '-struct', "
    "'s')"
)


def matlab_signals(path: Path) -> Iterator[Signal]:
    """Yield the channels of a MAT file of version 4 to 7.2."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque

    variables = loadmat(path, simplify_cells=True)
    count, objects = 0, []
    for name, content in variables.items():
        if name.startswith("__"):
            continue
        if isinstance(content, MatlabOpaque) or name == "None":
            objects.append(name)
            continue
        for signal in _channels(name, "", content, 0):
            count += 1
            yield signal
    if not count:
        kinds = ", ".join(
            f"{name} ({type(content).__name__})"
            for name, content in variables.items()
            if not name.startswith("__")
        )
        if objects:
            raise input_error(f"has an object such as a timetable, {_WAY}", where=str(path))
        raise input_error(
            f"has no numeric channel; its variables are {kinds or 'none'}", where=str(path)
        )


def _channels(name: str, group: str, content: Any, depth: int) -> Iterator[Signal]:
    """Yield the channels in a variable: an array, or the fields of structures."""
    if depth > DEEPEST:
        return
    inside = f"{group}/{name}" if group else name
    if isinstance(content, Mapping):
        given = next((v for k in _UNITS if isinstance(v := content.get(k), str)), "")
        arrays = [key for key, value in content.items() if _columns(value) is not None]
        for key, value in content.items():
            if given and len(arrays) == 1 and key in arrays:  # acc.data, acc.unit: it is acc
                yield from _arrays(name, group, value, given)
            else:
                yield from _channels(str(key), inside, value, depth + 1)
    elif isinstance(content, list) or (
        isinstance(content, np.ndarray) and content.dtype.kind == "O"
    ):
        for number, part in enumerate(np.asarray(content, dtype=object).reshape(-1), 1):
            yield from _channels(f"{name}({number})", group, part, depth + 1)
    else:
        yield from _arrays(name, group, content, "")


def _columns(content: Any) -> np.ndarray | None:
    """Return an array of numbers with one column for each channel; None if it is none."""
    array = np.asarray(content)
    if array.dtype.kind == "b":
        array = array.astype(float)
    if array.dtype.kind not in "fiuc" or array.ndim > 2 or array.size < 2:
        return None
    if array.ndim < 2 or 1 in array.shape:
        return array.reshape(-1, 1)
    columns = array if array.shape[0] >= array.shape[1] else array.T
    return columns if columns.shape[1] <= MOST_CHANNELS else None


def _arrays(
    name: str, group: str, content: Any, unit: str, labels: list[str] | None = None
) -> Iterator[Signal]:
    """Yield the columns of an array as channels."""
    columns = _columns(content)
    if columns is None:
        return
    stem, in_name = split_title(name)
    for place in range(columns.shape[1]):
        single = columns.shape[1] == 1
        label = labels[place] if labels else f":,{place + 1}"
        values = columns[:, place]
        values = values if values.dtype.kind == "c" else values.astype(float)
        yield real_signal(
            Signal(
                stem if single else f"{stem}({label})",
                values,
                unit or in_name,
                group=group,
                title=name if single and stem != name else "",
            )
        )


def hdf5_signals(path: Path) -> Iterator[Signal]:
    """Yield the channels of an HDF5 file: MAT 7.3, netCDF, or arrays in groups."""
    import h5py

    with h5py.File(path, "r") as file:
        objects = list[str]()
        count = 0
        for signal in _hdf5_group(file, file, "", objects):
            count += 1
            yield signal
        if not count and objects:
            raise input_error(
                f"has an object of MATLAB, {', '.join(objects[:3])}, {_WAY}", where=str(path)
            )


def _hdf5_group(file: Any, node: Any, group: str, objects: list[str]) -> Iterator[Signal]:
    import h5py

    if group.count("/") > DEEPEST:
        return
    given = _hdf5_text(node, "unit")
    for name, content in node.items():
        if name.startswith("#"):  # references of MATLAB
            continue
        kind = _text(content.attrs.get("MATLAB_class", ""))
        if isinstance(content, h5py.Group):
            inside = f"{group}/{name}" if group else name
            unit = next((t for k in _UNITS if (t := _hdf5_text(content, k))), "")
            arrays = [k for k, v in content.items() if _is_array(v)]
            if unit and len(arrays) == 1:
                yield from _arrays(name, group, content[arrays[0]][()], unit)
            else:
                yield from _hdf5_group(file, content, inside, objects)
        elif "MATLAB_object_decode" in content.attrs:
            objects.append(f"{name} ({kind or 'object'})")
        elif h5py.check_ref_dtype(content.dtype) is not None:  # texts have equal dtypes
            yield from _referenced(file, name, group, content)
        elif _is_array(content):
            yield from _hdf5_array(name, group, content, given)


def _is_array(content: Any) -> bool:
    """Return whether a dataset has numbers of channels."""
    import h5py

    return (
        isinstance(content, h5py.Dataset)
        and _text(content.attrs.get("MATLAB_class", "")) != "char"
        and "MATLAB_object_decode" not in content.attrs
        and not content.is_scale  # it is the abscissa of others
        and (content.dtype.kind in "fiubc" or content.dtype.names == ("real", "imag"))
        and 1 <= len(content.shape) <= 2
        and content.size > 1
    )


def _referenced(file: Any, name: str, group: str, content: Any) -> Iterator[Signal]:
    """Yield the channels behind references: cells, and structures of several elements."""
    for number, reference in enumerate(np.asarray(content[()]).reshape(-1), 1):
        if reference and _is_array(file[reference]):
            yield from _hdf5_array(f"{name}({number})", group, file[reference], "")


def _hdf5_array(name: str, group: str, content: Any, given: str) -> Iterator[Signal]:
    """Yield the channels of a dataset, over its dimension scale if that is numeric."""
    values = content[()]
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    unit = next((_text(content.attrs[k]) for k in _UNITS if k in content.attrs), given)
    base, start = unit, None
    if " since " in unit:  # netCDF: seconds since 2026-05-31
        base = unit.partition(" since ")[0]
    scales = [dim[0] if len(dim) else None for dim in content.dims]
    axis, labels = Abscissa(), None
    long = int(np.argmax(content.shape))
    for place, scale in enumerate(scales):
        if scale is None or scale.name == content.name:
            continue
        if place == long and scale.dtype.kind in "fiu":
            about = _text(scale.attrs.get("units", "")).partition(" since ")[0]
            kind = "" if about else "time" if scale.name.endswith("/time") else "without a unit"
            axis = Abscissa(
                np.asarray(scale[()], dtype=float), scale.name.rpartition("/")[2], about, kind
            )
        elif place != long and scale.dtype.kind in "OSU":
            labels = [_text(part) for part in scale[()]]
    for signal in _arrays(name, group, values, base, labels):
        yield replace(signal, abscissa=axis, start=start)


def _hdf5_text(node: Any, name: str) -> str:
    """Return a text of a group: an attribute, or a row of characters of MATLAB."""
    if name in node.attrs:
        return _text(node.attrs[name])
    content = node.get(name) if hasattr(node, "get") else None
    if content is None or not hasattr(content, "shape"):
        return ""
    if _text(content.attrs.get("MATLAB_class", "")) == "char":
        return "".join(chr(int(code)) for code in np.asarray(content[()]).reshape(-1))
    return _text(content[()]) if content.dtype.kind in "OS" and content.size == 1 else ""


def _text(value: Any) -> str:
    """Return text, bytes or an array of one of them as text; "" for anything else."""
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size == 1 else ""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""
