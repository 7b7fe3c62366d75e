"""Libraries of an FMU for other platforms, linked on this computer by the compiler of ziglang."""

import re
import zipfile

import pytest

import wm_drake as wm
from wm_drake.export.object_code import PLATFORMS
from wm_drake.export.options import FmuOptions

pytest.importorskip("fmpy", reason="headers are FMPy's: install wm-drake[fmu]")
pytest.importorskip("ziglang", reason="the compiler for other platforms: install wm-drake[fmu]")
pytestmark = pytest.mark.slow

FORMAT = {
    "linux64": b"\x7fELF\x02\x01\x01",
    "win64": b"MZ",
    "darwin64": b"\xcf\xfa\xed\xfe\x07\x00\x00\x01",
    "aarch64": b"\x7fELF\x02\x01\x01",
}
"""How a library begins: ELF of 64 bit, PE, Mach-O of x86-64."""
MACHINE = {"linux64": 62, "aarch64": 183}
"""Number of the processor in the header of an ELF file (`elf.h`: EM_X86_64, EM_AARCH64)."""
NEEDED = {
    "linux64": r"lib(c|m)\.so\.6|ld-linux-x86-64\.so\.2",
    "win64": r"KERNEL32\.dll|api-ms-win-crt-(heap|runtime|string|stdio|math|private)-l1-1-0\.dll",
    "darwin64": r"libSystem\.B\.dylib",
    "aarch64": r"lib(c|m)\.so\.6|ld-linux-aarch64\.so\.1",
}
"""Libraries that a library may need: C library and mathematics, and the loader."""


def test_library_of_each_platform(tmp_path):
    """Write all in one test: the compiler takes a minute for them."""
    path = tmp_path / "machine.fmu"
    options = FmuOptions(platform=",".join(PLATFORMS))
    wm.export_fmu(wm.load_machine("reference"), "middle", path, options)
    with zipfile.ZipFile(path) as archive:
        for name, platform in PLATFORMS.items():
            check(name, archive.read(f"binaries/{platform.fmi3}/wm_drake_machine{platform.suffix}"))


def check(name, content):
    """Check format, symbols and needed libraries of the library of a platform."""
    assert content.startswith(FORMAT[name])
    if name in MACHINE:
        assert int.from_bytes(content[18:20], "little") == MACHINE[name]
    for symbol in (b"fmi3InstantiateCoSimulation", b"fmi3InstantiateModelExchange", b"fmi3DoStep"):
        assert symbol in content
    assert not re.search(rb"Py_|PyObject|numba|NRT_", content)
    words = re.findall(rb"[\w.+-]*\.(?:so[.\d]*|dll|dylib)(?=\0)", content)
    needed = {word.decode() for word in words} - {f"wm_drake_machine{PLATFORMS[name].suffix}"}
    assert needed
    assert not [word for word in needed if not re.fullmatch(NEEDED[name], word)]
