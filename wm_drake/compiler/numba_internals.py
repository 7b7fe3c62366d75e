"""The parts of numba without a public name that compiled laws need; no other file imports them.

- `Compiler`, `JITCodeLibrary`: a law for lanes is linked into its callers, without machine code and
  entry from Python. No option of `numba.njit` leaves them out.
- `CompileResult`, `CompileResultCacheImpl`, `FunctionCache`, `IndexDataCacheFile`: numba's files of
  compiled code have no checksum, and its cache is chosen by no public function.
- `Conversion`: how a number converts to lanes, the result of the public `Type.can_convert_from`.
- `AbstractTemplate`, `infer_global`, `signature`: an operation whose arguments convert to other
  types. `numba.extending.type_callable` types a call by its arguments as they are.
- `lower_constant`: a `ChosenLaw` among the constants of a function that becomes machine code.
- `cgutils`: declaration of a function of LLVM in the module that is compiled.
"""

from numba.core import cgutils
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.imputils import lower_constant
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

__all__ = [
    "AbstractTemplate",
    "CompileResult",
    "CompileResultCacheImpl",
    "Compiler",
    "Conversion",
    "FunctionCache",
    "IndexDataCacheFile",
    "JITCodeLibrary",
    "cgutils",
    "infer_global",
    "lower_constant",
    "signature",
]
