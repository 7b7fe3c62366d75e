"""Compilation of laws: one source, compiled for floats and SIMD lanes, interpreted for others.

A law is a plain function of scalars (or short tuples and arrays of scalars). ``@law`` compiles it
with numba for floats, and for lanes (`wm_drake.compiler.lanes`) when a compiled loop calls it with
them. ``generic(law)`` runs the same source in Python, so that automatic differentiation applies to
every operation; a law that calls other laws calls their generic forms then.

Rules for the source: choose between values with ``where``, and take functions from
`wm_drake.compiler.elementary`; the condition of an ``if`` must be the same in all lanes, such as a
`whole_number`. ``np.sign`` drops derivatives, a square root of zero has none. Numbers of other
modules become constants of the compiled code: they must be in files that `_cache_folders` hashes.
"""

import atexit
import functools
import hashlib
import os
import shutil
import tempfile
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import config
from numba.extending import is_jitted

from wm_drake.compiler.cache_files import LawCache, say_once
from wm_drake.compiler.lanes import LawCompiler, TextCompiler, number_array, stack_array

_PACKAGE = Path(__file__).parents[1]


_COMPILED_ROOMS = {"compiler", "laws", "parameters", "elements"}
"""Rooms all of whose files compiled code may depend on: the fields of a type of the machine file,
for example, are the packed order of its numbers."""


def _cache_folders() -> tuple[str, str]:
    """Return where compiled code of exactly these sources is written, and a folder only to read.

    Each is "" if there is none. A folder that cannot be written to but has code, such as that of a
    cluster's image, is read; new code goes to the home of the user then, or stays for this process.

    numba checks only the file of the function that it compiles: after an edit of a called law, its
    cached callers would keep the old one. The folder is named by the hash of all sources that
    compiled code depends on.
    """
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        text = source.read_text(encoding="utf-8")
        room = source.relative_to(_PACKAGE).parts[0]
        if room in _COMPILED_ROOMS or "wm_drake.compiler" in text or "numba" in text:
            digest.update(text.encode())
    name, chosen = digest.hexdigest()[:16], os.environ.get("NUMBA_CACHE_DIR")
    try:
        of_user = Path.home() / ".cache" / "wm_drake" / name
    except RuntimeError:
        of_user = None
    folder = Path(chosen) / name if chosen else of_user
    reason = "the user has no home folder" if folder is None else _fault_of(folder)
    if not reason:
        return str(folder), ""
    read_only = str(folder) if folder is not None and folder.is_dir() else ""
    if of_user is not None and not _fault_of(of_user):
        if not read_only:
            say_once(f"compiled code is kept in {of_user}, not in {chosen} ({reason})")
        return str(of_user), read_only
    if read_only:
        temporary = tempfile.mkdtemp(prefix="wm_drake-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        return temporary, read_only
    say_once(f"compiled code is not kept ({reason}); set NUMBA_CACHE_DIR to a folder for it")
    return "", ""


def _fault_of(folder: Path) -> str:
    """Return why no file can be written to a folder, which is made; "" if one can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def law(function: Callable[..., Any]) -> Any:
    """Compile a law, with a cache on disk.

    Products and sums may fuse into one rounding; nothing else is reordered.
    """
    return _compiled(
        function,
        pipeline_class=LawCompiler,
        error_model="numpy",
        forceinline=True,
        fastmath={"contract", "nsz"},
    )


def long_running(function: Callable[..., Any]) -> Any:
    """Compile a loop that calls laws for milliseconds and more; Python threads run meanwhile."""
    return _compiled(function, error_model="numpy", nogil=True, fastmath={"contract", "nsz"})


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    options |= {"no_cfunc_wrapper": True}  # no C code calls these; a tenth of the time to compile
    compiled = numba.njit(**options)(function)
    if not CACHE_FOLDER:
        # numba would choose a folder beside the sources, where an edit of a called law goes unseen
        return compiled
    chosen_by_user = config.CACHE_DIR
    config.CACHE_DIR = CACHE_FOLDER
    try:
        compiled._cache = LawCache(function, READ_ONLY_FOLDER)
    except (RuntimeError, OSError):  # the folder cannot be written to any more
        return compiled
    finally:
        config.CACHE_DIR = chosen_by_user
    compiled._cache.compile_once(compiled)
    return compiled


@functools.cache
def generic(compiled: Any) -> Callable[..., Any]:
    """Return the interpreted form of a compiled law, for scalars such as Drake's AutoDiffXd."""
    source = compiled.py_func
    names = dict(source.__globals__)
    for name in source.__code__.co_names:  # names of the laws that it calls
        if is_jitted(names.get(name)):
            names[name] = generic(names[name])
    return types.FunctionType(
        source.__code__, names, source.__name__, source.__defaults__, source.__closure__
    )


@numba.njit
def _keep_alignment():
    """Do nothing, where a loop for lanes aligns its stack."""


@numba.njit(inline="always")
def _zeros(shape):
    """Return an array of zeros on the stack of the calling function."""
    array = stack_array(shape)
    array[:] = 0.0
    return array


_ON_STACK = types.ModuleType("arrays_on_stack")
"""In place of numpy in a loop for one run: its arrays need no memory of Python."""
vars(_ON_STACK).update(empty=stack_array, zeros=_zeros, inf=np.inf, nan=np.nan)


def for_one_run(loop: Any, **parts: Any) -> Any:
    """Return a long-running loop for a single run: its arrays of lanes are arrays of floats.

    The source is the same, so that a program without this package measures what a batch measures.
    The loop must not call others that fill lanes, and may take of numpy only `_ON_STACK`.

    Args:
        parts: Functions in place of others that the loop calls, by name: laws that are not inlined.
    """
    source = loop.py_func
    single = {
        "lane_array": number_array, "align_stack": _keep_alignment, "WIDTH": 1, "np": _ON_STACK
    }  # fmt: skip
    function = types.FunctionType(
        source.__code__, source.__globals__ | single | parts, source.__name__, source.__defaults__
    )
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nsz"}}
    return numba.njit(pipeline_class=TextCompiler, **options)(function)


CACHE_FOLDER, READ_ONLY_FOLDER = _cache_folders()
"""Folders of compiled code of exactly these sources: to write, and only to read; "" if none."""
