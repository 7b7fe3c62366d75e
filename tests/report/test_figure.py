"""Tests of figures: one declaration gives the picture of a page, the files and the data."""

import base64
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import plotly.graph_objects
import pytest

from wm_drake.report.arrangement import arrange, wrapped
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import (
    MARK,
    MEASURED,
    SHADES,
    Area,
    Axis,
    Bars,
    Cells,
    Figure,
    Line,
    Panel,
    Points,
    Rule,
    Scale,
    Span,
    Text,
    band,
    boxes,
    in_grid,
    named,
    round_numbers,
    segments,
    shade,
)
from wm_drake.report.interactive import plotly_of, thinned
from wm_drake.report.page import as_json, picture
from wm_drake.report.publication import collected, figure_data, file_name, write_figures

CELLS = np.array([[1.0, 10.0], [100.0, np.nan]])


def every_mark() -> Figure:
    """Return a figure with each kind of mark and of axis."""
    scale = Scale(low=1.0, high=100.0, kind="log", label="size, mm")
    left = Panel(
        title="left <b>",
        subtitle="of two\nlines",
        marks=(
            Span(0.5, 0.75, opacity=0.3, key="span"),
            band([0.0, 2.0], [0.0, 0.0], [1.0, 1.0], edge=MARK, key="band"),
            Line([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], dash="dashed", key="computed"),
            Line([0.0, 2.0], [0.5, 0.5], symbol="triangle-up", color=MEASURED, key="measured"),
            Points([0.0, 1.0], [1.0, 2.0], symbol="cross-thin", key="points"),
            Points([0.5], [1.5], values=[10.0], scale=replace(scale, label="")),
            *boxes([0.0, 1.0], [np.arange(5.0), np.array([])], 0.2),
            segments(([0.0], [1.0]), ([1.0], [2.0]), name="intervals"),
            Rule(2.5, color=MEASURED, key="limit"),
            Text(0.02, 0.9, "name %{x}", in_data=(False, False), across="left"),
            Line([0.0, 2.0], [10.0, 20.0], is_second=True, key="second"),
        ),
        x=Axis(label="time, s", range=(0.0, 2.0)),
        y=Axis(label="force, N"),
        second=Axis(label="speed, rpm"),
        top=Axis(label="drum speed, rpm", ticks=((0.0, "0"), (2.0, "400"))),
    )
    names = Axis(ticks=named(["one", "a much longer name of a bar"]), range=(1.5, -0.5))
    bars = Panel(
        name="bars",
        marks=(Bars([0, 1], [1.0, 2.0], base=[0.5, 0.0], colors=(MARK, MEASURED), is_across=True),),
        y=names,
    )
    cells = Panel(name="cells", marks=(Cells(CELLS, [1.0, 3.0], [0.0, 1.0], scale=scale),))
    logs = Panel(name="log", marks=(Line([1.0, 100.0], [1.0, 2.0]),), x=Axis(is_log=True))
    return Figure(panels=in_grid([left, bars, cells, logs], 2), widths=(2.0, 1.0))


def unpacked(plain):
    return np.frombuffer(base64.b64decode(plain["bdata"]), dtype="<f4")


def test_plotly_accepts_the_picture_of_every_mark():
    plain = plotly_of(every_mark())
    figure = plotly.graph_objects.Figure(plain)  # raises ValueError of unknown keys and values
    assert len(figure.data) == len(plain["data"]) > 10
    curve = next(c for c in plain["data"] if c.get("meta") == {"name": "computed"})
    assert unpacked(curve["x"]).tolist() == [0.0, 1.0, 2.0]
    assert unpacked(curve["y"]).tolist() == [1.0, 3.0, 2.0]
    cells = next(c for c in plain["data"] if c["type"] == "heatmap")
    assert unpacked(cells["z"])[:3].tolist() == [0.0, 1.0, 2.0]
    assert plain["layout"]["meta"]["keys"] == [
        *("span", "band", "computed", "measured", "points", "limit", "second")
    ]
    assert '"left &lt;b&gt;"' in str(plain["layout"]["annotations"]).replace("'", '"')


@pytest.mark.parametrize("name", SHADES)
def test_every_colour_scale_is_even_and_can_be_turned(name):
    scale = Scale(low=0.0, high=1.0, shades=name)
    assert scale.colors()[::-1] == replace(scale, shades=f"-{name}").colors()
    assert [shade(0.0, name), shade(1.0, name)] == [scale.colors()[0], scale.colors()[-1]]


def test_a_file_is_named_by_what_is_drawn_not_by_what_comes_out():
    names = [file_name(f"Gaps, load back{end}") for end in ("", "; least 3.1 mm", ". Least: 4 mm.")]
    assert names == 3 * ["gaps_load_back"]


def test_files_and_picture_show_the_same_data(tmp_path):
    figure = every_mark()
    with collected() as figures:
        picture(figure, "Two panels: <name>/..", "")
    write_figures(figures, tmp_path)
    stem = "01_two_panels_name"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{stem}.{kind}" for kind in ("csv", "pdf", "png", "svg")
    ]
    svg = (tmp_path / f"{stem}.svg").read_text()
    width = ElementTree.fromstring(svg).get("width")
    assert float(width.removesuffix("pt")) == pytest.approx(175.0 / 25.4 * 72.0)
    assert b"/MediaBox [ 0 0 496.0629" in (tmp_path / f"{stem}.pdf").read_bytes()
    table = pd.read_csv(tmp_path / f"{stem}.csv")
    pd.testing.assert_frame_equal(
        table, figure_data(figure), check_dtype=False, check_exact=False, rtol=1e-8
    )
    line = table[table.curve == "computed"]
    assert (line.x.tolist(), line.y.tolist()) == ([0.0, 1.0, 2.0], [1.0, 3.0, 2.0])
    cells = table[table.panel == "3 cells"]
    assert cells[["x", "y"]].to_numpy().tolist() == [[1, 0], [3, 0], [1, 1], [3, 1]]
    assert cells.value.tolist()[:3] == [1.0, 10.0, 100.0]
    bars = table[table.panel == "2 bars"]
    assert bars[["x", "y", "value"]].to_numpy().tolist() == [[1.5, 0, 1], [2, 1, 2]]
    assert file_name("") == "picture"


def test_one_column_has_the_panels_below_each_other_with_their_numbers(tmp_path):
    line = Line([0.0, 1.0, 2.0], [1.0, 3.0, 2.0])
    panels = [
        Panel(marks=(line,), x=Axis(label="time, s"), y=Axis(label="force, N"), title=title)
        for title in ("first", "second", "third", "fourth")
    ]
    figure = Figure(panels=in_grid(panels, 2, share="both"))
    hidden = [not panel.y.has_numbers for panel in figure.panels]
    assert any(hidden)
    drawing = matplotlib_of(figure, columns=1)
    assert drawing.get_figwidth() == pytest.approx(85.0 / 25.4)
    boxes = [axes.get_position() for axes in drawing.axes]
    assert all(above.y0 > below.y1 for above, below in pairwise(boxes))
    assert [axes.get_ylabel() for axes in drawing.axes] == ["force, N"] * 4
    assert [axes.get_xlabel() for axes in drawing.axes] == ["time, s"] * 4
    write_figures([(figure, "four")], tmp_path, columns=1, has_text=True)
    svg = ElementTree.parse(tmp_path / "01_four.svg").getroot()
    texts = {element.text for element in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert {"first", "fourth", "time, s"} <= texts


def test_the_name_of_a_file_ends_with_a_whole_word():
    title = "Orbits of the drum axis: front and rear"
    assert file_name(title) == "orbits_of_the_drum_axis_front_and_rear"
    words = file_name(" ".join(["amplitude"] * 40))
    assert len(words) <= 200
    assert words.endswith("_amplitude")
    assert file_name("a" * 280) == "a" * 200


def test_the_data_of_a_spectrum_are_compressed(tmp_path):
    values = np.arange(30_000.0).reshape(100, 300)
    cells = Cells(values, np.arange(300), np.arange(100), scale=Scale(low=0.0, high=3e4))
    with collected() as figures:
        picture(Figure(panels=(Panel(marks=(cells,)),)), "Map", "")
    write_figures(figures, tmp_path)
    path = tmp_path / "01_map.csv.gz"
    assert path.stat().st_size < 0.2 * 30_000 * 20
    assert pd.read_csv(path).value.tolist() == values.ravel().tolist()


def test_drawing_has_the_axes_of_the_declaration():
    axes = matplotlib_of(every_mark()).axes
    left = next(a for a in axes if a.get_xlabel() == "time, s")
    assert left.get_xlim() == (0.0, 2.0)
    assert left.get_title() == ""  # titles are annotations beside the top axis
    assert any(text.get_text() == "left <b>" for text in left.texts)


def test_panels_do_not_overlap_and_share_ranges():
    panel = Panel(marks=(Line([0.0, 1.0], [0.0, 10.0]),), x=Axis(label="t"), y=Axis(label="a"))
    wide = replace(panel, marks=(Line([0.0, 5.0], [-3.0, 1.0]),))
    figure = Figure(panels=in_grid([panel, wide, panel, None], 2, share="both"))
    places = arrange(figure).places
    assert {place.panel.x.range for place in places} == {(-0.25, 5.25)}
    assert len({place.panel.y.range for place in places}) == 1
    assert [bool(p.panel.x.label) for p in places] == [False, True, True]
    assert [p.panel.y.has_numbers for p in places] == [True, False, True]
    assert places[0].right < places[1].left
    assert places[0].bottom < places[2].top


def test_ranges_hold_the_data_of_each_mark():
    marks = (
        Area([0.0, 4.0], [0.0, 1.0]),
        Bars([1.0], [7.0], base=[1.0]),
        Rule(-2.0),
        Points([np.nan], [np.inf]),
    )
    (place,) = arrange(Figure(panels=(Panel(marks=marks),))).places
    assert place.panel.x.range == pytest.approx((-0.2, 4.2))
    assert place.panel.y.range == pytest.approx((-2.5, 8.5))


def test_texts_are_broken_where_they_may_be():
    assert wrapped("mount force of_spring", 10.0, 80.0) == ("mount force", "of_spring")
    assert round_numbers(0.0, 70.0, 7).tolist() == [0, 10, 20, 30, 40, 50, 60, 70]


def test_thinned_curve_keeps_its_extremes_and_ends():
    x = np.linspace(0.0, 1.0, 50_001)
    y = np.sin(40.0 * x)
    y[12_345], y[33_333] = 9.0, -9.0
    few_x, few_y = thinned(x, y, 1000)
    assert len(few_x) <= 1002
    assert np.all(np.diff(few_x) > 0.0)
    assert {few_y.max(), few_y.min()} == {9.0, -9.0}
    assert (few_x[0], few_x[-1]) == (0.0, 1.0)


def test_no_text_ends_the_script_of_a_page():
    text = str(as_json({"a": "</script><!--", "b": float("nan")}))
    assert "<" not in text
    assert '"b":null' in text


def test_option_figures_of_a_command(wm_drake, tmp_path):
    rig = ("rig", "damper", "-f", "2 Hz", "-a", "3 mm")
    ended = wm_drake(*rig, "--out", "a", "--figures", "a")
    assert (ended.code, "another folder than --out" in ended.err) == (2, True)
    assert not (tmp_path / "a").exists()
    ended = wm_drake(*rig, "--out", "a", "--figures", "b")
    assert ended.code == 0, ended.err
    names = [path.name for path in (tmp_path / "b").iterdir()]
    assert "run.json" in names
    assert sum(name.endswith(".pdf") for name in names) == 1  # one period
    again = wm_drake(*rig, "--out", "c", "--figures", "b")
    assert again.code == 2
    assert "b: holds an earlier run" in again.err
    assert not (tmp_path / "c").exists()


def test_square_panel_keeps_its_limits_in_a_file(caplog):
    line = Line([-1.0, 1.0], [0.0, 0.3])
    x, y = Axis(range=(-2.0, 2.0)), Axis(range=(-1.0, 1.0))
    drawing = matplotlib_of(Figure(panels=(Panel(marks=(line,), x=x, y=y, is_square=True),)))
    drawing.draw_without_rendering()
    axes = drawing.axes[0]
    assert (axes.get_xlim(), axes.get_ylim()) == (x.range, y.range)
    assert caplog.records == []
