"""From the frozen types of a machine file to packed numbers: curves, and the layout of a type."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel

from wm_drake.compiler.packed import SCALAR, PackedLayout
from wm_drake.laws.table import CURVE, pack_number, pack_table
from wm_drake.parameters.drive import TorqueLimit, TorqueLimitTable
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.keys import unit_of
from wm_drake.parameters.monotone import monotone_cubics
from wm_drake.parameters.types import FloatArray


def layout_of(name: str, kind: type[BaseModel], fields: Sequence[str]) -> PackedLayout:
    """Return the layout of fields of a type: its numbers in the order of the type, then its curves.

    Args:
        kind: Type of a machine file.
        fields: Names of its fields; what is not a plain number is a curve.
    """
    numbers = [field for field in fields if kind.model_fields[field].annotation is float]
    curves = [field for field in fields if field not in numbers]
    layout = PackedLayout(name, **dict.fromkeys(numbers, SCALAR), **dict.fromkeys(curves, CURVE))
    layout.units.update(units_of(kind))
    return layout


def units_of(kind: type[BaseModel]) -> dict[str, str]:
    """Return the SI unit of each field of a type of a machine file that is a number or a curve."""
    units = {
        name: unit_of(field.annotation, field.metadata) for name, field in kind.model_fields.items()
    }
    return {name: unit.si for name, unit in units.items() if unit is not None}


def packed_once(pack: Callable[[Any], FloatArray]) -> Callable[[Any], FloatArray]:
    """Return a method `packed` of a frozen component that packs once; each call gets a copy."""

    @functools.wraps(pack)
    def packed(self: Any) -> FloatArray:
        kept = vars(self)
        if "_packed" not in kept:
            kept["_packed"] = pack(self)
        return np.array(kept["_packed"])

    return packed


def packed_fields(layout: PackedLayout, values: BaseModel) -> FloatArray:
    """Return the packed numbers of a layout that `layout_of` made, from an instance of its type."""
    named = {field: getattr(values, field) for field in layout.fields}
    curves = [field for field, kind in layout.fields.items() if kind is CURVE]
    packed = packed_stiffnesses([named[field] for field in curves])
    return layout.pack(**named | dict(zip(curves, packed, strict=True)))


def packed_stiffness(stiffness: float | ForceTable | TorqueTable) -> FloatArray:
    """Return a stiffness in the packed form of `wm_drake.laws.table`."""
    return packed_stiffnesses([stiffness])[0]


def packed_stiffnesses(stiffnesses: Sequence[float | ForceTable | TorqueTable]) -> list[FloatArray]:
    """Return several packed stiffnesses; tables over the same points share one call of scipy.

    A study makes thousands of such calls.
    """
    packed = [pack_number(s) if isinstance(s, float | int) else np.empty(0) for s in stiffnesses]
    curves = {
        index: s.curve
        for index, s in enumerate(stiffnesses)
        if isinstance(s, ForceTable | TorqueTable)
    }
    for points in dict.fromkeys(x for x, _ in curves.values()):
        alike = [index for index, (x, _) in curves.items() if x == points]
        for index, curve in zip(
            alike, _packed_curves(points, tuple(curves[index][1] for index in alike)), strict=True
        ):
            packed[index] = curve
    return packed


def packed_torque_limit(limit: TorqueLimit | TorqueLimitTable) -> FloatArray:
    """Return the table of a torque limit as a curve that is constant at its end; 0 without one."""
    if isinstance(limit, TorqueLimit):
        return pack_number(0.0)
    cubics = monotone_cubics(np.array(limit.speed), np.array(limit.torque)[:, None])[:, :, 0]
    return pack_table(limit.speed, cubics, 0.0)


@functools.lru_cache(maxsize=256)  # a study packs the same curves for each run
def _packed_curves(x: tuple[float, ...], ys: tuple[tuple[float, ...], ...]) -> FloatArray:
    """Return packed tables, a row for each: monotone cubics (PCHIP) through the points."""
    cubics = monotone_cubics(np.array(x), np.array(ys).T)  # (4, pieces, curves)
    h, (_, a, b, c) = x[-1] - x[-2], cubics[:, -1]
    # rounding can make a flat end fall by 1e-11
    end_slopes = np.maximum(a + h * (2.0 * b + h * 3.0 * c), 0.0)
    packed = np.array(
        [pack_table(x, cubics[..., i], float(slope)) for i, slope in enumerate(end_slopes)]
    )
    packed.flags.writeable = False
    return packed
