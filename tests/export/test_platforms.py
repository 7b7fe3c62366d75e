"""Libraries of an FMU for other platforms, linked on this computer by the compiler of ziglang."""

import re
import subprocess
import zipfile

import pytest

import wm_drake as wm
from wm_drake.export.fmu import WRAPPER
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
AMD64 = 0x8664
"""Number of the processor with which an object file of Windows begins."""
NEEDED = {
    "linux64": r"lib(c|m)\.so\.6|ld-linux-x86-64\.so\.2",
    "win64": r"KERNEL32\.dll|api-ms-win-crt-(heap|runtime|string|stdio|math|private)-l1-1-0\.dll",
    "darwin64": r"libSystem\.B\.dylib",
    "aarch64": r"lib(c|m)\.so\.6|ld-linux-aarch64\.so\.1",
}
"""Libraries that a library may need: C library and mathematics, and the loader."""


@pytest.mark.parametrize(
    "names",
    [
        tuple(name for name in PLATFORMS if name != "win64"),
        pytest.param(("win64",), marks=pytest.mark.hours),
    ],
    ids=["others", "win64"],
)
def test_library_of_each_platform(names, tmp_path):
    """Link libraries; the compiler first builds the C library of Windows, for more than a minute."""
    path = tmp_path / "machine.fmu"
    options = FmuOptions(platform=",".join(names))
    wm.export_fmu(wm.load_machine("reference"), "middle", path, options)
    with zipfile.ZipFile(path) as archive:
        for name in names:
            platform = PLATFORMS[name]
            check(name, archive.read(f"binaries/{platform.fmi3}/wm_drake_machine{platform.suffix}"))


def test_code_for_windows_is_compiled(tmp_path, monkeypatch):
    """Compile the wrapper and the laws for Windows, without linking."""

    def compiled(contents, _platform, compiler):
        for name, content in contents.items():
            (tmp_path / name).write_bytes(content)
        options = ["-c", "-O2", "-std=c11", f"-I{tmp_path}", WRAPPER, "-o", tmp_path / "fmu.o"]
        subprocess.run([*compiler, *map(str, options)], check=True, cwd=tmp_path)
        return b""

    monkeypatch.setattr("wm_drake.export.fmu._library", compiled)
    path = tmp_path / "machine.fmu"
    wm.export_fmu(wm.load_machine("reference"), "middle", path, FmuOptions(platform="win64"))
    objects = {file.name: file.read_bytes() for file in tmp_path.glob("*.o")}
    assert len(objects) > 1
    for name, content in objects.items():
        assert int.from_bytes(content[:2], "little") == AMD64, name
        assert not re.search(rb"Py_|PyObject|numba|NRT_", content)
    for symbol in (b"fmi3InstantiateCoSimulation", b"fmi3InstantiateModelExchange", b"fmi3DoStep"):
        assert symbol in objects["fmu.o"]


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
