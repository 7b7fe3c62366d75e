"""Elements of other packages in a machine file: `elements: {NAME: {kind: KIND, ...}}`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Protocol, TypeAlias

from pydantic import SerializeAsAny, ValidationError, ValidationInfo, WrapValidator

from wm_drake.errors import Problem, nearest_names, shortened
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.problems import ProblemsInsideError, problems_of
from wm_drake.registry import Registry


class OfKind(Frozen):
    """An element of a registered kind.

    Attributes:
        kind: Name of an element kind.
    """

    kind: str


class DrumElement(OfKind):
    """An element on the drum; the parameters of a kind that acts on the drum extend this type.

    Attributes:
        y: Position along the drum axis, to the rear, from mid-depth of the drum.
    """

    y: u.Length = 0.0

    @property
    def mass_on_drum(self) -> float:
        """Return the mass of the element that moves with the axis of the drum. [kg]"""
        return 0.0


class Element(OfKind):
    """An element in its place; the parameters of an element kind extend this type.

    Attributes:
        tub_frame, housing_frame: Frames of the two ends, on the tub and on the housing; or
            "shape NAME" in both: the ends are the nearest points of two shapes, as drawn.

    Example:
        >>> from typing import Annotated
        >>> import wm_drake as wm
        >>> from wm_drake.parameters.units import Unit
        >>> class DragDamper(wm.Element):
        ...     coefficient: Annotated[float, Unit("N*s^2/m^2", "N*s^2/m^2")]
        >>> ends = {"tub_frame": "hook", "housing_frame": "anchor"}
        >>> DragDamper(kind="drag_damper", coefficient="400 N*s^2/m^2", **ends).coefficient
        400.0
    """

    tub_frame: str
    housing_frame: str


SHAPE = "shape "
"""Beginning of a `tub_frame` or `housing_frame` that names a shape in place of a frame."""


class HasParameters(Protocol):
    """What a machine file needs of an element kind."""

    @property
    def name(self) -> str:
        """Name of the kind in a machine file."""

    @property
    def parameters(self) -> type[OfKind]:
        """Type of its parameters."""


ELEMENT_KINDS: Registry[HasParameters] = Registry(
    "element kind",
    "wm_drake.elements",
    ["wm_drake.elements.stop:STOP"],
)
"""Registered element kinds, `wm_drake.elements.kind.ElementKind`, by name."""


def _validated(value: Any, handler: Any, info: ValidationInfo) -> Any:
    """Return an element as an instance of the parameters of its kind.

    Raises:
        ProblemsInsideError: the kind is unknown, or a value is wrong.
    """
    if isinstance(value, OfKind) or not isinstance(value, Mapping):
        return handler(value)
    name = value.get("kind")
    if not isinstance(name, str) or name not in ELEMENT_KINDS:
        text = "is missing" if name is None else f"'{shortened(str(name), 60)}' is not known"
        hint = nearest_names(str(name), ELEMENT_KINDS)
        raise ProblemsInsideError([Problem("", "kind", text + hint)])
    parameters = ELEMENT_KINDS[name].parameters
    try:
        return parameters.model_validate(value, context=info.context)
    except ValidationError as error:
        raise ProblemsInsideError(problems_of(error, parameters)) from None


if TYPE_CHECKING:
    AnyElement: TypeAlias = OfKind
else:
    AnyElement = Annotated[SerializeAsAny[OfKind], WrapValidator(_validated)]
"""An element of any registered kind."""
