"""Object files from compiled functions: machine code for a platform, without Python in it."""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass

import llvmlite.binding as llvm


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
    """

    name: str
    triple: str
    zig: str
    fmi2: str
    fmi3: str
    suffix: str
    fast: str = ""

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
            "+avx2,+fma",
        ),
        Platform(
            "win64",
            "x86_64-pc-windows-gnu",
            "x86_64-windows-gnu",
            "win64",
            "x86_64-windows",
            ".dll",
        ),
        Platform(
            "darwin64",
            "x86_64-apple-darwin",
            "x86_64-macos",
            "darwin64",
            "x86_64-darwin",
            ".dylib",
        ),
        Platform(
            "aarch64",
            "aarch64-unknown-linux-gnu",
            "aarch64-linux-gnu.2.17",
            "aarch64-linux",
            "aarch64-linux",
            ".so",
        ),
    )
}
"""Platforms by name. The folder of 64-bit ARM is not in FMI 2.0; tools use this one."""
OF_LIBM = {"sin", "cos", "tanh", "exp", "pow", "atan2"}
"""Functions that the code may call."""
BASELINE = {"x86_64": "x86-64", "aarch64": "generic"}
"""Processor for which code is generated, by architecture."""


def object_files(code: Mapping[str, str], platform: Platform) -> dict[str, bytes]:
    """Return the object files of functions for a platform, by file name.

    Args:
        code: LLVM's text of each function as numba gives it, by the name that its symbol gets.
        platform: The platform.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    files = {}
    for name, text in code.items():
        files[f"{name}.o"] = _object(name, name, text, platform, "")
        if platform.fast:
            files[f"{name}_fast.o"] = _object(name, f"{name}_fast", text, platform, platform.fast)
    return files


@functools.lru_cache(maxsize=8)  # both versions of the standard have the same code
def _object(name: str, symbol: str, text: str, platform: Platform, features: str) -> bytes:
    """Return the object file of one function."""
    processor = BASELINE[platform.triple.split("-")[0]]
    machine = llvm.Target.from_triple(platform.triple).create_target_machine(
        cpu=processor, features=features, opt=3, reloc="pic", codemodel="default"
    )
    text = re.sub(r"target triple = .*", f'target triple = "{platform.triple}"', text)
    text = re.sub(r"target datalayout = .*", f'target datalayout = "{machine.target_data}"', text)
    text = re.sub(r'"target-(cpu|features)"="[^"]*"', "", text)
    module = llvm.parse_assembly(text)
    entry = _entry(module, name)
    for item in [*module.functions, *module.global_variables]:
        if not item.is_declaration and item.name != entry:
            item.linkage = "internal"
    module.get_function(entry).name = symbol
    # the text is optimised; what only the entry from Python used is now without a caller
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    passes.run(module, llvm.create_pass_builder(machine, options))
    unwanted = [
        function.name
        for function in module.functions
        if function.is_declaration
        and not function.name.startswith("llvm.")
        and function.name not in OF_LIBM
    ]
    if unwanted:
        raise AssertionError(f"{symbol} needs {', '.join(unwanted)}")
    return bytes(machine.emit_object(module))


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
