"""Result folders that are either complete or not written at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wm_drake.errors import input_error


@contextmanager
def result_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `out`, and move its files to `out` if the block succeeds.

    If the block fails, `out` keeps its earlier files.

    Raises:
        InputError: `out` is a file, or it cannot be written to. This is checked before the block.
    """
    check_is_folder(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(
            tempfile.mkdtemp(prefix=f".{out.name}-", dir=out if out.is_dir() else out.parent)
        )
    except OSError as error:
        raise input_error(f"cannot be written to: {error.strerror}", where=str(out)) from None
    try:
        yield partial
        try:
            out.mkdir(exist_ok=True)
            for path in sorted(partial.iterdir()):
                path.replace(out / path.name)
        except OSError as error:
            raise input_error(f"cannot be written to: {error.strerror}", where=str(out)) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def check_is_folder(out: Path) -> None:
    """Raise an InputError if the path of a result folder is a file."""
    if out.exists() and not out.is_dir():
        raise input_error("this path is a file, but a folder is needed", where=str(out))
