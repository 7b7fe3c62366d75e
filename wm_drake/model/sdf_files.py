"""Check of the text of an SDF and of the files that it includes, before sdformat reads them.

sdformat drops an included file that it cannot use, takes 1 kg for a missing mass, and ends the
process on a cycle of files. So all this is checked here.
"""

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.text_files import read_text

MOST_FILES = 50
"""Largest number of files that an SDF consists of."""

LARGEST_SDF = 16 << 20
"""Largest size of an SDF file. [byte]"""


def sdf_roots(path: Path) -> dict[Path, Element]:
    """Return the root element of an SDF file and of each file that it includes, by path.

    Args:
        path: The SDF file. An included file is named relative to its folder.

    Raises:
        InputError: a file is missing, outside of this folder, not SDF, or includes itself.
    """
    folder, roots = path.parent, dict[Path, Element]()
    waiting: list[tuple[Path, tuple[Path, ...]]] = [(path, ())]
    while waiting:
        current, above = waiting.pop()
        root = roots.setdefault(current, _root(current))
        if len(roots) > MOST_FILES:
            raise _refused(path, f"includes more than {MOST_FILES} files")
        for include in root.iter("include"):
            uri = _text_at(include, "uri")
            included = _included(folder, current, uri)
            if included.resolve() in (p.resolve() for p in (*above, current)):
                raise _refused(current, f"includes '{uri}', and so itself")
            waiting.append((included, (*above, current)))
    return roots


def check_mass_properties(roots: dict[Path, Element], fixed: Iterable[str]) -> None:
    """Check that each link that moves states its mass and its moments of inertia.

    Args:
        fixed: Names of the links that are fixed to the world.

    Raises:
        InputError: a link lacks a number; there is one problem per link.
    """
    at_rest, problems = set(fixed), list[Problem]()
    for path, root in roots.items():
        for link in root.iter("link"):
            missing = [part for part in _MASS_PROPERTIES if not _text_at(link, part)]
            if missing and link.get("name", "") not in at_rest:
                names = ", ".join(part.rpartition("/")[2] for part in missing)
                message = (
                    f"SDF '{path.name}': link '{link.get('name', '')}' does not state its {names}"
                )
                problems.append(Problem("", "model", message))
    if problems:
        raise InputError(problems)


_MASS_PROPERTIES = (
    "inertial/mass",
    *(f"inertial/inertia/{name}" for name in ("ixx", "iyy", "izz")),
)


def _text_at(element: Element, part: str) -> str:
    """Return the text of an element below another one; empty if there is none."""
    return (element.findtext(part) or "").strip()


def _root(path: Path) -> Element:
    text = read_text(path, key="model", largest=LARGEST_SDF)
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise _refused(path, f"cannot be read: {error}") from None
    if root.tag != "sdf":
        raise _refused(path, f"cannot be read: it is <{root.tag[:40]}>, not <sdf>")
    return root


def _included(folder: Path, current: Path, uri: str) -> Path:
    """Return the path of an included file.

    Raises:
        InputError: it is not a file below the folder of the SDF.
    """
    allowed = "allowed is the name of an SDF file below the folder of the SDF"
    if not uri or "://" in uri or Path(uri).is_absolute():
        raise _refused(current, f"includes '{uri}'; {allowed}")
    try:
        path = folder / uri
        is_below = path.resolve().is_relative_to(folder.resolve())
        is_file = path.is_file()
    except (OSError, ValueError, RuntimeError):  # too long, a null byte, a cycle of links
        is_below = is_file = False
    if not is_file:
        raise _refused(current, f"includes '{uri}', but there is no such file; {allowed}")
    if not is_below:
        raise _refused(current, f"includes '{uri}', which is elsewhere; {allowed}")
    return path


def _refused(path: Path, reason: str) -> InputError:
    return input_error(f"SDF '{path.name}' {reason}", key="model")
