"""Files of compiled code: a damaged one is compiled anew, with one line of notice."""

import os
import resource
import runpy
import subprocess
import sys

import pytest
from read_only import with_read_only

from wm_drake.compiler import cache_files, compilation

LAW = """
from wm_drake.compiler.compilation import law

@law
def spring(x, k):
    return -k * x

print(spring(2.0, 3.0), sum(spring.stats.cache_hits.values()))
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run a law in a process of its own, with a cache of its own."""
    folder = tmp_path_factory.mktemp("law")
    (folder / "spring.py").write_text(LAW, encoding="utf-8")

    def run(cache, largest=resource.RLIM_INFINITY, before=(), **variables):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), **variables}
        environment["PYTHONPATH"] = os.pathsep.join(sys.path)
        ended = subprocess.run(
            [*before, sys.executable, folder / "spring.py"],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
            preexec_fn=lambda: resource.setrlimit(
                resource.RLIMIT_FSIZE, (largest, resource.RLIM_INFINITY)
            ),
        )
        return ended.stdout.split(), ended.stderr.splitlines()

    return run


def changed(kind, content):
    if kind == "flipped":
        middle = len(content) // 2
        return content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :]
    return content[: {"empty": 0, "half": len(content) // 2}[kind]]


@pytest.fixture
def load(tmp_path, monkeypatch, capsys):
    """Return a function that loads a law in this process, with a cache of its own in `tmp_path`."""
    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path / "cache"))

    def load(folder, text=LAW):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "spring.py").write_text(text, encoding="utf-8")
        cache_files.say_once.cache_clear()
        runpy.run_path(str(folder / "spring.py"))
        printed, notice = capsys.readouterr()
        return printed.split(), notice.splitlines()

    return load


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_file_is_compiled_anew(load, tmp_path, suffix):
    assert load(tmp_path) == (["-6.0", "0"], [])
    for kind in ("empty", "half", "flipped"):
        (path,) = tmp_path.rglob(f"spring*.{suffix}")
        path.write_bytes(changed(kind, path.read_bytes()))
        result, notice = load(tmp_path)
        assert result == ["-6.0", "0"], kind
        assert len(notice) == 1
        assert notice[0].endswith("is damaged; it is compiled anew")
    assert load(tmp_path) == (["-6.0", "1"], [])


def test_cache_that_cannot_be_written_is_left_out(run, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for home, hits, words in (
        ("file", "0", "compiled code is not kept ("),
        ("home", "0", "compiled code is kept in "),
        ("home", "1", "compiled code is kept in "),
    ):
        result, (line,) = run(tmp_path / "file", HOME=str(tmp_path / home))
        assert result == ["-6.0", hits]
        assert line.startswith(words)


def test_disk_that_is_full_leaves_the_cache_out(run, tmp_path):
    result, notice = run(tmp_path, largest=1000)
    assert result == ["-6.0", "0"]
    (line,) = notice
    assert (
        line == f"compiled code cannot be kept in {next(tmp_path.glob('*/law*'))} (File too large)"
    )
    assert run(tmp_path) == (["-6.0", "0"], [])
    assert run(tmp_path) == (["-6.0", "1"], [])


def test_a_filled_cache_that_is_read_only_is_read(run, tmp_path):
    cache, home = tmp_path / "cache", tmp_path / "home"
    cache.mkdir()
    before = with_read_only(cache)
    assert run(cache) == (["-6.0", "0"], [])
    assert run(cache, before=before, HOME=str(home)) == (["-6.0", "1"], [])
    for path in cache.rglob("spring*"):
        path.unlink()
    assert run(cache, before=before, HOME=str(home)) == (["-6.0", "0"], [])  # written at home
    assert run(cache, before=before, HOME=str(home)) == (["-6.0", "1"], [])
    assert run(cache, before=before, HOME=str(cache)) == (["-6.0", "0"], [])  # nowhere to write
    assert not list(cache.rglob("spring*"))


def test_checkouts_of_the_same_sources_share_their_files(load, tmp_path, monkeypatch):
    def loaded(checkout, text=LAW):
        monkeypatch.setattr(cache_files, "_PACKAGE", tmp_path / checkout)
        return load(tmp_path / checkout / "laws", text)

    assert loaded("one") == (["-6.0", "0"], [])
    assert loaded("other") == (["-6.0", "1"], [])
    assert loaded("other", LAW.replace("-k", "k")) == (["6.0", "0"], [])
