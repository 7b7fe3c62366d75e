"""Elements of a machine placed at their frames, and the force that they apply to the plant."""

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.elements.bearing import DRUM_BEARING, DrumBearingParameters
from wm_drake.elements.bushing import SixComponentBushingParameters, packed_bushing_law
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FRICTION_DAMPER_STRUT, FrictionDamperParameters
from wm_drake.elements.kind import DrumPlace, ElementKind, PlacedElement, element_kind
from wm_drake.elements.mount import Mounts, mounts_at
from wm_drake.elements.rubber import (
    MOST_STATES,
    SIX_COMPONENT_BUSHING_OF_RUBBER,
    RubberBushingParameters,
)
from wm_drake.elements.spring import SPRING_STRUT, SpringStrutParameters
from wm_drake.elements.state_map import (
    StateMap,
    cabinet_part,
    carrier_part,
    drive_part,
    element_part,
    sponge_part,
    stretches_part,
    tub_part,
    tubes_part,
)
from wm_drake.elements.telescopic_damper import TelescopicDamperParameters
from wm_drake.errors import input_error, problems_inside
from wm_drake.model.bodies import drawn_pose
from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.state_layout import StateLayout
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.sections import GASKET, SECTIONS, FileSection
from wm_drake.parameters.types import FloatArray

SHORTEST_STRUT = 1e-3
"""A spring or damper that is shorter than this as drawn has no defined direction. [m]"""

_RELAXED = np.zeros(MOST_STATES)
"""States at rest of an element of this package; it has fewer or none."""

SHIPPED = {
    "springs": SPRING_STRUT,
    "dampers": FRICTION_DAMPER_STRUT,
    "bushings": SIX_COMPONENT_BUSHING_OF_RUBBER,
}
"""Kinds of elements on the tub by their section of a machine file, in packed order."""

ON_TUB = (*SHIPPED, "others")
"""Kinds of elements whose forces depend on the motion of the tub only, in packed order."""


class Parts(NamedTuple):
    """What acts in a machine; the arguments of these names of `MachineSystems.set_up`."""

    gasket: bool = True
    dampers: bool = True
    friction: bool = True


ALL_PARTS = Parts()
"""Everything acts."""


@dataclass(frozen=True)
class PlacedElements:
    """All elements of a machine at their frames, by name.

    `bearing` is None for a rigid bearing; `others` are elements of kinds of other packages.
    """

    springs: dict[str, SpringStrutParameters]
    dampers: dict[str, FrictionDamperParameters]
    bushings: dict[str, SixComponentBushingParameters]
    telescopes: dict[str, TelescopicDamperParameters]
    bearing: DrumBearingParameters | None
    others: dict[str, PlacedElement]

    def with_parts(self, parts: "Parts") -> "PlacedElements":
        """Return the elements without those parts that do not act."""
        elements = self if parts.gasket else self.without_gasket()
        elements = elements if parts.dampers else elements.without_dampers()
        return elements if parts.friction else elements.without_friction()

    def without_gasket(self) -> "PlacedElements":
        """Return the elements with the gasket disengaged; the same elements if there is none."""
        if "gasket" not in self.bushings:
            return self
        gasket = replace(self.bushings["gasket"], engaged=0.0)
        return replace(self, bushings=self.bushings | {"gasket": gasket})

    def without_dampers(self) -> "PlacedElements":
        """Return the elements without damper laws and without friction of end and tube bushings."""
        dampers = {name: damper.without_law() for name, damper in self.dampers.items()}
        telescopes = {name: tubes.without_friction() for name, tubes in self.telescopes.items()}
        return replace(self, dampers=dampers, telescopes=telescopes)

    def without_friction(self) -> "PlacedElements":
        """Return the elements with saturated friction: dry friction is zero, dashpots remain."""
        return replace(
            self,
            dampers={name: damper.without_friction() for name, damper in self.dampers.items()},
            bushings={name: bushing.without_friction() for name, bushing in self.bushings.items()},
            telescopes={name: tubes.sliding() for name, tubes in self.telescopes.items()},
            others={name: element.without_friction() for name, element in self.others.items()},
        )

    def at_rest(self) -> "PlacedElements":
        """Return the elements whose force counts in the static equilibrium."""
        if not self.others:
            return self
        others = {name: e for name, e in self.others.items() if e.kind.acts_at_rest}
        return self if len(others) == len(self.others) else replace(self, others=others)

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

    def rubber_begins(self, indices: Mapping[str, Sequence[int]]) -> tuple[int, ...]:
        """Return the index of each bushing of rubber; `indices` are those of `packed_on_tub`."""
        pairs = zip(indices["bushings"], self.bushings.values(), strict=True)
        return tuple(at for at, bush in pairs if isinstance(bush, RubberBushingParameters))

    def initial_of_others(self, drum_rate: float = 0.0) -> FloatArray:
        """Return the states of all elements of registered kinds at the start, one after the other.

        Args:
            drum_rate: Rate of the drum. [rad/s]
        """
        return np.concatenate([[], *(e.initial(drum_rate) for e in self.others.values())])

    def states(self, *, drive: bool = False, cabinet: bool = False) -> StateMap:
        """Return the states of tub, drum and all elements.

        Args:
            drive, cabinet: Whether there are those of a drive with a motor, and of a cabinet that
                moves.
        """
        return _states(self._with_states, bearing=bool(self.bearing), drive=drive, cabinet=cabinet)

    @functools.cached_property
    def _with_states(self) -> "WithStates":
        """Return the elements that have states."""
        rubber = tuple(
            (name, tuple(bushing.state_kinds))
            for name, bushing in self.bushings.items()
            if isinstance(bushing, RubberBushingParameters)
        )
        others = tuple((name, len(e.kind.states)) for name, e in self.others.items())
        return WithStates(tuple(self.dampers), tuple(self.telescopes), rubber, others)

    def mounts(self, begins: Mapping[str, Sequence[int]], states: StateMap) -> Mounts:
        """Return the indices of the elements on the tub for compiled functions.

        Args:
            begins: Index of each element in packed numbers, by kind.
        """
        kinds = tuple(element.kind for element in self.others.values())
        return mounts_at(begins, self.rubber_begins(begins), kinds, states)

    def by_tree(self) -> Iterator[tuple[str, Any, ElementKind, int]]:
        """Yield label, element, kind, and the tree it acts on beside tub and drum; 0 for none."""
        for word, field in zip(("spring", "damper", "bushing", "element"), ON_TUB, strict=True):
            for name, element in getattr(self, field).items():
                is_gasket = field == "bushings" and name == GASKET
                yield name if is_gasket else f"{word}_{name}", element, element.kind, 0
        for tree, (name, telescope) in enumerate(self.telescopes.items(), start=1):
            yield f"damper_{name}", telescope, telescope.kind, tree
        if self.bearing:
            yield "drum_bearing", self.bearing, DRUM_BEARING, 1 + len(self.telescopes)


class WithStates(NamedTuple):
    """The elements of a machine that have states.

    Attributes:
        dampers, telescopes: Names of strut dampers and of telescopic dampers.
        rubber: Name of each bushing of rubber, and the role of each of its states.
        others: Name of each element of another package, and the number of its states.
    """

    dampers: tuple[str, ...]
    telescopes: tuple[str, ...]
    rubber: tuple[tuple[str, tuple[str, ...]], ...]
    others: tuple[tuple[str, int], ...]


@functools.lru_cache(maxsize=256)  # thousands of machines of a study have the same parts
def _states(elements: WithStates, **has: bool) -> StateMap:
    """Return the states of a machine with some elements.

    Args:
        has: Whether there are states of "bearing", "drive" and "cabinet".
    """
    parts = [tub_part(), *map(sponge_part, elements.dampers)]
    parts += map(tubes_part, elements.telescopes)
    parts += [stretches_part(*bushing) for bushing in elements.rubber]
    parts += [element_part(*element) for element in elements.others]
    extra = {"bearing": carrier_part(), "drive": drive_part(), "cabinet": cabinet_part()}
    return StateMap.of([*parts, *(part for name, part in extra.items() if has[name])])


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
        for _, element, kind, tree in elements.by_tree():
            if tree not in parts:  # elements on the same trees share a part of the state
                acted_on = [0, tree] if tree else [0]
                parts[tree] = len(parts), np.concatenate([trees[t] for t in acted_on])
                self._states.append(_as_slice(np.concatenate([states[t] for t in acted_on])))
            part, of_force = parts[tree]
            force = np.empty(len(of_force))
            state = element.initial() if isinstance(element, PlacedElement) else _RELAXED
            work = state, np.empty(kind.output_size), np.empty(len(state))
            self._calls.append(
                (kind.on_plant, part, _as_slice(of_force), element.packed(), force, work)
            )

    def __call__(self, state: FloatArray) -> FloatArray:
        """Return the generalized force (n,) at a state (2 n,) of the plant. [N m, N]"""
        total = np.zeros(self._size)
        parts = [np.ascontiguousarray(state[indices]) for indices in self._states]
        for evaluate, part, of_force, packed, force, (at_rest, outputs, rate) in self._calls:
            evaluate(parts[part], at_rest, packed, force, outputs, rate)
            total[of_force] += force  # no index occurs twice
        return total


def initial_state(element: Any, drum_rate: float) -> FloatArray:
    """Return the state of a placed element at the start of a run, at a rate of the drum. [rad/s]"""
    if isinstance(element, PlacedElement):
        return element.initial(drum_rate)
    return np.zeros(element.state_size)


def structure_of(element: Any) -> list[int]:
    """Return the structure of a placed element, which is found once."""
    kept = vars(element)
    if "_structure" not in kept:
        kept["_structure"] = element.structure
    structure: list[int] = kept["_structure"]
    return structure


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
    shipped = {section: _on_tub(poses, parameters, SECTIONS[section]) for section in SHIPPED}
    return PlacedElements(
        **shipped,
        telescopes=_telescopes(plant, poses, parameters),
        bearing=_bearing(plant, parameters),
        others=_on_tub(poses, parameters, SECTIONS["elements"]),
    )


def _on_tub(
    poses: FramePoses, parameters: MachineParameters, section: FileSection
) -> dict[str, Any]:
    """Place the elements of a section, each between a frame of the tub and one of the housing.

    A section whose elements and types are those of the last machine is placed already.
    """
    tables = tuple(getattr(parameters, table) for table in section.tables)
    place = functools.partial(_placed_one_by_one, poses, parameters, section)
    return poses.placed(section.name, tables, place)


def _placed_one_by_one(
    poses: FramePoses, parameters: MachineParameters, section: FileSection
) -> dict[str, Any]:
    """Place the elements of a section as far as they differ from those of the last machine."""
    placed = {}
    for name, element in section.elements(parameters).items():
        key, parts = section.key(name), tuple(section.parts(parameters, element).values())
        place = functools.partial(_placed, poses, key, SHIPPED.get(section.name), parts)
        placed[name] = poses.placed(key, parts, place)
    return placed


def _placed(poses: FramePoses, key: str, kind: ElementKind | None, parts: Sequence[Any]) -> Any:
    """Return an element in its place.

    Args:
        kind: Its kind; None for one of another package.
        parts: The element, and the types that it names.

    Raises:
        InputError: the ends of a strut coincide.
    """
    element, kind = parts[0], kind or element_kind(parts[0].kind)
    assert kind.place is not None  # the declaration has been checked
    if kind.on_drum:
        return kind.place(DrumPlace(*poses.on_drum(element.y), poses.gravity), *parts)
    with problems_inside(key):
        ends = poses.ends(element.tub_frame, element.housing_frame)
    is_strut = kind.picture == "strut"
    if is_strut and not math.dist(ends.tub_point, ends.housing_point) > SHORTEST_STRUT:
        raise input_error(
            f"frames '{element.tub_frame}' and '{element.housing_frame}' are at the same place; "
            f"they must be more than {1e3 * SHORTEST_STRUT:g} mm apart",
            key=key,
        )
    with problems_inside(key):
        return kind.place(ends, *parts)


def _telescopes(
    plant: MultibodyPlant, poses: FramePoses, parameters: MachineParameters
) -> dict[str, TelescopicDamperParameters]:
    """Place the dampers whose tubes are bodies."""
    placed = {}
    for name, damper in parameters.telescopic_dampers.items():
        joint = plant.GetJointByName(damper.joint)
        outer = joint.parent_body().name()
        X_OF = drawn_pose(plant, joint.frame_on_parent())
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


def _bearing(plant: MultibodyPlant, parameters: MachineParameters) -> DrumBearingParameters | None:
    """Place the compliant bearing between tub and drum carrier; return None if it is rigid.

    The tub is its ground side.
    """
    bearing = parameters.imperfections.bearing
    if bearing is None:
        return None
    joint = plant.GetJointByName(parameters.drive.joint)
    X_TF = drawn_pose(plant, joint.frame_on_parent())
    axis = X_TF.rotation() @ joint.revolute_axis()
    point = X_TF.translation() + bearing.y * axis
    across = np.eye(3)[int(abs(axis[0]) > 0.9)]  # x, if the axis is not near it
    x = across - (across @ axis) * axis
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, axis, np.cross(x, axis)])
    return DrumBearingParameters(
        point,
        rotation,
        point,
        rotation,
        packed_bushing_law(bearing.as_bushing()),
        clearance=bearing.clearance,
        contact_stiffness=bearing.contact_stiffness or 0.0,
        contact_damping=bearing.contact_damping,
    )
