"""Check of the shapes and poses in an SDF file, before Drake reads meshes or computes distances."""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from wm_drake.errors import InputError, Problem
from wm_drake.parameters.text_files import check_regular

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
