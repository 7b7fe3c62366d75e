"""A warning of `wm-drake study drive`, which runs many batches."""

from pathlib import Path

import pytest

PROFILE = "time: (0, 2, 3) s\nspeed: (60, 150, 150) rpm\n"


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a small study in a folder, with extra arguments."""
    Path("p.yaml").write_text(PROFILE)
    small = ("--load", "middle", "--torques", "2", "--unbalances", "2")
    return lambda out, *arguments: wm_drake(
        "study", "drive", *small, "--profile", "p.yaml", "--out", out, *arguments
    )


def test_friction_that_no_step_resolves_is_said_once_and_on_the_page(study):
    Path("dry.yaml").write_text(
        "extends: motor\nname: dry\n"
        "damper_types: {dry: {law: coulomb, friction_force: 22 N}}\ndampers: {left: {type: dry}}\n"
    )
    ended = study("out", "--machine", "dry.yaml")
    assert ended.code == 0
    assert ended.err.count("Coulomb friction jumps") == 1  # not for each of the many batches
    assert "Coulomb friction jumps" in Path("out/report.html").read_text(encoding="utf-8")
