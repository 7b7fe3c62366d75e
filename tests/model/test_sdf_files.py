"""SDF files that include others, and links without mass: refused before sdformat reads them."""

import pytest

from wm_drake.errors import InputError
from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.model.sdf_files import MOST_FILES, check_mass_properties, sdf_roots
from wm_drake.model.sdf_text import read_sdf

INERTIA = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>"


def written(path, content):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"<sdf version='1.9'><model name='m'>{content}</model></sdf>", encoding="utf-8")
    return path


def include(uri):
    return f"<include><uri>{uri}</uri></include>"


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("a.sdf", "and so itself"),
        ("b.sdf", "and so itself"),
        ("missing.sdf", "no such file"),
        ("folder", "no such file"),
        ("../outside.sdf", "elsewhere"),
        ("link.sdf", "elsewhere"),
        ("file:///etc/passwd", "allowed is the name of an SDF file"),
        ("model://tub", "allowed is the name of an SDF file"),
        ("/dev/zero", "allowed is the name of an SDF file"),
        ("", "allowed is the name of an SDF file"),
        ("a\0b", "not well-formed"),
        ("x" * 5000, "no such file"),
        ("page.sdf", "it is <html>"),
        ("text.sdf", "cannot be read"),
    ],
)
def test_include_is_refused(tmp_path, uri, reason):
    folder = tmp_path / "folder"
    path = written(folder / "a.sdf", include(uri))
    written(folder / "b.sdf", include("a.sdf"))
    written(tmp_path / "outside.sdf", "")
    (folder / "folder").mkdir()
    (folder / "link.sdf").symlink_to(tmp_path / "outside.sdf")
    (folder / "page.sdf").write_text("<html/>", encoding="utf-8")
    (folder / "text.sdf").write_text("text", encoding="utf-8")
    with pytest.raises(InputError, match=reason) as refused:
        sdf_roots(path)
    assert len(str(refused.value)) <= 500


def test_included_files_are_read_once_and_limited(tmp_path):
    path = written(tmp_path / "a.sdf", include("sub/b.sdf") * 2)
    written(tmp_path / "sub" / "b.sdf", include("c.sdf"))
    written(tmp_path / "c.sdf", "")
    assert [p.name for p in sdf_roots(path)] == ["a.sdf", "b.sdf", "c.sdf"]
    for number in range(MOST_FILES + 1):
        written(tmp_path / f"n{number}.sdf", include(f"n{number + 1}.sdf"))
    with pytest.raises(InputError, match="more than"):
        sdf_roots(tmp_path / "n0.sdf")


@pytest.mark.parametrize(
    ("inertial", "missing"),
    [
        ("", "mass, ixx, iyy, izz"),
        (f"<inertial>{INERTIA}</inertial>", "mass"),
        (f"<inertial><mass> </mass>{INERTIA}</inertial>", "mass"),
        ("<inertial><mass>1</mass></inertial>", "ixx, iyy, izz"),
    ],
)
def test_link_that_moves_states_mass_and_inertia(inertial, missing):
    link = read_sdf(f"<sdf><link name='tub'>{inertial}</link></sdf>")
    check_mass_properties({SDF_FOLDER / "a.sdf": link}, ["tub"])
    with pytest.raises(InputError, match=f"line 1: link 'tub' does not state its {missing}$"):
        check_mass_properties({SDF_FOLDER / "a.sdf": link}, ["housing"])


def test_joint_that_drake_refuses_is_one_message(wm_drake, tmp_path):
    text = (SDF_FOLDER / "oscillating_group.sdf").read_text(encoding="utf-8")
    joint = '<joint name="q" type="fixed"><parent>world</parent><child>tub</child></joint>'
    (tmp_path / "fixed.sdf").write_text(text.replace("</model>", f"{joint}</model>"), "utf-8")
    machine = tmp_path / "machine.yaml"
    machine.write_text("extends: reference\nmodel: fixed.sdf\n", encoding="utf-8")
    ended = wm_drake("machine", "check", str(machine))
    assert ended.code == 2
    assert ended.err.startswith(f"{machine}:2: model: SDF 'fixed.sdf' cannot be read: AddJoint")
    assert ended.err.count("\n") == 1
