"""Meshes of an SDF: files that cannot be read, sizes in wrong units, shapes that are not convex."""

import itertools
import re

import numpy as np
import pytest
from pydrake.geometry import Mesh

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.model.meshes import fault_of_mesh, hull_distance

CORNERS = list(itertools.product((0.0, 0.1), repeat=3))
FACES = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def obj(corners, faces):
    return "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces


CUBE = obj(CORNERS, FACES)


def prism(outline, depth=0.1):
    """Return a prism along y over an outline that is given with its triangles."""
    points, triangles = outline
    n = len(points)
    corners = [(x, y, z) for y in (0.0, depth) for x, z in points]
    faces = [*triangles, *((a + n, c + n, b + n) for a, b, c in triangles)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, i + n, j), (j, i + n, j + n)]
    return obj(corners, "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces))


def yoke(wall):
    """Return the outline of a U of 300 x 200 mm with a wall thickness, open at the top. [m]"""
    w = wall
    points = [
        (0, 0),
        (0.3, 0),
        (0.3, 0.2),
        (0.3 - w, 0.2),
        (0.3 - w, w),
        (w, w),
        (w, 0.2),
        (0, 0.2),
    ]
    return points, [(0, 1, 5), (1, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]


def tetrahedron(size):
    return obj([(0, 0, 0), (size, 0, 0), (0, size, 0), (0, 0, size)], "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")  # fmt: skip


@pytest.mark.parametrize(
    ("text", "scale", "reason"),
    [
        (None, 1, "which cannot be read: No such file or directory"),
        ("", 1, "which is empty"),
        ("f 1 2 3\n", 1, "which has no corners"),
        (CUBE.replace("v 0.1 0.1 0.1", "v nan 0 0"), 1, "which has a corner that is not three numbers"),
        (CUBE.replace("v 0.1 0.1 0.1", "v 0,1 0 0"), 1, "which has a corner that is not three numbers"),
        (CUBE.replace("v 0.1 0.1 0.1", "v 1e300 0 0"), 1, "which has a corner that is not three numbers"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", 1, "which cannot be read: "),
        (CUBE, 1, ""),
        (tetrahedron(262), 1, "which is 262 m long; allowed is up to 3 m; is it in mm? One mm is 0.001 m. Give it in <scale>"),
        (tetrahedron(262), 1e-3, ""),
        (tetrahedron(0.262), 1e-3, "which is 0.262 mm long; allowed is 1 mm or more"),
        (tetrahedron(10.3), 1, "which is 10.3 m long; allowed is up to 3 m; is it in mm?"),
        (prism(yoke(0.05)), 1, "which lies up to 100 mm outside of it"),
        (prism(yoke(0.0008)), 1, "which lies up to 149 mm outside of it"),
        (prism(([(0, 0), (0.3, 0), (0.3, 0.2), (0.15, 0.17), (0, 0.2)], [(0, 1, 3), (1, 2, 3), (0, 3, 4)])), 1, "outside of it. Split it into convex parts"),
        (prism(([(0, 0), (0.3, 0), (0.3, 0.2), (0.15, 0.1995), (0, 0.2)], [(0, 1, 3), (1, 2, 3), (0, 3, 4)])), 1, ""),
    ],
)  # fmt: skip
def test_mesh_that_is_measured(tmp_path, text, scale, reason):
    if text is not None:
        (tmp_path / "a.obj").write_text(text, encoding="utf-8")
    fault = fault_of_mesh("a.obj", tmp_path / "a.sdf", [scale] * 3, is_measured=True)
    assert bool(fault) == bool(reason)
    assert reason in fault
    assert not reason or fault.startswith("has the mesh 'a.obj', which ")


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("http://localhost/a.obj", "allowed is the name of a file"),
        ("package://drake/a.obj", "allowed is the name of a file"),
        ("model://a.obj", "allowed is the name of a file"),
        ("file:///dev/zero", "allowed is the name of a file"),
        ("a.png", "allowed are files .obj, .vtk, .gltf"),
        ("a.stl", "allowed are files .obj, .vtk, .gltf"),
        ("a.dae", "allowed are files .obj, .vtk, .gltf"),
        ("a.gltf", "which cannot be read"),
    ],
)
def test_name_of_a_mesh(tmp_path, uri, reason):
    for is_measured in (True, False):
        fault = fault_of_mesh(uri, tmp_path / "a.sdf", [1, 1, 1], is_measured=is_measured)
        assert reason in fault


def test_mesh_of_a_picture_may_have_any_shape(tmp_path):
    (tmp_path / "a.obj").write_text(prism(yoke(0.05)), encoding="utf-8")
    assert not fault_of_mesh("a.obj", tmp_path / "a.sdf", [1, 1, 1], is_measured=False)


def test_changed_file_is_read_again(tmp_path):
    path = tmp_path / "a.obj"
    for text, is_good in ((CUBE, True), (prism(yoke(0.05)), False), (CUBE + "# \n", True)):
        path.write_text(text, encoding="utf-8")
        assert is_good != bool(fault_of_mesh("a.obj", path, [1, 1, 1], is_measured=True))


def test_hull_of_a_fine_ball_with_a_dent_is_off_by_its_depth(tmp_path):
    """A dent of 60 deg half angle is a flat cut to the hull: its depth below it is known."""
    rows, columns, radius = 60, 60, 0.2
    theta = np.linspace(1e-3, np.pi - 1e-3, rows)
    phi = 2.0 * np.pi * np.arange(columns) / columns
    corners = []
    for t, f in itertools.product(theta, phi):
        x = radius * np.array([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)])
        x[2] = min(x[2], 2 * 0.15 - x[2])  # the cap above z = 150 mm is folded in
        corners.append(x)
    faces = ""
    for i, j in itertools.product(range(rows - 1), range(columns)):
        a, b = i * columns + j, i * columns + (j + 1) % columns
        faces += (
            f"f {a + 1} {a + columns + 1} {b + columns + 1}\nf {a + 1} {b + columns + 1} {b + 1}\n"
        )
    faces += "f " + " ".join(map(str, range(columns, 0, -1))) + "\n"
    faces += "f " + " ".join(str((rows - 1) * columns + k + 1) for k in range(columns)) + "\n"
    path = tmp_path / "a.obj"
    path.write_text(obj(corners, faces), encoding="utf-8")
    mesh = Mesh(str(path), 1.0)
    assert hull_distance(mesh, mesh.GetConvexHull()) == pytest.approx(0.05, rel=0.1)


def machine(tmp_path, geometry):
    text = (SDF_FOLDER / "oscillating_group.sdf").read_text(encoding="utf-8")
    odd = f'<collision name="odd"><pose>-0.15 0 0.2 0 0 0</pose><geometry>{geometry}</geometry></collision>'
    text = text.replace('<link name="tub">', f'<link name="tub">{odd}', 1)
    (tmp_path / "bodies.sdf").write_text(text, encoding="utf-8")
    path = str(tmp_path / "bodies.sdf")
    return wm.load_machine("reference").model_copy(update={"model": path})


def test_concave_mesh_is_refused_unless_its_hull_is_meant(tmp_path):
    (tmp_path / "yoke.obj").write_text(prism(yoke(0.05)), encoding="utf-8")
    mesh = "<mesh>{}<uri>yoke.obj</uri></mesh>"
    with pytest.raises(
        InputError, match=r"line \d+: collision 'odd' of link 'tub' has the mesh"
    ) as e:
        wm.build_machine(machine(tmp_path, mesh.format("")))
    way_out = re.search(r"write (<.*?/>) into <mesh>", str(e.value))[1]
    scene = wm.Scene(machine(tmp_path, mesh.format(way_out)))
    np.testing.assert_allclose(scene.tub_outlines()["odd"].half, [0.15, 0.05, 0.1], atol=0.11)
