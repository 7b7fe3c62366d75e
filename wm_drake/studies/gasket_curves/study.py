"""Curves of a gasket: ranges of the options, the computation, and what a machine file gets."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import Bushing, ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.solid.curves import AXIAL, MOTIONS, RADIAL, TILT, TWIST, Curve
from wm_drake.solid.deformed import Deformed
from wm_drake.studies.inputs import quantities_of

WRINKLED = 0.03
"""Amplitude of wrinkles that is reported, in parts of the largest displacement."""

NEAR_REST = 0.02
"""First point of a curve, in parts of the last one: the slope at rest is measured there."""


@dataclass(frozen=True)
class Checked:
    """A curve with what its deformed states show.

    Attributes:
        begin, end: Stretch and stress at its ends.
        touches_at: First value on each side where folds touch, and NaN without. (2,) [m or rad]
        depth: Largest depth by which they overlap, in thicknesses of the wall.
        wrinkles_at: First value on each side where the wall has wrinkles, and NaN without. (2,)
    """

    curve: Curve
    begin: Deformed
    end: Deformed
    touches_at: FloatArray
    depth: float
    wrinkles_at: FloatArray


def _first(values: FloatArray, holds: Sequence[bool]) -> FloatArray:
    """Return the value nearest to 0 on each side where something holds; NaN without one. (2,)"""
    chosen = values[np.array(holds)]
    sides = chosen[chosen < 0.0][-1:], chosen[chosen > 0.0][:1]
    return np.array([side[0] if len(side) else math.nan for side in sides])


def check_gasket(machine: MachineParameters) -> None:
    """Raise InputError if a machine has no gasket."""
    if machine.gasket is None:
        message = "the machine has no gasket, whose frames the new one takes"
        raise input_error(message, key="machine")


def curve_values(options: Any, points: int) -> dict[str, list[float]]:
    """Return the values of each curve above 0, by the option of its motion. [m or rad]"""
    parts = np.append(NEAR_REST, np.arange(1, points + 1) / points)
    values = {}
    for motion in MOTIONS:
        unit = Unit("rad", "deg") if motion.rotates else Unit("m", "mm")
        largest = positive(getattr(options, motion.name), unit, f"--{motion.name}")
        values[motion.name] = (largest * parts).tolist()
    return values


def positive(text: str, unit: Unit, option: str) -> float:
    """Return a number above 0 in SI."""
    numbers = quantities_of(text, unit, option)
    if len(numbers) != 1 or not 0.0 < numbers[0] < math.inf:
        raise input_error(f"'{text}': allowed is one number above 0", where=option)
    return numbers[0]


@dataclass(frozen=True)
class GasketStiffness:
    """What a machine takes of the curves of a gasket.

    Attributes:
        tables: Force over displacement, moment over angle, by the names of the motions.
        coupling: Moment about z per displacement along x. [N]
    """

    tables: Mapping[str, ForceTable | TorqueTable]
    coupling: float


def stiffness_of(curves: Mapping[str, Curve]) -> GasketStiffness:
    """Return tables and coupling of curves by the names of the motions."""
    tables = {name: curve.table for name, curve in curves.items()}
    return GasketStiffness(tables, coupling(curves))


def damping_per_stiffness(drawing: GasketDrawing, frequency: float) -> float:
    """Return the damping of an axis by its stiffness.

        c / k = E'' / E / (2 pi f)

    A dashpot with this coefficient dissipates what the rubber does at the frequency f. E is the
    modulus of the curves, E'' the loss modulus. [s]
    """
    return drawing.rubber.modulus(frequency).imag / (2.0 * math.pi * frequency)


def coupling(curves: Mapping[str, Curve]) -> float:
    """Return the moment about z per displacement along x, and force per angle: their mean. [N]

    Both are equal because the forces have a potential. The moment is about the moved rim's centre.
    """
    moment = curves[RADIAL.name].slope_at_rest(TILT.component)
    force = curves[TILT.name].slope_at_rest(RADIAL.component)
    return 0.5 * (moment + force)


def with_gasket(
    machine: MachineParameters, stiffness: GasketStiffness, damping: float, source: str
) -> MachineParameters:
    """Return a machine whose gasket has the curves of a drawing.

    A turn about the axis maps x to -z and z to x, so the coupling of z with the angle about x has
    the other sign than that of x with the angle about z.

    Args:
        damping: Damping of an axis by its stiffness. [s]
    """
    assert machine.gasket is not None
    axes = {"x": (RADIAL, TILT), "y": (AXIAL, TWIST), "z": (RADIAL, TILT)}
    values: dict[str, Any] = {}
    for axis, motions in axes.items():
        for kind, motion in zip(("", "rotational_"), motions, strict=True):
            table = stiffness.tables[motion.name]
            values[f"{kind}stiffness_{axis}"] = table
            values[f"{kind}damping_{axis}"] = damping * table.nominal_stiffness
    both = stiffness.coupling
    values |= {"cross_stiffness_x_about_z": both, "cross_stiffness_z_about_x": -both}
    frames = {name: getattr(machine.gasket, name) for name in ("tub_frame", "housing_frame")}
    sources = {key: text for key, text in machine.sources.items() if not key.startswith("gasket.")}
    sources |= {f"gasket.{key}": source for key in values}
    return machine.model_copy(
        update={
            "name": f"{machine.name}_with_drawn_gasket",
            "gasket": Bushing(**frames, **values),
            "sources": sources,
            "measured": (),
            "published": (),
        }
    )
