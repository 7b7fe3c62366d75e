"""Names in the SDF of a machine, and the problems of a machine file that uses others."""

from collections.abc import Iterable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RigidBody

from wm_drake.errors import Problem, nearest_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.element_kinds import SHAPE, Element
from wm_drake.parameters.sections import SECTIONS


@dataclass(frozen=True)
class SdfNames:
    """Names in the SDF of a machine.

    Attributes:
        frames: Frames and links to which elements attach, sorted.
        movable_frames: Those whose position a machine file can override.
        links: Links that are not fixed to the world.
        welded: For each frame, its body and all that are welded to it.
    """

    frames: tuple[str, ...]
    movable_frames: tuple[str, ...]
    links: tuple[str, ...]
    welded: dict[str, frozenset[str]]


_NAMES: WeakKeyDictionary[MultibodyPlant, SdfNames] = WeakKeyDictionary()


def sdf_names(plant: MultibodyPlant) -> SdfNames:
    """Return the names in the SDF of a finalized plant; they are read once for each plant."""
    names = _NAMES.get(plant)
    if names is None:
        names = _NAMES[plant] = _names_of(plant)
    return names


def _names_of(plant: MultibodyPlant) -> SdfNames:
    """Read the names in the SDF of a plant."""
    model = plant.GetBodyByName("tub").model_instance()
    frames = {frame.name(): frame for frame in map(plant.get_frame, plant.GetFrameIndices(model))}
    frames.pop("__model__", None)
    fixed = [body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())]
    joints = [plant.get_joint(index).name() for index in plant.GetJointIndices()]
    links = map(plant.get_body, plant.GetBodyIndices(model))
    return SdfNames(
        tuple(sorted(frames)),
        tuple(
            name
            for name in sorted(frames)
            if isinstance(frames[name], FixedOffsetFrame) and not _is_made(name, joints)
        ),
        tuple(link.name() for link in links if link.index() not in fixed),
        {
            name: frozenset(body.name() for body in plant.GetBodiesWeldedTo(frame.body()))
            for name, frame in frames.items()
        },
    )


def _is_made(frame: str, joints: list[str]) -> bool:
    """Return whether Drake made a frame on its own account, for a joint that is no revolute."""
    return frame.endswith(("_F", "_M")) and any(frame.startswith(f"{name}_") for name in joints)


def tubes_of(plant: MultibodyPlant, joint: str) -> tuple[RigidBody, RigidBody]:
    """Return outer and inner tube of the joint of a telescopic damper."""
    telescope = plant.GetJointByName(joint)
    return telescope.parent_body(), telescope.child_body()


def frame_problems(plant: MultibodyPlant, parameters: MachineParameters) -> list[Problem]:
    """Return one problem for each wrong name of a frame or body in a machine."""
    names = sdf_names(plant)
    problems = []
    for attachment in _attachments(plant, parameters):
        problems += frame_problem(plant, *attachment)
    for name in parameters.bodies:
        if name not in names.links:
            message = f"no moving link '{name}' in the SDF{nearest_names(name, names.links)}"
            problems.append(Problem("", f"bodies.{name}", message))
    for name in parameters.frames:
        if name not in names.movable_frames:
            message = (
                f"no frame '{name}' in the SDF{nearest_names(name, names.movable_frames)}; "
                "attached_to: LINK makes it a new frame"
            )
            problems.append(Problem("", f"frames.{name}", message))
    return problems


def frame_problem(plant: MultibodyPlant, key: str, body: str, frame: str) -> list[Problem]:
    """Return the problem of a frame that must be fixed to a body; empty if it is.

    Args:
        key: Key path that names the frame.
    """
    names = sdf_names(plant)
    if frame not in names.frames:
        message = f"no frame '{frame}' in the SDF{nearest_names(frame, names.frames)}"
        return [Problem("", key, message)]
    if body not in names.welded[frame]:
        return [Problem("", key, f"frame '{frame}' is not fixed to the {body}")]
    return []


def _attachments(
    plant: MultibodyPlant, parameters: MachineParameters
) -> Iterable[tuple[str, str, str]]:
    """Yield key path, body to be fixed to, and name of each frame that a machine file uses."""
    for section in SECTIONS.values():
        for name, element in section.elements(parameters).items():
            bodies = {"tub": "tub", "housing": "housing"}
            if joint := getattr(element, "joint", None):
                tubes = (body.name() for body in tubes_of(plant, joint))
                bodies |= dict(zip(("outer", "inner"), tubes, strict=True))
            for end, body in bodies.items():
                frame = getattr(element, f"{end}_frame", None)  # an element on the drum has none
                if frame is None or (isinstance(element, Element) and frame.startswith(SHAPE)):
                    continue
                yield f"{section.key(name)}.{end}_frame", body, frame
    for table in ("sensors", "accelerometers"):
        for name, sensor in getattr(parameters, table).items():
            yield f"{table}.{name}.frame", "tub", sensor.frame
    if parameters.clearance:
        yield "clearance.detergent_frame", "tub", parameters.clearance.detergent_frame
