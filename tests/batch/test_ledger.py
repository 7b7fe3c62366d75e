"""The ledger keeps results through kills and refuses other files with a message."""

import os
import random
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wm_drake.batch.ledger import FORMAT, LedgerError, key_of, open_ledger
from wm_drake.errors import InputError, WmDrakeError
from wm_drake.parameters import with_value

IDENTITY = {"study": "test", "trials": "1000"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "ledger.sqlite"


def filled(path, count=3):
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        for index in range(count):
            ledger.put(
                key_of(index=index),
                {"value": float(index), "grid": np.full((2, 3), index)},
                note=f"run {index}",
            )
    return path


def test_results_are_the_same_after_reopening(path):
    values = {
        "scalar": 0.1,
        "grid": np.arange(6.0).reshape(2, 3) / 7,
        "odd": [np.nan, np.inf, -0.0],
        "none": np.empty((0, 3)),
    }
    with open_ledger(path, IDENTITY) as ledger:
        ledger.put("a", values, "a note\nof two lines")
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        result = ledger.get("a")
        assert list(result.values) == list(values)
        for name, value in values.items():
            np.testing.assert_array_equal(result.values[name], value)
            assert result.values[name].shape == np.shape(value)
        assert np.signbit(result.values["odd"][2])
        assert result.note == "a note\nof two lines"
        assert ("a" in ledger, "b" in ledger, len(ledger)) == (True, False, 1)
        with pytest.raises(KeyError):
            ledger.get("b")


def test_first_result_of_a_key_stays(path):
    with open_ledger(path, IDENTITY) as ledger:
        ledger.put("a", {"x": 1.0})
        ledger.put("a", {"x": 2.0})
        assert ledger.get("a").values["x"] == 1.0


def test_threads_fill_it_together(path):
    with open_ledger(path, IDENTITY) as ledger:
        work = [
            lambda i=i: [ledger.put(f"{i}-{n}", {"x": i + n}) for n in range(50)] for i in range(8)
        ]
        threads = [threading.Thread(target=w) for w in work]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(ledger) == 400
        assert ledger.get("3-7").values["x"] == 10.0


KILLED = """
import sys
from pathlib import Path
from wm_drake.batch.ledger import open_ledger
with open_ledger(Path(sys.argv[1]), {"study": "test", "trials": "1000"}) as ledger:
    for number in range(10**9):
        ledger.put(str(number), {"x": number})
        print(number, flush=True)
"""


def test_nothing_reported_is_lost_by_a_kill(path):
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout:
            if int(line) >= 300:
                break
        with (
            pytest.raises(InputError, match="in use by another study"),
            open_ledger(path, IDENTITY, resume=True),
        ):
            pass
        process.send_signal(signal.SIGKILL)
        last = max([300, *map(int, process.stdout.read().split())])
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        assert all(ledger.get(str(number)).values["x"] == number for number in range(last + 1))


def test_unfinished_study_needs_resume_and_a_finished_one_does_not(path):
    filled(path)
    with pytest.raises(
        InputError,
        match=r"ledger.sqlite: holds 3 finished results of this study; go on .* --resume",
    ):
        open_ledger(path, IDENTITY).__enter__()
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        ledger.mark_finished()
    with open_ledger(path, IDENTITY) as ledger:
        assert len(ledger) == 3


def refusal(path, identity=IDENTITY):
    before = path.read_bytes()
    with pytest.raises(InputError) as caught, open_ledger(path, identity, resume=True):
        pass
    assert path.read_bytes() == before
    assert len(str(caught.value).splitlines()) == 1
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_another_study_is_refused_by_what_differs(path):
    filled(path)
    text = refusal(path, IDENTITY | {"trials": "500"})
    message = "belongs to another study or version: trials is '1000' in the ledger and '500' now"
    assert message in text
    text = refusal(path, IDENTITY | {"sources": "abc"})
    assert "sources is '' in the ledger and 'abc' now" in text


def test_another_layout_is_refused(path, monkeypatch):
    filled(path)
    monkeypatch.setattr("wm_drake.batch.ledger.FORMAT", "wm_drake ledger 2")
    assert f"format is '{FORMAT}' in the ledger and 'wm_drake ledger 2' now" in refusal(path)


def test_other_databases_and_other_files_are_refused(path):
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE recipes (name TEXT)")
    connection.close()
    assert "is a database but not a ledger" in refusal(path)
    path.write_text("not a database, but long enough to be looked at as one" * 20)
    assert "is damaged" in refusal(path)


def read_all(path, count):
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        return [ledger.get(key_of(index=index)) for index in range(count)]


def test_truncated_file_is_refused(path):
    filled(path, 2000)
    path.write_bytes(path.read_bytes()[:20_000])
    assert "is damaged" in refusal(path)


def test_changed_digit_is_found(path):
    filled(path)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE results SET numbers = zeroblob(56) WHERE note = 'run 1'")
    connection.close()
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        assert ledger.get(key_of(index=2)).values["value"] == 2.0
        with pytest.raises(LedgerError, match="is damaged"):
            ledger.get(key_of(index=1))


def test_folder_that_is_not_there_or_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (
        tmp_path / "nowhere" / "ledger.sqlite",
        tmp_path / "file" / "ledger.sqlite",
        tmp_path,
    ):
        with pytest.raises(InputError, match="cannot be written to"):
            open_ledger(path, IDENTITY).__enter__()


@pytest.fixture
def closed_folder():
    """Provide a folder without write permission; works for root as well."""
    folder = Path(tempfile.mkdtemp())
    yield folder
    os.seteuid(os.getuid())
    folder.chmod(0o700)
    shutil.rmtree(folder)


def close(folder):
    for path in folder.iterdir():
        path.chmod(0o444)
    folder.chmod(0o555)
    if os.getuid() == 0:
        os.seteuid(65534)  # nobody


def test_read_only_folder_and_ledger_are_refused(closed_folder):
    path = filled(closed_folder / "ledger.sqlite")
    close(closed_folder)
    assert "cannot be written to" in refusal(path)
    assert "damaged" not in refusal(path)
    with pytest.raises(InputError, match="cannot be written to"):
        open_ledger(closed_folder / "new.sqlite", IDENTITY).__enter__()


FULL = """
import resource, sys
from pathlib import Path
from wm_drake.batch.ledger import LedgerError, open_ledger
with open_ledger(Path(sys.argv[1]), {"study": "test", "trials": "1000"}) as ledger:
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
    try:
        for number in range(10_000):
            ledger.put(str(number), {"x": [number] * 10})
    except LedgerError as error:
        print(number, error)
"""


def test_full_disk_is_reported_and_loses_nothing(path):
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY
    ended = subprocess.run(
        [sys.executable, "-c", FULL, str(path)], capture_output=True, text=True, check=True
    )
    number, message = ended.stdout.split(maxsplit=1)
    assert f"is the disk full? Free some space. Its {number} results are kept" in message
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        assert len(ledger) == int(number) > 10
        assert all(ledger.get(str(n)).values["x"][0] == n for n in range(int(number)))


@given(st.dictionaries(st.text(), st.floats() | st.integers() | st.text() | st.lists(st.floats())))
def test_key_depends_on_content_not_on_order(parts):
    assert key_of(parts=parts) == key_of(parts=dict(reversed(parts.items())))
    assert key_of(parts=parts) != key_of(parts=parts | {"one more": 1})


def test_key_sees_the_last_digit(reference):
    damping = reference.gasket.damping_x
    same = with_value(reference, "gasket.damping_x", damping)
    near = with_value(reference, "gasket.damping_x", float(np.nextafter(damping, 0.0)))
    assert key_of(p=reference) == key_of(p=same) != key_of(p=near)
    assert key_of(a=np.array([1.0, 2.0])) == key_of(a=[1.0, 2.0])
    with pytest.raises(TypeError, match="Path"):
        key_of(a=Path())


def test_flipped_bit_is_found_or_harmless(path):
    count = 40
    filled(path, count)
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        ledger.mark_finished()
    content, results = path.read_bytes(), read_all(path, count)
    refused = 0
    for number in range(600):
        random_ = random.Random(number)
        damaged = bytearray(content)
        damaged[random_.randrange(len(damaged))] ^= 1 << random_.randrange(8)
        for end in ("-wal", "-shm"):
            path.with_name(path.name + end).unlink(missing_ok=True)
        path.write_bytes(damaged)
        try:
            found = read_all(path, count)
        except WmDrakeError:
            refused += 1
            continue
        for one, other in zip(found, results, strict=True):
            assert one.note == other.note
            assert all(
                np.array_equal(one.values[n], v, equal_nan=True) for n, v in other.values.items()
            )
    assert refused > 100


@pytest.mark.parametrize("numbers", ["'abc'", "x'00'", "7"])
def test_cell_of_another_type_is_found(path, numbers):
    filled(path)
    with sqlite3.connect(path) as connection:
        connection.execute(f"UPDATE results SET numbers = {numbers} WHERE note = 'run 1'")
    connection.close()
    with (
        open_ledger(path, IDENTITY, resume=True) as ledger,
        pytest.raises(LedgerError, match="is damaged"),
    ):
        ledger.get(key_of(index=1))
