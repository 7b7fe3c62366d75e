"""Files of compiled code on disk, with a checksum: a damaged file is compiled anew.

numba itself trusts its files. A file that is cut short, empty or changed ends in an error of its
reader or of the linker, or crashes the process.
"""

import contextlib
import functools
import hashlib
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from wm_drake.compiler.claims import claimed
from wm_drake.compiler.inlined import INLINED, InlinedLibrary
from wm_drake.compiler.numba_internals import (
    CompileResult,
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
)

_DIGEST = hashlib.sha256().digest_size
_PACKAGE = Path(__file__).parents[1]


class CheckedCacheFile(IndexDataCacheFile):
    """The index and the data files of one compiled function, each behind the hash of its content.

    A file that is damaged counts as missing; one that cannot be written is left out. Both are said
    in one line on standard error, once in a process. What is missing is looked for in a second
    folder, which is only read.
    """

    read_only: str = ""

    def _load_index(self) -> dict[Any, str]:
        merged: dict[Any, str] = {}
        for path in reversed(self._places(self._index_path)):
            version, stamp, overloads = _read(path) or (None, None, {})
            if version == self._version and stamp == self._source_stamp:
                merged |= overloads
        return merged

    def _save_index(self, overloads: dict[Any, str]) -> None:
        content = (self._version, self._source_stamp, overloads)
        self._write(self._index_path, self._dump(content))

    def _load_data(self, name: str) -> Any:
        for path in self._places(self._data_path(name)):
            if (stored_content := _read(path)) is not None:
                return stored_content
        raise FileNotFoundError(name)  # what numba takes as "compile it"

    def _places(self, path: str) -> list[Path]:
        """Return the path of a file, and that in the folder which is only read."""
        written = Path(path)
        return [written, Path(self.read_only, written.name)] if self.read_only else [written]

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        try:
            with self._open_for_write(path) as file:
                file.write(hashlib.sha256(content).digest() + content)
        except OSError as error:
            say_once(f"compiled code cannot be kept in {self._cache_path} ({error.strerror})")


class _LawCacheImpl(CompileResultCacheImpl):
    """How laws are read from files of compiled code; those with an `InlinedLibrary` too."""

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> CompileResult:
        """Return the compiled law of a file."""
        library, fndesc, environment, signature, objectmode, lifted, types, reload, envs = payload
        if library[1] != INLINED:
            return super().rebuild(target_context, payload)
        read = InlinedLibrary.read(target_context.codegen(), library)
        return CompileResult(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=target_context.get_executable(read, fndesc, environment),
            typing_error=None,
            type_annotation=types,
            signature=signature,
            objectmode=objectmode,
            lifted=lifted,
            fndesc=fndesc,
            library=read,
            call_helper=None,
            environment=environment,
            metadata=None,
            reload_init=reload,
            referenced_envs=envs,
        )


class LawCache(FunctionCache):
    """The compiled forms of a function on disk, in `CheckedCacheFile`s."""

    _impl_class = _LawCacheImpl
    _cache_file: IndexDataCacheFile

    def __init__(self, function: Callable[..., Any], read_only: str = "") -> None:
        """Choose the files of a function.

        Args:
            read_only: Folder of compiled code that is only read; "" for none.

        Raises:
            RuntimeError, OSError: the folder cannot be written to.
        """
        super().__init__(function)
        self._kept = set[Any]()
        files = self._cache_file
        folder, stamp = _shared(Path(files._cache_path), function) or (
            files._cache_path,
            files._source_stamp,
        )
        self._cache_file = CheckedCacheFile(folder, self._impl.filename_base, stamp)
        if read_only:
            self._cache_file.read_only = str(Path(read_only, Path(folder).name))

    def compile_once(self, dispatcher: Any) -> None:
        """Let one process at a time compile a form of the function; the others read its files."""
        compile_form = dispatcher._compiler.compile

        def compile_or_read(args: Any, return_type: Any) -> CompileResult:
            form = tuple(args)
            with self._claimed(str(form)):
                read = self.load_overload(form, dispatcher.targetctx)
                if read is not None:
                    entry = read.entry_point, read.fndesc, [read.library]
                    dispatcher.targetctx.insert_user_function(*entry)
                    self._kept.add(form)
                    return read
                compiled = compile_form(args, return_type)
                self.save_overload(form, compiled)
                return compiled

        dispatcher._compiler.compile = compile_or_read

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Save a compiled form once, while no other process changes the index of the function."""
        if sig not in self._kept:
            self._kept.add(sig)
            with self._claimed("index"):
                super().save_overload(sig, data)

    def _claimed(self, what: str) -> contextlib.AbstractContextManager[None]:
        folder = Path(self._cache_file._cache_path)
        return claimed(folder.parent, f"{folder.name} {self._cache_file._index_name} {what}")


def _shared(folder: Path, function: Callable[..., Any]) -> tuple[str, str] | None:
    """Return folder and stamp of a law of this package, the same in all checkouts of its sources.

    numba names the folder by the absolute path of the source: each checkout would compile anew.
    """
    source = Path(function.__code__.co_filename)
    if not source.is_relative_to(_PACKAGE):
        return None
    shared = folder.with_name("_".join(source.relative_to(_PACKAGE).parts[:-1]) or "wm_drake")
    shared.mkdir(exist_ok=True)
    return str(shared), hashlib.sha256(source.read_bytes()).hexdigest()


def _read(path: Path) -> Any:
    """Return the content of a file; None if it is missing or damaged."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        say_once(f"compiled code in {path.parents[1]} is damaged; it is compiled anew")
        return None
    return pickle.loads(content)


@functools.cache
def say_once(text: str) -> None:
    """Write a line on standard error, once in a process."""
    if sys.stderr is not None:  # None: it is closed
        sys.stderr.write(f"{text}\n")
