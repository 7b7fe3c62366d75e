"""Messages: one printable line of limited length."""

import os
import subprocess
import sys

import pytest

from wm_drake.errors import (
    LONGEST_LINE,
    MOST_PROBLEMS,
    InputError,
    Problem,
    libraries_named,
    nearest_names,
    shortened,
)


def test_short_text_stays():
    assert shortened("a spring of 5 N/mm", 100) == "a spring of 5 N/mm"


def test_long_word_loses_its_middle_before_the_text_does():
    text = shortened("value '" + "x" * 1000 + "' is out of range; allowed is > 0", 300)
    assert text.endswith("' is out of range; allowed is > 0")
    assert text.startswith("value 'xxx")
    assert len(text) < 150


def test_long_text_keeps_its_end():
    text = shortened("word " * 1000 + "allowed is > 0", 300)
    assert len(text) == 300
    assert text.endswith("allowed is > 0")


def test_characters_that_a_terminal_acts_on_are_escaped():
    assert shortened("a\x1b[31m\nb\u202e", 100) == "a\\x1b[31m\\nb\\u202e"


def test_problem_fits_in_a_line():
    problem = Problem("w " * 5000, "k" * 5000, "m " * 5000)
    assert len(str(problem)) <= LONGEST_LINE
    assert str(Problem("f:1", "gravity", "is missing")) == "f:1: gravity: is missing"


def test_error_lists_the_first_problems():
    text = str(InputError(Problem("", "", f"{n:03d}") for n in range(1000)))
    assert text.splitlines() == [
        *(f"{n:03d}" for n in range(MOST_PROBLEMS)),
        f"and {1000 - MOST_PROBLEMS} more problems",
    ]
    assert len(str(InputError(Problem("", "", "x") for _ in range(MOST_PROBLEMS)))) == 15


def test_name_itself_is_no_suggestion():
    assert nearest_names("mass", ["mass"]) == " (there are none)"
    assert nearest_names("mass", ["mass", "mask"]) == " (did you mean 'mask'? known: mask)"


def test_long_list_of_names_ends_with_their_number():
    hint = nearest_names("nothing like it", [f"name_{n:04d}" for n in range(1000)])
    assert "known: name_0000, name_0001, " in hint
    assert hint.endswith("name_0007, 992 more)")
    assert len(hint) < 350


GLIB = "libglib-2.0.so.0: cannot open shared object file: No such file or directory"
TO_INSTALL = "libglib-2.0.so.0: is missing, and Drake needs it; install the package of this system that has it"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GLIB, f"{TO_INSTALL}; on Debian or Ubuntu: apt-get install libglib2.0-0"),
        (GLIB.replace("glib", "new"), TO_INSTALL.replace("glib", "new")),
        (
            "dlopen(common.so, 0x2): Library not loaded: /opt/lib/libglib-2.0.0.dylib\n  Reason: tried",
            TO_INSTALL.replace("libglib-2.0.so.0", "/opt/lib/libglib-2.0.0.dylib"),
        ),
    ],
)
def test_a_library_that_drake_does_not_find_is_named_with_its_package(text, message):
    with pytest.raises(InputError) as raised, libraries_named():
        raise ImportError(text)
    assert str(raised.value) == message


def test_another_error_of_an_import_stays():
    with pytest.raises(ImportError, match="no name"), libraries_named():
        raise ImportError("cannot import: no name")


@pytest.fixture
def without_glib(tmp_path):
    """Return the environment of a process in which importing Drake fails as on a minimal Debian."""
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake" / "__init__.py").write_text(f"raise ImportError({GLIB!r})\n")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


@pytest.mark.parametrize("command", ["spin", "study gasket", "machine show reference"])
def test_a_command_without_a_library_of_drake_ends_with_one_message(
    command, without_glib, tmp_path
):
    line = [sys.executable, "-m", "wm_drake", *command.split()]
    ended = subprocess.run(
        line, env=without_glib, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert ended.stderr.splitlines()[-1].startswith(TO_INSTALL)
    assert "Traceback" not in ended.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pydrake"]


def test_a_public_name_without_a_library_of_drake_raises_one_message(without_glib, tmp_path):
    code = "import wm_drake as wm\ntry: wm.simulate\nexcept Exception as error: print(error)"
    line = [sys.executable, "-c", code]
    ended = subprocess.run(
        line, env=without_glib, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ended.stdout.startswith(TO_INSTALL)
