"""SDF texts of one machine whose links have other frames: the same machine, said in another way."""

from xml.etree import ElementTree

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw


def reposed(text, poses):
    """Return an SDF text whose links have poses, and whose contents stay where they are.

    Args:
        text: SDF text whose links have no pose, or that of another link.
        poses: x, y, z, roll, pitch, yaw in the model, by name of the link.
    """
    root = ElementTree.fromstring(text)
    model = root.find("model")
    frames = {link.get("name"): RigidTransform() for link in model.iter("link")}
    frames |= {name: pose_of(numbers) for name, numbers in poses.items()}
    for link in model.iter("link"):
        X_ML = frames[link.get("name")]
        for part in (
            *link.findall("inertial"),
            *link.findall("visual"),
            *link.findall("collision"),
        ):
            move(part, X_ML.inverse())
        set_pose(link, X_ML)
    for frame in model.iter("frame"):
        move(frame, frames[frame.get("attached_to")].inverse())
    for joint in model.iter("joint"):
        move(joint, frames[joint.findtext("child")].inverse())
    return ElementTree.tostring(root, encoding="unicode")


def pose_of(numbers):
    """Return the pose of x, y, z, roll, pitch, yaw."""
    return RigidTransform(RollPitchYaw(numbers[3:]), numbers[:3])


def move(part, X):
    """Multiply the pose of an element by another one from the left."""
    words = (part.findtext("pose") or "").split() or ["0"] * 6
    set_pose(part, X @ pose_of(np.array(words, dtype=float)))


def set_pose(part, X):
    """Set the pose of an element."""
    pose = part.find("pose")
    if pose is None:
        pose = ElementTree.Element("pose")
        part.insert(0, pose)
    pose.attrib.clear()
    numbers = [*X.translation(), *RollPitchYaw(X.rotation()).vector()]
    pose.text = " ".join(repr(float(number)) for number in numbers)
