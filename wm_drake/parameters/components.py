"""Parameter files of single components: a damper type or a bushing type as in a machine file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import TypeAdapter, ValidationError

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.damper_laws import DAMPER_LAWS, DamperType
from wm_drake.parameters.elements import BushingType, Frozen, RubberBushingType
from wm_drake.parameters.files import read_mapping
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.text_files import DATA, ShippedFiles

COMPONENTS_FOLDER = DATA / "components"
_FILES = ShippedFiles("component", COMPONENTS_FOLDER)

ComponentParameters: TypeAlias = DamperType | BushingType | RubberBushingType


@dataclass(frozen=True)
class Component:
    """A component.

    Attributes:
        name: Name of its file, without the suffix.
        parameters: Parameters of a damper type or a bushing type.
        sources: Source of each number, by key.
    """

    name: str
    parameters: ComponentParameters
    sources: dict[str, str]

    @property
    def is_damper(self) -> bool:
        """Whether the component is a damper; otherwise it is a bushing."""
        return not isinstance(self.parameters, BushingType)


class _DamperFile(Frozen):
    damper: DamperType


def shipped_components() -> dict[str, Path]:
    """Return the component files that the package contains, by name."""
    return _FILES.listed()


def load_component(name_or_path: str) -> Component:
    """Read a component file.

    The file has the keys of a damper type (among them `law`) or those of a bushing type.

    Args:
        name_or_path: Name of a shipped component or path of a file.
    """
    path = _FILES.path(name_or_path)
    plain, sources = read_mapping(path)
    return Component(path.stem, _validated(plain, path), sources)


def _is_damper(plain: dict[str, Any]) -> bool:
    """Return whether a file is that of a damper, also where its law is missing or misspelt."""
    of_dampers = {key for law in DAMPER_LAWS.values() for key in law.parameters.model_fields}
    of_bushings = set(RubberBushingType.model_fields)
    return "law" in plain or len(of_dampers & set(plain)) > len(of_bushings & set(plain))


def _validated(plain: dict[str, Any], path: Path) -> ComponentParameters:
    context = {"units_required": True}
    is_damper = _is_damper(plain)
    if is_damper and "law" not in plain:
        known = ", ".join(DAMPER_LAWS)
        raise input_error(f"is missing; allowed are {known}", where=str(path), key="law")
    try:
        if is_damper:
            return (
                TypeAdapter(_DamperFile).validate_python({"damper": plain}, context=context).damper
            )
        return RubberBushingType.model_validate(plain, context=context)
    except ValidationError as error:
        root = _DamperFile if is_damper else RubberBushingType
        problems = problems_of(error, root)
        raise InputError(
            Problem(str(path), p.key.removeprefix("damper").lstrip("."), p.message)
            for p in problems
        ) from None
