"""Curves of a gasket: ranges of the options, the computation, and what a machine file gets."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import Bushing, ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.quantity import CHANGE, HIDDEN, Quantity
from wm_drake.solid.curves import AXIAL, MOTIONS, RADIAL, TILT, TWIST, Curve, Mesh, RimMotion
from wm_drake.solid.deformed import Deformed
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.rig.quantities import loop_quantities

WRINKLED = 0.03
"""Amplitude of wrinkles that is reported, in parts of the largest displacement."""

NEAR_REST = 0.02
"""First point of a curve, in parts of the last one: the slope at rest is measured there."""


@dataclass(frozen=True)
class Checked:
    """A curve with what its deformed states show: a class, as its mesh is drawn.

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
        unit = loop_quantities(motion.rotates)["displacement"].unit
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


AXES: dict[str, tuple[RimMotion, str]] = {
    "x": (RADIAL, ""),
    "y": (AXIAL, ""),
    "z": (RADIAL, ""),
    "about_x": (TILT, "rotational_"),
    "about_y": (TWIST, "rotational_"),
    "about_z": (TILT, "rotational_"),
}
"""Motion of each axis of a bushing, and the beginning of its keys in a machine file."""

STRETCH = Quantity("stretch", decimals=3)
STRESS = Quantity("stress", Unit("Pa", "MPa"), 3)
ENERGY = Quantity("energy", Unit("J", "J"))
COUPLING = Quantity("moment about z by displacement along x", Unit("N*m/m", "N*m/m"))
FREQUENCY = Quantity("frequency of the damping", Unit("Hz", "Hz"))
MODULUS = Quantity("part of the modulus of the curves", form="{:.3g}".format)
WORK_ERROR = Quantity("work less energy", Share(), form="{:.2g}".format)
OVERLAP = Quantity("overlap, of the wall", Share(), 2)


def curves_data(curves: Mapping[str, Checked], *, rotates: bool) -> xr.Dataset:
    """Return the points of the curves along axes, or of those about axes.

    Returns:
        Over `point`: name of the `curve`, `displacement` or `angle` of the rim [m or rad], force
        and moment on it [N, N m], `energy` of the rubber and `work` of the rim [J]. The motions are
        those of x (radial), y (axial), about y (twist) and about z (tilt).
    """
    chosen = {name: c.curve for name, c in curves.items() if c.curve.motion.rotates == rotates}
    motion = loop_quantities(rotates)["displacement"]
    wrenches = {"force_x": RADIAL, "force_y": AXIAL, "moment_y": TWIST, "moment_z": TILT}
    names = [name for name, curve in chosen.items() for _ in curve.points]
    numbers: dict[str, tuple[Quantity, list[Any]]] = {
        motion.words: (motion, [curve.values for curve in chosen.values()]),
        "energy": (ENERGY, [[p.energy for p in curve.points] for curve in chosen.values()]),
        "work": (ENERGY.named("work"), [curve.work() for curve in chosen.values()]),
    }
    for name, one in wrenches.items():
        load = loop_quantities(one.rotates)["load"].named(name.replace("_", " "))
        numbers[name] = (load, [curve.wrench(one.component) for curve in chosen.values()])
    data = {name: q.variable("point", np.concatenate(v)) for name, (q, v) in numbers.items()}
    return xr.Dataset({"curve": ("point", names), **data})


def values_data(
    curves: Mapping[str, Checked], machine: MachineParameters, *, rotates: bool
) -> xr.Dataset:
    """Return stiffness and damping along the axes, or about them.

    Returns:
        Over `axis`: `stiffness_at_rest` and `stiffness_first_20_percent` [N/m or N m/rad],
        `damping` [N s/m or N m s/rad], and the secant stiffness at both ends of the curve against
        the slope at rest, `change_at_negative_end` and `change_at_positive_end`.
    """
    quantities = loop_quantities(rotates)
    stiffness, damping = (
        replace(q, decimals=None) for q in (quantities["stiffness"], quantities["damping"])
    )
    axes = {a: (m, kind) for a, (m, kind) in AXES.items() if m.rotates == rotates}
    chosen = [curves[motion.name].curve for motion, _ in axes.values()]
    rest = np.array([curve.slope_at_rest() for curve in chosen])
    secants = np.array([curve.wrench()[[0, -1]] / curve.values[[0, -1]] for curve in chosen])
    ends = secants.T / rest - 1.0
    numbers = {
        "stiffness_at_rest": (stiffness.named("stiffness at rest"), rest),
        "stiffness_first_20_percent": (
            stiffness.named("stiffness of the first 20 %"),
            [curve.table.nominal_stiffness for curve in chosen],
        ),
        "damping": (
            damping.named("damping"),
            [getattr(machine.gasket, f"{kind}damping_{a[-1]}") for a, (_, kind) in axes.items()],
        ),
        "change_at_negative_end": (
            CHANGE.named("secant at the negative end"),
            ends[0],
        ),
        "change_at_positive_end": (CHANGE.named("at the positive end"), ends[1]),
    }
    data = {name: q.variable("axis", values) for name, (q, values) in numbers.items()}
    return xr.Dataset(data, {"axis": list(axes)})


def checks_data(curves: Mapping[str, Checked], *, rotates: bool) -> xr.Dataset:
    """Return the checks of the curves along axes, or of those about axes.

    Returns:
        Over `curve`: ends of the motion, `from` and `to` [m or rad]; stretch and stress at both
        ends [Pa]; `work_error`; where folds touch, `folds_touch_below` and `_above` [m or rad];
        `largest_overlap` by the thickness of the wall; where the wall wrinkles [m or rad]; and why
        the curve `stopped`, if it did.
    """
    chosen = {name: c for name, c in curves.items() if c.curve.motion.rotates == rotates}
    motion = replace(loop_quantities(rotates)["displacement"], decimals=2, form=None)
    all_of = list(chosen.values())
    numbers = {
        "from": (motion.named("from"), [c.curve.values[0] for c in all_of]),
        "to": (motion.named("to"), [c.curve.values[-1] for c in all_of]),
        "stretch_at_begin": (
            STRETCH.named("at the begin"),
            [c.begin.stretch for c in all_of],
        ),
        "stretch_at_end": (STRETCH.named("at the end"), [c.end.stretch for c in all_of]),
        "stress_at_begin": (STRESS.named("stress at the begin"), [c.begin.stress for c in all_of]),
        "stress_at_end": (STRESS.named("at the end"), [c.end.stress for c in all_of]),
        "work_error": (WORK_ERROR, [c.curve.work_error() for c in all_of]),
        "folds_touch_below": (motion.named("folds touch below"), [c.touches_at[0] for c in all_of]),
        "folds_touch_above": (motion.named("folds touch above"), [c.touches_at[1] for c in all_of]),
        "largest_overlap": (OVERLAP, [c.depth for c in all_of]),
        "wrinkles_below": (motion.named("wrinkles below"), [c.wrinkles_at[0] for c in all_of]),
        "wrinkles_above": (motion.named("wrinkles above"), [c.wrinkles_at[1] for c in all_of]),
    }
    data = {name: q.variable("curve", values) for name, (q, values) in numbers.items()}
    stopped = ("curve", [c.curve.stopped for c in all_of], {HIDDEN: True})
    return xr.Dataset({**data, "stopped": stopped}, {"curve": list(chosen)})


def numbers_data(
    drawing: GasketDrawing, mesh: Mesh, frequency: float, curves: Mapping[str, Checked]
) -> xr.Dataset:
    """Return numbers of the whole gasket.

    Returns:
        `frequency` of the damping [Hz]; `storage_modulus` and `loss_modulus` of the rubber there,
        in parts of the modulus of the curves; `shear_modulus` [Pa]; `coupling`, moment about z by
        displacement along x [N m/m]; `elements_along` the meridian and `elements_around` half the
        ring.
    """
    rubber, modulus = drawing.rubber, drawing.rubber.modulus(frequency)
    both = coupling({name: checked.curve for name, checked in curves.items()})
    numbers = {
        "frequency": (FREQUENCY, frequency),
        "storage_modulus": (MODULUS.named("storage modulus"), modulus.real),
        "loss_modulus": (MODULUS.named("loss modulus"), modulus.imag),
        "shear_modulus": (STRESS.named("shear modulus"), 2.0 * rubber.constants[0]),
        "coupling": (COUPLING, both),
        "elements_along": (Quantity("elements along the meridian", decimals=0), mesh.meridian),
        "elements_around": (Quantity("elements around half the ring", decimals=0), mesh.around),
    }
    return xr.Dataset({name: q.variable((), value) for name, (q, value) in numbers.items()})
