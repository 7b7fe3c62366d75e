"""The wheel has all files that the command needs, and works away from the checkout."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from every_page import write_inputs_of_studies
from typer.main import get_command

from wm_drake.cli import app

CHECKOUT = Path(__file__).parents[1]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("git") is None or not (CHECKOUT / ".git").exists(), reason="needs a git checkout"),
]  # fmt: skip


def run(*command, cwd):
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    }
    ended = subprocess.run(
        [*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return a wheel built from a copy of what git has or would add, without old build folders."""
    copy = tmp_path_factory.mktemp("copy")
    listed = run(
        "git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", cwd=CHECKOUT
    )
    for name in filter(None, listed.split("\0")):
        if (CHECKOUT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(CHECKOUT / name, copy / name)
    run(sys.executable, "-m", "build", "--wheel", "--outdir", copy / "dist", ".", cwd=copy)
    (path,) = (copy / "dist").glob("*.whl")
    return path


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Return the interpreter of an environment with the wheel; it borrows our dependencies."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=True, symlinks=True)
    python = home / "bin" / "python"
    run(python, "-m", "pip", "install", "--no-deps", "--no-index", wheel, cwd=home)
    own = Path(
        run(
            python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=home
        ).strip()
    )
    borrowed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (own / "borrowed.pth").write_text("".join(f"{folder}\n" for folder in borrowed))
    return python


def test_wheel_holds_the_data_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    for folder, pattern in (
        ("sdf", "*"),
        ("wm_drake", "data/**/*"),
        ("wm_drake", "export/c/*.c"),
        ("wm_drake", "live/static/*"),
        ("wm_drake", "**/*.py"),
        ("wm_drake", "**/*.html"),
        ("wm_drake", "**/*.js"),
        ("wm_drake", "**/*.css"),
    ):
        wanted = [path for path in (CHECKOUT / folder).glob(pattern) if path.is_file()]
        prefix = "wm_drake/" if folder == "sdf" else ""
        assert wanted
        assert [
            path for path in wanted if prefix + path.relative_to(CHECKOUT).as_posix() not in names
        ] == []
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"wm_drake"}
    assert [name for name in names if name.endswith((".pyc", ".nbi", ".nbc"))] == []
    assert "wm_drake/py.typed" in names
    assert [name for name in names if name.endswith(".md")] == ["wm_drake/sdf/README.md"]


def test_package_and_bodies_come_from_the_wheel(python, tmp_path):
    code = (
        "import wm_drake, wm_drake.model.bodies as b; print(wm_drake.__file__); "
        "print(b.SDF_FOLDER); print(b.sdf_path('oscillating_group.sdf')); "
        "wm_drake.build_machine(wm_drake.load_machine('reference'))"
    )
    for line in run(python, "-c", code, cwd=tmp_path).split():
        assert Path(line).is_relative_to(python.parents[1])
        assert Path(line).exists()


EACH_COMMAND = """
machine list --json
machine schema file
cite --format bibtex
machine new mine --tub-mass '40 kg' --springs 2
machine check mine.yaml
machine show mine.yaml
rig damper --component mstv_damper -f '1,5 Hz' -a '0.3,1 mm' --out damper
identify damper damper/loop_*.csv --law mstv --quick --out damper_fit
rig bushing --machine free_stroke --axis axial -f '1,5 Hz' -a '0.4 mm' --out bushing
identify bushing bushing/loop_*.csv --machine free_stroke --axis axial --law voigt --out bushing_fit
rig gasket --axis axial -f '1,5 Hz' -a '1 mm' --out ring
identify gasket ring/loop_*.csv --axis axial --law voigt --out ring_fit
gasket curves folded --points 2 --elements 6 --around 3 --axial '1 mm' --radial '1 mm' --tilt '1 deg' --twist '1 deg' --out curves
spin --load middle --out spin
record channels spin/record_middle.nc
record orders spin/record_middle.nc --out orders
record compare spin/record_middle.nc --load middle --channels 'Xr=displacement(Xr)' --out compare
calibrate spin/record_middle.nc --load middle --channels 'Xr=displacement(Xr)' --unknown 'damper_types.friction.friction_force=(30, 40) N' --quick --out record_calibrate
calibrate --machine short.yaml --vary free.yaml --targets measured.csv --quick --out calibrate
verdict short.yaml --samples 16 --out verdict
export fmu --load middle --out machine.fmu
export page --load middle --out machine.html
study balancer --quick --place '0 mm' --damping '100 %' --release '80 rpm' --to '110 rpm' --rate '80 rpm/s' --out balancer
study cycle --profile short_cycle.yaml --out cycle
study design gasket --quick --profile short_cycle.yaml --out design
study detect --quick --out detect
study drive --quick --load middle --out drive
study gasket --quick --response D --profile short_cycle.yaml --archive gasket.zip --out gasket
rerun gasket.zip --out gasket_again
study gasket-damping --mesh 20 --record middle=spin/record_middle.nc --out gasket_damping
study gasket-geometry --quick --profile short_cycle.yaml --out gasket_geometry
study modes --quick --out modes
study next short.yaml --quick --vary free.yaml --out next
study response --quick --load middle --out response
study spin-cycle --quick --profile eight_regions.yaml --out spin_cycle
study spin-identify --quick --case 2 --unknown 'gasket.stiffness_y=(1, 4) N/mm' --profile short_cycle.yaml --out spin_identify
study tolerance laundry --samples 32 --subset 0 --profile short_cycle.yaml --out tolerance
"""  # fmt: skip
STUDIO = (
    "wm-drake studio --no-browser > studio.txt & "
    "until grep -q http studio.txt; do kill -0 $!; sleep 1; done; kill $!; wait $! || test $? = 143"
)
IN_ONE_PROCESS = """
import glob, shlex, sys
from wm_drake.__main__ import open_streams
open_streams()
from wm_drake.cli import main

for line in sys.argv[1].split("\\n"):
    print(line, file=sys.stderr)
    words = [sorted(glob.glob(word)) if "*" in word else [word] for word in shlex.split(line)]
    sys.argv = ["wm-drake", *sum(words, [])]
    try:
        main()
    except SystemExit as end:
        if end.code:
            raise
"""
"""Imports take most of the time of a command."""
WITHOUT_OUTPUT = 'exec "$0" "$@" <&- >&-'
"""A scheduler may start programs so; no result may depend on what is printed."""


def names_of_commands(group, words=()):
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        if hasattr(command, "list_commands"):
            yield from names_of_commands(command, (*words, name))
        else:
            yield " ".join((*words, name))


def test_each_command_runs_from_an_empty_folder(python, tmp_path, monkeypatch):
    names = set(names_of_commands(get_command(app)))
    run_here = {name for name in names if f"\n{name} " in f"\n{EACH_COMMAND}"}
    assert run_here == names - {"studio"}
    write_inputs_of_studies(tmp_path)
    script = (python, "-c", IN_ONE_PROCESS, EACH_COMMAND.strip())
    run("bash", "-c", WITHOUT_OUTPUT, *script, cwd=tmp_path)
    monkeypatch.setenv("PATH", str(python.parent), prepend=os.pathsep)
    run("bash", "-euxc", STUDIO, cwd=tmp_path)
