"""Files are written as a whole or not at all, and what exists stays unless it may be replaced."""

import ast
import re
import resource
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from read_only import with_read_only

import wm_drake
from wm_drake.errors import InputError
from wm_drake.export import fmu
from wm_drake.live import exported
from wm_drake.written_files import write_files

PACKAGE = Path(wm_drake.__file__).parent


@contextmanager
def full_disk(largest):
    """Let no file of this process grow beyond a size while the block runs. [byte]"""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    sys.dont_write_bytecode = True  # Python 3.11 leaves files of byte code that are cut short
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = False


COMMANDS = {
    "machine new mine": ["mine.yaml"],
    "machine new mine --springs 2": ["mine.sdf", "mine.yaml"],
    "machine check reference --page page.html": ["page.html"],
    "export page --out page.html": ["page.html"],
    "export fmu --out machine.fmu": ["machine.fmu"],
}
"""All commands that write files by themselves, not in a result folder."""


@pytest.fixture
def quick_exports(monkeypatch):
    """Let exports write files of some size without compiling a machine."""
    monkeypatch.setattr(exported, "page_data", lambda _: {"machine": {"numbers": []}})
    machine = SimpleNamespace(plan=None, variables=[], states=[])
    contents = SimpleNamespace(about=lambda _: {}, libraries=lambda _: {"x": bytes(range(256)) * 9})
    for name, value in {
        "exported_model": machine, "kernel_code": {}, "_Contents": contents, "real_time_factor": 1.0
    }.items():  # fmt: skip
        monkeypatch.setattr(fmu, name, lambda *_, value=value, **__: value)


def names():
    return sorted(path.name for path in Path().iterdir())


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.usefixtures("quick_exports")
def test_a_full_disk_leaves_nothing_and_what_exists_stays(command, wm_drake):
    assert wm_drake(command).code == 0
    assert names() == COMMANDS[command]
    written = list(map(Path, names()))
    for path in written:
        path.unlink()
    with full_disk(200):
        refused = wm_drake(command)
    where, _, reason = refused.messages[-1].partition(": ")
    assert (refused.code, reason) == (2, "cannot be written to: File too large")
    assert where in COMMANDS[command]
    assert not names()
    for path in written:
        path.write_text("notes of a colleague", encoding="utf-8")
        refused = wm_drake(command)
        assert (refused.code, path.read_text()) == (2, "notes of a colleague")
        assert refused.messages[-1].startswith(f"{path}: exists already; ")
        if "--overwrite" in refused.err:
            with full_disk(200):
                assert wm_drake(f"{command} --overwrite").code == 2
            assert path.read_text() == "notes of a colleague"
            assert wm_drake(f"{command} --overwrite").code == 0
            assert path.stat().st_size > 200
        path.unlink()
        assert set(names()) <= set(COMMANDS[command])


def test_a_pair_is_written_as_a_whole_and_links_and_rights_stay(tmp_path):
    first, second, link = tmp_path / "a.sdf", tmp_path / "b.yaml", tmp_path / "link.yaml"
    second.write_text("old")
    second.chmod(0o640)
    link.symlink_to(second)
    with pytest.raises(InputError, match=r"b\.yaml: exists already; add --overwrite"):
        write_files({first: "1", second: "2"}, replace=False)
    assert (second.read_text(), first.exists()) == ("old", False)
    write_files({first: "1", link: "2"}, replace=True)
    assert (second.read_text(), link.is_symlink()) == ("2", True)
    assert second.stat().st_mode & 0o777 == 0o640
    for path, reason in {"/dev/null": "not a regular", str(tmp_path): "not a regular", f"{second}/x": "Not a dir"}.items():  # fmt: skip
        with pytest.raises(InputError, match=reason):
            write_files({Path(path): "x"}, replace=True)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_file_that_appears_meanwhile_stays(tmp_path):
    first, second = tmp_path / "a.sdf", tmp_path / "b.yaml"

    def appears(_):
        second.write_text("of another process")

    with pytest.raises(InputError, match=r"b\.yaml: exists already"):
        write_files({first: "1", second: "2"}, replace=False, check=appears)
    assert [path.name for path in tmp_path.iterdir()] == ["b.yaml"]
    assert second.read_text() == "of another process"


REFUSED = """
from pathlib import Path
from wm_drake.errors import InputError
from wm_drake.written_files import check_new
from wm_drake.studies.result_folder import check_is_folder
for check in (lambda: check_is_folder(Path("out")), lambda: check_new([Path("m")], replace=True)):
    try:
        check()
    except InputError as error:
        print(error)
"""


def test_a_read_only_file_system_is_named(tmp_path):
    before = with_read_only(tmp_path)
    command = [*before, "sh", "-c", 'cd "$0" && exec "$@"', tmp_path, sys.executable, "-c", REFUSED]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    reason = "cannot be written to: Read-only file system"
    assert printed.splitlines() == [f"out: {reason}", f"m: {reason}"]


INTO_TEMPORARY = {
    "compiler/cache_files", "compiler/claims", "compiler/kept", "simulation/first_call",  # compiled code
    "export/fmu", "model/sdf_files",  # a temporary folder
    "written_files", "studies/result_folder",  # the two homes
    "studies/archive",  # a text in memory
    "report/publication", "studies/answer", "studies/run", "studies/spin/study", "studies/study",
    "studio/jobs",  # the output of a process while it runs
}  # fmt: skip
"""Modules that write by themselves; those of reports into the folder of `result_folder`."""


WRITERS = {"write_text", "write_bytes", "to_csv", "to_netcdf", "savefig", "savetxt", "savez"}


def test_all_other_modules_write_by_one_home():
    writers = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        nodes = (
            ast.walk(ast.parse(text))
            if re.search(r"open\(|\.write_|\.to_|save|ZipFile", text)
            else ()
        )
        for node in (node for node in nodes if isinstance(node, ast.Call)):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            modes = [a.value for a in node.args if isinstance(a, ast.Constant)]
            opens = name in ("open", "ZipFile") and any(
                re.fullmatch("[wax]b?", str(mode)) for mode in modes
            )
            if opens or name in WRITERS:
                writers.add(path.relative_to(PACKAGE).with_suffix("").as_posix())
    assert writers <= INTO_TEMPORARY
