"""Named declarations that a package of a user can extend: element kinds, measures, studies."""

import configparser
import functools
import importlib.metadata
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from wm_drake.errors import WmDrakeError, input_error, nearest_names

EDGE = Path(__file__).with_name("edge.ini")
"""File with what this package adds to its core, in the form of entry points; the core works without
it."""


class Named(Protocol):
    """A declaration with a name."""

    @property
    def name(self) -> str:
        """Name by which files and commands choose the declaration."""


Declaration = TypeVar("Declaration", bound=Named)


class Registry(Mapping[str, Declaration], Generic[Declaration]):
    """Declarations by name: those of the core, of the edge (`EDGE`), then those of users.

    A user registers a declaration with a function of the public face (`wm_drake.register_element`,
    `register_measure`, `register_study`), or in the metadata of a package with an entry point:

        [project.entry-points."wm_drake.elements"]
        quadratic_drag = "my_package.drag:QUADRATIC_DRAG"

    Entry points are read when a name is looked up for the first time. Processes that this program
    starts (workers of the Drake engine, a cluster, jobs of the studio) know the entry points, but
    not what a script registered by a function call.
    """

    def __init__(self, word: str, group: str, shipped: Sequence[str]) -> None:
        """Create an empty registry.

        Args:
            word: What a declaration is called in messages, such as "element kind".
            group: Group of entry points.
            shipped: Declarations of the core, as `module:name`. They are imported at the first
                look-up, because a registry may be in an earlier room than they.
        """
        self._word, self._group, self._shipped = word, group, shipped
        self._declarations: dict[str, Declaration] = {}
        self._is_loaded = False

    def register(self, declaration: Declaration) -> Declaration:
        """Add a declaration, and return it.

        Raises:
            ValueError: another declaration has this name.
        """
        known = self._declarations.setdefault(declaration.name, declaration)
        if known is not declaration:
            raise ValueError(f"{self._word} '{declaration.name}' is registered already")
        return declaration

    def find(self, name: str, *, where: str = "", key: str = "") -> Declaration:
        """Return the declaration with a name.

        Args:
            where, key: Place of the name in the input, for the message.

        Raises:
            InputError: the name is unknown; the message names similar ones.
        """
        if name not in self:
            hint = nearest_names(name, self)
            raise input_error(f"no {self._word} '{name}'{hint}", where=where, key=key)
        return self[name]

    def _all(self) -> dict[str, Declaration]:
        if not self._is_loaded:
            self._is_loaded = True
            pairs = [*((place, place) for place in self._shipped), *edge(self._group).items()]
            shipped = (importlib.metadata.EntryPoint(*pair, self._group) for pair in pairs)
            for entry in (*shipped, *importlib.metadata.entry_points(group=self._group)):
                self._register_entry_point(entry)
        return self._declarations

    def _register_entry_point(self, entry: importlib.metadata.EntryPoint) -> None:
        source = f"entry point '{entry.name}' of the group '{self._group}'"
        try:
            declaration = entry.load()
        except Exception as error:  # any fault of a user's package is one message
            reason = f"{type(error).__name__}: {error}"
            raise WmDrakeError(f"{source} ({entry.value}): cannot be loaded: {reason}") from error
        try:
            self.register(declaration)
        except (ValueError, AttributeError) as error:
            raise WmDrakeError(f"{source} ({entry.value}): {error}") from error

    def __getitem__(self, name: str) -> Declaration:
        """Return the declaration with a name; raise a KeyError if there is none."""
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the names, those of this package first."""
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())


def edge(section: str) -> dict[str, str]:
    """Return the entries of a section of `EDGE`: places of declarations by name, or `modules`."""
    return dict(_edge()[section]) if _edge().has_section(section) else {}


@functools.cache
def _edge() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(allow_no_value=True, delimiters=("=",))
    parser.read(EDGE, encoding="utf-8")
    return parser
