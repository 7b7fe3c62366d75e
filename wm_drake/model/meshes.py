"""Meshes of an SDF: which ones can be used, how large they are, how far they are from convex.

Drake measures the distance of a mesh by its convex hull. So a mesh that is not convex is refused
where distances are measured, with how far the hull lies outside of it.
"""

import functools
import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    GeometryInstance,
    Mesh,
    PolygonSurfaceMesh,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform

from wm_drake.errors import InputError, shortened
from wm_drake.model.sdf_elements import LONGEST_LENGTH, unit_of_length
from wm_drake.parameters.text_files import check_regular
from wm_drake.parameters.types import FloatArray

MESH_SUFFIXES = (".obj", ".vtk", ".gltf")

SMALLEST_SHAPE = 1e-3
"""Smallest length of a mesh: a smaller one is in a larger unit, or was scaled twice. [m]"""

HULL_TOLERANCE = 1e-3
"""By how much the convex hull of a mesh may lie outside of it. [m]"""

_MOST_POINTS = 4000
"""Largest number of points of a hull at which its distance from the mesh is computed."""

_GRID = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6.0
"""Points of a triangle, in barycentric coordinates."""


def fault_of_mesh(uri: str, sdf: Path, scale: Sequence[float], *, is_measured: bool) -> str:
    """Return what is wrong with a mesh; empty if nothing is.

    Args:
        uri: Its name in the SDF.
        sdf: The SDF file; the name is relative to it.
        scale: Factors along the axes.
        is_measured: Whether distances are measured from the mesh itself, not from its hull.
    """
    shown = shortened(uri, 80)
    if "://" in uri:
        return f"has the mesh '{shown}'; allowed is the name of a file"
    mesh = sdf.parent / uri
    if mesh.suffix.lower() not in MESH_SUFFIXES:
        return f"has the mesh '{shown}'; allowed are files {', '.join(MESH_SUFFIXES)}"
    try:
        check_regular(mesh)
    except InputError as error:
        return f"has the mesh '{shown}', which cannot be read: {error.problems[0].message}"
    status = mesh.stat()
    stamp = status.st_mtime_ns, status.st_size
    reason = _fault_of_file(mesh, tuple(scale), is_measured, stamp)
    return f"has the mesh '{shown}', which {reason}" if reason else ""


@functools.lru_cache(maxsize=64)
def _fault_of_file(
    mesh: Path, scale: tuple[float, ...], is_measured: bool, stamp: tuple[int, int]
) -> str:
    """Return what is wrong with a mesh file in the state that a stamp says."""
    if not stamp[1]:
        return "is empty"
    if mesh.suffix.lower() == ".obj" and (fault := _fault_of_corners(mesh)):
        return fault
    try:
        return _fault_of_shape(Mesh(str(mesh), np.array(scale)), is_measured)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).replace(f"{mesh.parent}/", "")
        return f"cannot be read: {shortened(reason, 200)}"


def _fault_of_shape(shape: Mesh, is_measured: bool) -> str:
    """Return what is wrong with size and form of a mesh; empty if nothing is."""
    hull = shape.GetConvexHull()
    if fault := _fault_of_size(hull):
        return fault
    if not is_measured:
        return ""
    if shape.extension() != ".obj":
        return f"is no .obj file: its distances would be those of its convex hull. {_HULL}"
    off = hull_distance(shape, hull)
    if off <= HULL_TOLERANCE:
        return ""
    return (
        "is not convex: distances would be those of its convex hull, which lies up to "
        f"{1e3 * off:.3g} mm outside of it. Split it into convex parts, each a collision of its "
        f"own, such as boxes. {_HULL}"
    )


_HULL = "If the hull is what you mean, write <drake:declare_convex/> into <mesh>"


def _fault_of_corners(mesh: Path) -> str:
    """Return what is wrong with the corners of an .obj file; empty if nothing is."""
    lines = mesh.read_text(encoding="utf-8", errors="replace").splitlines()
    corners = [words[1:4] for words in map(str.split, lines) if words[:1] == ["v"]]
    if not corners:
        return "has no corners"
    if not all(len(corner) == 3 and all(map(_is_length, corner)) for corner in corners):
        return "has a corner that is not three numbers"
    return ""


def _is_length(text: str) -> bool:
    try:
        return abs(float(text)) <= 1e9  # false for nan
    except ValueError:
        return False


def _vertices(mesh: PolygonSurfaceMesh) -> FloatArray:
    return np.array([mesh.vertex(index) for index in range(mesh.num_vertices())])


def _fault_of_size(hull: PolygonSurfaceMesh) -> str:
    """Return what is wrong with the size of a mesh; empty if nothing is."""
    corners = _vertices(hull)
    size = float(np.ptp(corners, axis=0).max())
    farthest = float(np.abs(corners).max())
    if size < SMALLEST_SHAPE:
        return f"is {1e3 * size:.3g} mm long; allowed is {1e3 * SMALLEST_SHAPE:g} mm or more"
    if max(size, farthest) > LONGEST_LENGTH:
        what = f"is {size:.4g} m long" if size > LONGEST_LENGTH else f"reaches {farthest:.4g} m"
        hint = unit_of_length(max(size, farthest))
        hint += ". Give it in <scale>, such as 0.001 0.001 0.001" if hint else ""
        return f"{what}; allowed is up to {LONGEST_LENGTH:g} m{hint}"
    return ""


def hull_distance(mesh: Mesh, hull: PolygonSurfaceMesh) -> float:
    """Return by how much the convex hull of a mesh lies outside of it. [m]

    It is the largest distance of a point of the hull from the mesh. The points are a grid on the
    largest triangles of the hull: a triangle that spans a hollow is at least as wide as it is deep.
    """
    scene = SceneGraph()
    shape = GeometryInstance(RigidTransform(), mesh, "mesh")
    shape.set_proximity_properties(ProximityProperties())
    scene.RegisterAnchoredGeometry(scene.RegisterSource("hull"), shape)
    query = scene.get_query_output_port().Eval(scene.CreateDefaultContext())
    points = _points_of(hull)
    return max(
        (abs(query.ComputeSignedDistanceToPoint(point)[0].distance) for point in points),
        default=0.0,
    )


def _points_of(hull: PolygonSurfaceMesh) -> FloatArray:
    """Return points on the largest triangles of a hull. (n, 3) [m]"""
    corners, triangles = _vertices(hull), list[tuple[int, int, int]]()
    faces = iter(hull.face_data())
    for count in faces:
        first, *others = (next(faces) for _ in range(count))
        triangles += [(first, a, b) for a, b in itertools.pairwise(others)]
    chosen = corners[np.array(triangles)]
    sides = np.linalg.norm(chosen - np.roll(chosen, 1, axis=1), axis=2)
    largest = np.argsort(-sides.max(axis=1))[: _MOST_POINTS // len(_GRID)]
    return np.asarray(np.einsum("gc,tcx->tgx", _GRID, chosen[largest]).reshape(-1, 3))
