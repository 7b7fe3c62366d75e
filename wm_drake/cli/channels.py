"""Option `--channels`: names that files of measurements have for what a command reads."""

from typing import Annotated

import typer

from wm_drake.errors import input_error, nearest_names

LOOP_WORDS = ("time", "displacement", "angle", "force", "moment")
"""Words of a force loop."""

RecordChannelsOption = Annotated[
    str | None,
    typer.Option(
        "--channels",
        help="Names in the files: 'S1_x=Acc 1,S1_y=Acc 2' (also time, and speed in a record).",
        metavar="WORD=NAME,...",
    ),
]


def channels_of(text: str | None, words: tuple[str, ...] = ()) -> dict[str, str]:
    """Return the names of the channels of the option `--channels`, by word.

    Args:
        text: The option.
        words: Allowed words; any word if empty.

    Raises:
        InputError: a part is not WORD=NAME, a word is not allowed or there twice.
    """
    found: dict[str, str] = {}
    for part in text.split(",") if text else []:
        word, separator, name = (piece.strip() for piece in part.partition("="))
        if not (separator and name and word):
            raise input_error(f"'{part.strip()}' is not WORD=NAME", where="--channels")
        if words and word not in words:
            raise input_error(f"no word '{word}'{nearest_names(word, words)}", where="--channels")
        if word in found:
            raise input_error(f"'{word}' is there twice", where="--channels")
        found[word] = name
    return found
