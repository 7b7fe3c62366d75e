"""Tests of the description of figures for a browser, and of their files for publication."""

import base64

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from wm_drake.report.describing import NotDescribableError, as_plain, describe, thinned
from wm_drake.report.page import as_json, picture
from wm_drake.report.publication import collected, file_name, write_figures


def drawn():
    figure = Figure(figsize=(10.6, 4.0))
    left, right = figure.subplots(1, 2, width_ratios=(2, 1))
    (line,) = left.plot([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], "--", color="#0072b2", label="computed")
    left.axhline(2.5, color="#b34700")
    left.fill_between([0.0, 2.0], [0.0, 0.0], [1.0, 1.0], color="#00aa00", alpha=0.5, linewidth=0)
    left.barh([0, 1], [1.0, 2.0], left=[0.5, 0.0], height=0.5, color="#333333")
    left.set_xticks([0.0, 1.0], ["zero", "one"])
    left.text(0.02, 0.9, "name", transform=left.transAxes)
    right.imshow([[1.0, 10.0], [100.0, np.nan]], norm=LogNorm(1.0, 100.0), extent=(0, 4, 0, 2))
    figure.legend(handles=[line])
    return figure


def test_description_has_the_data_of_the_artists():
    found = describe(drawn())
    left, right = found["panels"]
    assert left["columns"] == [0, 1]
    assert left["widths"] == [2.0, 1.0]
    parts = {part["kind"]: part for part in left["parts"]}
    assert parts["line"]["x"].tolist() == [0.0, 1.0, 2.0]
    assert parts["line"]["label"] == "computed"
    assert parts["rule"] | {"along": "x", "at": 2.5} == parts["rule"]
    assert parts["area"]["color"] == {"hex": "#00aa00", "alpha": 0.5}
    assert parts["bars"]["begins"].tolist() == [0.5, 0.0]
    assert parts["bars"]["sizes"].tolist() == [1.0, 2.0]
    assert parts["text"]["in_data"] == [False, False]
    assert left["x"]["ticks"] == [(0.0, "zero"), (1.0, "one")]
    cells = right["parts"][0]
    assert cells["x"].tolist() == [1.0, 3.0]
    assert cells["y"].tolist() == [1.5, 0.5]  # the first row is at the top
    entry = found["legends"][0]["entries"][0]
    assert entry["own"] == "computed"
    assert set(entry["keys"]) & set(parts["line"]["keys"])


def test_cells_are_steps_of_their_colour_scale():
    cells = as_plain(describe(drawn()))["panels"][1]["parts"][0]
    steps = np.frombuffer(base64.b64decode(cells["levels"]), dtype="<u2")
    assert steps.tolist() == [0, 32767, 65534, 65535]


def test_thinned_curve_keeps_its_extremes_and_ends():
    x = np.linspace(0.0, 1.0, 50_001)
    y = np.sin(40.0 * x)
    y[12_345], y[33_333] = 9.0, -9.0
    few_x, few_y = thinned(x, y, 1000)
    assert len(few_x) <= 1002
    assert np.all(np.diff(few_x) > 0.0)
    assert {few_y.max(), few_y.min()} == {9.0, -9.0}
    assert (few_x[0], few_x[-1]) == (0.0, 1.0)


def test_three_dimensional_figure_becomes_a_static_image():
    figure = Figure(figsize=(3.0, 2.0))
    figure.add_subplot(projection="3d")
    with pytest.raises(NotDescribableError):
        describe(figure)
    shown = picture(figure, "Axes.", "")
    assert shown.drawing is None
    assert shown.source.startswith("data:image/svg+xml")


def test_no_text_ends_the_script_of_a_page():
    text = str(as_json({"a": "</script><!--", "b": float("nan")}))
    assert "<" not in text
    assert '"b":null' in text


def test_figures_are_written_at_journal_width_with_their_data(tmp_path):
    with collected() as figures:
        picture(drawn(), "Two panels: <name>/..", "")
    write_figures(figures, tmp_path)
    stem = "01_two_panels_name"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{stem}.{kind}" for kind in ("csv", "pdf", "png", "svg")
    ]
    assert 'width="510.236pt"' in (tmp_path / f"{stem}.svg").read_text()
    assert b"/MediaBox [ 0 0 510.236" in (tmp_path / f"{stem}.pdf").read_bytes()
    table = pd.read_csv(tmp_path / f"{stem}.csv")
    line = table[table.curve == "computed"]
    assert line.y.tolist() == [1.0, 3.0, 2.0]
    cells = table[table.curve.str.startswith("cells")]
    assert cells[["x", "y"]].to_numpy().tolist() == [[1, 1.5], [3, 1.5], [1, 0.5], [3, 0.5]]
    assert file_name("") == "picture"


def test_option_figures_of_a_command(wm_drake, tmp_path):
    rig = ("rig", "damper", "-f", "2 Hz", "-a", "3 mm")
    ended = wm_drake(*rig, "--out", "a", "--figures", "a")
    assert (ended.code, "another folder than --out" in ended.err) == (2, True)
    assert not (tmp_path / "a").exists()
    ended = wm_drake(*rig, "--out", "a", "--figures", "b")
    assert ended.code == 0, ended.err
    names = [path.name for path in (tmp_path / "b").iterdir()]
    assert "run.json" in names
    assert sum(name.endswith(".pdf") for name in names) == 2  # one period, friction law
    again = wm_drake(*rig, "--out", "c", "--figures", "b")
    assert again.code == 2
    assert "b: holds an earlier run" in again.err
    assert not (tmp_path / "c").exists()
