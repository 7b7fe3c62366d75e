"""The gasket of a machine from the curves of a drawing: tables, damping, coupling."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import Bushing, ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST, Curve


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
