"""Write a machine as an FMU (FMI 2.0 or 3.0) for co-simulation and model exchange.

The machine code is that of the compiled engine. The file needs neither Python nor this package
where it runs; headers of the standard come from the installed FMPy.
"""

import csv
import hashlib
import importlib.metadata
import importlib.util
import io
import platform as host
import shutil
import subprocess
import sys
import time
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.engines.trajectory import LARGEST_ANGLE, LARGEST_DISPLACEMENT, LARGEST_TILT
from wm_drake.errors import check_known, input_error, shortened
from wm_drake.export.description import IDENTIFIER, Identity, model_description
from wm_drake.export.kernel import kernel_code
from wm_drake.export.model import ExportedModel, exported_model
from wm_drake.export.object_code import (
    PLATFORMS,
    Platform,
    build_description,
    object_files,
    sources_in_c,
)
from wm_drake.export.options import FmuOptions
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.written_files import check_new, filled, temporary_folder, write_files

WRAPPER = Path(__file__).parent / "c" / "fmu.c"
DOCUMENTATION = Path(__file__).parent / "documentation.html"
VERSIONS = (2, 3)
READABLE, SETTABLE = 1, 2
"""Bits of a variable in the table of the C functions."""
HOST = {
    ("Linux", "x86_64"): "linux64",
    ("Linux", "aarch64"): "aarch64",
    ("Windows", "AMD64"): "win64",
    ("Darwin", "x86_64"): "darwin64",
}
"""Platform of this computer, by system and processor."""
LONGEST_REASON = 300


@dataclass(frozen=True)
class ExportedFmu:
    """An FMU that was written.

    Attributes:
        platforms: Names of the platforms that it has code for.
        size: Size of the file. [byte]
    """

    path: Path
    model: ExportedModel
    platforms: tuple[str, ...]
    size: int


def host_platform() -> str:
    """Return the name of the platform of this computer."""
    return HOST.get((host.system(), host.machine()), "linux64")


def export_fmu(
    parameters: MachineParameters,
    load: str,
    out: str | Path,
    options: FmuOptions | None = None,
    *,
    replace: bool = True,
) -> ExportedFmu:
    """Write a machine with a load as an FMU.

    Args:
        load: Name of one of its loads, with which a run of the FMU begins.
        out: File to write.
        replace: Whether a file that exists is replaced.

    Raises:
        InputError: an option is not allowed, FMPy or a compiler is missing, the compiled engine
            does not represent the machine, or the file exists or cannot be written. Nothing is
            written then.

    Example:
        >>> import wm_drake as wm
        >>> machine = wm.load_machine("reference")
        >>> wm.export_fmu(machine, "middle", "machine.fmu", wm.FmuOptions(fmi=1))
        Traceback (most recent call last):
        wm_drake.errors.InputError: fmi: there is no version 1; allowed are 2 and 3
    """
    options = options or FmuOptions()
    path, platforms = Path(out), _platforms(options)
    _check_file(path, replace)
    headers = _headers()
    compilers = {p.name: [*_compiler(p), f"-I{headers}"] for p in platforms}
    model = exported_model(
        parameters,
        load,
        input_kind="torque" if options.input == "torque" else "speed",
        step=options.step,
        gasket=not options.no_gasket,
    )
    contents = _Contents(model, kernel_code(model.plan), options.fmi, platforms)
    sources = contents.sources() if options.sources else {}
    files = contents.about(sources) | contents.libraries(compilers)
    files |= {f"sources/{name}": content for name, content in sources.items()}
    write_files({path: _zipped(files)}, replace=replace)
    names = tuple(platform.name for platform in platforms)
    return ExportedFmu(path, model, names, path.stat().st_size)


class _Contents:
    """Files of an FMU, by their path in it."""

    def __init__(
        self, model: ExportedModel, code: Mapping[str, str], fmi: int, platforms: list[Platform]
    ) -> None:
        self.model, self.code, self.fmi, self.platforms = model, code, fmi, platforms
        self.token = _token(model, code, fmi)
        self.header = _machine_header(model, self.token, fmi).encode()

    def about(self, sources: Iterable[str]) -> dict[str, bytes]:
        """Return the description, the documentation and the reference results."""
        compiled = tuple(name for name in sources if name.endswith(".c"))
        identity = Identity(self.token, self.fmi, _program(), compiled)
        files = {
            "modelDescription.xml": model_description(self.model, identity),
            "documentation/index.html": _documentation(self.model, self.fmi),
        }
        if self.model.plan.follows_speed:
            files["documentation/reference.csv"] = _reference(self.model)
        return files

    def libraries(self, compilers: Mapping[str, list[str]]) -> dict[str, bytes]:
        """Return the library of each platform."""
        files = {}
        for platform in self.platforms:
            place = f"binaries/{platform.folder(self.fmi)}/{IDENTIFIER}{platform.suffix}"
            objects = object_files(self.code, platform) | {"machine.h": self.header}
            files[place] = _library(objects, platform, compilers[platform.name])
        return files

    def sources(self) -> dict[str, bytes]:
        """Return the sources by file name; for FMI 3 with the description of how to build them."""
        files = {"fmu.c": WRAPPER.read_bytes()}
        for platform in self.platforms:
            files |= sources_in_c(self.code, platform)
        more = {"buildDescription.xml": build_description(files)} if self.fmi == 3 else {}
        return files | {"machine.h": self.header} | more


def _platforms(options: FmuOptions) -> list[Platform]:
    """Return the platforms, after checking the options."""
    if options.fmi not in VERSIONS:
        raise input_error(f"there is no version {options.fmi}; allowed are 2 and 3", where="fmi")
    if options.input not in ("speed", "torque"):
        raise input_error(f"no input '{options.input}'; allowed: speed, torque", where="input")
    names = [name.strip() for name in options.platform.split(",") if name.strip()]
    for name in names:
        check_known(name, PLATFORMS, f"no platform '{name}'", where="platform")
    return [PLATFORMS[name] for name in dict.fromkeys(names or [host_platform()])]


def _check_file(path: Path, replace: bool) -> None:
    if path.suffix != ".fmu":
        raise input_error(f"'{path.name}' must end with .fmu", where="out")
    if not path.parent.is_dir():
        raise input_error(f"there is no folder '{path.parent}'", where="out")
    check_new([path], replace=replace)


def _headers() -> Path:
    """Return the folder of the headers of the standard."""
    fmpy = importlib.util.find_spec("fmpy")
    if fmpy is None or fmpy.origin is None:
        raise input_error(
            "the headers of the standard come from the package FMPy, which is not installed; "
            "pip install 'wm-drake[fmu]'",
            where="export fmu",
        )
    return Path(fmpy.origin).parent / "c-code"


def _compiler(platform: Platform) -> list[str]:
    """Return the command that compiles and links for a platform."""
    if platform.name == host_platform() and host.system() != "Windows":
        for name in ("cc", "gcc", "clang"):
            if compiler := shutil.which(name):
                return [compiler]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-target", platform.zig]
    raise input_error(
        f"no compiler for '{platform.name}'; pip install 'wm-drake[fmu]' installs ziglang, which "
        "compiles for all platforms",
        where="platform",
    )


def _program() -> str:
    return f"wm-drake {importlib.metadata.version('wm-drake')}"


def _token(model: ExportedModel, code: Mapping[str, str], fmi: int) -> str:
    """Return the token of an FMU: equal for equal contents."""
    digest = hashlib.sha256(f"{fmi} {model.step} {model.variables}".encode())
    for part in (
        model.numbers.tobytes(),
        model.constants.tobytes(),
        *map(str.encode, code.values()),
    ):
        digest.update(part)
    return str(uuid.UUID(bytes=digest.digest()[:16]))


def _library(contents: Mapping[str, bytes], platform: Platform, compiler: list[str]) -> bytes:
    """Return the shared library of a platform.

    Raises:
        InputError: the compiler fails.
    """
    with temporary_folder() as place:
        for name, content in contents.items():
            (place / name).write_bytes(content)
        library = place / f"{IDENTIFIER}{platform.suffix}"
        objects = sorted(str(file) for file in place.glob("*.o"))
        kind = ["-shared", "-O2", "-std=c11", "-fvisibility=hidden", *platform.linking]
        files = [f"-I{place}", str(WRAPPER), *objects, "-o", str(library), "-lm"]
        command = [*compiler, *kind, *files]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=place)
        if done.returncode or not library.is_file():
            reason = shortened(" ".join(done.stderr.split()), LONGEST_REASON)
            raise input_error(f"the compiler failed: {reason}", where=f"platform {platform.name}")
        return library.read_bytes()


def _machine_header(model: ExportedModel, token: str, fmi: int) -> str:
    """Return the C header with the numbers of a machine."""
    at, begins = model.plan.at, model.plan.elements.begins
    limits = [v for v in model.variables if v.minimum is not None or v.maximum is not None]
    rows = [
        f'{{{v.index}, {_c(v.minimum, "-HUGE_VAL")}, {_c(v.maximum, "HUGE_VAL")}, "{v.name}"}}'
        for v in limits
    ]
    by_index = {v.index: v.nominal or 1.0 for v in model.variables}
    nominals = [by_index[k] for k in model.states]
    defines = {
        "FMI_VERSION": fmi,
        "WM_TOKEN": f'"{token}"',
        "WM_SIZE": at.size,
        "WM_FOLLOWS_SPEED": int(model.plan.follows_speed),
        "WM_SPEED": at.speed,
        "WM_ACCELERATION": at.acceleration,
        "WM_IN_FORCE": at.in_force,
        "WM_STATE": at.state,
        "WM_RATE": at.rate,
        "WM_DRUM_RATE": DRUM_RATE,
        "WM_STATES": len(model.states),
        "WM_STEP": _c(model.step),
        "WM_LARGEST_ANGLE": _c(LARGEST_ANGLE),
        "WM_LARGEST_SHIFT": _c(LARGEST_DISPLACEMENT),
        "WM_CABINET": at.state + begins.cabinet if model.setup.cabinet else 0,
        "WM_LARGEST_TILT": _c(LARGEST_TILT),
        "WM_LIMITS": len(limits),
    }
    lines = [f"#define {name} {value}" for name, value in defines.items()]
    fast = " || ".join(f"({p.condition})" for p in PLATFORMS.values() if p.fast)
    lines += [f"#if {fast}", "#define WM_FAST 1", "#else", "#define WM_FAST 0", "#endif"]
    lines += [
        f"static const double wm_start[] = {{{', '.join(map(_c, model.numbers))}}};",
        f"static const double wm_constants[] = {{{', '.join(map(_c, model.constants))}}};",
        f"static const unsigned wm_states[] = {{{', '.join(map(str, model.states))}}};",
        f"static const double wm_nominals[] = {{{', '.join(map(_c, nominals))}}};",
        f"static const unsigned char wm_access[] = {{{', '.join(map(str, _access(model)))}}};",
        "static const struct { unsigned index; double least, most; const char *name; }",
        f"    wm_limits[] = {{{', '.join(rows)}}};",
    ]
    return "\n".join(lines) + "\n"


def _access(model: ExportedModel) -> list[int]:
    """Return for each number of an instance whether importers may read and set it."""
    access = [0] * model.plan.at.size
    access[0] = READABLE | SETTABLE
    for variable in model.variables:
        is_set = variable.causality in ("input", "parameter")
        access[variable.index] = READABLE | (SETTABLE if is_set else 0)
    return access


def _c(value: float | None, none: str = "0.0") -> str:
    """Return a number as a constant of C that has all its digits."""
    return none if value is None else float(value).hex() if value else "0.0"


def _reference(model: ExportedModel) -> bytes:
    """Return the displacements of a run of the engine through the spin profile, as CSV.

    The masses stay, as those of an FMU do until an importer changes them.
    """
    parameters = model.setup.parameters
    profile, load = parameters.profile, parameters.loads[model.load]
    load = load.with_masses(load.masses(np.ones(len(load.wet))))
    case = Case("reference", load, profile, model.plan.gasket >= 0)
    record = simulate(parameters, case, step=model.step, integrator="runge_kutta")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [f"displacement.{name}" for name in record.sensor.values]
    writer.writerow(["time", "drum_speed", *names])
    time = record.time.values
    speed = np.interp(time, profile.time, profile.speed)
    for row in np.column_stack([time, speed, record.displacement.values]):
        writer.writerow([f"{number:.12g}" for number in row])
    return text.getvalue().encode()


def _documentation(model: ExportedModel, fmi: int) -> bytes:
    """Return the page that describes the FMU."""
    about = {"parameters": model.setup.parameters, "program": _program()}
    return filled(DOCUMENTATION, {}, model=model, fmi=fmi, **about).encode()


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """Return the content of an FMU, which is an archive of files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, file in files.items():
            archive.writestr(name, file)
    return content.getvalue()


SIMULATED = 5.0
"""Simulated time of a measurement. [s]"""
COMMUNICATION_STEP = 0.01
"""Communication step of a measurement. [s]"""


def real_time_factor(path: Path) -> float:
    """Return how many times faster than real time an FMU runs, in processor time of one core.

    The drum stands: the number of operations does not depend on the motion.
    """
    import fmpy  # half a second to import
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    description = fmpy.read_model_description(str(path))
    is_second = description.fmiVersion == "2.0"
    folder = fmpy.extract(str(path))
    try:
        machine = (FMU2Slave if is_second else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="machine",
        )
        machine.instantiate()
        if is_second:
            machine.setupExperiment(startTime=0.0)
        machine.enterInitializationMode()
        machine.exitInitializationMode()
        begin = time.process_time()
        for k in range(round(SIMULATED / COMMUNICATION_STEP)):
            machine.doStep(k * COMMUNICATION_STEP, COMMUNICATION_STEP)
        duration = time.process_time() - begin
        machine.terminate()
        machine.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return SIMULATED / duration
