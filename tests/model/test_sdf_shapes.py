"""Shapes of an SDF file that cannot be measured are refused by `machine check` with their names."""

from xml.etree import ElementTree

import pytest

from wm_drake.errors import InputError
from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.model.sdf_files import check_shapes

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)) + "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"  # fmt: skip


@pytest.fixture
def machine(tmp_path):
    """Write a machine whose link has one more shape, and return its file."""

    def write(shape, link="tub", tag="collision"):
        text = (SDF_FOLDER / "oscillating_group.sdf").read_text(encoding="utf-8")
        odd = f'<link name="{link}"><{tag} name="odd"><geometry>{shape}</geometry></{tag}>'
        (tmp_path / "bodies.sdf").write_text(
            text.replace(f'<link name="{link}">', odd), encoding="utf-8"
        )
        path = tmp_path / "machine.yaml"
        path.write_text("extends: reference\nmodel: bodies.sdf\n", encoding="utf-8")
        return path

    return write


def mesh(uri):
    return f"<mesh><uri>{uri}</uri></mesh>"


PLANE = "<plane><normal>0 0 1</normal><size>1 1</size></plane>"


@pytest.mark.parametrize("link", ["tub", "housing", "drum"])
@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (PLANE, "is a plane, which has no bounds"),
        ("<sphere><radius>nan</radius></sphere>", "has 'nan' as its radius; allowed are numbers up to 1000 (metres), above 0"),
        ("<sphere><radius>-1</radius></sphere>", "has '-1' as its radius"),
        ("<sphere><radius>1e300</radius></sphere>", "has '1e300' as its radius"),
        ("<box><size>1 0 1</size></box>", "has '1 0 1' as its size"),
        (mesh("nosuch.obj"), "has the mesh 'nosuch.obj', which cannot be read: No such file or directory"),
        (mesh("empty.obj"), "has the mesh 'empty.obj', which has no corners"),
        (mesh("nan.obj"), "has the mesh 'nan.obj', which has a corner that is not three numbers up to 1000"),
        (mesh("http://localhost/a.obj"), "has the mesh 'http://localhost/a.obj'; allowed is the name of a file"),
        (mesh("file:///dev/zero"), "allowed is the name of a file"),
        (mesh("pictures.png"), "allowed are files .obj, .vtk, .gltf"),
    ],
)  # fmt: skip
def test_shape_is_refused_by_machine_check(machine, wm_drake, tmp_path, shape, message, link):
    (tmp_path / "empty.obj").write_text("", encoding="utf-8")
    (tmp_path / "nan.obj").write_text(CUBE.replace("v 0.1 0.1 0.1", "v nan 0 0"), encoding="utf-8")
    ended = wm_drake("machine", "check", machine(shape, link))
    assert ended.code == 2
    (line,) = ended.messages
    where = f"{tmp_path / 'machine.yaml'}:2: model: SDF 'bodies.sdf': shape 'odd' "
    assert line.startswith(where)
    assert message in line


def test_good_mesh_is_accepted(machine, wm_drake, tmp_path):
    (tmp_path / "cube.obj").write_text(CUBE, encoding="utf-8")
    ended = wm_drake("machine", "check", machine(mesh("cube.obj")))
    assert ended.code == 0, ended.err


def test_every_bad_shape_is_reported(tmp_path):
    path = tmp_path / "two.sdf"
    shapes = "".join(f'<visual name="{n}"><geometry>{PLANE}</geometry></visual>' for n in "ab")
    path.write_text(
        f"<sdf version='1.9'><model name='m'><link name='l'>{shapes}</link></model></sdf>",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as error:
        check_shapes(path, ElementTree.parse(path).getroot())
    assert len(error.value.problems) == 2


@pytest.mark.parametrize("pose", ["1e300 0 0 0 0 0", "0 nan 0 0 0 0"])
def test_pose_too_far_away_is_refused(tmp_path, pose):
    path = tmp_path / "far.sdf"
    path.write_text(
        f"<sdf version='1.9'><model name='m'><link name='l'><pose>{pose}</pose></link></model></sdf>",
        encoding="utf-8",
    )
    with pytest.raises(InputError, match=r"a pose is '.*'; allowed are numbers up to 1000"):
        check_shapes(path, ElementTree.parse(path).getroot())


def test_shipped_models_are_accepted():
    for path in SDF_FOLDER.glob("*.sdf"):
        check_shapes(path, ElementTree.parse(path).getroot())
