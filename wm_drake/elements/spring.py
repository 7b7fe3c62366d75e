"""Suspension spring between a point of the tub and a point of the housing."""

import functools
import math
from dataclasses import dataclass, replace

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotate, scale
from wm_drake.elements.kind import Described, ElementKind, Ends, Output
from wm_drake.elements.layouts import packed_once, packed_stiffness
from wm_drake.elements.motion import tub_motion, write_generalized_force
from wm_drake.elements.strut import STRUT_ENDS, strut_line, wrench_at_origin
from wm_drake.laws.spring import spring_tension
from wm_drake.laws.table import CURVE, stiffness_force
from wm_drake.parameters.elements import Spring, SpringType
from wm_drake.parameters.types import FloatArray

SPRING = PackedLayout(
    "SpringNumbers",
    p_ToA_T=VECTOR,
    p_WH=VECTOR,
    rest_length=SCALAR,
    preload=SCALAR,
    taut_from=SCALAR,
    stiffness=CURVE,
)
"""Tub hook (T) and housing hook (W) [m], rest length [m], preload [N], tension from which it is
taut [N], stiffness [N/m or a table]."""
SPRING.units.update(preload="N", stiffness="N/m")
read_spring = SPRING.read

SLACK_TRANSITION = 1e-3
"""Elongation over which a spring changes from slack to taut. [m]

Assumption: a hook settles in its eye over about this distance. A run crosses it within a few steps;
amplitudes do not depend on it (docs/theory/springs.md).
"""

_LARGEST_SHARE = 0.5
"""Largest part of a positive preload at which a spring is fully taut, so that it is so as drawn."""

_SMALLEST_TAUT = 1e-9
"""Smallest tension at which a spring is taut, for springs whose stiffness is zero. [N]"""


@dataclass(frozen=True)
class SpringStrutParameters:
    """A spring in its place: hooks at the rest pose, preload, packed stiffness, whether it pushes.

    `pushes` is True for a spring that can be compressed; others go slack. `is_given` is True if the
    preload follows from numbers of the machine file, not from static equilibrium.
    """

    p_ToA_T: FloatArray
    p_WH: FloatArray
    preload: float
    packed_stiffness: FloatArray
    pushes: bool = False
    is_given: bool = False

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element."""
        return SPRING_STRUT

    @property
    def state_size(self) -> int:
        """Return the number of own states."""
        return 0

    @functools.cached_property
    def rest_length(self) -> float:
        """Distance of the hooks when T coincides with W. [m]"""
        return math.dist(self.p_ToA_T.tolist(), self.p_WH.tolist())

    @functools.cached_property
    def free_length(self) -> float | None:
        """Length without tension; None if it is not between 0 and twice the drawn length. [m]"""
        ends = 0.0, 2.0 * self.rest_length
        if not self._tension(ends[0], -math.inf) < 0.0 <= self._tension(ends[1], -math.inf):
            return None
        if self.structure == [0]:  # a straight line
            slope = float(stiffness_force(1.0, self.packed_stiffness, 0))
            return self.rest_length - self.preload / slope
        from scipy.optimize import brentq  # slow to import: springs with a table

        return float(brentq(self._tension, *ends, args=(-math.inf,), xtol=1e-12))

    @functools.cached_property
    def taut_from(self) -> float:
        """Tension from which it is fully taut; -inf if it pushes. [N]"""
        if self.pushes:
            return -math.inf
        return float(taut_tension(self.preload, self.packed_stiffness, 0))

    def tension(self, length: float) -> float:
        """Return its tension at a length. [m -> N]"""
        return self._tension(length, self.taut_from)

    def _tension(self, length: float, taut_from: float) -> float:
        stiffness = self.packed_stiffness, 0
        return float(spring_tension(length, self.rest_length, self.preload, taut_from, stiffness))

    @property
    def structure(self) -> list[int]:
        """Number of points of its table, 0 without one."""
        return CURVE.structure(self.packed_stiffness, 0)

    @packed_once
    def packed(self) -> FloatArray:
        """Return the numbers of `SPRING`."""
        return SPRING.pack(
            p_ToA_T=self.p_ToA_T,
            p_WH=self.p_WH,
            rest_length=self.rest_length,
            preload=self.preload,
            taut_from=self.taut_from,
            stiffness=self.packed_stiffness,
        )


@law
def taut_tension(preload, packed, at):
    """Return the tension from which a spring that goes slack is fully taut. [N]

    Args:
        preload: [N]
        packed, at: Array that holds the packed stiffness, and where it begins.
    """
    w = stiffness_force(SLACK_TRANSITION, packed, at) - stiffness_force(0.0, packed, at)
    if preload > 0.0:
        w = min(w, _LARGEST_SHARE * preload)
    return max(w, _SMALLEST_TAUT)


@law
def spring_strut_wrench(motion, p, at):
    """Return moment about To and force on the tub (six numbers, W), and tension, of a spring strut.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds the numbers of `SPRING`, and where they begin.
    """
    spring = read_spring(p, at)
    arm = rotate(motion.rotation, spring.p_ToA_T)
    length, _, direction, _, _ = strut_line(motion, arm, spring.p_WH)
    tension = spring_tension(
        length, spring.rest_length, spring.preload, spring.taut_from, spring.stiffness
    )
    return wrench_at_origin(arm, scale(-tension, direction), (0.0, 0.0, 0.0)), tension


@law
def evaluate_spring_strut(x, state, p, generalized_force, force, rate):
    """Write the force of a spring strut; arguments as in `ElementSystem`, numbers of `SPRING`."""
    wrench, tension = spring_strut_wrench(tub_motion(numbers(x)), numbers(p), 0)
    write_generalized_force(generalized_force, 0, wrench, 0.0 * tension)
    force[0] = tension


def placed_spring(ends: Ends, spring: Spring, type_: SpringType) -> SpringStrutParameters:
    """Return a spring in its place; preload 0 if it follows from static equilibrium."""
    strut = SpringStrutParameters(
        ends.tub_point,
        ends.housing_point,
        0.0,
        packed_stiffness(type_.stiffness),
        pushes=type_.action == "tension-compression",
    )
    preload = spring.preload
    if type_.free_length is not None:
        preload = -stiffness_force(type_.free_length - strut.rest_length, strut.packed_stiffness, 0)
    return strut if preload is None else replace(strut, preload=float(preload), is_given=True)


SPRING_STRUT = ElementKind(
    name="spring_strut",
    parameters=Spring,
    layout=SPRING,
    place=placed_spring,
    outputs=(Output("force", "N", "tension of a spring, > 0"),),
    words="suspension spring between a point of the tub and a point of the housing",
    described=(
        *STRUT_ENDS,
        Described("length_at_preload", "Length as drawn.", "rest_length", "m"),
        Described("preload", "Tension as drawn.", unit="N"),
        Described("taut_from", "Null for tension-compression.", unit="N"),
        Described("free_length", "Length at which h is 0; null without one.", unit="m"),
    ),
    on_plant=evaluate_spring_strut,
)
