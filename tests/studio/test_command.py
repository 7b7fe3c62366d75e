"""The command `wm-drake studio`: what it refuses before it serves anything."""

import socket
from importlib.util import find_spec

import pytest


def test_missing_extra_is_named(wm_drake, monkeypatch):
    monkeypatch.setattr(
        "wm_drake.cli.studio.find_spec", lambda name: None if name == "uvicorn" else find_spec(name)
    )
    ended = wm_drake("studio", "--no-browser")
    assert ended.code == 2
    assert ended.messages == ["studio: needs uvicorn: pip install 'wm-drake[studio]'"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--machine", "nowhere.yaml"], "no such file"),
        (["--folder", "file"], "cannot be written to"),
    ],
)
def test_wrong_input_is_told(wm_drake, tmp_path, options, words):
    (tmp_path / "file").write_text("")
    ended = wm_drake("studio", "--no-browser", *options)
    assert ended.code == 2
    assert words in ended.err


def test_port_in_use_is_told(wm_drake):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        ended = wm_drake("studio", "--no-browser", "--port", port)
    assert ended.code == 2
    assert ended.messages == [f"--port: {port}: Address already in use"]
