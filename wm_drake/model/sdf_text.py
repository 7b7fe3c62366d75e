"""Numbers of a machine into the text of its SDF model."""

from typing import Any
from xml.dom.minidom import Document, parseString

from wm_drake.parameters import BodyOverride, MachineParameters, source_of

_DIGITS = 6
"""Of metres and kilograms: a thousandth of a millimetre or a gram is beyond any drawing."""


def sdf_with(text: str, parameters: MachineParameters) -> str:
    """The SDF with the overrides of a machine in it, each followed by a comment with its source; all else stays as it is.

    A body with a single shape called ``NAME_block`` carries it along with its centre of mass.

    Args:
        text: Of an SDF model that has the bodies and frames.
        parameters: Its `bodies` and `frames` are written.
    """
    document = parseString(text)
    for name, frame in parameters.frames.items():
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


def _sources(parameters: MachineParameters, key: str) -> list[str]:
    """Where a group of numbers comes from: the sources of its own, or the nearest one above."""
    return [text for known, text in parameters.sources.items() if known.startswith(f"{key}.")] or [
        source_of(parameters, key)
    ]


def _named(document: Document, tag: str, name: str) -> Any:
    return next(e for e in document.getElementsByTagName(tag) if e.getAttribute("name") == name)


def _only(element: Any, tag: str) -> Any:
    return next(child for child in element.childNodes if child.nodeName == tag)


def _shapes(link: Any, name: str) -> list[Any]:
    tags = ("visual", "collision")
    return [
        e for tag in tags for e in link.getElementsByTagName(tag) if e.getAttribute("name") == name
    ]


def _set_text(element: Any, text: str) -> None:
    element.firstChild.data = text


def _set_position(pose: Any, position: tuple[float, ...]) -> None:
    angles = pose.firstChild.data.split()[3:]
    _set_text(pose, " ".join([*map(_digits, position), *angles]))


def _set_body(inertial: Any, body: BodyOverride) -> None:
    if body.mass is not None:
        _set_text(_only(inertial, "mass"), _digits(body.mass))
    if body.centre_of_mass is not None:
        _set_position(_only(inertial, "pose"), body.centre_of_mass)
    if body.inertia is not None:
        for axis in ("xx", "yy", "zz", "xy", "xz", "yz"):
            _set_text(
                _only(_only(inertial, "inertia"), f"i{axis}"), _digits(getattr(body.inertia, axis))
            )


def _comment(document: Document, element: Any, text: str) -> None:
    """Puts a comment after an element, in place of one that was put there before."""
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
    return f"{round(value, _DIGITS) + 0.0:.10g}"  # -0.0 + 0.0 is 0.0
