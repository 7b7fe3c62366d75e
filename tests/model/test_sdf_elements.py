"""Each element of an SDF is honoured or refused; a number that is not one is named with its line.

The tests walk the declaration `wm_drake.model.sdf_elements`, so that a new element is tested too.
"""

import re
from xml.sax.saxutils import quoteattr

import pytest

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.model.sdf_elements import (
    SHAPES,
    Empty,
    Refused,
    SdfChoice,
    SdfElement,
    SdfLimit,
    SdfName,
    SdfNumbers,
    SdfPose,
    element_problems,
    kinds,
)
from wm_drake.model.sdf_files import check_elements, sdf_roots
from wm_drake.model.sdf_text import read_sdf

KINDS = dict(kinds())
HONOURED = {path: kind for path, kind in KINDS.items() if isinstance(kind, SdfElement)}
REFUSED = [path for path, kind in KINDS.items() if isinstance(kind, Refused)]
WITH_VALUE = [path for path, kind in HONOURED.items() if not isinstance(kind.value, Empty)]
NUMBERS = [p for p in WITH_VALUE if isinstance(HONOURED[p].value, SdfNumbers | SdfPose | SdfLimit)]


def value_of(path):
    """Return a text that an element may have."""
    kind = HONOURED[path].value
    if isinstance(kind, SdfNumbers):
        return " ".join(["0.5"] * kind.count)
    if isinstance(kind, SdfPose):
        return "0 0 0 0 0 0"
    if isinstance(kind, SdfLimit):
        return "inf"
    if isinstance(kind, SdfChoice):
        return kind.words[0]
    return "" if isinstance(kind, Empty) else "text"


def element(path, inside=""):
    """Return an element with what it must have, and more inside it."""
    kind = KINDS[path]
    if isinstance(kind, Refused):
        return f"<{path[-1]}/>"
    attributes = "".join(
        f" {name}={quoteattr(next(iter(words), 'a'))}"
        for name, words in kind.attributes.items()
        if name in kind.needed
    )
    made = "".join(
        element((*path, tag))
        for tag in kind.needed
        if tag in kind.children and not re.search(f"^<{tag}[ />]", inside)
    )
    if path[-1] == "geometry" and not inside:
        made = element((*path, "sphere"))
    return f"<{path[-1]}{attributes}>\n{value_of(path)}{inside}{made}</{path[-1]}>"


def document(path, last=None):
    """Return an SDF with an element at a path; `last` is its text in place of an allowed one."""
    inside = element(path) if last is None else last
    for depth in range(len(path) - 1, 0, -1):
        inside = element(path[:depth], inside)
    return inside


def messages(text):
    return [problem.message for problem in element_problems("a.sdf", read_sdf(text))]


@pytest.mark.parametrize("path", HONOURED, ids="/".join)
def test_element_is_accepted(path):
    assert messages(document(path)) == []


@pytest.mark.parametrize("path", REFUSED, ids="/".join)
def test_element_is_refused_with_what_to_do(path):
    found = messages(document(path))
    assert any(message.endswith(f"is not represented: {KINDS[path].why}") for message in found)
    assert all(re.match(r"SDF 'a.sdf', line \d+: ", message) for message in found)


BAD_NUMBERS = ["1,5", "88.2 lb", "nan", "1_0", "0x10", "x", "1e999", "４", "- 1", "1;2", "1.5.2"]


@pytest.mark.parametrize("path", NUMBERS, ids="/".join)
def test_number_that_is_none_is_refused_with_line_and_element(path):
    tag, good = path[-1], value_of(path)
    rest = good.split()[1:]
    texts = [" ".join([bad, *rest]) for bad in BAD_NUMBERS] + [f"{good} 1 1", f"{good} m", "- -"]
    texts += ["", " ".join(rest)] if not isinstance(HONOURED[path].value, SdfPose) else ["0 0 0"]
    texts += [] if isinstance(HONOURED[path].value, SdfLimit) else [f"inf {' '.join(rest)}"]
    for text in texts:
        (message,) = messages(document(path, f"<{tag}>{text}</{tag}>"))
        assert re.match(r"SDF 'a.sdf', line \d+: ", message), text
        assert f"<{tag}>" in message
        assert "allowed" in message
    commented = document(path, f"<{tag}>{good[0]}<!-- c -->{good[1:]}</{tag}>")
    (message,) = messages(commented)
    assert "has a comment inside" in message
    line = int(re.search(r"line (\d+)", message)[1])
    assert f"<{tag}>" in commented.splitlines()[line - 1]


@pytest.mark.parametrize("path", HONOURED, ids="/".join)
def test_misspelt_elements_attributes_and_repetitions_are_refused(path):
    kind = HONOURED[path]
    wrong = re.sub(rf"<{path[-1]}\b", f'<{path[-1]} nmae="x"', document(path), count=1)
    assert any("has the attribute 'nmae', which is unknown" in text for text in messages(wrong))
    if len(path) > 1:
        tag = path[-1].replace("drake:", "")
        other = f"<{tag.capitalize()}/>"
        found = messages(document(path, other))
        assert any(f"is not an element of <{path[-2]}> (did you mean '" in text for text in found)
        if not kind.many and "geometry" not in path[-2]:
            twice = document(path, element(path) * 2)
            assert any(f"has 2 elements <{path[-1]}>; allowed is one" in m for m in messages(twice))
    for name, words in kind.attributes.items():
        if words:
            odd = re.sub(f' {name}="[^"]*"', "", document(path), count=1)
            odd = re.sub(rf"<{path[-1]}\b", f'<{path[-1]} {name}="odd"', odd, count=1)
            assert any(f'has {name}="odd"; allowed are ' in text for text in messages(odd))


@pytest.mark.parametrize(
    ("path", "text", "reason"),
    [
        ("model/pose", "0 0 262 0 0 0", "is it in mm?"),
        ("model/pose", "0 0 0 90 0 0", 'are the angles in degrees? Then write <pose degrees="true">'),
        ("model/link/inertial/mass", "40000", "a number above 0 up to 1000 (kg)"),
        ("model/link/inertial/mass", "0", "above 0"),
        ("model/link/inertial/mass", "-4", "above 0"),
        ("model/link/inertial/inertia/ixx", "-1", "above 0"),
        ("model/link/collision/geometry/cylinder/radius", "262", "is it in mm?"),
        ("model/link/collision/geometry/box/size", "12 20 10", "is it in mm or"),
        ("model/link/collision/geometry/box/size", "1 0 1", "above 0"),
        ("model/link/collision/geometry/mesh/scale", "-1 1 1", "above 0"),
        ("model/joint/axis/limit/lower", "-1", "allowed is inf: a run does not know limits"),
        ("model/joint/axis/dynamics/friction", "2.0", "drive.bearing_friction of the machine file"),
        ("model/link/visual/material/diffuse", "255 0 0", "from 0 up to 1"),
    ],
)  # fmt: skip
def test_number_out_of_range_is_refused(path, text, reason):
    whole = ("sdf", *path.split("/"))
    reason = reason.replace("is it in mm or", "is it in mm")
    (message,) = messages(document(whole, f"<{whole[-1]}>{text}</{whole[-1]}>"))
    assert f"is '{text}'; allowed " in message
    assert reason in message


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        ('<pose degrees="true">0 0 0 90 0 0</pose>', ""),
        ('<pose degrees="true">0 0 0 900 0 0</pose>', "roll, pitch, yaw (deg)"),
        ('<pose rotation_format="quat_xyzw">0 0 0 0 0 0 1</pose>', ""),
        ('<pose rotation_format="quat_xyzw">0 0 0 0 0 0</pose>', "a quaternion x, y, z, w"),
        ('<pose rotation_format="quat_xyzw">0 0 0 1 1 0 1</pose>', "a quaternion x, y, z, w"),
        ("<pose>0 0 0 0 0 0 1</pose>", "six numbers"),
    ],
)
def test_pose_has_the_numbers_of_its_notation(pose, reason):
    found = messages(document(("sdf", "model", "link", "pose"), pose))
    assert [reason in message for message in found] == ([True] if reason else [])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<sdf version='1.9'><model name='a'/><model name='b'/></sdf>", "has 2 elements <model>"),
        ("<sdf version='2.0'><model name='a'/></sdf>", 'has version="2.0"; allowed are 1.5, '),
        ("<sdf version='1.9'/>", "has no <model>"),
        ("<sdf><model name='a'/></sdf>", "has no attribute 'version'"),
        ("<sdf version='1.9' xmlns='x'><model name='a'/></sdf>", "the attribute 'xmlns'"),
        ("<sdf version='1.9'><model name='a'>40</model></sdf>", "has the text '40'"),
    ],
)
def test_root_holds_one_model(text, reason):
    assert any(reason in message for message in messages(text))


def test_elements_that_are_refused_for_one_reason_share_a_line():
    links = "<link name='a'><sensor name='s'/></link><link name='b'><sensor name='t'/></link>"
    (message,) = messages(f"<sdf version='1.9'><model name='m'>{links}</model></sdf>")
    assert message.startswith("SDF 'a.sdf', line 1: sensor 's' of link 'a' is not represented")
    assert message.endswith("(1 more like it)")


def test_shipped_models_are_accepted():
    for path in SDF_FOLDER.glob("*.sdf"):
        check_elements(sdf_roots(path))


@pytest.fixture
def with_part(tmp_path):
    """Build the reference machine with more in its SDF."""

    def build(tag, text, inside="model"):
        source = (SDF_FOLDER / "oscillating_group.sdf").read_text(encoding="utf-8")
        opening = re.search(f"<{inside}[^>]*>", source)[0]
        (tmp_path / "bodies.sdf").write_text(
            source.replace(opening, f"{opening}{text.format(tag)}", 1), encoding="utf-8"
        )
        path = str(tmp_path / "bodies.sdf")
        return wm.build_machine(wm.load_machine("reference").model_copy(update={"model": path}))

    return build


ON_TUB = """<link name="part"><pose relative_to="tub"/><inertial><mass>2</mass>
<inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>{}</link>
<joint name="part_to_tub" type="fixed"><parent>{{}}</parent><child>part</child></joint>"""
SOLIDS = {
    "box": "<size>.1 .1 .1</size>",
    "cylinder": "<radius>.1</radius><length>.1</length>",
    "capsule": "<radius>.1</radius><length>.1</length>",
    "ellipsoid": "<radii>.1 .1 .2</radii>",
    "sphere": "<radius>.1</radius>",
}


def test_honoured_shapes_and_looks_are_accepted_by_drake(with_part):
    assert set(SOLIDS) | {"mesh"} == {
        t for t, kind in SHAPES.items() if isinstance(kind, SdfElement)
    }
    colours = "".join(
        f"<{tag}>1 0 0 1</{tag}>" for tag in ("ambient", "diffuse", "specular", "emissive")
    )
    shapes = "".join(
        f'<{part} name="{tag}"><geometry><{tag}>{size}</{tag}></geometry>{looks}</{part}>'
        for tag, size in SOLIDS.items()
        for part, looks in (("visual", f"<material>{colours}</material>"), ("collision", ""))
    )
    scene = wm.Scene(with_part("tub", ON_TUB.format(shapes)).parameters)
    assert set(SOLIDS) <= set(scene.tub_outlines())


@pytest.mark.parametrize("carrier", ["tub", "drum"])
def test_part_on_tub_or_drum_is_in_the_description(with_part, carrier):
    described = wm.describe(with_part(carrier, ON_TUB.format("")))
    before = wm.describe(wm.build_machine("reference"))["oscillating_mass_kg"]
    assert described["oscillating_mass_kg"] == pytest.approx(before + 2.0)
    assert described["bodies"]["part"]["mass"] == 2.0
    assert described["bodies"]["part"]["turns_with"] == carrier


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ("<ixx>1e4</ixx><iyy>1e4</iyy><izz>1e4</izz>", "radius of gyration of .* m; allowed is up to 1 m; is it in .*kg mm"),
        ("<ixx>.01</ixx><iyy>.01</iyy><izz>.1</izz>", "belongs to no body"),
        ("<ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>.3</ixy>", "is not positive definite"),
    ],
)  # fmt: skip
def test_impossible_inertia_is_refused_with_its_line(with_part, inertia, reason):
    part = ON_TUB.format("").replace("<ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz>", inertia)
    with pytest.raises(InputError, match=rf"line \d+: <inertia> of link 'part' .*{reason}"):
        with_part("tub", part)


def test_names_are_texts_of_all_elements_that_have_one():
    assert all(isinstance(HONOURED[path].value, SdfName) for path in HONOURED if path[-1] == "uri")
