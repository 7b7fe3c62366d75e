"""Check of the text of an SDF and of the files that it includes, before sdformat reads them.

sdformat drops an included file that it cannot use, takes 1 kg for a missing mass, and ends the
process on a cycle of files. So all this is checked here.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.text_files import check_regular, read_text

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


UNBOUNDED = ("plane", "heightmap")
SIZES = ("size", "radius", "radii", "length")
MESH_SUFFIXES = (".obj", ".vtk", ".gltf")

LONGEST_LENGTH = 1000.0
"""Largest length in an SDF file: far above any machine, and squares of it never overflow. [m]"""

_LENGTHS = f"numbers up to {LONGEST_LENGTH:g} (metres)"


def check_shapes(path: Path, root: Element) -> None:
    """Check that all shapes and poses of an SDF file are bounded and that its meshes can be read.

    Args:
        path: The SDF file; names of meshes are relative to it.

    Raises:
        InputError: a shape is unbounded, or a mesh is missing, empty, of another type, has a corner
            that is not finite, or is not a file; or a pose is too far away. There is one problem
            per shape and pose.
    """
    problems = []
    for name, shape in _shapes(root):
        reason = _fault(shape, path)
        if reason:
            message = f"SDF '{path.name}': shape '{name}' {reason}"
            problems.append(Problem("", "model", message))
    for pose in root.iter("pose"):
        words = (pose.text or "").split()
        if not all(map(_is_length, words)):
            message = (
                f"SDF '{path.name}': a pose is '{' '.join(words)[:60]}'; allowed are {_LENGTHS}"
            )
            problems.append(Problem("", "model", message))
    if problems:
        raise InputError(problems)


def _shapes(root: Element) -> Iterator[tuple[str, Element]]:
    for tag in ("collision", "visual"):
        for part in root.iter(tag):
            for geometry in part.findall("geometry"):
                for shape in geometry:
                    yield part.get("name", ""), shape


def _fault(shape: Element, path: Path) -> str:
    """Return what is wrong with a shape; empty if nothing is."""
    if shape.tag in UNBOUNDED:
        return f"is a {shape.tag}, which has no bounds; allowed are bounded shapes such as a box"
    if shape.tag == "mesh":
        return _fault_of_mesh((shape.findtext("uri") or "").strip(), path)
    for part in shape.iter():
        words = (part.text or "").split()
        if part.tag in SIZES and not all(_is_length(word) and float(word) > 0.0 for word in words):
            return (
                f"has '{' '.join(words)[:60]}' as its {part.tag}; allowed are {_LENGTHS}, above 0"
            )
    return ""


def _fault_of_mesh(uri: str, path: Path) -> str:
    if re.match(r"(package|model)://", uri):
        return ""  # Drake finds these, or refuses them with a message
    if "://" in uri:
        return f"has the mesh '{uri}'; allowed is the name of a file"
    mesh = path.parent / uri
    if mesh.suffix.lower() not in MESH_SUFFIXES:
        return f"has the mesh '{uri}'; allowed are files {', '.join(MESH_SUFFIXES)}"
    try:
        check_regular(mesh)
    except InputError as error:
        return f"has the mesh '{uri}', which cannot be read: {error.problems[0].message}"
    if mesh.suffix.lower() != ".obj":
        return "" if mesh.stat().st_size else f"has the mesh '{uri}', which is empty"
    corners = [
        line.split()[1:4]
        for line in mesh.read_text(encoding="utf-8", errors="replace").splitlines()
        if line.split()[:1] == ["v"]
    ]
    if not corners:
        return f"has the mesh '{uri}', which has no corners"
    if not all(len(corner) == 3 and all(map(_is_length, corner)) for corner in corners):
        return f"has the mesh '{uri}', which has a corner that is not three {_LENGTHS}"
    return ""


def _is_length(text: str) -> bool:
    try:
        return abs(float(text)) <= LONGEST_LENGTH  # false for nan
    except ValueError:
        return False
