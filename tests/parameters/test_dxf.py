"""Middle line of a gasket from DXF files as CAD programs and people write them."""

import itertools
import math
import re
import warnings
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.math import BSpline, ConstructionArc, bulge_to_arc

from wm_drake.errors import InputError, InputNotice
from wm_drake.parameters import dxf
from wm_drake.parameters.gasket_drawing import load_gasket_drawing

BEND = math.tan(math.pi / 8.0)
"""Bulge of a quarter of a turn."""

WALL = [
    (160.0, 0.0, 0.0), (160.0, 24.0, -BEND), (166.0, 30.0, 0.0), (170.0, 30.0, -BEND),
    (176.0, 24.0, 0.0), (176.0, 14.0, BEND), (182.0, 8.0, 0.0), (186.0, 8.0, BEND),
    (192.0, 14.0, 0.0), (192.0, 60.0, 0.0),
]  # fmt: skip
"""Middle line of the shipped drawing `folded`: x, y, bulge."""

SIDES = list(itertools.pairwise(WALL))


def new(version="R2010", units=4):
    """Return a new drawing and its model space."""
    document = ezdxf.new(version, units=units)
    return document, document.modelspace()


def read(text=None, **changes):
    """Return the drawing with the file wall.dxf, which has the text if one is given."""
    if text is not None:
        Path("wall.dxf").write_text(text, newline="")
    keys = {"file": "wall.dxf", "unit": "mm", "thickness": "2.5 mm"} | changes
    listed = ", ".join(f"{key}: {value}" for key, value in keys.items())
    Path("mine.yaml").write_text(f"dxf: {{{listed}}}\nrubber: {{shore_a: 40}}\n", encoding="utf-8")
    return load_gasket_drawing("mine.yaml")


@pytest.fixture(autouse=True)
def _in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def arc_of(begin, end):
    """Return centre, radius and angles in degrees of the arc of a bulge, counter-clockwise."""
    centre, first, last, radius = bulge_to_arc(begin[:2], end[:2], begin[2])
    return centre, radius, math.degrees(first), math.degrees(last)


def lines_and_arcs(space, **attributes):
    """Draw the wall as lines and arcs, out of order and with some lines backwards."""
    for number, (begin, end) in enumerate(reversed(SIDES)):
        ends = (begin[:2], end[:2]) if number % 2 else (end[:2], begin[:2])
        if begin[2]:
            space.add_arc(*arc_of(begin, end), dxfattribs=attributes)
        else:
            space.add_line(*ends, dxfattribs=attributes)


def polyline(space, vertices=WALL, **attributes):
    return space.add_lwpolyline(vertices, format="xyb", dxfattribs=attributes)


def saved(document, **options):
    document.saveas("wall.dxf", **options)
    return {}


def plain():
    document, space = new()
    polyline(space)
    return saved(document)


def plain_text(version="R2010"):
    document, space = new(version)
    polyline(space)
    saved(document)
    return Path("wall.dxf").read_text()


def separate_lines():
    document, space = new()
    lines_and_arcs(space)
    return saved(document)


def mirrored_polyline():
    document, space = new()
    polyline(space, [(-x, y, -bulge) for x, y, bulge in WALL], extrusion=(0, 0, -1))
    return saved(document)


def mirrored_arcs():
    document, space = new()
    for begin, end in SIDES:
        if begin[2]:
            turned = [(-x, y, -bulge) for x, y, bulge in (begin, end)]
            space.add_arc(*arc_of(*turned), dxfattribs={"extrusion": (0, 0, -1)})
        else:
            space.add_line(begin[:2], end[:2], dxfattribs={"extrusion": (0, 0, -1)})
    return saved(document)


def r12_polyline():
    document, space = new("R12", 0)
    space.add_polyline2d(WALL, format="xyb")
    return saved(document)


def mirrored_r12_polyline():
    document, space = new("R12", 0)
    vertices = [(-x, y, -bulge) for x, y, bulge in WALL]
    space.add_polyline2d(vertices, format="xyb", dxfattribs={"extrusion": (0, 0, -1)})
    return saved(document)


def frame_of_a_fitted_polyline():
    document, space = new("R12", 0)
    drawn = space.add_polyline2d(WALL, format="xyb")
    drawn.append_vertices([(0.0, 5.0)], dxfattribs={"flags": 16})
    return saved(document)


def double_vertices():
    document, space = new()
    polyline(space, [vertex for x, y, bulge in WALL for vertex in ((x, y, 0.0), (x, y, bulge))])
    return saved(document)


def lines_drawn_twice():
    document, space = new()
    lines_and_arcs(space)
    lines_and_arcs(space)
    for begin, end in SIDES:
        if not begin[2]:
            space.add_line(end[:2], begin[:2])
    return saved(document)


def three_decimals():
    document, space = new()
    for begin, end in SIDES:
        if begin[2]:
            centre, radius, first, last = arc_of(begin, end)
            space.add_arc([value + 0.0004 for value in centre], radius, first - 0.01, last + 0.01)
        else:
            space.add_line([v + 0.0006 for v in begin[:2]], [v - 0.0006 for v in end[:2]])
    return saved(document)


def rounded_bulges():
    document, space = new()
    polyline(space, [(x, y, round(bulge, 3) or 1e-9) for x, y, bulge in WALL])
    return saved(document)


def bends_of_many_lines():
    document, space = new()
    vertices = []
    for begin, end in SIDES:
        vertices.append(begin[:2])
        if begin[2]:
            arc = ConstructionArc(*arc_of(begin, end))
            points = [(place.x, place.y) for place in arc.vertices(arc.angles(40))][1:-1]
            vertices += points if begin[2] > 0.0 else points[::-1]
    space.add_lwpolyline([*vertices, WALL[-1][:2]])
    return saved(document)


def bends_as(curve):
    """Return the writer of a wall whose bends are curves of a kind."""

    def write():
        document, space = new()
        for begin, end in SIDES:
            if begin[2]:
                curve(space, *arc_of(begin, end))
            else:
                space.add_line(begin[:2], end[:2])
        return saved(document)

    return write


def elliptic(space, centre, radius, first, last):
    ends = math.radians(first), math.radians(last)
    space.add_ellipse(centre, (radius, 0.0), 1.0, *ends)


def rational(space, *arc):
    space.add_spline().apply_construction_tool(BSpline.from_arc(ConstructionArc(*arc)))


def fitted(space, *arc):
    bend = ConstructionArc(*arc)
    spline = space.add_spline(list(bend.vertices(bend.angles(7))))
    spline.dxf.start_tangent, spline.dxf.end_tangent = bend.tangents(
        [bend.start_angle, bend.end_angle]
    )


def within(placed):
    """Return the writer of a wall in a block that is placed as told, in another block."""

    def write():
        document, _ = new()
        document.layers.add("WALL")
        block, outer = document.blocks.new("B"), document.blocks.new("OUTER")
        placed(block, outer)
        document.modelspace().add_blockref("OUTER", (0, 0), dxfattribs={"layer": "WALL"})
        polyline(document.modelspace(), [(0, 0, 0), (300, 0, 0)], layer="frame")
        return saved(document) | {"layer": "wall"}

    return write


def scaled_and_turned(block, outer):
    polyline(block, [(10 * y, -10 * (x - 100), bulge) for x, y, bulge in WALL])
    outer.add_blockref("B", (100, 0), dxfattribs={"xscale": 0.1, "yscale": 0.1, "rotation": 90})


def mirrored_block(block, outer):
    lines_and_arcs(block)
    outer.add_blockref("B", (0, 0), dxfattribs={"xscale": -1.0, "extrusion": (0, 0, -1)})


def narrow_block(block, outer):
    for begin, end in SIDES:
        if begin[2]:
            (x, y), radius, first, last = arc_of(begin, end)
            block.add_ellipse((x / 2, y), (0, radius), 0.5, *np.radians((first - 90, last - 90)))
        else:
            block.add_line((begin[0] / 2, begin[1]), (end[0] / 2, end[1]))
    outer.add_blockref("B", (0, 0), dxfattribs={"xscale": 2.0})


def sheet_with_a_frame():
    document, space = new()
    polyline(space)
    document.layout("Layout1").add_lwpolyline([(0, 0), (297, 0), (297, 210)], close=True)
    return saved(document)


def text_dimension_hatch_and_axis():
    document, space = new()
    polyline(space)
    space.add_text("gasket")
    space.add_mtext("wall 2.5")
    space.add_point((5, 5))
    space.add_linear_dim((0, 70), (160, 0), (192, 60)).render()
    space.add_hatch().paths.add_polyline_path([(0, 0), (1, 0), (1, 1)], is_closed=True)
    space.add_leader([(0, 0), (5, 5)])
    space.add_line((0, -10), (0, 90))
    return saved(document)


def hidden_layers():
    document, space = new()
    document.layers.add("frozen").freeze()
    document.layers.add("off").off()
    polyline(space)
    space.add_circle((0, 0), 5, dxfattribs={"layer": "frozen"})
    space.add_circle((0, 0), 5, dxfattribs={"layer": "off"})
    space.add_circle((0, 0), 5, dxfattribs={"invisible": 1})
    return saved(document)


def layer_in_other_letters():
    document, space = new("R2000")
    document.layers.add("AUẞENKONTUR")
    polyline(space, layer="Außenkontur")
    space.add_circle((0, 0), 5)
    Path("wall.dxf").write_bytes(document_text(document).encode("cp1252", errors="replace"))
    return {"layer": "außenKONTUR"}


def document_text(document):
    saved(document)
    return Path("wall.dxf").read_text(encoding=document.encoding)


def raised():
    document, space = new()
    polyline(space, elevation=7.0)
    return saved(document)


def binary():
    document, space = new()
    polyline(space)
    return saved(document, fmt="bin")


def changed(change, version="R2010"):
    """Return the writer of a file whose text is changed."""

    def write():
        content = change(plain_text(version))
        if isinstance(content, str):
            Path("wall.dxf").write_text(content, newline="")
        else:
            Path("wall.dxf").write_bytes(content)
        return {}

    return write


def bare(text):
    """Return the section of entities only, its polyline without markers of subclasses."""
    entities = text[text.index("LWPOLYLINE") : text.index("ENDSEC", text.index("LWPOLYLINE"))]
    entities = re.sub(r"(?m)^100\nAcDb\w+\n|^330\n\w+\n|^5\n\w+\n", "", entities.replace(" ", ""))
    return f"0\nSECTION\n2\nENTITIES\n0\n{entities}ENDSEC\n0\nEOF\n"


ORDINARY = {
    "polyline": plain,
    "lines and arcs": separate_lines,
    "mirrored polyline": mirrored_polyline,
    "mirrored arcs": mirrored_arcs,
    "R12": r12_polyline,
    "mirrored R12": mirrored_r12_polyline,
    "frame vertices": frame_of_a_fitted_polyline,
    "double vertices": double_vertices,
    "twice": lines_drawn_twice,
    "three decimals": three_decimals,
    "rounded bulges": rounded_bulges,
    "bends of many lines": bends_of_many_lines,
    "ellipses": bends_as(elliptic),
    "rational splines": bends_as(rational),
    "fitted splines": bends_as(fitted),
    "block": within(scaled_and_turned),
    "mirrored block": within(mirrored_block),
    "narrow block": within(narrow_block),
    "sheet": sheet_with_a_frame,
    "text": text_dimension_hatch_and_axis,
    "hidden layers": hidden_layers,
    "layer": layer_in_other_letters,
    "elevation": raised,
    "binary": binary,
    "CRLF": changed(lambda text: text.replace("\n", "\r\n")),
    "CR": changed(lambda text: text.replace("\n", "\r")),
    "text behind EOF": changed(lambda text: text + "trash\n"),
    "byte order mark": changed(lambda text: b"\xef\xbb\xbf" + text.encode()),
    "blank lines first": changed(lambda text: "\n\n" + text),
    "comment first": changed(lambda text: "999\nmade by hand\n" + text),
    "no header, no markers": changed(bare),
    "version of R12": changed(lambda text: text.replace("AC1015", "AC1009"), "R2000"),
}


@pytest.mark.parametrize("write", ORDINARY.values(), ids=ORDINARY)
def test_an_ordinary_file_is_the_wall(write):
    keys = write()
    with warnings.catch_warnings():
        warnings.simplefilter("error", InputNotice)
        line = read(**keys).stations(200)
    whole = load_gasket_drawing("folded").stations(200)
    assert line[:, :3] == pytest.approx(whole[:, :3], abs=2e-5)


def of(draw, version="R2010", units=4, **options):
    """Return the writer of a file that a function draws."""

    def write():
        document, space = new(version, units)
        draw(space)
        return saved(document, **options)

    return write


def tilted(space):
    space.add_lwpolyline([(160, 0), (180, 20)], dxfattribs={"extrusion": (0, -1, 0)})


def block_on_its_edge(space):
    space.doc.blocks.new("B").add_line((160, 0), (180, 20))
    space.add_blockref("B", (0, 0), dxfattribs={"extrusion": (0, -1, 0)})


def two_heights(space):
    space.add_line((160, 0, 0), (160, 20, 0))
    space.add_line((160, 20, 3), (180, 20, 3))


def block_of_itself(space):
    space.doc.blocks.new("B").add_blockref("B", (0, 0))
    space.add_blockref("B", (0, 0))


def array_of_blocks(space):
    space.doc.blocks.new("B").add_text("x")
    grid = {"row_count": 30000, "column_count": 30000, "row_spacing": 1, "column_spacing": 1}
    space.add_blockref("B", (0, 0), dxfattribs=grid)


def other_file(space):
    space.doc.add_xref_def("other.dxf", "OTHER")
    space.add_blockref("OTHER", (0, 0))


def loose_lines(space):
    for layer, x in (("wall", 160), ("frame", 10)):
        space.add_line((x, 0), (x, 50), dxfattribs={"layer": layer})


def on_layers(*names):
    return of(lambda space: [polyline(space, layer=name) for name in names])


def square(space):
    corners = [(160, 0), (163, 0), (163, 50), (160, 50), (160, 0)]
    for begin, end in itertools.pairwise(corners):
        space.add_line(begin, end)


def cut_off(part):
    return changed(lambda text: text[: text.index("AcDbPolyline") + part])


def written(content):
    def write():
        Path("wall.dxf").write_bytes(content)
        return {}

    return write


def cut_binary():
    binary()
    Path("wall.dxf").write_bytes(Path("wall.dxf").read_bytes()[:-400])
    return {}


CLOSED = "is closed; allowed is the open middle line of the wall"
FLAT = "leaves the plane of x and y"
UNREADABLE = "cannot be read by ezdxf"


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (of(lambda s: polyline(s).close()), f"LWPOLYLINE on layer '0' {CLOSED}"),
        (of(lambda s: s.add_polyline2d([(1, 0), (9, 9)], close=True), "R12"), f"POLYLINE on layer '0' {CLOSED}"),
        (of(lambda s: s.add_circle((170, 0), 5)), "has a CIRCLE on layer '0'"),
        (of(lambda s: s.add_arc((170, 0), 5, 0, 360)), f"ARC on layer '0' {CLOSED}"),
        (of(lambda s: s.add_ellipse((170, 0), (5, 0))), "the path is closed at (175, 0) mm"),
        (of(lambda s: s.add_spline().set_closed([(1, 0, 0), (9, 0, 0), (9, 9, 0), (1, 9, 0)])), CLOSED),
        (of(square), "the path is closed at (160, 0) mm"),
        (of(lambda s: s.add_line((160, 0, 0), (180, 20, 5))), f"LINE on layer '0' {FLAT}"),
        (of(lambda s: s.add_polyline3d([(160, 0, 0), (160, 20, 0), (180, 20, 4)])), FLAT),
        (of(lambda s: s.add_arc((170, 0), 5, 0, 90, dxfattribs={"extrusion": (0, 1, 0)})), FLAT),
        (of(lambda s: s.add_spline([(160, 0, 0), (165, 5, 2), (170, 9, 0)])), FLAT),
        (of(lambda s: s.add_ellipse((170, 0), (5, 0), 0.5, 0, 1, dxfattribs={"extrusion": (0, 1, 0)})), FLAT),
        (of(tilted), FLAT),
        (of(block_on_its_edge), FLAT),
        (of(two_heights), "z is 3 mm there, 0 mm elsewhere"),
        (of(lambda s: s.add_polymesh()), "is a mesh; allowed is a flat polyline"),
        (of(lambda s: s.add_mline([(160, 0), (180, 20)])), "has a MLINE on layer '0'; allowed are LINE"),
        (of(lambda s: s.add_3dface([(0, 0), (1, 0), (1, 1)])), "has a 3DFACE"),
        (of(lambda s: s.add_text("a")), "has no line or arc of a wall, only 1 TEXT"),
        (of(lambda s: None), "has 0 lines and arcs; allowed are 1 to 300"),
        (of(lambda s: s.add_line((160, 0), (160, 0.001))), "has 0 lines and arcs"),
        (of(lambda s: s.add_lwpolyline([(160 + k % 2, k) for k in range(400)])), "has 399 lines"),
        (of(loose_lines), "does not continue the others; allowed is one path, its ends within 0.01 mm; dxf.layer chooses one of the layers frame, wall"),
        (of(lambda s: polyline(s, [(-x, y, -b) for x, y, b in WALL])), "x is the radius"),
        (of(lambda s: polyline(s, [(-5, 0, 0), (160, 9, 0)])), "reaches x = 0"),
        (of(lambda s: polyline(s, [(160, 0, 0), (170, 20, 0), (180, 0, 0)])), "have the same y; dxf.housing_end needs smaller or larger radius"),
        (of(block_of_itself), "has blocks within blocks; allowed are up to 16"),
        (of(array_of_blocks), "has too many entities; allowed are up to 500"),
        (of(other_file), "block 'OTHER' is in another file"),
        (of(lambda s: s.add_blockref("NONE", (0, 0))), "block 'NONE' cannot be read"),
        (of(lambda s: polyline(s, [(160, 0, 0), (160, 24, BEND), (166, 30, 0), (180, 30, 0)])),
         "the path turns by 90 degrees where an arc ends at (160, 24) mm"),
        (of(lambda s: polyline(s, [(160, 0, 0), (160, 30, 0), (176, 30, 0)])),
         "meridian.1: fillet 0 mm is too sharp for the wall"),
        (changed(lambda text: text.replace("\n176.0\n", "\nnan\n")), "a coordinate that is not a number"),
        (changed(lambda text: text.replace("\n176.0\n", "\nabc\n")), UNREADABLE),
        (changed(lambda text: text.replace("\n176.0\n", "\n176,0\n")), UNREADABLE),
        (changed(lambda text: text.replace("\n30.0\n", "\n30.0\nstray\n", 1)), UNREADABLE),
        (written(b"0\nSECTION\n2\nENTITIES\n0\nLINE\n10\n160\n20\n0\n0\nENDSEC\n0\nEOF\n"), "LINE on layer '0' has no end"),
        (written(b"0\nSECTION\n2\nENTITIES\n0\nLINE\n10\n160\n11\n170\n21\n9\n0\nENDSEC\n0\nEOF\n"), "LINE on layer '0' has no start"),
        (written(b"0\nSECTION\n2\nENTITIES\n0\nARC\n10\n160\n20\n0\n40\n9\n0\nENDSEC\n0\nEOF\n"), "ARC on layer '0' has no start angle"),
        (cut_off(60), UNREADABLE),
        (cut_off(200), UNREADABLE),
        (cut_binary, UNREADABLE),
        (written(b"AutoCAD Binary DXF\n\0"), UNREADABLE),
        (written(b""), UNREADABLE),
        (written(b"a: 1\nb: 2\n"), UNREADABLE),
        (written(b"AC1027\0\0\0\0"), "is a DWG file; allowed is DXF"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_middle_line_is_one_message(write, message, monkeypatch):
    monkeypatch.setattr(dxf, "MOST_ENTITIES", 500)
    write()
    with pytest.raises(InputError) as caught:
        read()
    assert len(caught.value.problems) == 1
    assert "wall.dxf" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        ("wal", "has no line or arc on the layer 'wal' (did you mean 'Wall'? known: Wall, frame)"),
        ("text", "has no line or arc on the layer 'text' (known: Wall, frame)"),
    ],
)
def test_a_wrong_layer_lists_those_with_lines(layer, message):
    def draw(space):
        polyline(space, layer="Wall")
        polyline(space, layer="frame")
        space.add_text("gasket", dxfattribs={"layer": "text"})

    of(draw)()
    with pytest.raises(InputError, match=re.escape(message)):
        read(layer=layer)


def test_half_a_turn_is_a_circle():
    """Two legs and half a turn, the second leg drawn backwards."""
    document, space = new()
    space.add_arc((170, 50), 10, 0, 180)
    space.add_line((180, 20), (180, 50))
    space.add_line((160, 0), (160, 50))
    saved(document)
    line = read().stations(2001)[:, :2]
    assert line[[0, -1]] == pytest.approx(np.array([[0.160, 0.0], [0.180, 0.020]]))
    turn = line[line[:, 1] > 0.0502]
    assert np.linalg.norm(turn - [0.170, 0.050], axis=1) == pytest.approx(0.01, rel=1e-3)
    assert read(housing_end="larger y").meridian[0].radius == pytest.approx(0.180)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"unit": "km"}, "mine.yaml:1: dxf.unit"),
        ({"thickness": "0 mm"}, "mine.yaml:1: dxf.thickness"),
        ({"housing_end": "left"}, "mine.yaml:1: dxf.housing_end"),
        ({"file": "other.dxf"}, "other.dxf: No such file"),
    ],
)
def test_wrong_keys_beside_the_dxf_are_refused(changes, message):
    plain()
    with pytest.raises(InputError, match=message):
        read(**changes)


def test_a_hairpin_begins_at_the_radius_that_is_chosen():
    of(lambda space: polyline(space, [(160, 0, 0), (160, 40, -1.0), (180, 40, 0), (180, 0, 0)]))()
    begins = [
        read(housing_end=end).meridian[0].radius for end in ("smaller radius", "larger radius")
    ]
    assert begins == pytest.approx([0.160, 0.180])


def test_a_file_without_the_package_says_what_to_install(monkeypatch):
    plain()
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    with pytest.raises(InputError, match=re.escape("pip install 'wm-drake[gasket]'")):
        read()


SHORT = [(160, 0), (165, 50)]


def straight(factor=1.0):
    return lambda space: space.add_lwpolyline([(factor * x, factor * y) for x, y in SHORT])


@pytest.mark.parametrize(
    ("write", "changes", "messages"),
    [
        (of(straight()), {}, []),
        (of(straight(1 / 25.4), units=1), {"unit": "in"}, []),
        (of(straight(), units=0), {}, []),
        (r12_polyline, {}, []),
        (of(straight(), units=1), {}, ["wall.dxf: dxf.unit: says that its unit is in ($INSUNITS 1); the gasket drawing says mm, which is used"]),
        (of(straight(0.001), units=4), {"unit": "m"}, ["its unit is mm"]),
        (of(straight(), units=4), {"unit": "cm"},
         ["its unit is mm", "mine.yaml: meridian.radius: 1600 mm is unusual; usual is 80 to 400 mm", "meridian.height: 500 mm"]),
        (of(straight(), units=4), {"unit": "in"}, ["its unit is mm", "meridian.radius: 4064 mm", "meridian.height: 1270 mm"]),
        (of(straight(0.1), units=0), {}, ["meridian.radius: 16 mm", "meridian.height: 5 mm"]),
        (of(straight()), {"thickness": "2.5 cm"}, ["meridian.thickness: 25 mm is unusual; usual is 0.5 to 8 mm"]),
        (of(straight()), {"thickness": "2.5 um"}, ["meridian.thickness: 0.0025 mm"]),
        (changed(lambda text: text[: text.rindex("EOF") - 4]), {}, ["is damaged (missing EOF tag) and was repaired"]),
    ],
)  # fmt: skip
def test_what_a_file_says_of_itself_is_compared(write, changes, messages):
    write()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read(**changes)
    found = [str(each.message) for each in caught if each.category is InputNotice]
    assert len(found) == len(messages)
    assert all(part in text for part, text in zip(messages, found, strict=True))


def test_a_meridian_of_numbers_has_the_same_usual_sizes():
    rim = "thickness: 30 mm"
    points = f"[{{radius: 1.7 m, y: 0 mm, {rim}}}, {{radius: 1.7 m, y: 900 mm, {rim}}}]"
    Path("mine.yaml").write_text(f"meridian: {points}\nrubber: {{shore_a: 40}}\n")
    with pytest.warns(InputNotice) as caught:
        load_gasket_drawing("mine.yaml")
    found = [str(each.message).split(" is unusual")[0] for each in caught]
    assert found == [f"mine.yaml: meridian.{size}" for size in
                     ("radius: 1700 mm", "height: 900 mm", "thickness: 30 mm")]  # fmt: skip


def test_a_curve_becomes_arcs_that_stay_at_it():
    """An ellipse of 30 by 12 mm, whose curvature varies sixfold, against its own points."""
    document, space = new()
    curve = space.add_ellipse((170, 20), (0, 30), 0.4, 0.0, math.pi)
    saved(document)
    drawing = read(thickness="1 mm")
    points = np.array(
        [(0.001 * p.x, 0.001 * p.y) for p in curve.vertices(np.linspace(0.0, math.pi, 4001))]
    )
    line = drawing.stations(101)[:, :2]
    apart = np.linalg.norm(line[:, None] - points[None], axis=2).min(axis=1)
    assert apart.max() < 2e-5
    assert len(drawing.meridian) < 40
