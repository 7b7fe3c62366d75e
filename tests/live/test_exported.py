"""The page of an exported machine: what it has, what it refuses, and that no name is markup."""

import base64
import gzip
import hashlib
import json
import re

import pytest
from typer.testing import CliRunner

import wm_drake as wm
from wm_drake.cli import app
from wm_drake.errors import InputError
from wm_drake.live import exported
from wm_drake.live.exported import bundled, export_page
from wm_drake.parameters import SpinProfile
from wm_drake.report.scripts import Scripts
from wm_drake.simulation.cases import Case


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "no/folder/machine.html"], "there is no folder"),
        (["--out", "machine.txt"], "must end with .html"),
        (["--load", "midle"], "no load 'midle'"),
        (["--machine", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_errors_are_one_message_and_nothing_is_written(tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["export", "page", *options])
    assert isinstance(result.exception, InputError)  # which the command prints, with exit code 2
    assert message in str(result.exception)
    assert not list(tmp_path.iterdir())


def test_a_folder_in_place_of_the_file_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(exported, "page_data", lambda parameters: SMALLEST)
    (tmp_path / "machine.html").mkdir()
    with pytest.raises(InputError, match="is not a regular file"):
        export_page(wm.load_machine("reference"), tmp_path / "machine.html")
    assert [path.name for path in tmp_path.iterdir()] == ["machine.html"]


SMALLEST = {"machine": {"numbers": []}}


@pytest.mark.parametrize("name", ["</script><b>x", "<!--<script>", "a" * 10_000, "\u2028'\"&"])
def test_no_text_of_a_machine_ends_its_data(tmp_path, monkeypatch, name):
    monkeypatch.setattr(exported, "page_data", lambda parameters: SMALLEST | {"name": name})
    export_page(wm.load_machine("reference"), tmp_path / "machine.html", given=name)
    text = (tmp_path / "machine.html").read_text(encoding="utf-8")
    data = re.search(r'id="machine-data">(.*?)</script>', text, re.DOTALL)[1]
    assert "<" not in data
    assert json.loads(data)["name"] == json.loads(data)["given"] == name


def test_a_bundle_has_each_module_once_before_those_that_import_it():
    text = bundled("main", {"server": "page_engine"})
    names = re.findall(r"^modules\.(\w+) = ", text, re.MULTILINE)
    assert len(names) == len(set(names))
    assert names[-1] == "main"
    assert names.index("dom") < names.index("curves")
    assert "fetch(" not in text
    assert not re.search(r"^(import|export) ", text, re.MULTILINE)


def test_the_page_reaches_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(exported, "page_data", lambda parameters: SMALLEST)
    export_page(wm.load_machine("reference"), tmp_path / "machine.html")
    text = (tmp_path / "machine.html").read_text(encoding="utf-8")
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    assert "default-src &#x27;none&#x27;" in text


def test_a_report_allows_the_page_in_its_frame_and_nothing_of_its_texts(monkeypatch, reference):
    bad = "sha256-bad' https://elsewhere"
    monkeypatch.setattr(exported, "page_data", lambda parameters: SMALLEST | {"name": bad})
    page, _ = exported.page_text(reference)
    scripts = Scripts()
    packed = scripts.framed(page)
    assert gzip.decompress(base64.b64decode(packed)).decode() == page
    script = re.search(r'<script type="module">(.*?)</script>', page, re.DOTALL)[1]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in scripts.policy()
    assert "bad" not in scripts.policy()
    assert "frame-src blob:" in scripts.policy()
    assert "frame-src" not in Scripts().policy()


def test_live_needs_one_variant():
    with pytest.raises(InputError, match="--live"):
        wm.run_study("spin", "reference", compare_gasket=True, live=True, quiet=True)


def test_the_profile_of_a_command_is_that_of_its_page(monkeypatch, reference):
    monkeypatch.setattr(exported, "page_data", lambda parameters: {"of": parameters})
    monkeypatch.setattr(exported, "_page", lambda data: data)
    slow = SpinProfile(time=(0.0, 10.0), speed=(0.0, 10.0))
    case = Case("mine", reference.loads["middle"], slow, gasket=False)
    data = exported.page_of_cases(reference, [case], "reference", ["step='1 ms'"])
    assert data["of"].profile == slow
    assert data["of"].loads == {"mine": reference.loads["middle"]}
    assert data["of"].measured == ()
    assert data["begin"] == {"gasket": False}
