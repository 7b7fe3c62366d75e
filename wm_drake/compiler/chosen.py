"""Laws that a caller chooses: arguments of compiled loops, compiled into them.

A function of numba can be an argument too, but its type is new in every process, so that no later
process would find the compiled loop on disk. The type of a `ChosenLaw` is named by the hash of its
sources.
"""

import hashlib
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numba import types
from numba.extending import NativeValue, models, overload, register_model, typeof_impl, unbox

from wm_drake.compiler.numba_internals import lower_constant

_PACKAGE = Path(__file__).parents[1]


class ChosenLaw:
    """A law as an argument of a compiled loop.

    Attributes:
        law: The compiled law.
        key: Name and hash of the sources of the law and of all laws that it calls.
        made_by: Function and arguments that return it in another process.
    """

    def __init__(self, law: Any, name: str, made_by: tuple[Any, ...] = ()) -> None:
        """Choose a law.

        Args:
            name: Name of what it computes, equal for laws of equal sources.
            made_by: See the attribute; none for a law that no other process needs.
        """
        self.law, self.made_by = law, made_by
        self.key = f"{name} {_digest_of(law)}"
        _KNOWN[self.key] = law

    def __repr__(self) -> str:
        """Return the key: what is made of equal laws is kept on disk under equal names."""
        return self.key

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how another process makes this law."""
        return self.made_by


_KNOWN: dict[str, Any] = {}
"""Laws by key, for the compiler."""


def _digest_of(law: Any) -> str:
    """Return a hash of the files of a law and of the laws that it calls, outside this package."""
    digest, codes = hashlib.sha256(), [called.__code__ for called in _called(law, set())]
    for code in codes:  # a generated law has no file
        digest.update(repr((code.co_name, code.co_code, code.co_names)).encode())
    for path in sorted({code.co_filename for code in codes}):
        if path.startswith("<generated") or _PACKAGE in Path(path).parents:
            continue  # the folder of compiled code is named by the sources of this package
        try:
            digest.update(Path(path).read_bytes())
        except OSError:  # written at a prompt: it cannot be told from another one
            digest.update(uuid.uuid4().bytes)
    return digest.hexdigest()[:16]


def _called(law: Any, known: set[int]) -> Iterator[Any]:
    """Yield the functions of a law and of the laws that it calls."""
    function = getattr(law, "py_func", None)  # a compiled law has it
    if function is None or id(function) in known:
        return
    known.add(id(function))
    yield function
    for name in function.__code__.co_names:
        yield from _called(function.__globals__.get(name), known)


class ChosenLawType(types.Type):
    """Type of a `ChosenLaw` in compiled code: one for each key."""

    def __init__(self, law_key: str) -> None:
        """Name the type."""
        self.law_key = law_key
        super().__init__(name=f"ChosenLaw({law_key})")


register_model(ChosenLawType)(models.OpaqueModel)


@typeof_impl.register(ChosenLaw)
def _type_of(chosen: ChosenLaw, _context: Any) -> ChosenLawType:
    return ChosenLawType(chosen.key)


@unbox(ChosenLawType)
def _unbox(_kind: Any, _value: Any, c: Any) -> NativeValue:
    return NativeValue(c.context.get_dummy_value())


@lower_constant(ChosenLawType)
def _constant(context: Any, _builder: Any, _kind: Any, _value: Any) -> Any:
    return context.get_dummy_value()


def call(chosen, *arguments):
    """Return what a `ChosenLaw` returns."""
    return chosen.law(*arguments)


@overload(call, jit_options={"forceinline": True, "error_model": "numpy"})
def _compiled_call(chosen, *arguments):  # noqa: ARG001
    if not isinstance(chosen, ChosenLawType):
        return None
    law = _KNOWN[chosen.law_key]
    return lambda chosen, *arguments: law(*arguments)
