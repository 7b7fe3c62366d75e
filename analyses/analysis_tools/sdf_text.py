"""Write the overrides of a machine into the text of its SDF model."""

from typing import Any
from xml.dom.minidom import Document, parseString

from wm_drake.parameters import BodyOverride, FrameOverride, MachineParameters, source_of

_DIGITS = 6
"""Decimals of metres and kilograms: drawings are not more accurate than 1e-6 m and 1e-6 kg."""


def sdf_with(text: str, parameters: MachineParameters) -> str:
    """Return the text of an SDF with the overrides of a machine written into it.

    A comment with the source follows each override that comes from a fit. All else is unchanged.
    The shape ``NAME_block`` of a body moves with the body's centre of mass.

    Args:
        text: Text of an SDF model that has the bodies and frames.
        parameters: The machine; its `bodies` and `frames` are written.
    """
    document = parseString(text)
    for name, frame in parameters.frames.items():
        if frame.attached_to:
            element = _new_frame(document, name, frame)
        else:
            element = _named(document, "frame", name)
            _set_position(_only(element, "pose"), frame.position)
        _comment(document, element, source_of(parameters, f"frames.{name}.position"))
    for name, body in parameters.bodies.items():
        link = _named(document, "link", name)
        _set_body(_only(link, "inertial"), body)
        if body.centre_of_mass is not None:
            for shape in _shapes(link, f"{name}_block"):
                _set_position(_only(shape, "pose"), body.centre_of_mass)
        parts = ("mass", "centre_of_mass", "inertia")
        given = [f"bodies.{name}.{part}" for part in parts if getattr(body, part) is not None]
        texts = [text for key in given for text in _sources(parameters, key)]
        _comment(document, _only(link, "inertial"), "; ".join(dict.fromkeys(filter(None, texts))))
    return str(document.toxml()).replace('<?xml version="1.0" ?>', '<?xml version="1.0"?>\n') + "\n"


def _new_frame(document: Document, name: str, frame: FrameOverride) -> Any:
    """Add a frame that is fixed to a link, at the end of the model, and return it."""
    element, pose = document.createElement("frame"), document.createElement("pose")
    element.setAttribute("name", name)
    element.setAttribute("attached_to", str(frame.attached_to))
    pose.setAttribute("relative_to", str(frame.attached_to))
    text = " ".join(map(_digits, (*frame.position, *(frame.angles or (0.0, 0.0, 0.0)))))
    pose.appendChild(document.createTextNode(text))
    element.appendChild(pose)
    model = document.getElementsByTagName("model")[0]
    model.appendChild(document.createTextNode("  "))
    model.appendChild(element)
    model.appendChild(document.createTextNode("\n  "))
    return element


def _sources(parameters: MachineParameters, key: str) -> list[str]:
    """Return the sources of the numbers below a key, else the source of the nearest key above."""
    return [text for known, text in parameters.sources.items() if known.startswith(f"{key}.")] or [
        source_of(parameters, key)
    ]


def _named(document: Document, tag: str, name: str) -> Any:
    """Return the first element with a tag and a name."""
    return next(e for e in document.getElementsByTagName(tag) if e.getAttribute("name") == name)


def _only(element: Any, tag: str) -> Any:
    """Return the first child of an element with a tag."""
    return next(child for child in element.childNodes if child.nodeName == tag)


def _shapes(link: Any, name: str) -> list[Any]:
    """Return the visual and collision elements of a link that have a name."""
    tags = ("visual", "collision")
    return [
        e for tag in tags for e in link.getElementsByTagName(tag) if e.getAttribute("name") == name
    ]


def _set_text(element: Any, text: str) -> None:
    """Replace the text of an element."""
    element.firstChild.data = text


def _set_position(pose: Any, position: tuple[float, ...]) -> None:
    """Replace the position in a pose element and keep its angles."""
    angles = pose.firstChild.data.split()[3:]
    _set_text(pose, " ".join([*map(_digits, position), *angles]))


def _set_body(inertial: Any, body: BodyOverride) -> None:
    """Write the mass properties of an override into an inertial element.

    A mass without inertia scales the inertia of the element, as it does in the machine.
    """
    if body.mass is not None:
        if body.inertia is None:
            _scale_inertia(inertial, body.mass)
        _set_text(_only(inertial, "mass"), _digits(body.mass))
    if body.centre_of_mass is not None:
        _set_position(_only(inertial, "pose"), body.centre_of_mass)
    if body.inertia is not None:
        for axis in ("xx", "yy", "zz", "xy", "xz", "yz"):
            _set_text(
                _only(_only(inertial, "inertia"), f"i{axis}"), _digits(getattr(body.inertia, axis))
            )


def _scale_inertia(inertial: Any, mass: float) -> None:
    """Scale the moments and products in an inertial element to a new mass."""
    factor = mass / float(_only(inertial, "mass").firstChild.data)
    for moment in _only(inertial, "inertia").getElementsByTagName("*"):
        _set_text(moment, _digits(factor * float(moment.firstChild.data)))


def _comment(document: Document, element: Any, text: str) -> None:
    """Write a comment with the source of a fit after an element; it replaces an earlier one."""
    following = element.nextSibling
    if (
        following is not None
        and following.nodeName == "#comment"
        and following.data.startswith(" fit:")
    ):
        element.parentNode.removeChild(following)
    if text.startswith("fit:"):
        element.parentNode.insertBefore(document.createComment(f" {text} "), element.nextSibling)


def _digits(value: float) -> str:
    """Return a rounded number as text; `+ 0.0` removes the sign of -0.0."""
    return f"{round(value, _DIGITS) + 0.0:.10g}"
