"""Results that take long to compute, kept on disk beside the compiled code of the same sources."""

import contextlib
import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from wm_drake.compiler.compilation import CACHE_FOLDER, READ_ONLY_FOLDER

_DIGEST = hashlib.sha256().digest_size
_PACKAGE = Path(__file__).parents[1]


@functools.cache
def all_sources() -> str:
    """Return the hash of all sources: compiled code, and so its folder, depends on some only."""
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def kept(key: str, compute: Callable[[], bytes]) -> bytes:
    """Return the result of a computation, from its file if there is one.

    A file that is damaged counts as missing. If none can be written, the result is computed each
    time.

    Args:
        key: What the result depends on, beside the sources: kind and inputs.
    """
    if not CACHE_FOLDER:
        return compute()
    path = Path(CACHE_FOLDER) / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.kept"
    for folder in filter(None, (CACHE_FOLDER, READ_ONLY_FOLDER)):
        with contextlib.suppress(OSError):
            stored = Path(folder, path.name).read_bytes()
            if hashlib.sha256(stored[_DIGEST:]).digest() == stored[:_DIGEST]:
                return stored[_DIGEST:]
    content = compute()
    part = path.with_suffix(f".{os.getpid()}")
    with contextlib.suppress(OSError):
        part.write_bytes(hashlib.sha256(content).digest() + content)
        part.replace(path)
    return content
