"""Element kinds: one declaration of all that the program needs to know of a kind of element.

    DRAG_DAMPER = ElementKind(
        name="drag_damper",
        parameters=DragDamper,
        layout=NUMBERS,
        numbers=numbers,
        evaluate=drag_damper_wrench,
        outputs=(Output("tension", "N", "tension of the drag dampers"),),
    )
    wm_drake.register_element(DRAG_DAMPER)

From it follow the keys of the machine file, the LeafSystem and its ports, the compiled engine, the
states, equilibrium, forces on the cabinet, records and pictures.
"""

import functools
import operator
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pickle import PicklingError
from typing import Any, Literal, NamedTuple

import numpy as np

from wm_drake.compiler.chosen import ChosenLaw
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.packed import PackedLayout, generated
from wm_drake.elements.motion import drum_motion, tub_motion, write_generalized_force
from wm_drake.parameters.element_kinds import ELEMENT_KINDS, DrumElement, OfKind
from wm_drake.parameters.types import FloatArray


class Ends(NamedTuple):
    """The two frames of an element, as drawn.

    Attributes:
        tub_point, tub_rotation: Origin and rotation of the frame on the tub, in T. (3,) [m], (3, 3)
        housing_point, housing_rotation: The same of the frame on the housing, in W.
    """

    tub_point: FloatArray
    tub_rotation: FloatArray
    housing_point: FloatArray
    housing_rotation: FloatArray


class DrumPlace(NamedTuple):
    """The place of an element on the drum, as drawn.

    Attributes:
        tub_point: Point of the drum axis, in T. (3,) [m]
        tub_rotation: Rotation of a frame there whose y axis is the drum axis and whose z axis
            points to the top of the drum at angle 0, in T. (3, 3)
        gravity: Acceleration of free fall in W. (3,) [m/s^2]
    """

    tub_point: FloatArray
    tub_rotation: FloatArray
    gravity: FloatArray


@dataclass(frozen=True)
class Output:
    """A named output of an element.

    Attributes:
        name: Name of the port, and of the variable in a record behind the name of the kind.
        unit: SI unit.
        words: What it is, for records and pages.
        size: 1, 3 for a vector, or any number with a dimension of its own.
        dim: Dimension of the numbers in a record.

    Example:
        >>> import wm_drake as wm
        >>> wm.Output("tension", "N", "tension of the drag dampers").size
        1
    """

    name: str
    unit: str
    words: str = ""
    size: int = 1
    dim: str = "axis"


@dataclass(frozen=True)
class State:
    """A continuous state of an element.

    Attributes:
        name: Name of the state.
        unit: SI unit.
        initial: Value at the start of a run and at rest.

    Example:
        >>> import wm_drake as wm
        >>> wm.State("stretch", "m").initial
        0.0
    """

    name: str
    unit: str
    initial: float = 0.0


@dataclass(frozen=True)
class Described:
    """A number of a placed element that the description of a machine has beside its parameters.

    Attributes:
        name: Key. A suffix `_T` or `_W` is the frame.
        words: What it is.
        path: Where a placed element has it, by default the name.
        unit: SI unit; empty for a direction.
        shape: () for a number, (3,) for a vector, (3, 3) for a rotation.
    """

    name: str
    words: str
    path: str = ""
    unit: str = ""
    shape: tuple[int, ...] = ()

    def of(self, placed: Any) -> Any:
        """Return it of a placed element, as a number or lists; None for one that is not finite."""
        value = operator.attrgetter(self.path or self.name)(placed)
        plain = np.asarray(np.nan if value is None else value, dtype=float)
        return plain.tolist() if np.isfinite(plain).all() else None


@dataclass(frozen=True)
class RingPicture:
    """How pictures draw a ring on the drum: circles about its axis, and what moves in it as balls.

    Attributes:
        radii: Fields of the parameters that are radii of circles.
        across: Field that is the diameter of a drawn ball.
        places: Function (parameters, outputs by name) that returns where the balls are in D, from
            the origin of D. (n, balls, 3) [m]
        is_liquid: Whether what moves is liquid.
    """

    radii: tuple[str, ...]
    across: str
    places: Callable[[Any, Mapping[str, FloatArray]], FloatArray]
    is_liquid: bool = False


_ON_TUB = (
    Described("tub_point_T", "Point on the tub.", "ends.tub_point", "m", (3,)),
    Described("tub_rotation_T", "Rotation of its frame.", "ends.tub_rotation", "", (3, 3)),
)
FRAMES = (
    *_ON_TUB,
    Described("housing_point_W", "Point on the housing.", "ends.housing_point", "m", (3,)),
    Described("housing_rotation_W", "Rotation of its frame.", "ends.housing_rotation", "", (3, 3)),
)
"""The two frames of an element between tub and housing."""
DRUM_PLACE = (
    replace(_ON_TUB[0], words="Point of the drum axis."),
    replace(_ON_TUB[1], words="y is the drum axis, z points to the top of the drum at angle 0."),
    Described("gravity_W", "Acceleration of free fall.", "ends.gravity", "m/s^2", (3,)),
)
"""The place of an element on the drum."""


@dataclass(frozen=True, eq=False)
class ElementKind:
    """A kind of element.

    Attributes:
        name: Name in machine files.
        parameters: Type of its parameters in a machine file, with units; for a kind of another
            package a subclass of `Element`, or of `DrumElement` if it acts on the drum.
        layout: Packed numbers.
        outputs: Named outputs of an element, one after the other.
        numbers: Function (parameters, `Ends` or `DrumPlace`) that returns the values of the
            layout's fields by name.
        evaluate: Law (motion, state, p, at). motion: `TubMotion` of the tub, in the frame of the
            housing, or `DrumMotion` in W for an element on the drum; state: named tuple of the
            states; p, at: array that holds the packed numbers, and index where they begin, as
            `layout.read` takes them. It returns the moment about To and the force on the tub (six
            numbers, W), a tuple with the outputs, and a tuple with the time derivatives of the
            states. An element on the drum returns its torque on the drum about the drum axis as a
            seventh number. It has no branches: `where` chooses. None for a kind with `on_plant`.
        states: Continuous states.
        acts_at_rest: Whether its force counts in the static equilibrium; False for a damper.
        frictionless: Values of fields of the layout that take the dry friction out, for modes.
        words: What an element of the kind is, for pages.
        described: What the description of a machine has of its elements beside the numbers of the
            machine file, which it has by itself; by default the two frames.
        picture: What pictures draw: a strut between the two points, or nothing but its end points.
        ring: How pictures draw a ring on the drum. The place in T of each of its balls, from the
            point of the drum axis, is in three states whose names begin with `place_x`, `place_y`
            and `place_z`.
        on_plant: Law (plant_state, state, p, generalized_force, written, rate) that writes the last
            three, see `wm_drake.systems.element_system`. By default it is generated from
            `evaluate`.
        trees: Number of trees of the plant that `on_plant` acts on.
        place: Function (ends, parameters, *types) that returns an element in its place; types are
            those that its section of the machine file names. By default a `PlacedElement`.

    Example:
        >>> from wm_drake.elements.spring import SPRING_STRUT
        >>> [(output.name, output.unit) for output in SPRING_STRUT.outputs]
        [('force', 'N')]
    """

    name: str
    parameters: type[Any]
    layout: PackedLayout
    outputs: tuple[Output, ...] = ()
    numbers: Callable[[Any, Any], Mapping[str, Any]] | None = None
    evaluate: Any = None
    states: tuple[State, ...] = ()
    acts_at_rest: bool = True
    frictionless: Mapping[str, Any] = field(default_factory=dict)
    words: str = ""
    described: tuple[Described, ...] = ()
    picture: Literal["strut", "points"] = "strut"
    ring: RingPicture | None = None
    on_plant: Any = None
    trees: int = 1
    place: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        """Generate `on_plant`.

        Raises:
            ValueError: a part of the declaration is missing or has no meaning.
        """
        if self.on_plant is None:
            if self.evaluate is None or self.numbers is None:
                raise ValueError(f"element kind '{self.name}' needs numbers and evaluate")
            if not issubclass(self.parameters, OfKind):
                raise ValueError(f"element kind '{self.name}': parameters must extend Element")
            if not self.name.isidentifier():
                raise ValueError(f"element kind '{self.name}': the name must be an identifier")
            object.__setattr__(self, "on_plant", _on_plant(self))
        if not self.described and self.evaluate is not None:
            object.__setattr__(self, "described", DRUM_PLACE if self.on_drum else FRAMES)
        if self.place is None and self.numbers is not None:
            object.__setattr__(self, "place", functools.partial(_placed, self))

    @property
    def on_drum(self) -> bool:
        """Return whether its elements act on the drum, and not between tub and housing."""
        return issubclass(self.parameters, DrumElement)

    @property
    def balls(self) -> list[int]:
        """Return the index in the states of the place, three numbers, of each ball of a ring."""
        return [k for k, state in enumerate(self.states) if state.name.startswith("place_x")]

    @property
    def output_parts(self) -> dict[str, slice]:
        """Return the part of each output in the own numbers of an element, by name."""
        ends = np.cumsum([output.size for output in self.outputs]).tolist()
        pairs = zip(self.outputs, ends, strict=True)
        return {output.name: slice(end - output.size, end) for output, end in pairs}

    @property
    def output_size(self) -> int:
        """Return the number of own numbers of an element."""
        return sum(output.size for output in self.outputs)

    @property
    def title(self) -> str:
        """Return the name of the kind in diagrams, such as SpringStrut."""
        return "".join(word.capitalize() for word in self.name.split("_"))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how another process finds this kind: by its name, if that is enough."""
        if element_kind(self.name) is not self:
            raise PicklingError(f"'{self.name}' is the name of several kinds")
        return element_kind, (self.name,)


def register_element(kind: ElementKind) -> ElementKind:
    """Make an element kind of another package known, and return it.

    Machine files then have it in the section `elements`. In the metadata of a package, an entry
    point of the group `wm_drake.elements` does the same.

    Args:
        kind: The declaration.

    Raises:
        ValueError: another kind has this name.

    Example:
        A shipped kind has a section of the machine file of its own, so it is refused here.

        >>> import wm_drake as wm
        >>> from wm_drake.elements.spring import SPRING_STRUT
        >>> wm.register_element(SPRING_STRUT)
        Traceback (most recent call last):
        ValueError: element kind 'spring_strut' needs a law `evaluate`
    """
    if kind.evaluate is None:
        raise ValueError(f"element kind '{kind.name}' needs a law `evaluate`")
    ELEMENT_KINDS.register(kind)
    return kind


def element_kind(name: str) -> ElementKind:
    """Return the registered kind of a name."""
    kind = ELEMENT_KINDS.find(name, key="elements")
    assert isinstance(kind, ElementKind)
    return kind


@dataclass(frozen=True)
class PlacedElement:
    """An element of another package in its place.

    Attributes:
        packed_numbers: Numbers of `ElementKind.layout`.
        start: Function that returns the states at the start of a run from the rate of the drum
            [rad/s]; those of the kind if None.
    """

    kind: ElementKind
    ends: Ends | DrumPlace
    packed_numbers: FloatArray
    start: Callable[[float], FloatArray] | None = None

    @property
    def structure(self) -> list[int]:
        """Return what must be equal in a batch: numbers of points of tables."""
        return self.kind.layout.structure(self.packed_numbers)

    @property
    def state_size(self) -> int:
        """Return the number of its states."""
        return len(self.kind.states)

    def initial(self, drum_rate: float = 0.0) -> FloatArray:
        """Return the values of its states at the start, at a rate of the drum. [rad/s]"""
        if self.start is None:
            return np.array([state.initial for state in self.kind.states])
        return self.start(drum_rate)

    def without_friction(self) -> "PlacedElement":
        """Return the element without dry friction."""
        changed = self.kind.layout.replaced(self.packed_numbers, **self.kind.frictionless)
        return replace(self, packed_numbers=changed)

    def packed(self) -> FloatArray:
        """Return its packed numbers."""
        return self.packed_numbers.copy()


def _placed(kind: ElementKind, ends: Ends | DrumPlace, parameters: OfKind) -> PlacedElement:
    """Return an element of another package in its place."""
    assert kind.numbers is not None  # the declaration has been checked
    return PlacedElement(kind, ends, kind.layout.pack(**kind.numbers(parameters, ends)))


RegisteredLaws = namedtuple(
    "RegisteredLaws", ("wrench", "outputs", "at", "states", "on_cabinet", "torque")
)
"""Elements of other packages in a machine, for compiled functions.

wrench: `ChosenLaw` (i, x, dx, motion, p, at, first) that returns moment about To and force of
element i on the tub, and writes the time derivatives of its states unless dx is None; outputs:
`ChosenLaw` (i, x, motion, p, at, first, answer, column) that writes its outputs and returns the
index behind them; at, states: index of each element in the packed numbers, and of its first state;
on_cabinet: numbers i of the elements whose reaction acts on the cabinet, which are those not on the
drum; torque: `ChosenLaw` (i, x, motion, p, at, first) that returns the torque on the drum, None
without elements on the drum. A machine without such elements has None in place of this.
"""


def registered_laws(
    kinds: Sequence[ElementKind], at: Sequence[int], states: Sequence[int]
) -> RegisteredLaws | None:
    """Return the laws of the elements of other packages; None without any.

    Args:
        at, states: Index of each element in the packed numbers, and of its first state.
    """
    if not kinds:
        return None
    begins, firsts = (np.array(values, dtype=np.int64) for values in (at, states))
    on_cabinet = np.flatnonzero([not kind.on_drum for kind in kinds])
    wrench, outputs, torque = _laws_of(tuple(kinds))
    return RegisteredLaws(wrench, outputs, begins, firsts, on_cabinet, torque)


@functools.lru_cache(maxsize=64)
def _laws_of(kinds: tuple[ElementKind, ...]) -> tuple[ChosenLaw, ChosenLaw, ChosenLaw | None]:
    """Return the laws `wrench`, `outputs` and `torque` of `RegisteredLaws`."""
    torque = None
    if any(kind.on_drum for kind in kinds):
        torque = _law_of_all(kinds, "torque", "x, motion, p, at, first", _torque_law)
    return (
        _law_of_all(kinds, "wrench", "x, dx, motion, p, at, first", _wrench_law),
        _law_of_all(kinds, "outputs", "x, motion, p, at, first, answer, column", _outputs_law),
        torque,
    )


def _law_of_all(
    kinds: tuple[ElementKind, ...], word: str, arguments: str, law_of: Callable[[ElementKind], Any]
) -> ChosenLaw:
    """Return a law (i, arguments) that calls that of the kind of element i."""
    lines, names = [f"def element_{word}(i, {arguments}):"], {}
    each = list(dict.fromkeys(kinds))
    for number, kind in enumerate(each):
        names[f"law_{number}"] = law_of(kind)
        last = number == len(each) - 1
        of_kind = " or ".join(f"i == {i}" for i, other in enumerate(kinds) if other is kind)
        lines += [] if last else [f"    if {of_kind}:"]
        lines.append(f"    {'' if last else '    '}return law_{number}({arguments})")
    compiled = generated(f"element_{word}", "\n".join(lines) + "\n", names)
    title = "+".join(f"{kind.name}{len(kind.states)}({kind.layout.name})" for kind in kinds)
    made_by = _law_of_all, (kinds, word, arguments, law_of)
    return ChosenLaw(compiled, f"{word} of {title}", made_by)


@functools.cache
def _wrench_law(kind: ElementKind) -> Any:
    """Return the law (x, dx, motion, p, at, first) of an element of a kind."""
    rates = [f"        dx[first + {k}] = rates[{k}]" for k in range(len(kind.states))]
    put = [f"def {kind.name}_rates(dx, first, rates):", "    if dx is not None:"]
    names: dict[str, Any] = _names(kind)
    write = ""
    if rates:
        names["put"] = generated(f"{kind.name}_rates", "\n".join([*put, *rates]) + "\n", {})
        write = "    put(dx, first, rates)\n"
    source = (
        f"def {kind.name}_wrench(x, dx, motion, p, at, first):\n"
        f"    wrench, outputs, rates = {_evaluated(kind)}\n"
        f"{write}    return {_six('wrench')}\n"
    )
    return generated(f"{kind.name}_wrench", source, names)


@functools.cache
def _outputs_law(kind: ElementKind) -> Any:
    """Return the law (x, motion, p, at, first, answer, column) of an element of a kind."""
    size = kind.output_size
    lines = [f"    answer[column + {k}] = outputs[{k}]" for k in range(size)]
    source = (
        f"def {kind.name}_outputs(x, motion, p, at, first, answer, column):\n"
        f"    wrench, outputs, rates = {_evaluated(kind)}\n"
    )
    source += "\n".join([*lines, f"    return column + {size}"]) + "\n"
    return generated(f"{kind.name}_outputs", source, _names(kind))


@functools.cache
def _torque_law(kind: ElementKind) -> Any:
    """Return the law (x, motion, p, at, first) of the torque of an element on the drum."""
    lines = [f"def {kind.name}_torque(x, motion, p, at, first):"]
    if kind.on_drum:
        lines += [f"    wrench, outputs, rates = {_evaluated(kind)}", "    return wrench[6]"]
    else:
        lines.append("    return 0.0 * motion.velocity[0]")
    return generated(f"{kind.name}_torque", "\n".join(lines) + "\n", _names(kind))


def _evaluated(kind: ElementKind) -> str:
    """Return the source that evaluates an element in a law of `RegisteredLaws`."""
    motion = "drum_motion(motion, x)" if kind.on_drum else "motion"
    return f"evaluate({motion}, {_states(kind, 'x', 'first')}, p, at)"


def _six(wrench: str) -> str:
    """Return the source of moment and force of a wrench."""
    return f"({', '.join(f'{wrench}[{k}]' for k in range(6))})"


def _on_plant(kind: ElementKind) -> Any:
    """Return the law (plant_state, state, p, generalized_force, written, rate) of a kind."""
    lines = [
        f"def {kind.name}_on_plant(x, state, p, generalized_force, written, rate):",
        "    motion = tub_motion(numbers(x))",
        "    motion = drum_motion(motion, x)" if kind.on_drum else "",
        f"    wrench, outputs, rates = evaluate(motion, {_states(kind, 'state')}, numbers(p), 0)",
        f"    torque = {'wrench[6]' if kind.on_drum else '0.0 * wrench[0]'}",
        "    write_generalized_force(generalized_force, 0, wrench, torque)",
        *(f"    written[{k}] = outputs[{k}]" for k in range(kind.output_size)),
        *(f"    rate[{k}] = rates[{k}]" for k in range(len(kind.states))),
    ]
    names = _names(kind) | {
        "tub_motion": tub_motion,
        "numbers": numbers,
        "write_generalized_force": write_generalized_force,
    }
    return generated(f"{kind.name}_on_plant", "\n".join(lines) + "\n", names)


def _names(kind: ElementKind) -> dict[str, Any]:
    """Return the global names of the generated laws of a kind."""
    names: dict[str, Any] = {"evaluate": kind.evaluate, "drum_motion": drum_motion}
    if kind.states:
        names["States"] = namedtuple(f"{kind.name}_states", [state.name for state in kind.states])
    return names


def _states(kind: ElementKind, array: str, first: str = "") -> str:
    """Return the source of the named tuple of states in an array, from an index on."""
    if not kind.states:
        return "()"
    begin = f"{first} + " if first else ""
    return f"States({', '.join(f'{array}[{begin}{k}]' for k in range(len(kind.states)))})"
