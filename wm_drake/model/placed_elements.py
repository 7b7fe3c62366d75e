"""Elements of a machine placed at their frames, and the force that they apply to the plant."""

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.elements.bearing import evaluate_drum_bearing
from wm_drake.elements.bushing import (
    SixComponentBushingParameters,
    evaluate_six_component_bushing,
    packed_bushing_law,
)
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FrictionDamperParameters, evaluate_friction_damper
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.rubber import (
    MOST_STATES,
    RubberBushingParameters,
    evaluate_rubber_bushing,
    placed_bushing,
)
from wm_drake.elements.spring import SpringStrutParameters, evaluate_spring_strut
from wm_drake.elements.telescopic_damper import (
    FORCE_SIZE,
    TelescopicDamperParameters,
    evaluate_telescopic_damper,
)
from wm_drake.errors import input_error
from wm_drake.laws.table import stiffness_force
from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.state_layout import StateLayout
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.elements import Damper, Spring, SpringType
from wm_drake.parameters.types import FloatArray

SHORTEST_STRUT = 1e-3
"""A spring or damper that is shorter than this as drawn has no defined direction. [m]"""

LARGEST_OWN_SIZE = FORCE_SIZE
"""Most own numbers that an element writes beside its generalized force: the telescopic damper's."""


ON_TUB = ("springs", "dampers", "bushings")
"""Kinds of elements whose forces depend on the motion of the tub only, in packed order."""


@dataclass(frozen=True)
class PlacedElements:
    """All elements of a machine at their frames, by name; `bearing` is None for a rigid bearing."""

    springs: dict[str, SpringStrutParameters]
    dampers: dict[str, FrictionDamperParameters]
    bushings: dict[str, SixComponentBushingParameters]
    telescopes: dict[str, TelescopicDamperParameters]
    bearing: SixComponentBushingParameters | None

    def without_gasket(self) -> "PlacedElements":
        """Return the elements with the gasket disengaged; the same elements if there is none."""
        if "gasket" not in self.bushings:
            return self
        gasket = replace(self.bushings["gasket"], engaged=0.0)
        return replace(self, bushings=self.bushings | {"gasket": gasket})

    def without_dampers(self) -> "PlacedElements":
        """Return the elements with all damper laws and the friction of tube bushings disengaged."""
        dampers = {name: replace(damper, engaged=0.0) for name, damper in self.dampers.items()}
        telescopes = {name: tubes.without_friction() for name, tubes in self.telescopes.items()}
        return replace(self, dampers=dampers, telescopes=telescopes)

    def without_friction(self) -> "PlacedElements":
        """Return the elements with saturated friction: dry friction is zero, dashpots remain."""
        return replace(
            self,
            dampers={name: damper.without_friction() for name, damper in self.dampers.items()},
            bushings={name: bushing.without_friction() for name, bushing in self.bushings.items()},
            telescopes={name: tubes.sliding() for name, tubes in self.telescopes.items()},
        )

    def packed_on_tub(self, size: int = 0) -> tuple[FloatArray, dict[str, tuple[int, ...]]]:
        """Return the packed elements `ON_TUB`, and by kind the index of each element.

        Args:
            size: Number of packed numbers before these.
        """
        packed, indices = self._packed_on_tub
        moved = {kind: tuple(size + at for at in begins) for kind, begins in indices.items()}
        return packed.copy(), moved

    @functools.cached_property
    def _packed_on_tub(self) -> tuple[FloatArray, dict[str, list[int]]]:
        packed: list[FloatArray] = []
        size, indices = 0, dict[str, list[int]]()
        for kind in ON_TUB:
            indices[kind] = []
            for element in getattr(self, kind).values():
                indices[kind].append(size)
                packed.append(element.packed())
                size += len(packed[-1])
        return np.concatenate([[], *packed]), indices

    @functools.cached_property
    def structure_on_tub(self) -> tuple[int, ...]:
        """Number of each damper's law and number of points of every table of these elements."""
        elements = (element for kind in ON_TUB for element in getattr(self, kind).values())
        return tuple(number for element in elements for number in structure_of(element))

    def links(self) -> Iterator[tuple[Any, Callable[..., None], int]]:
        """Yield each element, its law and the tree it acts on beside tub and drum; 0 for none."""
        for spring in self.springs.values():
            yield spring, evaluate_spring_strut, 0
        for damper in self.dampers.values():
            yield damper, evaluate_friction_damper, 0
        for bushing in self.bushings.values():
            rubber = isinstance(bushing, RubberBushingParameters)
            yield bushing, evaluate_rubber_bushing if rubber else evaluate_six_component_bushing, 0
        for tree, telescope in enumerate(self.telescopes.values(), start=1):
            yield telescope, evaluate_telescopic_damper, tree
        if self.bearing:
            yield self.bearing, evaluate_drum_bearing, 1 + len(self.telescopes)


class AppliedForce:
    """Generalized force of placed elements on the plant, computed without a diagram.

    The sponges of dampers and the branches of bushings are relaxed. The diagram of the machine
    applies the same laws to the same packed numbers.
    """

    def __init__(self, elements: PlacedElements, state_layout: StateLayout) -> None:
        """Pack the elements."""
        trees, states = state_layout.trees, state_layout.states()
        self._size = state_layout.size
        self._calls = []
        self._states: list[np.ndarray | slice] = []
        parts: dict[int, tuple[int, np.ndarray]] = {}
        for element, evaluate, tree in elements.links():
            if tree not in parts:  # elements on the same trees share a part of the state
                acted_on = [0, tree] if tree else [0]
                parts[tree] = len(parts), np.concatenate([trees[t] for t in acted_on])
                self._states.append(_as_slice(np.concatenate([states[t] for t in acted_on])))
            part, of_force = parts[tree]
            force = np.empty(len(of_force))
            self._calls.append((evaluate, part, _as_slice(of_force), element.packed(), force))
        self._work = np.zeros(MOST_STATES), np.empty(LARGEST_OWN_SIZE), np.empty(MOST_STATES)

    def __call__(self, state: FloatArray) -> FloatArray:
        """Return the generalized force (n,) at a state (2 n,) of the plant. [N m, N]"""
        total, (relaxed, own, rate) = np.zeros(self._size), self._work
        parts = [np.ascontiguousarray(state[indices]) for indices in self._states]
        for evaluate, part, of_force, packed, force in self._calls:
            evaluate(parts[part], relaxed, packed, force, own, rate)
            total[of_force] += force  # no index occurs twice
        return total


def structure_of(element: Any) -> list[int]:
    """Return the structure of a placed element, which is found once."""
    kept = vars(element)
    if "_structure" not in kept:
        kept["_structure"] = element.structure
    found: list[int] = kept["_structure"]
    return found


def _as_slice(indices: np.ndarray) -> np.ndarray | slice:
    """Return indices as a slice, which numpy reads faster, if they follow one another."""
    numbers = indices.tolist()
    if numbers and numbers == list(range(numbers[0], numbers[0] + len(numbers))):
        return slice(numbers[0], numbers[-1] + 1)
    return indices


def placed_elements(
    plant: MultibodyPlant, poses: FramePoses, parameters: MachineParameters
) -> PlacedElements:
    """Place all elements; springs without preload. The plant's positions must be zero, as drawn.

    Raises:
        InputError: a spring or damper whose ends coincide.
    """
    return PlacedElements(
        _springs(poses, parameters),
        _dampers(poses, parameters),
        _bushings(poses, parameters),
        _telescopes(plant, poses, parameters),
        _bearing(plant, parameters),
    )


def _ends(poses: FramePoses, element: Any) -> tuple[FloatArray, FloatArray]:
    """Return the tub end in T and the housing end in W of an element. [m]"""
    return poses("tub", element.tub_frame)[0], poses("world", element.housing_frame)[0]


def _strut_ends(poses: FramePoses, element: Any, key: str) -> tuple[FloatArray, FloatArray]:
    """Return the ends of an element that acts along the line between them; see `_ends`."""
    tub_end, housing_end = _ends(poses, element)
    if not math.dist(tub_end, housing_end) > SHORTEST_STRUT:
        raise input_error(
            f"frames '{element.tub_frame}' and '{element.housing_frame}' are at the same place; "
            f"they must be more than {1e3 * SHORTEST_STRUT:g} mm apart",
            key=key,
        )
    return tub_end, housing_end


def _springs(poses: FramePoses, parameters: MachineParameters) -> dict[str, SpringStrutParameters]:
    """Place the springs, without the preloads that follow from static equilibrium."""
    placed = {}
    for name, spring in parameters.springs.items():
        kind, key = parameters.spring_types[spring.type], f"springs.{name}"
        place = functools.partial(_placed_spring, poses, spring, kind, key)
        placed[name] = poses.placed(key, (spring, kind), place)
    return placed


def _placed_spring(
    poses: FramePoses, spring: Spring, kind: SpringType, key: str
) -> SpringStrutParameters:
    """Place a spring; preload 0 if none is given."""
    found = SpringStrutParameters(
        *_strut_ends(poses, spring, key),
        0.0,
        packed_stiffness(kind.stiffness),
        pushes=kind.action == "tension-compression",
    )
    preload = spring.preload
    if kind.free_length is not None:
        preload = -stiffness_force(kind.free_length - found.rest_length, found.packed_stiffness, 0)
    return found if preload is None else replace(found, preload=float(preload), is_given=True)


def _dampers(
    poses: FramePoses, parameters: MachineParameters
) -> dict[str, FrictionDamperParameters]:
    """Place the dampers that are massless struts."""
    placed = {}
    for name, damper in parameters.dampers.items():
        kind, key = parameters.damper_types[damper.type], f"dampers.{name}"
        place = functools.partial(_placed_damper, poses, damper, kind, key)
        placed[name] = poses.placed(key, (damper, kind), place)
    return placed


def _placed_damper(
    poses: FramePoses, damper: Damper, kind: DamperNumbers, key: str
) -> FrictionDamperParameters:
    """Place a damper that is a massless strut."""
    ends = _strut_ends(poses, damper, key)
    return FrictionDamperParameters(*ends, kind.end_bushing, packed_damper_law(kind))


def _bushings(
    poses: FramePoses, parameters: MachineParameters
) -> dict[str, SixComponentBushingParameters]:
    """Place the bushings between tub and housing, the gasket among them."""
    placed = {}
    for name, bushing in parameters.all_bushings().items():
        ends = poses("tub", bushing.tub_frame), poses("world", bushing.housing_frame)
        place = functools.partial(placed_bushing, bushing, *ends)
        placed[name] = poses.placed(f"bushings.{name}", (bushing,), place)
    return placed


def _telescopes(
    plant: MultibodyPlant, poses: FramePoses, parameters: MachineParameters
) -> dict[str, TelescopicDamperParameters]:
    """Place the dampers whose tubes are bodies."""
    placed = {}
    for name, damper in parameters.telescopic_dampers.items():
        joint = plant.GetJointByName(damper.joint)
        outer = joint.parent_body().name()
        X_OF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        at_tub = SixComponentBushingParameters(
            *poses("tub", damper.tub_frame),
            *poses(outer, damper.outer_frame),
            packed_bushing_law(parameters.bushing_types[damper.tub_bushing]),
        )
        at_housing = SixComponentBushingParameters(
            *poses(outer, damper.inner_frame),
            *poses("world", damper.housing_frame),
            packed_bushing_law(parameters.bushing_types[damper.housing_bushing]),
        )
        axis = X_OF.rotation() @ joint.translation_axis()
        law = packed_damper_law(parameters.damper_types[damper.type])
        placed[name] = TelescopicDamperParameters(axis, at_tub, at_housing, law)
    return placed


def _bearing(
    plant: MultibodyPlant, parameters: MachineParameters
) -> SixComponentBushingParameters | None:
    """Place the compliant bearing between tub and drum carrier; return None if it is rigid.

    The tub is its ground side.
    """
    bearing = parameters.imperfections.bearing
    if bearing is None:
        return None
    joint = plant.GetJointByName(parameters.drive.joint)
    X_TF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
    axis = X_TF.rotation() @ joint.revolute_axis()
    point = X_TF.translation() + bearing.y * axis
    across = np.eye(3)[int(abs(axis[0]) > 0.9)]  # x, if the axis is not near it
    x = across - (across @ axis) * axis
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, axis, np.cross(x, axis)])
    return SixComponentBushingParameters(
        point, rotation, point, rotation, packed_bushing_law(bearing.as_bushing())
    )
