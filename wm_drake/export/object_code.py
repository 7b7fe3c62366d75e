"""Object files from compiled functions: machine code for a platform, without Python in it."""

import ctypes
import functools
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass

import llvmlite.binding as llvm
import numpy as np

from wm_drake.export.description import IDENTIFIER
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Platform:
    """A platform that an FMU runs on.

    Attributes:
        name: Its name on the command line.
        triple: Name of the target of LLVM; None for that of this computer.
        zig: Name of the target of `zig cc`.
        fmi2, fmi3: Its folder in an FMU of each version.
        suffix: How names of its libraries end.
        fast: Features of newer processors for which a second code is added; "" for none.
        condition: Condition of the C preprocessor that holds there.
        linking: Options with which its library is linked.
    """

    name: str
    triple: str
    zig: str
    fmi2: str
    fmi3: str
    suffix: str
    condition: str
    fast: str = ""
    linking: tuple[str, ...] = ("-fPIC", "-Wl,-s")

    def folder(self, version: int) -> str:
        """Return its folder below `binaries` in an FMU of a version of the standard."""
        return self.fmi2 if version == 2 else self.fmi3


PLATFORMS = {
    platform.name: platform
    for platform in (
        Platform(
            "linux64",
            "x86_64-unknown-linux-gnu",
            "x86_64-linux-gnu.2.17",
            "linux64",
            "x86_64-linux",
            ".so",
            "defined __x86_64__ && defined __linux__",
            "+avx2,+fma",
        ),
        Platform(
            "win64",
            "x86_64-pc-windows-gnu",
            "x86_64-windows-gnu",
            "win64",
            "x86_64-windows",
            ".dll",
            "defined __x86_64__ && defined _WIN32",
            linking=(),
        ),
        Platform(
            "darwin64",
            "x86_64-apple-darwin",
            "x86_64-macos",
            "darwin64",
            "x86_64-darwin",
            ".dylib",
            "defined __x86_64__ && defined __APPLE__",
            linking=("-fPIC", "-Wl,-install_name,@rpath/wm_drake_machine.dylib"),
        ),
        Platform(
            "aarch64",
            "aarch64-unknown-linux-gnu",
            "aarch64-linux-gnu.2.17",
            "aarch64-linux",
            "aarch64-linux",
            ".so",
            "defined __aarch64__ && defined __linux__",
        ),
    )
}
"""Platforms by name. The folder of 64-bit ARM is not in FMI 2.0; tools use this one."""
OF_LIBM = {"sin", "cos", "tanh", "exp", "pow", "atan2"}
"""Functions that the code may call."""
BASELINE = {"x86_64": "x86-64", "aarch64": "generic"}
"""Processor for which code is generated, by architecture."""


def symbols(code: Mapping[str, str], platform: Platform) -> list[tuple[str, str, str]]:
    """Return function, symbol and features of the processor of each code of a platform.

    Args:
        code: LLVM's text of each function as numba gives it, by the name that its symbol gets.
    """
    usual = [(name, name, "") for name in code]
    fast = [(name, f"{name}_fast", platform.fast) for name in code if platform.fast]
    return usual + fast


def object_files(code: Mapping[str, str], platform: Platform) -> dict[str, bytes]:
    """Return the object files of functions for a platform, by file name."""
    return {
        f"{symbol}.o": _emitted(name, symbol, code[name], _Target(platform, features, "object"))
        for name, symbol, features in symbols(code, platform)
    }


def assembly(code: Mapping[str, str], platform: Platform) -> dict[str, str]:
    """Return the text for an assembler of functions for a platform, by symbol."""
    return {
        symbol: _emitted(name, symbol, code[name], _Target(platform, features, "text")).decode()
        for name, symbol, features in symbols(code, platform)
    }


@dataclass(frozen=True)
class _Target:
    """What is emitted: for a platform, with features of its processor, as "object" or "text"."""

    platform: Platform
    features: str
    form: str

    def machine(self) -> llvm.TargetMachine:
        """Return LLVM's machine."""
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        triple = self.platform.triple
        return llvm.Target.from_triple(triple).create_target_machine(
            cpu=BASELINE[triple.split("-")[0]],
            features=self.features,
            opt=3,
            reloc="pic",
            codemodel="default",
        )


@functools.lru_cache(maxsize=16)  # both versions of the standard have the same code
def _emitted(name: str, symbol: str, text: str, target: _Target) -> bytes:
    """Return the machine code of one function."""
    machine = target.machine()
    module = exposed_module(name, symbol, text, target.platform.triple, machine)
    if unwanted := foreign_functions(module, OF_LIBM):
        raise AssertionError(f"{symbol} needs {', '.join(unwanted)}")
    if target.form == "object":
        return bytes(machine.emit_object(module))
    return str(machine.emit_assembly(module)).encode()


def function_here(name: str, text: str) -> Callable[..., float]:
    """Return a function from its text, for this process: of arrays of floats, with a number.

    Args:
        name: Name of the function in the source.
        text: LLVM's text of the function as numba gives it.
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = llvm.get_process_triple()
    machine = llvm.Target.from_triple(triple).create_target_machine(opt=1, codemodel="jitdefault")
    engine = llvm.create_mcjit_compiler(exposed_module(name, name, text, triple, machine), machine)
    engine.finalize_object()

    def run(*arrays: FloatArray) -> float:
        result = np.zeros(2)  # numba's functions write it, and errors, to their first arguments
        kinds = [ctypes.c_void_p] * (2 + len(arrays))
        entry = ctypes.CFUNCTYPE(ctypes.c_int, *kinds)(engine.get_function_address(name))
        places = (array.ctypes.data for array in (result, result[1:], *arrays))
        entry(*places)
        return float(result[0])

    return run


def exposed_module(
    name: str, symbol: str, text: str, triple: str, machine: llvm.TargetMachine
) -> llvm.ModuleRef:
    """Return the module of a function for a target, in which it alone is seen, under a symbol.

    Args:
        name: Name of the function in the source.
        text: LLVM's text of the function as numba gives it.
        triple, machine: The target.
    """
    text = re.sub(r"target triple = .*", f'target triple = "{triple}"', text)
    text = re.sub(r"target datalayout = .*", f'target datalayout = "{machine.target_data}"', text)
    text = re.sub(r'"target-(cpu|features)"="[^"]*"', "", text)
    module = llvm.parse_assembly(text)
    _expose(module, _entry(module, name), symbol)
    remove_unused(module, machine)
    return module


def _expose(module: llvm.ModuleRef, entry: str, symbol: str) -> None:
    """Make a function the only one that other files see, under the name of a symbol."""
    for item in [*module.functions, *module.global_variables]:
        if not item.is_declaration and item.name != entry:
            item.linkage = "internal"
    function = module.get_function(entry)
    function.name, function.linkage = symbol, "external"
    function.visibility = "hidden"  # libraries of other FMUs have the same names


def remove_unused(module: llvm.ModuleRef, machine: llvm.TargetMachine) -> None:
    """Remove what only the entry from Python used; the text is optimised already."""
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    passes.run(module, llvm.create_pass_builder(machine, options))


def foreign_functions(module: llvm.ModuleRef, known: Container[str]) -> list[str]:
    """Return the functions outside of a module that are none of the known ones."""
    return [
        function.name
        for function in module.functions
        if function.is_declaration
        and not function.name.startswith("llvm.")
        and function.name not in known
    ]


def _entry(module: llvm.ModuleRef, name: str) -> str:
    """Return the function that numba's entry for C calls: it has neither Python nor exceptions."""
    (entry,) = (
        function.name
        for function in module.functions
        if not function.is_declaration
        and name in function.name
        and not function.name.startswith("cfunc.")
    )
    return str(entry)


LEFT_OUT = ("\t.file", "\t.ident")
"""Beginnings of lines that the compiler writes itself."""


def sources_in_c(code: Mapping[str, str], platform: Platform) -> dict[str, bytes]:
    """Return the C files with the functions of a platform, by file name.

    Each function has its own file, because labels of an assembler are valid in a whole file.

    Args:
        code: LLVM's text of the functions, as for `assembly`.
        platform: The platform; elsewhere the files are empty.
    """
    texts = assembly(code, platform)
    return {f"{symbol}_{platform.name}.c": _in_c(text, platform) for symbol, text in texts.items()}


def _in_c(text: str, platform: Platform) -> bytes:
    lines = [line for line in text.splitlines() if not line.startswith(LEFT_OUT)]
    body = "\n".join(["__asm__(", *(json.dumps(f"{line}\n") for line in lines), ");"])
    head = f"/* Machine code of the washing machine for {platform.name}. */"
    empty = "typedef int wm_other_platform;"
    return f"{head}\n#if {platform.condition}\n{body}\n#else\n{empty}\n#endif\n".encode()


def build_description(names: Iterable[str]) -> bytes:
    """Return `buildDescription.xml` of FMI 3.0 for the files that are compiled."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=IDENTIFIER)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    for name in names:
        ET.SubElement(files, "SourceFile", name=name)
    ET.SubElement(configuration, "Library", name="m", external="true")
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))
