"""Drawing of a gasket: middle line from a DXF file, relaxation of the rubber."""

import math
from pathlib import Path

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters.gasket_drawing import PronySeries, load_gasket_drawing

HOUSING, TUB = (160.0, 0.0), (192.0, 60.0)


def dxf(*entities):
    """Return the text of a DXF file: each entity is its kind and pairs of group code and value."""
    lines = ["0", "SECTION", "2", "ENTITIES"]
    for kind, *pairs in entities:
        lines += ["0", kind, *(str(part) for pair in pairs for part in pair)]
    return "\n".join([*lines, "0", "ENDSEC", "0", "EOF", ""])


def polyline(*vertices, flag=0):
    """Return a LWPOLYLINE through x, y, bulge."""
    pairs = [(code, value) for vertex in vertices
             for code, value in zip((10, 20, 42), vertex, strict=True)]  # fmt: skip
    return ("LWPOLYLINE", (8, "wall"), (70, flag), *pairs)


BEND = math.tan(math.pi / 8.0)
"""Bulge of a quarter of a turn."""

FOLDED = polyline(
    (160.0, 0.0, 0.0), (160.0, 24.0, -BEND), (166.0, 30.0, 0.0), (170.0, 30.0, -BEND),
    (176.0, 24.0, 0.0), (176.0, 14.0, BEND), (182.0, 8.0, 0.0), (186.0, 8.0, BEND),
    (192.0, 14.0, 0.0), (192.0, 60.0, 0.0),
)  # fmt: skip
"""Middle line of the shipped drawing `folded`."""


def read(text, **changes):
    """Return the drawing with a DXF file."""
    Path("wall.dxf").write_text(text)
    keys = {"file": "wall.dxf", "unit": "mm", "thickness": "2.5 mm"} | changes
    listed = ", ".join(f"{key}: {value}" for key, value in keys.items())
    Path("mine.yaml").write_text(f"dxf: {{{listed}}}\nrubber: {{shore_a: 40}}\n")
    return load_gasket_drawing("mine.yaml")


@pytest.fixture(autouse=True)
def _in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_polyline_with_arcs_is_the_shipped_drawing():
    same, shipped = read(dxf(FOLDED)), load_gasket_drawing("folded")
    for ours, theirs in zip(same.meridian, shipped.meridian, strict=True):
        assert (ours.radius, ours.y) == pytest.approx((theirs.radius, theirs.y), abs=1e-9)
        assert ours.fillet == pytest.approx(theirs.fillet, rel=2e-5)
    assert same.stations(50) == pytest.approx(shipped.stations(50), abs=1e-5)


def test_lines_and_arcs_in_any_order_and_direction_are_one_path():
    """A hairpin: two legs and half a turn, the second leg drawn backwards, other layers beside."""
    legs = [("LINE", (8, "wall"), (10, x), (20, 0.0), (11, x), (21, 50.0)) for x in (160.0, 180.0)]
    legs[1] = ("LINE", (8, "wall"), (10, 180.0), (20, 50.0), (11, 180.0), (21, 20.0))
    arc = ("ARC", (8, "wall"), (10, 170.0), (20, 50.0), (40, 10.0), (50, 0.0), (51, 180.0))
    other = ("CIRCLE", (8, "text"), (10, 0.0), (20, 0.0), (40, 1.0))
    drawing = read(dxf(other, arc, legs[1], legs[0]), layer="wall")
    line = drawing.stations(2001)
    assert line[0, :2] == pytest.approx((0.160, 0.0))
    assert line[-1, :2] == pytest.approx((0.180, 0.020))
    turn = line[line[:, 1] > 0.0502]
    centre = np.array([0.170, 0.050])
    assert np.linalg.norm(turn[:, :2] - centre, axis=1) == pytest.approx(0.01, rel=1e-3)
    other_way = read(dxf(arc, *legs), housing_end="larger y")
    assert (other_way.meridian[0].radius, other_way.meridian[-1].radius) == (0.180, 0.160)


def test_unit_of_the_file():
    line = ("LINE", (10, 6.0), (20, 0.0), (11, 6.0), (21, 2.0))
    drawing = read(dxf(line), unit="in")
    assert drawing.meridian[-1].radius == pytest.approx(0.1524)
    assert drawing.meridian[-1].y == pytest.approx(0.0508)


LINE = ("LINE", (10, 160.0), (20, 0.0), (11, 160.0), (21, 50.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("AutoCAD Binary DXF\n\0", "line 1: 'AutoCAD Binary DXF' is no group code"),
        ("0\nSECTION\n2\nHEADER\n0\nENDSEC\n", "has no section ENTITIES"),
        (dxf(LINE).split("ENDSEC")[0], "ends within the section ENTITIES"),
        (dxf(), "has 0 lines and arcs; allowed are 1 to 60"),
        (dxf(LINE, ("SPLINE", (8, "0"))), "has an entity SPLINE; allowed are LWPOLYLINE, LINE"),
        (dxf(("LINE", (10, 1.0), (20, "x"))), "LINE: group 20 is 'x', not a number"),
        (dxf(("LINE", (10, 1.0), (20, "nan"))), "LINE: group 20 is 'nan', not a number"),
        (dxf(("LINE", (10, 1.0))), "LINE: has no group 20"),
        (dxf(polyline((1, 0, 0), (1, 9, 0), flag=1)), "LWPOLYLINE: is closed"),
        (dxf(LINE, ("LINE", (10, 170), (20, 0), (11, 170), (21, 9))), "does not continue"),
        (dxf(("LINE", (10, 1), (20, 1), (11, 1), (21, 1))), "has no length, or is closed"),
        (
            dxf(polyline((160, 0, 0), (160, 24, BEND), (166, 30, 0), (180, 30, 0))),
            "the path turns by 90 degrees where an arc ends at (160, 24) mm",
        ),
        (
            dxf(polyline((160, 0, 0), (160, 30, 0), (176, 30, 0))),
            "meridian.1: fillet 0 mm is too sharp for the wall",
        ),
        (dxf(("LINE", (10, -5), (20, 0), (11, 160), (21, 9))), "radius"),
    ],
)
def test_a_wrong_dxf_is_one_message(text, message):
    with pytest.raises(InputError) as caught:
        read(text)
    assert len(caught.value.problems) == 1
    assert "wall.dxf" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"unit": "km"}, "mine.yaml:1: dxf.unit"),
        ({"thickness": "0 mm"}, "mine.yaml:1: dxf.thickness"),
        ({"file": "other.dxf"}, "other.dxf"),
    ],
)
def test_wrong_keys_beside_the_dxf_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        read(dxf(LINE), **changes)


def test_modulus_of_a_series_is_the_transform_of_its_relaxation():
    """E* = i w integral of k(t) exp(-i w t) dt, by that of the relaxed rubber."""
    series, frequency = PronySeries(time=(0.02, 0.3), share=(0.2, 0.1)), 2.5
    w, t = 2.0 * math.pi * frequency, np.linspace(0.0, 6.0, 600001)
    moving = sum(g * np.exp(-t / tau) for g, tau in zip(series.share, series.time, strict=True))
    transform = 0.7 + 1j * w * np.trapezoid(moving * np.exp(-1j * w * t), t)
    assert series.modulus(frequency) == pytest.approx(transform / 0.7, rel=1e-6)
    assert series.modulus(1e-9) == pytest.approx(1.0, abs=1e-6)
    assert series.modulus(1e9).real == pytest.approx(1.0 / 0.7)


@pytest.mark.parametrize(
    ("rubber", "message"),
    [
        ("prony: {time: '(0.1, 1) s', share: [0.1]}", "needs as many shares as times"),
        (
            "prony: {time: '(0.1, 1) s', share: [0.5, 0.5]}",
            "the shares add up to 1; allowed is below",
        ),
        ("prony: {time: '(0) s', share: [0.5]}", "rubber.prony.time"),
        ("prony: {time: '(0.1) s', share: [0.5]}, loss_factor: 0.1", "needs either loss_factor or"),
    ],
)
def test_a_wrong_series_is_one_message(rubber, message):
    rim = "radius: 160 mm, thickness: 2 mm"
    points = f"[{{{rim}, y: 0 mm}}, {{{rim}, y: 30 mm}}]"
    Path("mine.yaml").write_text(f"meridian: {points}\nrubber: {{shore_a: 40, {rubber}}}\n")
    with pytest.raises(InputError) as caught:
        load_gasket_drawing("mine.yaml")
    assert message in str(caught.value)
