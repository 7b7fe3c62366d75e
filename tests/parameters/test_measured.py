"""Measured amplitudes that a machine file names."""

import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, measured_amplitudes, measured_changes

HEADER = "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\n"
ROW = "middle,yes,experiment,1,2,3.5,4,5,6\n"


@pytest.fixture
def machine(tmp_path, reference):
    def with_tables(*texts):
        paths = [tmp_path / f"table{index}.csv" for index in range(len(texts))]
        for path, text in zip(paths, texts, strict=True):
            path.write_text(text)
        return reference.model_copy(update={"measured": tuple(map(str, paths))})

    return with_tables


def test_tables_are_put_together(machine):
    table = measured_amplitudes(
        machine("# source: me\n" + HEADER + ROW, HEADER + ROW.replace("yes", "no") + ROW)
    )
    assert table["gasket"].tolist() == ["yes", "no", "yes"]
    assert table["Zr"].tolist() == [3.5, 3.5, 3.5]
    assert table.columns.tolist() == HEADER.strip().split(",")


def test_change_by_the_gasket_is_the_printed_one_or_that_of_the_amplitudes(machine):
    without = "middle,no,experiment,2,0,2,2,2,2\n"
    computed = measured_changes(machine(HEADER + ROW + without)).iloc[0]
    assert (computed["load"], computed["source"]) == ("middle", "experiment")
    assert computed[["Xr", "Zr", "Xf"]].tolist() == pytest.approx([-50.0, 75.0, 100.0])
    assert computed.isna()["Yr"]  # nothing moves without gasket
    printed = ROW.replace("yes", "change")
    both = machine(HEADER + ROW + without, HEADER + printed)
    assert measured_changes(both).iloc[0]["Xr":].tolist() == [1, 2, 3.5, 4, 5, 6]
    assert "change" not in measured_amplitudes(both)["gasket"].tolist()
    assert measured_changes(machine(HEADER + ROW)).empty


def test_printed_changes_are_those_of_the_amplitudes_before_rounding():
    """Check [B] Table 1: each printed percentage lies within the rounding of both amplitudes."""
    parameters = load_machine("reference")
    table = measured_amplitudes(parameters)
    experiment = table[table["source"] == "experiment"].set_index(["load", "gasket"])
    half = 0.025  # of half the printed amplitudes, half of the last digit
    for row in measured_changes(parameters).to_dict("records"):
        for sensor in parameters.sensors:
            one, other = (experiment.loc[(row["load"], word), sensor] for word in ("no", "yes"))
            low = 100.0 * ((other - half) / (one + half) - 1.0)
            high = 100.0 * ((other + half) / (one - half) - 1.0)
            assert low - 0.06 <= row[sensor] <= high + 0.06, (row["load"], sensor)


def test_no_tables_give_the_columns_alone(machine):
    table = measured_amplitudes(machine())
    assert table.empty
    assert table.columns.tolist() == HEADER.strip().split(",")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read as CSV"),
        (HEADER.replace(",Zf", "") + ROW, "needs the columns load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf, has load"),
        (HEADER.replace("Zf", "Zg") + ROW, "needs the columns"),
        (HEADER.replace("\n", ",extra\n") + ROW.replace("\n", ",1\n"), "needs the columns"),
        (HEADER + ROW.replace("\n", ",1\n"), "a row has more values than columns"),
        (HEADER + ROW.replace("yes", "perhaps"), "'perhaps' in the column gasket is not allowed; allowed are yes, no, change"),
        (HEADER + ROW.replace("3.5", "big"), "not a finite number"),
        (HEADER + ROW.replace("3.5", ""), "not a finite number"),
        (HEADER + ROW.replace("3.5", "inf"), "not a finite number"),
    ],
)  # fmt: skip
def test_bad_table_is_refused(machine, tmp_path, text, message):
    with pytest.raises(InputError, match=message) as refused:
        measured_amplitudes(machine(text))
    (problem,) = refused.value.problems
    assert (problem.where, problem.key) == (str(tmp_path / "table0.csv"), "measured")


def test_missing_table_is_refused(machine, tmp_path):
    parameters = machine(HEADER + ROW)
    (tmp_path / "table0.csv").unlink()
    with pytest.raises(InputError, match="No such file"):
        measured_amplitudes(parameters)


def test_table_without_rows_is_empty(machine):
    assert measured_amplitudes(machine(HEADER)).empty
