"""Results in Python: table, plot and text for a notebook, of every result alike."""

import pytest

import wm_drake as wm
from wm_drake.errors import InputError


@pytest.fixture(scope="module")
def result():
    """Return a quick result with several tables."""
    return wm.run_study("drive", load=["middle"], quick=True, quiet=True)


def test_table_is_the_first_one_or_the_named_one(result):
    assert result.to_dataframe().equals(result.tables()["map"])
    assert result.to_dataframe("thresholds").equals(result.tables()["thresholds"])
    with pytest.raises(InputError, match=r"no table 'mapp' .*did you mean 'map'"):
        result.to_dataframe("mapp")


def test_plot_is_a_figure_of_the_page(result):
    titles = list(result.pictures())
    drawings = [result.plot(), result.plot(titles[-1][:20])]
    assert all(drawing.get_axes() for drawing in drawings)
    with pytest.raises(InputError, match="no figure 'nothing'"):
        result.plot("nothing")


def test_notebook_shows_each_table_under_its_name(result):
    shown = result._repr_html_()
    assert [shown.count(f"<h4>{name}</h4>") for name in result.tables()] == [1] * len(
        result.tables()
    )
    assert shown.count("<table") == len(result.tables()) > 1
