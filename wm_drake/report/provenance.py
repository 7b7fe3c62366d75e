"""Where results come from: date, version and source revision of the program that wrote them."""

import functools
import hashlib
import importlib.metadata
import shlex
import subprocess
import sys
from datetime import datetime
from pathlib import Path

PACKAGE = Path(__file__).parents[1]


@functools.cache
def version() -> str:
    """Return the version of this package."""
    return importlib.metadata.version("wm-drake")


@functools.cache
def source_revision() -> str:
    """Return the revision of the sources of this program.

    In a git checkout this is the commit, with a note if files of the package differ from it. An
    installed package has no commit, so its revision is a hash of its Python files.
    """
    checkout = PACKAGE.parent
    if (checkout / ".git").exists():
        commit = _git("rev-parse", "--short=12", "HEAD")
        if commit:
            changed = _git("status", "--porcelain", "--", PACKAGE.name, "sdf")
            return f"{commit} with local changes" if changed else commit
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode() + path.read_bytes())
    return f"sources {digest.hexdigest()[:12]}"


def now() -> str:
    """Return the local date and time, with the offset from UTC."""
    return datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")


def program() -> str:
    """Return name, version and source revision of this program, as one text."""
    return f"wm_drake {version()}, revision {source_revision()}"


def command_line() -> str:
    """Return the running command as a user would type it."""
    return shlex.join(["wm-drake", *sys.argv[1:]])


def _git(*arguments: str) -> str:
    try:
        ended = subprocess.run(
            ["git", "-C", str(PACKAGE.parent), *arguments],
            capture_output=True,
            text=True,
            check=False,
            timeout=10,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return ended.stdout.strip() if ended.returncode == 0 else ""
