"""Test that every analysis script runs with --quick and writes its result."""

import re
import runpy
import sys
from pathlib import Path

import pytest
from analysis_tools.validation_page import FAILS, HOLDS, NOT_COMPARABLE

ANALYSES = Path(__file__).parents[2] / "analyses"
VERDICTS = {HOLDS, FAILS, NOT_COMPARABLE, "met", "missed"}
LONG = {  # more than five seconds
    "calibrate_reference.py", "check_coverage.py", "check_spin_of_tubes.py", "choose_step.py",
    "choose_damper_law.py",
    "check_spin_coverage.py",
    "check_next.py", "check_record_coverage.py",
    "compare_ball_balancer.py", "compare_dampers.py", "compare_measured_balls.py", "compare_rotor_rig.py",
    "spin_up_fmu.py",
    "compare_designs.py", "compare_integrators.py", "compare_mujoco.py", "compare_searches.py", "compare_speed.py",
    "fit_coulomb_to_mstv.py", "write_paper_a.py", "write_paper_b.py",
    "show_timeline.py", "time_page.py", "write_paper_c.py", "write_validation.py",
}  # fmt: skip
LONGER = {"compare_error_causes.py", "fit_basins.py", "search_basins.py", "show_growth.py"}
"""More than ten seconds: they compile what nothing else has, or start a cluster."""


def marks_of(script):
    if script in LONGER:
        return [pytest.mark.hours]
    return [pytest.mark.slow] if script in LONG else []


SCRIPTS = [
    pytest.param(path.name, marks=marks_of(path.name)) for path in sorted(ANALYSES.glob("*.py"))
]


@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs_quickly_and_writes_its_output(script, tmp_path, monkeypatch, capsys):
    """Run the script in this process, which has imported and compiled what most of it needs."""
    out = tmp_path / "out.txt"
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ANALYSES)  # as of a script: some import another one
    monkeypatch.setattr(sys, "argv", [script, "--quick", "--out", str(out)])
    runpy.run_path(str(ANALYSES / script), run_name="__main__")
    assert out.read_text().strip() in capsys.readouterr().out
    assert script in (ANALYSES / "README.md").read_text()
    if script in ("write_paper_a.py", "write_paper_c.py"):
        rows = verdicts(out.read_text())
        assert len(rows) > 15
        page = ANALYSES.parent / "docs" / f"{script[6:13].replace('_', '-')}.md"
        assert rows <= verdicts(page.read_text())


def verdicts(page):
    """Return statement and verdict of each row: statement, paper, ours, verdict, command."""
    rows = (line.split(" | ") for line in page.splitlines() if line.startswith("| "))
    return {(cells[0], cells[3]) for cells in rows if len(cells) == 5 and cells[3] in VERDICTS}


def test_renewing_the_table_of_times_changes_the_measured_rows_only(monkeypatch):
    monkeypatch.syspath_prepend(ANALYSES)
    import compare_speed

    page = (ANALYSES.parent / "docs" / "performance.md").read_text()
    table = page.split(compare_speed.BEGIN)[1].split(compare_speed.END)[0]
    rows = re.findall(r"^\| ((?!task|---).*?) \|.*$", table, re.MULTILINE)
    assert set(rows) <= set(compare_speed.TASKS)
    assert compare_speed.renewed(page, {}) == page
    renewed = compare_speed.renewed(page, {"`spin`": "| `spin` | 1 | 2 | 0.5 |  | today |"})
    before, after = (text.splitlines() for text in (page, renewed))
    assert [line for line in after if line not in before] == ["| `spin` | 1 | 2 | 0.5 |  | today |"]
    assert [line for line in before if line not in after and not line.startswith("| `spin`")] == []
