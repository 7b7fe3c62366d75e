"""What an expert expects of a front loader: geometry and stiffness that no single range shows.

What is unexpected is legal: it is reported as unusual, not refused.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.errors import Problem
from wm_drake.laws.table import stiffness_force
from wm_drake.model.bodies import drawn_frame, oscillating_bodies
from wm_drake.model.equilibrium import spring_force
from wm_drake.model.machine import Setup
from wm_drake.model.scene import Outline, Scene
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.inertia import unlikely_mass_properties
from wm_drake.parameters.plausibility import unusual_numbers
from wm_drake.parameters.types import FloatArray

LARGEST_RING_RADIUS = 0.2
"""Radius of the largest usual gasket: 150 to 200 mm. [m]"""

BOUNCE_HZ = (2.0, 3.5)
"""Usual frequencies of the tub on its springs, up and down. [Hz]

The static stretch is then 20 to 62 mm. Judgement of this project; higher ones shake the housing.
"""

PUBLISHED_END_BUSHING = 0.75
"""Bending stiffness of a damper's end bushing in [A] Table 3. [N m/rad]"""

LARGEST_END_BUSHING = 5.0 * PUBLISHED_END_BUSHING
"""Largest usual bending stiffness of an end bushing: a little above the one of 3.4 N m/rad that the
results of [B] give. Judgement of this project. [N m/rad]"""

CONCRETE, STEEL = 2400.0, 7850.0
"""Densities. [kg/m^3]"""

_MM = 1e3
_STEP = 1e-4  # m
_INTO_TUB = 0.01
"""By how much the plane of a gasket may be behind the front of the tub. [m]"""


def unexpected(setup: Setup, scene: Scene) -> list[Problem]:
    """Return one problem for each property of a machine that an expert would doubt."""
    return [
        *_bounce(setup),
        *_end_bushings(setup),
        *_gasket_torsion(setup),
        *_gasket_place(setup, scene),
        *_unbalance_radii(setup, scene),
        *_densities(setup, scene),
        *_inertias(setup, scene),
    ]


def bounce_frequency(setup: Setup) -> float:
    """Return the frequency of the tub on its springs alone, up and down about rest. [Hz]"""
    up, down = setup.rest_pose.copy(), setup.rest_pose.copy()
    up[5] += _STEP
    down[5] -= _STEP
    stiffness = (spring_force(setup.elements, down) - spring_force(setup.elements, up))[2]
    context, plant = setup.plant_context, setup.machine.plant
    mass = sum(body.get_mass(context) for body in oscillating_bodies(plant))
    return float(np.sqrt(max(stiffness, 0.0) / (2.0 * _STEP * mass)) / (2.0 * np.pi))


def _bounce(setup: Setup) -> Iterator[Problem]:
    frequency, (low, high) = bounce_frequency(setup), BOUNCE_HZ
    if setup.elements.springs and not low <= frequency <= high:
        yield Problem(
            "",
            "spring_types",
            f"the tub bounces on its springs at {frequency:.2f} Hz, which is unusual; usual is "
            f"{low:g} to {high:g} Hz",
        )


def _end_bushings(setup: Setup) -> Iterator[Problem]:
    for name, kind in setup.parameters.damper_types.items():
        if kind.end_bushing.stiffness > LARGEST_END_BUSHING:
            yield Problem(
                "",
                f"damper_types.{name}.end_bushing.stiffness",
                f"{_MM * kind.end_bushing.stiffness:.0f} N mm/rad is unusual; usual is up to "
                f"{_MM * LARGEST_END_BUSHING:.0f} N mm/rad ([A] Table 3 has "
                f"{_MM * PUBLISHED_END_BUSHING:.0f})",
            )


def _gasket_torsion(setup: Setup) -> Iterator[Problem]:
    """Yield a problem if the gasket is stiffer about its axis than a ring can be.

    Own derivation. A ring of radius R with radial and tangential stiffness k_r and k_t per length
    has K_radial = pi R (k_r + k_t), from integrating over the circle, and K_Ty = 2 pi R^3 k_t. As
    k_r >= 0, K_Ty <= 2 K_radial R^2.
    """
    gasket = setup.parameters.gasket
    if gasket is None:
        return
    radial = 0.5 * (_slope(gasket.stiffness_x) + _slope(gasket.stiffness_z))
    largest = 2.0 * radial * LARGEST_RING_RADIUS**2
    torsion = _slope(gasket.rotational_stiffness_y)
    if torsion > largest:
        yield Problem(
            "",
            "gasket.rotational_stiffness_y",
            f"{torsion:.0f} N m/rad is unusual; a ring of {_MM * LARGEST_RING_RADIUS:.0f} mm "
            f"radius with the radial stiffness of this gasket has up to {largest:.0f} N m/rad",
        )


def _slope(stiffness: float | ForceTable | TorqueTable) -> float:
    """Return the stiffness at zero displacement or angle. [N/m or N m/rad]"""
    packed = packed_stiffness(stiffness)
    ends = (stiffness_force(x, packed, 0) for x in (_STEP, -_STEP))
    return float(next(ends) - next(ends)) / (2.0 * _STEP)


def _gasket_place(setup: Setup, scene: Scene) -> Iterator[Problem]:
    """Yield a problem if the gasket is not between the housing's front wall and the tub's front."""
    gasket = setup.bushings.get("gasket")
    tub = scene.outlines("tub")
    if gasket is None or not tub:
        return
    x, y, z = gasket.ground_side_point
    front = min(_extent(outline, 1)[0] for outline in tub.values())
    walls = [
        _extent(outline, 1)[1]
        for outline in scene.outlines("housing").values()
        if _extent(outline, 1)[1] <= front and _covers(outline, 0, x) and _covers(outline, 2, z)
    ]
    high = front + _INTO_TUB
    low = max(walls) + 0.1 * (front - max(walls)) if walls else -np.inf
    if not low <= y <= high:
        usual = f"{_MM * low:.0f} to {_MM * high:.0f} mm" if walls else f"up to {_MM * high:.0f} mm"
        yield Problem(
            "",
            "gasket.housing_frame",
            f"its plane at y = {_MM * y:.0f} mm is unusual; usual is {usual}, between the front "
            "wall of the housing and the front of the tub",
        )


def _unbalance_radii(setup: Setup, scene: Scene) -> Iterator[Problem]:
    drum = [outline.half[0] for outline in scene.outlines("drum").values() if outline.is_round]
    if not drum:
        return
    parameters, largest = setup.parameters, float(max(drum))
    radii = {
        f"loads.{name}.unbalances.{index}.radius": unbalance.radius
        for name, load in parameters.loads.items()
        for index, unbalance in enumerate(load.unbalances)
    }
    radii["imperfections.residual_imbalance.radius"] = (
        parameters.imperfections.residual_imbalance.radius
    )
    if parameters.unbalance_planes:
        for plane in ("front", "rear"):
            place = getattr(parameters.unbalance_planes, plane)
            radii[f"unbalance_planes.{plane}.radius"] = place.radius
    keys = {radius: key for key, radius in reversed(radii.items()) if radius > largest}
    for radius, key in keys.items():
        yield Problem(
            "",
            key,
            f"{_MM * radius:.6g} mm is unusual; the drum of the SDF has a radius of "
            f"{_MM * largest:.6g} mm",
        )


def _densities(setup: Setup, scene: Scene) -> Iterator[Problem]:
    """Yield a problem for each body that is heavier than its shapes of concrete or steel."""
    for body in oscillating_bodies(setup.machine.plant):
        volume = sum(map(_volume, scene.outlines(body.name()).values()))
        if not volume:
            continue
        density = body.get_mass(setup.plant_context) / volume
        largest, what = (
            (CONCRETE, "concrete") if "weight" in body.name() else (STEEL, "solid steel")
        )
        if density > largest:
            yield Problem(
                "",
                f"bodies.{body.name()}.mass",
                f"{body.get_mass(setup.plant_context):.4g} kg in the shape of the SDF are "
                f"{density:.0f} kg/m^3, which is unusual; usual is up to {largest:.0f} ({what})",
            )


def _inertias(setup: Setup, scene: Scene) -> Iterator[Problem]:
    """Yield a problem for each body whose inertia fits neither its mass nor its shapes."""
    plant, context = setup.machine.plant, setup.plant_context
    tub = drawn_frame(plant, plant.GetBodyByName("tub"))
    for body in oscillating_bodies(plant):
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        centre = plant.CalcRelativeTransform(context, tub, body.body_frame()) @ M_B.get_com()
        outlines = scene.outlines(body.name()).values()
        reach = max((_farthest(outline, centre) for outline in outlines), default=np.inf)
        matrix = M_B.Shift(M_B.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        if remark := unlikely_mass_properties(M_B.get_mass(), matrix, reach):
            yield Problem("", f"bodies.{body.name()}.inertia", remark)


def _farthest(outline: Outline, point: FloatArray) -> float:
    """Return the largest distance of a corner of an outline from a point in T. [m]"""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners = outline.centre + (signs * outline.half) @ outline.axes
    return float(np.linalg.norm(corners - point, axis=1).max())


def _extent(outline: Outline, axis: int) -> tuple[float, float]:
    """Return the smallest and largest coordinate of an outline along an axis of T as drawn. [m]"""
    direction, at_origin = np.eye(3)[axis], np.zeros((1, 6))
    low = outline.lower_extent(direction, at_origin)[0]
    return float(low), -float(outline.lower_extent(-direction, at_origin)[0])


def _covers(outline: Outline, axis: int, value: float) -> bool:
    """Return whether a coordinate is within an outline. [m]"""
    low, high = _extent(outline, axis)
    return low < value < high


def _volume(outline: Outline) -> float:
    """Return the volume of an outline. [m^3]"""
    a, b, c = (2.0 * outline.half).tolist()
    return float(a * b * c * (0.25 * np.pi if outline.is_round else 1.0))


def unusual_springs(setup: Setup) -> list[Problem]:
    """Return one problem for each spring that would have no positive free length.

    A spring of free length L0 > 0 pulls with t = 0 at length L0 and would have to push at length 0.
    A spring that still pulls when its hooks meet is too soft for the weight that it carries: it has
    to be stretched by more than its own length.
    """
    return [
        Problem(
            "",
            f"springs.{name}",
            f"is too soft: it carries {spring.preload:.0f} N at a length of "
            f"{_MM * spring.rest_length:.0f} mm, so its free length would be negative; is "
            "the unit of its stiffness right?",
        )
        for name, spring in setup.springs.items()
        if spring.preload > 0.0 and spring.free_length is None
    ]


def unusual_values(setup: Setup) -> list[Problem]:
    """Return one problem for each unusual number and each impossible spring of a machine."""
    return [*unusual_numbers(setup.parameters), *unusual_springs(setup)]
