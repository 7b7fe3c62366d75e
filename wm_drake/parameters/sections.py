"""Sections of a machine file that have elements in their places, and what an element is made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

GASKET = "gasket"
"""Name of the bushing that has a key of its own in a machine file."""


@dataclass(frozen=True)
class FileSection:
    """A section of a machine file that has elements in their places, by name.

    Attributes:
        name: Key of the section; the bushings include the gasket.
        types: Section of the types that a field of an element names, by field.
    """

    name: str
    types: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def tables(self) -> tuple[str, ...]:
        """Return the keys of a machine file on which its elements depend."""
        of_gasket = [GASKET] if self.name == "bushings" else []
        return tuple(dict.fromkeys([*of_gasket, self.name, *self.types.values()]))

    def elements(self, machine: Any) -> dict[str, Any]:
        """Return the elements of a machine in this section, by name."""
        elements: dict[str, Any] = getattr(machine, self.name)
        if self.name == "bushings" and machine.gasket:
            return {GASKET: machine.gasket, **elements}
        return elements

    def key(self, name: str) -> str:
        """Return the key path of an element."""
        return name if self.name == "bushings" and name == GASKET else f"{self.name}.{name}"

    def parts(self, machine: Any, element: Any) -> dict[str, Any]:
        """Return an element, and the types that it names by their field."""
        tables = ((field, getattr(machine, table)) for field, table in self.types.items())
        return {"": element, **{field: table[getattr(element, field)] for field, table in tables}}


SECTIONS = {
    section.name: section
    for section in (
        FileSection("springs", {"type": "spring_types"}),
        FileSection("dampers", {"type": "damper_types"}),
        FileSection("bushings"),
        FileSection(
            "telescopic_dampers",
            {
                "type": "damper_types",
                "tub_bushing": "bushing_types",
                "housing_bushing": "bushing_types",
            },
        ),
        FileSection("elements"),
    )
}
"""All sections by name, in the order of the mounts."""
