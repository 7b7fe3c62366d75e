"""Elements of an SDF file: what each may hold, and why others are refused.

This is the only declaration: the check of a file, the table of the manual and the tests read it.
What a machine does not represent is refused, so that nothing of a file is dropped in silence.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from wm_drake.errors import Problem, nearest_names, shortened
from wm_drake.model.sdf_text import Node
from wm_drake.parameters.inertia import LARGEST_MASS
from wm_drake.parameters.units import comma_hint

LONGEST_LENGTH = 3.0
"""Largest length and distance from an origin: above any washing machine. [m]"""

NO_LIMIT = 1e15
"""From this size on a limit is none: sdformat writes 1e16 for a limit that is not given."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_COUNTS = {1: "a number", 3: "three numbers", 4: "four numbers", 6: "six numbers", 7: "7 numbers"}


class SdfValue(Protocol):
    """Text of an element."""

    @property
    def allowed(self) -> str:
        """Return what is allowed, in words."""

    def fault(self, node: Node) -> str:
        """Return what is wrong with the text of an element; empty if nothing is."""


@dataclass(frozen=True)
class Empty:
    """No text: the element holds others, or is a sign by itself."""

    allowed = ""

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        return f"has the text {_shown(node)}; allowed are elements only" if node.words else ""


@dataclass(frozen=True)
class SdfName:
    """A name, such as that of a link or of a file."""

    allowed = "a name"

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        return "" if node.words else "is empty; allowed is a name"


@dataclass(frozen=True)
class SdfChoice:
    """One of a few words, because another would change what the machine does not represent."""

    words: tuple[str, ...]
    why: str

    @property
    def allowed(self) -> str:
        """Return what is allowed, in words."""
        return f"{self.words[0]}: {self.why}"

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        if node.words in self.words:
            return ""
        return f"is {_shown(node)}; allowed is {self.words[0]}: {self.why}"


@dataclass(frozen=True)
class SdfNumbers:
    """Numbers in SI units.

    Attributes:
        count: How many.
        unit: Unit; empty for none.
        above: Whether they must be above 0.
        low, high: Smallest and largest ones.
        more: Further numbers that may follow.
    """

    count: int = 1
    unit: str = ""
    above: bool = False
    low: float = -math.inf
    high: float = math.inf
    more: int = 0

    @property
    def allowed(self) -> str:
        """Return what is allowed, in words."""
        low = " above 0" if self.above else ""
        low = f" from {self.low:g}" if math.isfinite(self.low) else low
        high = f" up to {self.high:g}" if math.isfinite(self.high) else ""
        return f"{_COUNTS[self.count]}{low}{high}" + (f" ({self.unit})" if self.unit else "")

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        words = node.words.split()
        if not self.count <= len(words) <= self.count + self.more or not all(map(_is_plain, words)):
            return _not_allowed(node, self.allowed)
        values = [float(word) for word in words]
        if all(
            self.low <= value <= self.high and not (self.above and value <= 0.0) for value in values
        ):
            return ""
        guess = unit_of_length(max(map(abs, values))) if self.unit == "m" else ""
        return f"is {_shown(node)}; allowed is {self.allowed}{guess}"


@dataclass(frozen=True)
class SdfLimit:
    """A number, or none of an unbounded joint."""

    allowed = "a number, or inf for no limit"
    unbounded: str = ""
    """Why the joint must have no limit; empty if it may have one."""

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        if _INFINITE.fullmatch(node.words):
            return ""
        if not _is_plain(node.words):
            return _not_allowed(node, self.allowed)
        if self.unbounded and abs(float(node.words)) < NO_LIMIT:
            return f"is {_shown(node)}; allowed is inf: {self.unbounded}"
        return ""


@dataclass(frozen=True)
class SdfPose:
    """A position and an orientation, in the notation that the attributes of the element say."""

    allowed = "six numbers: x, y, z up to 3 (m), roll, pitch, yaw (rad)"

    def fault(self, node: Node) -> str:
        """Return what is wrong; see `Value`."""
        if not node.words:
            return ""
        is_quaternion = node.attributes.get("rotation_format") == "quat_xyzw"
        in_degrees = node.attributes.get("degrees") in ("true", "1")
        allowed, words = self.allowed, node.words.split()
        if is_quaternion:
            allowed = "7 numbers: x, y, z up to 3 (m), and a quaternion x, y, z, w of length 1"
        elif in_degrees:
            allowed = allowed.replace("rad", "deg")
        if len(words) != (7 if is_quaternion else 6) or not all(map(_is_plain, words)):
            return _not_allowed(node, allowed)
        values = [float(word) for word in words]
        farthest = max(map(abs, values[:3]))
        if farthest > LONGEST_LENGTH:
            return f"is {_shown(node)}; allowed are {allowed}{unit_of_length(farthest)}"
        if is_quaternion:
            off = abs(sum(value * value for value in values[3:]) - 1.0)
            return "" if off < 1e-3 else f"is {_shown(node)}; allowed are {allowed}"
        largest = max(map(abs, values[3:]))
        if largest > (360.0 if in_degrees else 6.3):
            hint = '; are the angles in degrees? Then write <pose degrees="true">'
            return f"is {_shown(node)}; allowed are {allowed}{'' if in_degrees else hint}"
        return ""


def _is_plain(word: str) -> bool:
    """Return whether a word is a finite number as every program reads it."""
    return bool(_NUMBER.fullmatch(word)) and abs(float(word)) <= 1e300


def _shown(node: Node) -> str:
    return f"'{shortened(node.words, 60)}'"


def _not_allowed(node: Node, allowed: str) -> str:
    verb = "is" if allowed.startswith("a ") else "are"
    return (
        f"is {_shown(node)}; allowed {verb} {allowed}, without units and separated by "
        f"spaces{comma_hint(node.words)}"
    )


def unit_of_length(value: float) -> str:
    """Return the question whether a length is in a smaller unit; empty if it cannot be. [m]"""
    for unit, size in (("mm", 1e-3), ("in", 0.0254), ("cm", 1e-2)):
        if 1e-3 <= value * size <= 2.0:
            return f"; is it in {unit}? One {unit} is {size:g} m"
    return ""


@dataclass(frozen=True)
class Refused:
    """An element that a machine does not represent.

    Attributes:
        why: What to do in place of it.
    """

    why: str


@dataclass(frozen=True)
class SdfElement:
    """An element that is honoured.

    Attributes:
        meaning: What becomes of it.
        value: Its text.
        children: Elements that it may have, by name.
        attributes: Its attributes: allowed words of each, none for any.
        needed: Elements and attributes that it must have.
        many: Whether there may be several side by side.
    """

    meaning: str
    value: SdfValue = Empty()
    children: Mapping[str, "SdfElement | Refused"] = field(default_factory=dict)
    attributes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    needed: tuple[str, ...] = ()
    many: bool = False

    @property
    def honoured(self) -> list[str]:
        """Return the names of the elements that it may have."""
        return [tag for tag, kind in self.children.items() if isinstance(kind, SdfElement)]


VERSIONS = ("1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")
_BOOLEANS = ("true", "false", "1", "0")
_NAMED: dict[str, tuple[str, ...]] = {"name": ()}

_NO_WORLD = Refused("a machine is one <model> directly in <sdf>; gravity is in the machine file")
_NO_CONTACT = Refused("shapes measure distances and touch nothing; leave it out")
_LOOKS = Refused("it changes only looks in another program; leave it out")
_SIMULATOR = Refused("it belongs to another simulator; leave it out")
_OF_ELEMENT = Refused("forces are elements of the machine file; leave it out")
_TEXTURE = Refused("pictures have plain colours: ambient, diffuse, specular, emissive")

_POSE = SdfElement(
    "honoured",
    SdfPose(),
    attributes={
        "relative_to": (),
        "rotation_format": ("euler_rpy", "quat_xyzw"),
        "degrees": _BOOLEANS,
    },
)
_MOMENT = SdfElement("honoured, about the centre of mass", SdfNumbers(unit="kg m^2", above=True))
_PRODUCT = SdfElement(
    "honoured: element of the matrix, -sum(m x y); 0 if left out", SdfNumbers(unit="kg m^2")
)
_INERTIA = SdfElement(
    "honoured",
    children={
        **dict.fromkeys(("ixx", "iyy", "izz"), _MOMENT),
        **dict.fromkeys(("ixy", "ixz", "iyz"), _PRODUCT),
    },
)
_INERTIAL = SdfElement(
    "honoured; a link that moves needs mass, ixx, iyy and izz",
    children={
        "pose": _POSE,
        "mass": SdfElement("honoured", SdfNumbers(unit="kg", above=True, high=LARGEST_MASS)),
        "inertia": _INERTIA,
        "fluid_added_mass": Refused("a machine turns in air; leave it out"),
        "density": Refused("state mass and inertia"),
    },
    attributes={"auto": ("false", "0")},
)


def _lengths(count: int = 1) -> SdfElement:
    return SdfElement("honoured", SdfNumbers(count, "m", above=True, high=LONGEST_LENGTH))


_MESH = SdfElement(
    "honoured; of a collision its convex hull is measured, so one that is not convex is refused",
    children={
        "uri": SdfElement("honoured: a file .obj, for pictures also .gltf or .vtk", SdfName()),
        "scale": SdfElement("honoured", SdfNumbers(3, above=True, high=1000.0)),
        "drake:declare_convex": SdfElement("honoured: the convex hull is what is meant"),
        "submesh": Refused("write the part into a file of its own"),
    },
    needed=("uri",),
)
_NO_BOUNDS = "it has no bounds; allowed are bounded shapes such as a box"
SHAPES: Mapping[str, SdfElement | Refused] = {
    "box": SdfElement("honoured", children={"size": _lengths(3)}, needed=("size",)),
    "cylinder": SdfElement(
        "honoured; its axis is z",
        children={"radius": _lengths(), "length": _lengths()},
        needed=("radius", "length"),
    ),
    "capsule": SdfElement(
        "honoured; its axis is z",
        children={"radius": _lengths(), "length": _lengths()},
        needed=("radius", "length"),
    ),
    "ellipsoid": SdfElement("honoured", children={"radii": _lengths(3)}, needed=("radii",)),
    "sphere": SdfElement("honoured", children={"radius": _lengths()}, needed=("radius",)),
    "mesh": _MESH,
    "plane": Refused(_NO_BOUNDS),
    "heightmap": Refused(_NO_BOUNDS),
    "empty": Refused("a shape needs a body; leave the collision or visual out"),
    "polyline": Refused("write boxes, or a mesh"),
    "cone": Refused("write a cylinder, or a mesh"),
    "image": Refused("write boxes, or a mesh"),
    "drake:capsule": Refused("write <capsule>"),
    "drake:ellipsoid": Refused("write <ellipsoid>"),
}
_GEOMETRY = SdfElement("honoured; one shape", children=SHAPES)
_COLOUR = SdfElement("in pictures", SdfNumbers(3, low=0.0, high=1.0, more=1))
_MATERIAL = SdfElement(
    "in pictures",
    children={
        **dict.fromkeys(("ambient", "diffuse", "specular", "emissive"), _COLOUR),
        **dict.fromkeys(
            ("script", "shader", "pbr", "lighting", "render_order", "double_sided", "shininess",
             "drake:diffuse_map"),
            _TEXTURE,
        ),
    },
)  # fmt: skip
_COLLISION = SdfElement(
    "honoured: distances are measured from it",
    children={
        "pose": _POSE,
        "geometry": _GEOMETRY,
        **dict.fromkeys(
            ("surface", "max_contacts", "laser_retro", "drake:proximity_properties"), _NO_CONTACT
        ),
        "density": Refused("state mass and inertia of the link"),
        "auto_inertia_params": Refused("state mass and inertia of the link"),
    },
    attributes=_NAMED,
    needed=("name", "geometry"),
    many=True,
)
_VISUAL = SdfElement(
    "in pictures",
    children={
        "pose": _POSE,
        "geometry": _GEOMETRY,
        "material": _MATERIAL,
        **dict.fromkeys(
            ("transparency", "cast_shadows", "laser_retro", "visibility_flags", "meta",
             "drake:accepting_renderer", "drake:illustration_properties",
             "drake:perception_properties"),
            _LOOKS,
        ),
        "plugin": _SIMULATOR,
    },
    attributes=_NAMED,
    needed=("name", "geometry"),
    many=True,
)  # fmt: skip
_LINK = SdfElement(
    "honoured: housing, tub, drum, and parts that are fixed to them; it may have any pose",
    children={
        "pose": _POSE,
        "inertial": _INERTIAL,
        "collision": _COLLISION,
        "visual": _VISUAL,
        "gravity": SdfElement(
            "honoured", SdfChoice(("true", "1"), "all parts have weight; see gravity in the file")
        ),
        "kinematic": SdfElement(
            "honoured", SdfChoice(("false", "0"), "all parts follow from forces")
        ),
        "velocity_decay": _OF_ELEMENT,
        **dict.fromkeys(
            ("self_collide", "enable_wind", "must_be_base_link", "sensor", "light", "battery",
             "projector", "audio_sink", "audio_source", "particle_emitter", "plugin",
             "drake:visual", "drake:QuaternionFloatingJoint"),
            _SIMULATOR,
        ),
    },
    attributes=_NAMED,
    needed=("name",),
    many=True,
)  # fmt: skip

_NO_FRICTION = SdfChoice(
    ("0", "0.0"),
    "friction of the drum is drive.bearing_friction of the machine file, other friction a damper",
)
_NO_SPRING = SdfChoice(("0", "0.0"), "springs are elements of the machine file")
_NO_STOP = "a run does not know limits of joints; stops are elements of the machine file"
_AXIS = SdfElement(
    "honoured",
    children={
        "xyz": SdfElement("honoured", SdfNumbers(3), attributes={"expressed_in": ()}),
        "dynamics": SdfElement(
            "honoured",
            children={
                "damping": SdfElement("honoured", SdfNumbers(low=0.0, unit="N m s/rad or N s/m")),
                "friction": SdfElement("must be 0", _NO_FRICTION),
                "spring_reference": SdfElement("must be 0", _NO_SPRING),
                "spring_stiffness": SdfElement("must be 0", _NO_SPRING),
            },
        ),
        "limit": SdfElement(
            "honoured",
            children={
                "lower": SdfElement("must be none", SdfLimit(_NO_STOP)),
                "upper": SdfElement("must be none", SdfLimit(_NO_STOP)),
                "velocity": SdfElement(
                    "must be none", SdfLimit("the speed is that of the profile and the motor")
                ),
                "effort": SdfElement(
                    "0 for a joint without a motor; none for that of the drum", SdfLimit()
                ),
                "stiffness": _OF_ELEMENT,
                "dissipation": _OF_ELEMENT,
                "drake:acceleration": _OF_ELEMENT,
            },
        ),
        "mimic": Refused("only the drum has a motor; leave it out"),
        "use_parent_model_frame": Refused('write <xyz expressed_in="__model__">'),
        "initial_position": Refused("the drum begins where the profile says; leave it out"),
    },
    needed=("xyz",),
)
_NO_GEAR = Refused("the transmission is in drive of the machine file (belt_ratio, rotor_inertia)")
_NO_AXIS2 = Refused("joints have one axis: fixed, revolute, continuous, prismatic")
_JOINT = SdfElement(
    "honoured: fixed; revolute or continuous for the drum; prismatic for telescopic dampers",
    children={
        "parent": SdfElement("honoured", SdfName()),
        "child": SdfElement("honoured", SdfName()),
        "pose": _POSE,
        "axis": _AXIS,
        **dict.fromkeys(
            ("gearbox_ratio", "gearbox_reference_body", "drake:rotor_inertia", "drake:gear_ratio",
             "drake:controller_gains", "drake:mimic"),
            _NO_GEAR,
        ),
        **dict.fromkeys(("axis2", "thread_pitch", "screw_thread_pitch"), _NO_AXIS2),
        **dict.fromkeys(("physics", "sensor", "plugin"), _SIMULATOR),
    },
    attributes={**_NAMED, "type": ("fixed", "revolute", "continuous", "prismatic")},
    needed=("name", "type", "parent", "child"),
    many=True,
)  # fmt: skip
_FRAME = SdfElement(
    "honoured: where elements and sensors are attached",
    children={"pose": _POSE},
    attributes={**_NAMED, "attached_to": ()},
    needed=("name",),
    many=True,
)
_STATIC = SdfElement(
    "honoured", SdfChoice(("false", "0"), "only the housing is fixed, by a joint to world")
)
_INCLUDE = SdfElement(
    "honoured: the links of another file become links of this model",
    children={
        "uri": SdfElement("honoured: a file below the folder of this one", SdfName()),
        "name": SdfElement("honoured", SdfName()),
        "pose": _POSE,
        "placement_frame": SdfElement("honoured", SdfName()),
        "static": _STATIC,
        "plugin": _SIMULATOR,
    },
    attributes={"merge": ("true", "1")},
    needed=("uri", "merge"),
    many=True,
)
_MODEL = SdfElement(
    "honoured; one a file",
    children={
        "pose": _POSE,
        "static": _STATIC,
        "link": _LINK,
        "joint": _JOINT,
        "frame": _FRAME,
        "include": _INCLUDE,
        "model": Refused(
            "write its links into the outer model, or include its file with merge=\"true\""
        ),
        **dict.fromkeys(
            ("self_collide", "allow_auto_disable", "enable_wind", "plugin", "gripper"), _SIMULATOR
        ),
        **dict.fromkeys(("drake:joint",), _NO_AXIS2),
        **dict.fromkeys(
            ("drake:linear_bushing_rpy", "drake:linear_spring_damper", "drake:prismatic_spring",
             "drake:revolute_spring", "drake:ball_constraint", "drake:tendon_constraint"),
            _OF_ELEMENT,
        ),
        "drake:collision_filter_group": _NO_CONTACT,
    },
    attributes={**_NAMED, "canonical_link": (), "placement_frame": ()},
    needed=("name",),
)  # fmt: skip
ROOT = SdfElement(
    f"honoured; versions {VERSIONS[0]} to {VERSIONS[-1]}",
    children={
        "model": _MODEL,
        **dict.fromkeys(("world", "actor", "light"), _NO_WORLD),
    },
    attributes={"version": VERSIONS},
    needed=("version", "model"),
)


def kinds() -> Iterator[tuple[tuple[str, ...], SdfElement | Refused]]:
    """Yield the path of names from `sdf` down to each element of the declaration, and its kind."""
    waiting: list[tuple[tuple[str, ...], SdfElement | Refused]] = [(("sdf",), ROOT)]
    while waiting:
        path, kind = waiting.pop()
        yield path, kind
        if isinstance(kind, SdfElement):
            waiting.extend(((*path, tag), of) for tag, of in reversed([*kind.children.items()]))


def element_problems(file: str, root: Node) -> list[Problem]:
    """Return one problem for each thing in an SDF file that is not allowed.

    Elements that are refused for the same reason share one problem, at the first of them.

    Args:
        file: Name of the file, for the messages.
        root: Its element <sdf>.
    """
    faults = list(_faults(root, ROOT))
    same = Counter(group for _, group, _ in faults)
    problems = []
    for node, group, message in faults:
        count = same.pop(group, 0)
        if count:
            more = f" ({count - 1} more like it)" if count > 1 else ""
            problems.append(problem_at(file, node, f"{message}{more}"))
    return problems


def problem_at(file: str, node: Node, message: str) -> Problem:
    """Return the problem of an element of an SDF file."""
    label = shortened(node.label, 120)
    return Problem("", "model", f"SDF '{file}', line {node.line}: {label} {message}")


_Fault = tuple[Node, object, str]
"""An element, what faults of the same sort have in common, and the message."""


def _faults(root: Node, kind: SdfElement) -> Iterator[_Fault]:
    waiting = [(root, kind)]
    while waiting:
        node, kind = waiting.pop()
        yield from _faults_of(node, kind)
        inside = []
        for child in node.children:
            of = kind.children.get(child.tag)
            if of is None:
                known = nearest_names(child.tag, kind.honoured)
                yield child, child, f"is not an element of <{node.tag}>{known}"
            elif isinstance(of, Refused):
                yield child, (child.tag, node.tag), f"is not represented: {of.why}"
            else:
                inside.append((child, of))
        waiting.extend(reversed(inside))


def _faults_of(node: Node, kind: SdfElement) -> Iterator[_Fault]:
    if node.has_comment and not isinstance(kind.value, Empty):
        yield node, node, "has a comment inside; move it out, so that the value is read as a whole"
    elif fault := kind.value.fault(node):
        yield node, node, fault
    for message in (*_wrong_attributes(node, kind), *_wrong_counts(node, kind)):
        yield node, node, message


def _wrong_attributes(node: Node, kind: SdfElement) -> Iterator[str]:
    for name, text in node.attributes.items():
        if name.startswith("xmlns:"):
            continue
        if name not in kind.attributes:
            known = nearest_names(name, kind.attributes)
            yield f"has the attribute '{shortened(name, 40)}', which is unknown{known}"
        elif kind.attributes[name] and text not in kind.attributes[name]:
            allowed = ", ".join(kind.attributes[name])
            yield f'has {name}="{shortened(text, 40)}"; allowed are {allowed}'
    for name in kind.needed:
        if name in kind.attributes and not node.attributes.get(name):
            yield f"has no attribute '{name}'"


def _wrong_counts(node: Node, kind: SdfElement) -> Iterator[str]:
    tags = Counter(child.tag for child in node.children)
    for tag, of in kind.children.items():
        if not tags[tag] and tag in kind.needed:
            yield f"has no <{tag}>"
        if tags[tag] > 1 and isinstance(of, SdfElement) and not of.many:
            yield f"has {tags[tag]} elements <{tag}>; allowed is one"
    if kind is _GEOMETRY and len(node.children) != 1:
        yield f"has {len(node.children)} shapes; allowed is one"
