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
    venv.create(home, with_pip=False, symlinks=True)
    python = home / "bin" / "python"
    run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-deps",
        "--no-index",
        wheel,
        cwd=home,
    )
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
        ("wm_drake", "data/machines/*"),
        ("wm_drake", "data/cycles/*"),
        ("wm_drake", "data/components/*"),
        ("wm_drake", "data/tolerances/*"),
        ("wm_drake", "data/designs/*"),
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


def test_command_runs_a_rig_and_writes_a_page(python, tmp_path):
    """Compile code of the wheel, less than a whole machine needs, and write a page."""
    command = python.parent / "wm-drake"
    rig = ["rig", "damper", "--component", "mstv_damper", "-f", "1 Hz", "-a", "1 mm"]
    run(command, *rig, "--out", "out", cwd=tmp_path)
    assert {"report.html", "run.json"} < {path.name for path in (tmp_path / "out").iterdir()}
