"""Laws that only compiled code calls: their code goes into their callers and is not run itself.

numba makes machine code of every function that it compiles, and an entry from Python. A law for
lanes needs neither: its callers contain it. Without them, the first call after an installation
takes a sixth less time. Its optimised code is the same.
"""

import ctypes
from typing import Any

import llvmlite.binding as llvm
from numba import types

from wm_drake.compiler.numba_internals import JITCodeLibrary

INLINED = "inlined"
"""Kind of these libraries in files of compiled code."""

_REFUSE = ctypes.cast(ctypes.pythonapi.PyErr_BadArgument, ctypes.c_void_p).value
"""Address that Python would call: a function that raises a TypeError."""


class _NoEngine:
    """Takes the place of numba's execution engine, which does not have these laws."""

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: only an entry from Python reads the environment of a function."""


class InlinedLibrary(JITCodeLibrary):
    """The code of a law that is linked into its callers and has no machine code of its own."""

    @property
    def codegen(self) -> _NoEngine:
        """Return what sets the environment of the law: nothing."""
        return _NoEngine()

    def get_pointer_to_function(self, _name: str) -> int | None:
        """Return the address of a function that raises a TypeError."""
        self._ensure_finalized()
        return _REFUSE

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return the law for a file of compiled code."""
        self._ensure_finalized()
        return self.name, INLINED, self._final_module.as_bitcode()

    @classmethod
    def read(cls, codegen: Any, state: tuple[str, str, bytes]) -> "InlinedLibrary":
        """Return the library of `serialize_using_object_code`."""
        library = cls(codegen, state[0])
        library._final_module = llvm.parse_bitcode(state[2])
        library._finalize_final_module()
        return library

    def _finalize_final_module(self) -> None:
        """Make the code ready for linking, without the execution engine."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


def has_indices(kind: Any) -> bool:
    """Return whether a type is a tuple with an array of whole numbers in it.

    Such are the indices of elements, which no Python code gives a law.
    """
    if isinstance(kind, types.Array):
        return isinstance(kind.dtype, types.Integer)
    return isinstance(kind, types.BaseTuple) and any(map(has_indices, kind.types))
