"""WebAssembly from compiled functions: one module, without a linker.

LLVM's object file for WebAssembly is a valid module already. It imports memory, the top of the
stack and functions of libm, and its addresses count from 0. It lacks only the list of what it
exports; that is written here, and what a linker would read is left out.
"""

import re
from collections.abc import Iterator, Mapping

import llvmlite.binding as llvm

from wm_drake.errors import input_error
from wm_drake.export.object_code import exposed_module, remove_unused

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+bulk-memory,+sign-ext,+nontrapping-fptoint,+simd128,+mutable-globals"
"""What Chromium 91, Firefox 89 and Safari 16.4 have, and later ones."""
CUSTOM, IMPORT, EXPORT = 0, 2, 7
"""Numbers of sections of a module."""
OF_PAGE = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
    *("exp", "expm1", "log", "log1p", "log2", "log10", "pow", "cbrt", "hypot"),
    "__multi3",
}
"""Functions that a page has for a module: those of JavaScript, and a product of 128 bits."""
_COUNTER = re.compile(
    r"^(define [^\n]*@NRT_(?:in|de)cref\([^\n]*\{)\n.*?^\}", re.MULTILINE | re.DOTALL
)
"""Functions that count references to memory of Python, which these functions do not have."""
FUNCTION_TABLE = 8
"""Number of the table of symbols in the section "linking"."""
FUNCTION_SYMBOL, DATA_SYMBOL, SECTION_SYMBOL = 0, 1, 3
FUNCTION, TABLE, GLOBAL = 0, 1, 3
"""Kinds of imports; the fourth is a memory."""
UNDEFINED, EXPLICIT_NAME = 0x10, 0x40


def wasm_module(code: Mapping[str, str]) -> bytes:
    """Return a module that exports functions.

    Args:
        code: LLVM's text of each function as numba gives it, by the name of its export.

    Raises:
        InputError: a law calls a function that a page does not have.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(
        cpu="mvp", features=FEATURES, opt=3, reloc="static", codemodel="default"
    )
    modules = [
        exposed_module(name, name, _COUNTER.sub(r"\1\n  ret void\n}", text), TRIPLE, machine)
        for name, text in code.items()
    ]
    whole = modules[0]
    for module in modules[1:]:
        whole.link_in(module)
    remove_unused(whole, machine)
    return with_exports(bytes(machine.emit_object(whole)), code)


def with_exports(built: bytes, names: Mapping[str, str]) -> bytes:
    """Return a module from an object file: with exports, without what a linker reads."""
    sections = list(_sections(built))
    imported = next((body for kind, body in sections if kind == IMPORT), b"\0")
    if foreign := sorted(_imported_functions(imported) - OF_PAGE):
        raise input_error(
            f"an element calls {', '.join(foreign)}, which a page does not have; allowed are "
            f"{', '.join(sorted(OF_PAGE - {'__multi3'}))}",
            key="elements",
        )
    linking = next(body for kind, body in sections if kind == CUSTOM and _name(body) == "linking")
    numbers = _function_symbols(linking)
    entries = b"".join(_text(name) + b"\x00" + _unsigned(numbers[name]) for name in names)
    exports = _unsigned(len(names)) + entries
    kept = [(kind, body) for kind, body in sections if kind != CUSTOM]
    at = next((k for k, (kind, _) in enumerate(kept) if kind > EXPORT), len(kept))
    kept.insert(at, (EXPORT, exports))
    return built[:8] + b"".join(bytes([k]) + _unsigned(len(b)) + b for k, b in kept)


def _sections(built: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number and content of each section."""
    at = 8
    while at < len(built):
        kind = built[at]
        size, at = _read(built, at + 1)
        yield kind, built[at : at + size]
        at += size


def _imported_functions(body: bytes) -> set[str]:
    """Return the names of the functions that a module imports."""
    count, at = _read(body, 0)
    names = set[str]()
    for _ in range(count):
        size, at = _read(body, at)
        size, at = _read(body, at + size)
        name, kind, at = body[at : at + size].decode(), body[at + size], at + size + 1
        if kind == FUNCTION:
            names.add(name)
            _, at = _read(body, at)
        else:
            at = _behind_type(body, kind, at)
    return names


def _behind_type(body: bytes, kind: int, at: int) -> int:
    """Return where the next import begins behind the type of a table, a memory or a global."""
    if kind == GLOBAL:
        return at + 2
    at += kind == TABLE
    has_largest, at = body[at] & 1, at + 1
    for _ in range(1 + has_largest):
        _, at = _read(body, at)
    return at


def _name(body: bytes) -> str:
    size, at = _read(body, 0)
    return body[at : at + size].decode()


def _function_symbols(linking: bytes) -> dict[str, int]:
    """Return the number of each function of an object file, by the name of its symbol."""
    _, at = _read(linking, 1 + linking[0])  # behind the name: the version
    while True:
        kind, (size, at) = linking[at], _read(linking, at + 1)
        if kind == FUNCTION_TABLE:
            break
        at += size
    count, at = _read(linking, at)
    numbers = {}
    for _ in range(count):
        kind, (flags, at) = linking[at], _read(linking, at + 1)
        is_named = not flags & UNDEFINED or flags & EXPLICIT_NAME
        if kind == SECTION_SYMBOL:
            _, at = _read(linking, at)
            continue
        if kind == DATA_SYMBOL:
            size, at = _read(linking, at)
            at += size
            for _ in range(0 if flags & UNDEFINED else 3):
                _, at = _read(linking, at)
            continue
        number, at = _read(linking, at)
        if is_named:
            size, at = _read(linking, at)
            if kind == FUNCTION_SYMBOL:
                numbers[linking[at : at + size].decode()] = number
            at += size
    return numbers


def _read(data: bytes, at: int) -> tuple[int, int]:
    """Return an unsigned number in LEB128, and where the next one begins."""
    value = shift = 0
    while True:
        byte = data[at]
        value, shift, at = value | (byte & 0x7F) << shift, shift + 7, at + 1
        if byte < 0x80:
            return value, at


def _unsigned(value: int) -> bytes:
    """Return an unsigned number in LEB128."""
    parts = []
    while True:
        parts.append(value & 0x7F | (0x80 if value > 0x7F else 0))
        value >>= 7
        if not value:
            return bytes(parts)


def _text(name: str) -> bytes:
    return _unsigned(len(name)) + name.encode()
