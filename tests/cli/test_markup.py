"""Names with the markup of a terminal or of a page are printed and drawn as they are."""

import json
import re

import pytest

PROFILE = "profile: {time: '(0, 3) s', speed: '(0, 60) rpm'}\n"


@pytest.mark.parametrize("name", ["[/b][bold]x :smile: $x_", "<script>alert(1)</script>"])
def test_name_of_a_machine_is_printed_as_it_is(wm_drake, tmp_path, name):
    (tmp_path / "machine.yaml").write_text(
        f"extends: reference\nname: '{name}'\n{PROFILE}", encoding="utf-8"
    )
    ended = wm_drake("spin", "--machine", "machine.yaml", "--load", "middle", "--out", "[/b]")
    assert ended.code == 0, ended.err
    assert name in ended.out
    assert "Results in [/b]: " in ended.out
    page = (tmp_path / "[" / "b]" / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", page, re.DOTALL)
    drawings = [json.loads(text) for kind, text in scripts if kind == ' type="application/json"']
    assert drawings
    assert all("<" not in text for kind, text in scripts if "json" in kind)


def test_machine_and_case_of_a_study(wm_drake, tmp_path):
    (tmp_path / "cases.csv").write_text(
        "case,front_g,rear_g,phase_deg\n[/b],100,0,0\n", encoding="utf-8"
    )
    (tmp_path / "profile.csv").write_text(
        "time_s,speed_rpm,region\n0,0,R1\n2,60,R1\n3,60,\n", encoding="utf-8"
    )
    ended = wm_drake("study", "spin-cycle", "--cases", "cases.csv", "--profile", "profile.csv")
    assert ended.code == 0, ended.err
    assert "[/b]" in ended.out
