"""Part of the machine and group in words of each number that a page lists, from its key path."""

from collections.abc import Mapping

from pydrake.multibody.plant import MultibodyPlant

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.keys import is_index
from wm_drake.parameters.sections import SECTIONS
from wm_drake.report.formatting import shape_name

COUNTERWEIGHTS, BODIES, CALCULATION = "counterweights", "tub, drum, motor", "calculation"

_PARTS = {
    "gasket": "gasket",
    "spring_types": "springs",
    "springs": "springs",
    "damper_types": "dampers",
    "dampers": "dampers",
    "telescopic_dampers": "dampers",
    "bushing_types": "other mounts",
    "bushings": "other mounts",
    "elements": "other mounts",
    "bodies": BODIES,
    "loads": "loads",
    "unbalance_planes": "loads",
    "profile": "drum speed",
    "drive": "drum speed",
    "imperfections": "drum and bearing",
    "cabinet": "cabinet and feet",
    "sensors": "sensors",
    "accelerometers": "sensors",
    "clearance": "sensors",
    "frames": "other places",
}
"""Part of the machine of a section of the machine file; others belong to the calculation."""

PART_ORDER = tuple(
    dict.fromkeys(
        ["gasket", "springs", "dampers", "other mounts", COUNTERWEIGHTS, *_PARTS.values()]
    )
)
"""Parts in the order of the page; the calculation comes last."""

_OF_BUSHING = {
    "cross": "cross stiffness",
    "maxwell": "Maxwell elements",
    "dahl": "friction",
    "friction": "friction",
}
"""Group of a number of a bushing by a word in its name."""


def part_and_group(key: str, places: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    """Return the part of the machine of a number, and the words of its group in that part."""
    first, *rest = key.split(".")
    if first == "frames" and rest[0] in places:
        return places[rest[0]]
    part = _part(first, rest[0] if rest else "")
    parents = [first, *rest][:-1]
    name = key.split(".")[len(parents)]
    if parents and is_index(name):  # an entry of a vector
        name = parents.pop()
    words = words_of(parents) or part
    if first in ("gasket", "bushings", "bushing_types"):
        word = next((word for word in _OF_BUSHING if word in name), "")
        group = _OF_BUSHING.get(word, "stiffness and damping")
        return part, group if first == "gasket" else f"{words}: {group}"
    return part, words


def places_of(parameters: MachineParameters, plant: MultibodyPlant) -> dict[str, tuple[str, str]]:
    """Return part and words of each frame that an element, a sensor or a joint has."""
    places = {}
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        body = joint.child_body().name()
        words = f"{shape_name(body)}, at joint {shape_name(joint.name())}"
        for frame in (joint.frame_on_parent(), joint.frame_on_child()):
            places[frame.name()] = _part("bodies", body), words
    for section in SECTIONS.values():
        for name, element in section.elements(parameters).items():
            owner = words_of(section.key(name).split("."))
            for end in ("tub", "housing", "outer", "inner"):
                if frame := getattr(element, f"{end}_frame", None):
                    part = _part(section.key(name).split(".")[0], name)
                    places[frame] = part, f"{owner}, end on the {end}"
    for frame, words in _sensor_frames(parameters).items():
        places[frame] = _PARTS["sensors"], words
    return places


def _sensor_frames(parameters: MachineParameters) -> dict[str, str]:
    """Return the words of each frame with sensors."""
    names: dict[str, list[str]] = {}
    for name, frame in parameters.accelerometer_frames().items():
        names.setdefault(frame, []).append(f"accelerometer {name}")
    for name, sensor in parameters.sensors.items():
        names.setdefault(sensor.frame, []).insert(0, f"sensor {name}, along {sensor.axis}")
    return {
        parameters.clearance_frame: "point whose distance to the detergent box counts",
        **{frame: "; ".join(words) for frame, words in names.items()},
    }


def _part(section: str, name: str) -> str:
    if section == "bodies" and "counterweight" in name:
        return COUNTERWEIGHTS
    return _PARTS.get(section, CALCULATION)


def words_of(parents: list[str]) -> str:
    """Return a path in words: `springs.left` as "spring left"."""
    if not parents:
        return ""
    first, rest = parents[0], [part for part in parents[1:] if part != "feet"]
    if first in ("bodies", "frames") and rest:
        return shape_name(rest[0])
    single = "foot" if "feet" in parents else first.removesuffix("s") if rest else first
    texts: list[str] = []
    for part in rest:
        if is_index(part):
            number = int(part) + 1
            texts[-1:] = [f"mass {number}" if first == "loads" else f"{texts[-1]} no. {number}"]
        else:
            texts.append(part)
    return shape_name(", ".join([" ".join([single, *texts[:1]]), *texts[1:]]))
