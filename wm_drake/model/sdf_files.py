"""Check of the text of an SDF and of the files that it includes, before sdformat reads them.

sdformat drops an included file that it cannot use, takes 1 kg for a missing mass, and ends the
process on a cycle of files. So all this is checked here.
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.sax.saxutils import escape, unescape

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.model.meshes import fault_of_mesh
from wm_drake.model.sdf_elements import element_problems, problem_at
from wm_drake.model.sdf_text import Node, SdfTextError, read_sdf
from wm_drake.parameters.inertia import fault_of_mass_properties, inertia_matrix
from wm_drake.parameters.text_files import read_text
from wm_drake.written_files import temporary_folder

MOST_FILES = 50
"""Largest number of files that an SDF consists of."""

LARGEST_SDF = 16 << 20
"""Largest size of an SDF file. [byte]"""


def sdf_roots(path: Path) -> dict[Path, Node]:
    """Return the root element of an SDF file and of each file that it includes, by path.

    Args:
        path: The SDF file. An included file is named relative to its folder.

    Raises:
        InputError: a file is missing, outside of this folder, not SDF, or includes itself.
    """
    folder, roots = path.parent, dict[Path, Node]()
    waiting: list[tuple[Path, tuple[Path, ...]]] = [(path, ())]
    while waiting:
        current, above = waiting.pop()
        root = roots.setdefault(current, _root(current))
        if len(roots) > MOST_FILES:
            raise _refused(path, f"includes more than {MOST_FILES} files")
        for include in root.iter("include"):
            uri = include.text_at("uri")
            included = _included(folder, current, uri)
            if included.resolve() in (p.resolve() for p in (*above, current)):
                raise _refused(current, f"includes '{uri}', and so itself")
            waiting.append((included, (*above, current)))
    return roots


PACKAGE = "wm_drake_sdf"
"""Name under which the parser finds the files that an SDF includes."""


@contextmanager
def readable(path: Path, roots: dict[Path, Node]) -> Iterator[tuple[Path, Path]]:
    """Yield an SDF file as sdformat finds what it includes, and the folder of `PACKAGE`.

    sdformat looks for the name of an included file in the current folder only. So files that
    include others are copied, with names that do not depend on it.
    """
    if len(roots) == 1:
        yield path, path.parent
        return
    with temporary_folder() as folder:
        for file, root in roots.items():
            copy = folder / file.relative_to(path.parent)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(_with_whole_names(file, root), encoding="utf-8")
        yield folder / path.name, folder


def _with_whole_names(file: Path, root: Node) -> str:
    """Return the text of an SDF file with names of other files that are not relative."""
    included = {node.text_at("uri") for node in root.iter("include")}

    def whole(match: re.Match[str]) -> str:
        uri = unescape(match[1].strip())
        if uri in included:
            return f"<uri>package://{PACKAGE}/{escape(uri)}</uri>"
        return match[0] if "://" in uri else f"<uri>{escape(str(file.parent / uri))}</uri>"

    return re.sub(r"<uri>(.*?)</uri>", whole, read_text(file, key="model"), flags=re.DOTALL)


def check_elements(roots: dict[Path, Node]) -> None:
    """Check all elements of an SDF, its shapes, and the mass properties of its links.

    Raises:
        InputError: there is one problem for each.
    """
    problems = []
    for path, root in roots.items():
        problems += element_problems(path.name, root)
    for path, root in roots.items() if not problems else ():
        problems += _mesh_problems(path, root)
        problems += _inertia_problems(path, root)
    if problems:
        raise InputError(problems)


def check_mass_properties(roots: dict[Path, Node], fixed: Iterable[str]) -> None:
    """Check that each link that moves states its mass and its moments of inertia.

    Args:
        fixed: Names of the links that are fixed to the world.

    Raises:
        InputError: a link lacks a number; there is one problem per link.
    """
    at_rest, problems = set(fixed), list[Problem]()
    for path, root in roots.items():
        for link in root.iter("link"):
            missing = [part[-1] for part in _MASS_PROPERTIES if not link.text_at(*part)]
            if missing and link.name not in at_rest:
                message = f"does not state its {', '.join(missing)}"
                problems.append(problem_at(path.name, link, message))
    if problems:
        raise InputError(problems)


_MOMENTS = ("ixx", "iyy", "izz")
_MASS_PROPERTIES = (
    ("inertial", "mass"),
    *(("inertial", "inertia", name) for name in _MOMENTS),
)


def _inertia_problems(path: Path, root: Node) -> list[Problem]:
    """Return a problem for each link whose mass and inertia no part of a machine has."""
    problems = []
    for link in root.iter("link"):
        if not all(link.text_at(*part) for part in _MASS_PROPERTIES):
            continue
        numbers = {
            name: float(link.text_at("inertial", "inertia", name) or 0.0)
            for name in (*_MOMENTS, "ixy", "ixz", "iyz")
        }
        matrix = inertia_matrix(*numbers.values())
        fault = fault_of_mass_properties(float(link.text_at("inertial", "mass")), matrix)
        if fault:
            inertia = link.find("inertial", "inertia")
            problems.append(problem_at(path.name, inertia or link, fault))
    return problems


def _mesh_problems(path: Path, root: Node) -> list[Problem]:
    """Return a problem for each mesh that cannot be used."""
    problems = []
    for tag in ("collision", "visual"):
        for part in root.iter(tag):
            mesh = part.find("geometry", "mesh")
            if mesh is None:
                continue
            scale = [float(word) for word in (mesh.text_at("scale") or "1 1 1").split()]
            is_measured = tag == "collision" and not mesh.find("drake:declare_convex")
            fault = fault_of_mesh(mesh.text_at("uri"), path, scale, is_measured=is_measured)
            if fault:
                problems.append(problem_at(path.name, part, fault))
    return problems


def _root(path: Path) -> Node:
    text = read_text(path, key="model", largest=LARGEST_SDF)
    try:
        root = read_sdf(text)
    except SdfTextError as error:
        raise _refused(path, str(error)) from None
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
