"""Files that are written under a new name and then renamed: each is there as a whole or not at all.

Files of a result folder have the same rule, by `wm_drake.studies.result_folder`. What exists is
replaced only where the caller says so: commands have the option `--overwrite` for it.
"""

import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from wm_drake.errors import InputError, input_error, reason_of

OTHER_NAME = "choose another name"
OVERWRITE = f"add --overwrite to replace it, or {OTHER_NAME}"


def unwritable(path: Path, error: OSError, kept: str = "") -> InputError:
    """Return the message for a file or folder that cannot be written to.

    Args:
        kept: What is kept, if anything.
    """
    reason = "; ".join(filter(None, [f"cannot be written to: {reason_of(error)}", kept]))
    return input_error(reason, where=str(path))


def try_folder(folder: Path) -> None:
    """Make and remove a file in a folder, or in the nearest one above it that exists.

    Raises:
        OSError: the system does not allow it.
    """
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    tempfile.TemporaryFile(dir=nearest).close()


def check_new(paths: Iterable[Path], *, replace: bool, way_out: str = OVERWRITE) -> None:
    """Check before the work that files can be written, and that none exists if none is replaced.

    Args:
        replace: Whether files that exist are replaced.
        way_out: What the user can do about a file that exists.

    Raises:
        InputError: a file exists, is no regular file, or its folder cannot be written to.
    """
    for path in paths:
        try:
            if path.exists() and not path.is_file():
                raise input_error("is not a regular file; name another one", where=str(path))
            if os.path.lexists(path) and not replace:
                raise FileExistsError
            try_folder(_real(path).parent)
        except FileExistsError:
            raise input_error(f"exists already; {way_out}", where=str(path)) from None
        except (OSError, ValueError) as error:  # ValueError: the name has a null byte
            raise unwritable(path, OSError(0, reason_of(error))) from None


def write_files(
    contents: Mapping[Path, str | bytes],
    *,
    replace: bool,
    way_out: str = OVERWRITE,
    check: Callable[[Path], None] = lambda part: None,
) -> None:
    """Write one file, or several that belong together: all of them or none.

    Args:
        contents: Texts and bytes by path, in the order in which the files get their names.
        replace, way_out: As of `check_new`.
        check: Called with each file before it gets its name; may raise an error.

    Raises:
        InputError: as of `check_new`, or a file cannot be written.
    """
    check_new(contents, replace=replace, way_out=way_out)
    parts, named = dict[Path, Path](), list[Path]()
    try:
        for path, content in contents.items():
            real = _real(path)
            part = parts[path] = real.with_name(f".{secrets.token_hex(6)}{real.suffix}")
            part.write_bytes(content.encode() if isinstance(content, str) else content)
            check(part)
        for path, part in parts.items():
            _rename(part, _real(path), replace)
            named.append(path)
    except BaseException as error:
        for done in [] if replace else named:
            done.unlink(missing_ok=True)
        if isinstance(error, FileExistsError):
            raise input_error(f"exists already; {way_out}", where=str(path)) from None
        if isinstance(error, OSError):
            raise unwritable(path, error) from None
        raise
    finally:
        for part in parts.values():
            with suppress(OSError):
                part.unlink(missing_ok=True)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder that is removed after the block; a full disk is an error that names it."""
    with tempfile.TemporaryDirectory(prefix="wm_drake-") as name:
        try:
            yield Path(name)
        except OSError as error:
            if error.filename is not None:  # such as a program that cannot be started
                raise
            raise unwritable(Path(name), error) from None


def filled(template: Path, filters: Mapping[str, Callable[[Any], str]], **values: object) -> str:
    """Return the text of a file from its template; in HTML no value is markup.

    Args:
        filters: Functions by the names by which the template calls them.
        values: What the template reads.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=FileSystemLoader(template.parent),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= dict(filters)
    return environment.get_template(template.name).render(values)


def _real(path: Path) -> Path:
    """Return the file that a path names: behind a symbolic link, which stays."""
    return Path(os.path.realpath(path))


def _rename(part: Path, path: Path, replace: bool) -> None:
    """Give a file its name.

    Raises:
        FileExistsError: another process has made a file of this name, and none is replaced.
    """
    if replace:
        if path.exists():
            shutil.copymode(path, part)
    else:
        try:
            os.link(part, path)
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links
            if path.exists():
                raise FileExistsError from None
        else:
            return
    part.replace(path)
