"""Files that are too large, too deep, endless or no files, and texts that would keep a parser busy."""

import os
import re
import time

import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, load_profile, read_loops, units, with_value
from wm_drake.parameters.csv_files import finite_numbers, read_csv
from wm_drake.parameters.files import LARGEST_YAML, LONGEST_CHAIN, MOST_VALUES, read_yaml
from wm_drake.parameters.text_files import read_text


def refused(function, *arguments):
    begin = time.perf_counter()
    with pytest.raises(InputError) as error:
        function(*arguments)
    assert time.perf_counter() - begin < 5.0
    lines = str(error.value).splitlines()
    assert all(len(line) < 500 for line in lines)
    return lines


def doubling(levels, width=2):
    """Return nested lists of aliases with width ** levels values."""
    rows = ["a0: &a0 [" + ", ".join("x" * width) + "]"]
    rows += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * width)}]" for n in range(1, levels)]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (doubling(25), f"is not YAML: has too many values with its aliases; allowed are {MOST_VALUES}"),
        (doubling(9, 9), "has too many values with its aliases"),
        (doubling(9, 9).replace("[", "{<<: [").replace("]", "]}"), "has too many values"),
        ("a: &a [*a]\n", ":1: is not YAML: alias 'a' is inside the value that it stands for"),
        ("b: 1\na: &a\n  <<: *a\n", ":3: is not YAML: alias 'a' is inside"),
        ("a: " + "[" * 500 + "]" * 500, "is not YAML: is nested too deeply; allowed are 40 levels"),
        ("\n".join(" " * n + "a:" for n in range(600)), ":40: is not YAML: is nested too deeply"),
        ("name: " + "x" * LARGEST_YAML, "is too large (1.0 MB); allowed are up to 1 MB"),
    ],
    ids=["2^25", "9^9", "merge keys", "alias in itself", "merge in itself", "deep", "deep block", "large"],
)  # fmt: skip
def test_yaml_bomb_is_refused_at_once(tmp_path, text, message):
    path = tmp_path / "machine.yaml"
    path.write_text(text, encoding="utf-8")
    (line,) = refused(read_yaml, path)
    assert message in line
    assert line.startswith(str(path))


def test_aliases_within_the_bounds_are_read(tmp_path):
    path = tmp_path / "machine.yaml"
    path.write_text(doubling(10), encoding="utf-8")
    tree = read_yaml(path)
    assert tree["a9"] == [tree["a8"]] * 2


def test_chain_of_machine_files_has_a_bound(tmp_path):
    for n in range(1500):
        (tmp_path / f"m{n}.yaml").write_text(f"extends: m{n + 1}.yaml\n", encoding="utf-8")
    (tmp_path / "m1500.yaml").write_text("extends: reference\n", encoding="utf-8")
    (line,) = refused(load_machine, tmp_path / "m0.yaml")
    assert line.endswith(
        f"extends: more than {LONGEST_CHAIN} files extend each other; extend an earlier one"
    )
    assert load_machine(tmp_path / f"m{1500 - LONGEST_CHAIN + 1}.yaml").name == "reference"


@pytest.mark.parametrize("name", ["link.yaml", "loop/machine.yaml"])
def test_cycle_through_links_is_refused(tmp_path, name):
    path = tmp_path / "machine.yaml"
    path.write_text(f"extends: {name}\n", encoding="utf-8")
    (tmp_path / "link.yaml").symlink_to(path)
    (tmp_path / "loop").symlink_to(tmp_path)
    assert refused(load_machine, path)[0].endswith("extends: extends itself")


def test_link_to_itself_is_refused(tmp_path):
    path = tmp_path / "machine.yaml"
    path.symlink_to(path)
    assert refused(load_machine, path)[0].startswith(f"{path}: ")


@pytest.mark.parametrize(
    "name", ["x" * 300, "x/" * 3000, "a\0b"], ids=["long", "long path", "null"]
)
def test_name_that_no_file_can_have_is_refused(tmp_path, name):
    path = tmp_path / "machine.yaml"
    refused(load_machine, name)
    for key in ("extends", "model"):
        path.write_text(
            f'extends: reference\n{key}: "{name}"\n'.replace("\0", "\\0").removeprefix(
                "extends: reference\n" if key == "extends" else ""
            ),
            encoding="utf-8",
        )
        if key == "extends":
            assert "extends: " in refused(load_machine, path)[0]
    refused(load_profile, name)
    refused(read_text, tmp_path / name)


def test_device_pipe_and_folder_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", tmp_path / "pipe"):
        (line,) = refused(read_csv, path, ["a"], "measured")
        assert line == f"{path}: measured: is a device or pipe, not a regular file"
    assert refused(read_csv, tmp_path, ["a"]) == [f"{tmp_path}: is a folder, not a file"]
    assert refused(load_machine, "/dev/zero") == [
        "/dev/zero: is a device or pipe, not a regular file"
    ]


def test_huge_table_is_refused_unread(tmp_path):
    path = tmp_path / "table.csv"
    with path.open("wb") as file:
        file.truncate(10 << 30)  # a hole in the file system
    assert refused(read_csv, path, ["a"]) == [
        f"{path}: is too large (10240.0 MB); allowed are up to 64 MB"
    ]


def test_table_of_many_columns_is_refused(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("a," * 50_000 + "a\n", encoding="utf-8")
    assert "50001 columns; allowed are up to 1000" in refused(read_csv, path, ["a"])[0]


def test_field_of_a_loop_beyond_the_limit_of_the_reader(tmp_path):
    path = tmp_path / "loop.csv"
    path.write_text(f'time [s],d [mm],f [N]\n1,2,3\n"{"x" * 140_000}",1,2\n', encoding="utf-8")
    (line,) = refused(read_loops, [path])
    assert line.startswith(f"{path}:3: cannot be read as CSV")


@pytest.mark.parametrize(
    "unit",
    ["m" * 41, "m" * 100_000, "9**9**9**9", "mm**9**9**9", "m^99^99", "m^999", "m^1.5e9", "(" * 3000 + "m" + ")" * 3000, "m*" * 3000 + "m", "m^٣", "__import__('os')"],
    ids=lambda unit: unit[:12],
)  # fmt: skip
def test_unit_that_would_keep_the_parser_busy_is_refused(reference, unit):
    (line,) = refused(with_value, reference, "gravity", f"1 {unit}")
    assert re.match(r"gravity: (unit '|has \d+ characters; allowed are up to)", line)


@pytest.mark.parametrize(
    ("text", "value"),
    [("2 1/s", 2.0), ("3 N*m^-1", 3.0), ("4 kg m**2 / s**2", 4.0), ("50 %", 0.5), ("1 (N)/(mm)", 1e3), ("1 µm", 1e-6)],
)  # fmt: skip
def test_unit_of_any_usual_form_is_read(text, value):
    (number,), unit, _ = units.split(text)
    assert units.to_base(number, unit) == pytest.approx(value)


@pytest.mark.parametrize("text", ["５ m/s^2", "٣ m/s^2", "1_0 m/s^2"])
def test_digits_other_than_0_to_9_are_refused(reference, text):
    assert refused(with_value, reference, "gravity", text)[0].startswith("gravity: ")
    with pytest.raises(ValueError, match="is not a number"):
        units.plain_number(text.split()[0])


@pytest.mark.parametrize(
    "key", [".".join("a" * 3000), "bodies.tub" + ".inertia" * 2000, "gravity." + "9" * 5000]
)
def test_deeply_nested_key_is_refused(reference, key):
    assert len(refused(with_value, reference, key, "1 kg")) == 1


def test_text_in_a_number_column_names_row_and_column(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("time_s,Xr\n0,1\n1,text\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"record\.csv: Xr: row 2 of the data: 'text' is not a finite number"
    ):
        finite_numbers(read_csv(path, ["time_s", "Xr"]), path)


def test_half_a_character_is_refused(tmp_path):
    path = tmp_path / "machine.yaml"
    path.write_text('gravity: 1 m/s^2\nname: "\\ud83d\\udca5"\n', encoding="utf-8")
    assert refused(read_yaml, path) == [
        f"{path}:2: is not YAML: has half a character; write the character itself"
    ]
