"""Many loops of one component, as in a test report; the test matrices of the papers."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.elements.bushing import BUSHING_LAW
from wm_drake.elements.damper_law import law_numbers, law_of
from wm_drake.laws.friction import havsin_friction
from wm_drake.laws.table import table_range
from wm_drake.parameters.damper_laws import DamperLaw, FreeStrokeDamper
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import Bench, BushingBench, DamperBench, Harmonic
from wm_drake.rigs.loops import ForceLoop, LoopMeasures, force_loops, measures_of

JIG_ARM = 0.1
"""Radius of the jig of [A] section 2.2. [m]"""

_MM = 1e-3
_A_DAMPER = (
    *itertools.product((1.0, 3.0), (6.0, 8.0, 10.0)),
    *itertools.product((5.0, 7.0), (1.0, 3.0, 5.0)),
)
_A_BUSHING = tuple(itertools.product((1.0, 3.0, 5.0, 7.0), (0.1, 0.2, 0.4)))
_A_BUSHING_ROTATION = tuple(itertools.product((1.0, 3.0, 5.0, 7.0), (2.0, 4.0)))
_A_GASKET = tuple(itertools.product((1.0, 3.0, 5.0), (1.0, 5.0, 10.0)))
_C_DAMPER = (
    *itertools.product((1.0,), (0.3, 0.5, 1.0, 5.0, 10.0)),
    *itertools.product((3.0,), (0.3, 0.5, 1.0, 3.0, 5.0)),
    *itertools.product((6.67, 10.0), (0.3, 0.5, 1.0, 1.5)),
)
MATRICES: dict[str, dict[str, tuple[Harmonic, ...]]] = {
    component: {
        paper: tuple(Harmonic(f, a * _MM) for f, a in tests) for paper, tests in papers.items()
    }
    for component, papers in {
        "damper": {"A": _A_DAMPER, "C": _C_DAMPER},
        "bushing": {"A": _A_BUSHING},
        "bushing about": {"A": _A_BUSHING_ROTATION},
        "gasket": {"A": _A_GASKET},
    }.items()
}
"""Motions by component and paper, as printed: [C] Table 1; [A] Tables 2, 4, 5 and 7. Rotations of a
bushing are driven through the jig arm, so these amplitudes are its displacements. [A] does not
rotate the gasket."""


@dataclass(frozen=True, eq=False)
class RigRun:
    """Loops of a component.

    Attributes:
        title: What is on the bench, in words.
        bench: The component on the bench.
        numbers: Its parameters for reading: key, value with unit, source.
        loops, measures: One of each for every motion.
    """

    title: str
    bench: Bench
    numbers: tuple[tuple[str, str, str], ...]
    loops: tuple[ForceLoop, ...]
    measures: tuple[LoopMeasures, ...]


def run_rig(
    title: str,
    bench: Bench,
    motions: Sequence[Harmonic],
    numbers: tuple[tuple[str, str, str], ...] = (),
    progress: Callable[[int], None] = lambda done: None,
) -> RigRun:
    """Run all motions, those of one frequency side by side, and return their loops."""
    loop_of: dict[Harmonic, ForceLoop] = {}
    for frequency in dict.fromkeys(motion.frequency for motion in motions):
        together = [motion for motion in motions if motion.frequency == frequency]
        loop_of |= dict(zip(together, force_loops(bench, together), strict=True))
        progress(len(loop_of))
    loops = tuple(loop_of[motion] for motion in motions)
    return RigRun(title, bench, numbers, loops, tuple(map(measures_of, loops)))


def beyond_tables(bench: Bench, widest: float) -> list[str]:
    """Return a sentence for a table of a bushing that motions leave, with how far they go.

    A deformation of a sponge is not known before its loop, so dampers have none here.

    Args:
        bench: Component on the bench.
        widest: Displacement or angle of the widest motion. [m; rad]
    """
    if not isinstance(bench, BushingBench):
        return []
    about = bench.axis.startswith("about")
    field = f"{'rotational_' if about else ''}stiffness_{bench.axis[-1]}"
    low, high = table_range(  # type: ignore[no-untyped-call]
        *getattr(BUSHING_LAW.unpack(bench.packed), field)
    )
    reach = float(np.arcsin(min(widest / bench.arm, 1.0))) if bench.arm else widest
    if reach <= min(-low, high) * (1.0 + 1e-9):
        return []
    unit, factor = ("deg", 180.0 / np.pi) if about else ("mm", 1.0 / _MM)
    return [
        f"{field}: the motion reaches {factor * reach:.3g} {unit}, the table goes from "
        f"{factor * low:.3g} to {factor * high:.3g} {unit}; beyond it the curve is continued by "
        "straight lines"
    ]


def slider_friction_curves(
    bench: Bench, deformation_rates: Sequence[float], rates: FloatArray
) -> FloatArray | None:
    """Return the friction on a slider at held deformation rates, the form of [C] Fig. 12. [N]

    Args:
        deformation_rates: Rates at which the sponge is deformed (k,). [m/s]
        rates: Velocities of the slider (n,). [m/s]

    Returns:
        Friction (k, n), or None for a law without such a friction.
    """
    if not isinstance(bench, DamperBench):
        return None
    friction, numbers = law_of(bench.packed).slider_friction, law_numbers(bench.packed)
    if friction is None:
        return None
    constants = [getattr(numbers, name) for name in DamperLaw.arguments(friction)[2:]]
    return np.array([[friction(w, u, *constants) for w in rates] for u in deformation_rates])


UNDEFORMED = 0.02
"""Part of the largest force of a sponge below which it counts as undeformed."""


def stroke_points(bench: Bench, loop: ForceLoop) -> dict[str, int]:
    """Return the points A to D of the loop of a free-stroke damper, as [A] Fig. 5.

    While the damper lengthens, the free stroke goes from A to B; the sponge is deformed up to C,
    where the force is largest, and the motion turns at D. The basic friction is taken off the force
    to find where the sponge has none.

    Returns:
        Samples of the loop by letter; empty for another law, or where the stroke ends before B.
    """
    if not isinstance(bench, DamperBench):
        return {}
    if law_of(bench.packed).parameters is not FreeStrokeDamper:
        return {}
    numbers = law_numbers(bench.packed)
    basic = [
        havsin_friction(v, numbers.basic_full_friction_velocity, numbers.basic_friction_force)
        for v in loop.velocity
    ]
    bottom, turn = int(np.argmin(loop.displacement)), int(np.argmax(loop.displacement))
    way = np.arange(bottom, turn if turn > bottom else turn + len(loop.force)) % len(loop.force)
    sponge = (loop.force + np.array(basic))[way]  # the friction acts against the motion
    free = np.flatnonzero(np.abs(sponge) <= UNDEFORMED * np.abs(sponge).max())
    if not len(free) or free[-1] == len(way) - 1:
        return {}
    largest = int(np.argmax(loop.force[way]))
    return {"A": int(way[free[0]]), "B": int(way[free[-1]]), "C": int(way[largest]), "D": turn}
