"""Messages: one printable line of limited length."""

from wm_drake.errors import (
    LONGEST_LINE,
    MOST_PROBLEMS,
    InputError,
    Problem,
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
