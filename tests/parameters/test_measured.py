"""Measured amplitudes that a machine file names."""

import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import measured_amplitudes

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
        (HEADER + ROW.replace("yes", "perhaps"), "in the column gasket is neither yes nor no"),
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
