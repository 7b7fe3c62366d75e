"""Tests of `wm-drake verdict`: answer, advice that holds when it is run, exit codes."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import SpinProfile, with_values
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.verdict.study import influences, smallest

PROFILE = "time: (0, 2) s\nspeed: (0, 300) rpm\n"


@pytest.fixture
def verdict(wm_drake):
    """Return a function that gives a verdict on a short run."""
    Path("p.yaml").write_text(PROFILE)
    return lambda *words: wm_drake("verdict", *words, "--samples", "16", "--profile", "p.yaml")


def smallest_gaps(parameters):
    """Return the smallest gap of each load by single runs, with its drum speed. [m, rad/s]"""
    profile, machine = wm.load_profile("p.yaml"), wm.build_machine(parameters)
    scene = wm.Scene(parameters)
    gaps = {}
    for name, load in parameters.loads.items():
        record = wm.simulate(machine, wm.Case(name, load, profile))
        gap = wm.measure(record, scene).smallest_gap
        speed = float(record.drum_speed.interp(time=gap.time))
        gaps[name] = gap.distance, speed, f"{gap.moving} and {gap.fixed}".replace("_", " ")
    return gaps


def test_the_answer_and_the_advice_are_those_of_single_runs(verdict):
    ended = verdict("reference", "--json", "--out", "out")
    assert ended.code == 0, ended.err
    shown = json.loads(ended.out)
    reference = wm.load_machine("reference")
    assert [row["load"] for row in shown["loads"]] == list(reference.loads)
    for row, (gap, speed, parts) in zip(
        shown["loads"], smallest_gaps(reference).values(), strict=True
    ):
        assert row["smallest_gap_mm"] == pytest.approx(1e3 * gap, rel=1e-9)
        assert row["speed_rpm"] == pytest.approx(30.0 / 3.14159265 * speed, rel=1e-4)
        assert row["between"] == parts
    (numbers,), (proposed,) = shown["numbers"], shown["proposed"]
    assert numbers["verdict"] == "clear"
    laundry, _ = shown["laundry_probability"]
    assert laundry["upper_percent"] == pytest.approx(100.0 * (1.0 - 0.05 ** (1 / 16)))
    words = shlex.split(proposed["line_to_copy"])
    assert words[:3] == ["wm-drake", "verdict", "reference"]
    sets = [word for word in words if "=" in word]
    assert len(sets) == len(shown["changes"])
    changed = with_values(reference, dict(text.split("=") for text in sets))
    gaps = [gap for gap, _, _ in smallest_gaps(changed).values()]
    (gap,) = [row for row in shown["proposal"] if row["response"] == "gap"]
    assert gap["before"] == pytest.approx(numbers["smallest_gap_mm"], rel=1e-9)
    assert gap["after"] == pytest.approx(1e3 * min(gaps), rel=1e-9)
    assert gap["after"] > gap["before"]
    limited = [row for row in shown["proposal"] if not row["response"].startswith("mount_force")]
    assert max(row["loss_percent"] for row in limited) <= 10.0
    why = {row["key"]: row["why_not"] for row in shown["influences"]}
    assert {key for key, reason in why.items() if not reason} == {
        text.partition("=")[0] for text in sets
    }
    page = Path("out/report.html").read_text(encoding="utf-8")
    lead = page[page.index('<p class="summary">') : page.index("<nav")]
    asked = ("does not touch", "How likely", "What decides", "What to change", "What it costs")
    places = [lead.index(words) for words in asked]
    assert places == sorted(places)
    linked = re.findall(r'<dt><a href="#([^"]+)">', lead)
    assert len(linked) == 4
    assert all(f'<section id="{anchor}">' in page for anchor in linked)


def test_limits_and_parts_that_may_change_are_the_users(verdict):
    only = verdict("reference", "--only", "gasket", "--json", "--out", "gasket")
    changed = json.loads(only.out)["influences"]
    assert changed
    assert all(row["key"].startswith("gasket.") for row in changed)
    tight = ("--limit", "mount_force_peak=0", "--limit", "F=0 %", "--limit", "amplitude=0")
    shown = json.loads(verdict("reference", *tight, "--json", "--out", "tight").out)
    if shown["changes"]:
        named = [row for row in shown["proposal"] if not row["response"].startswith("cabinet")]
        assert max(row["loss_percent"] for row in named) <= 1e-6
    assert any("changes by" in row["why_not"] for row in shown["influences"])


@pytest.mark.parametrize("limit", ["F=10", "mount_force_peak=5"])
def test_a_smaller_change_is_not_better_than_the_default(verdict, limit):
    gaps = []
    for change in ("20", "9"):
        words = ("--change", change, "--limit", limit, "--json", "--out", change)
        shown = json.loads(verdict("reference", *words).out)
        gaps += [row["after"] for row in shown["proposal"] if row["response"] == "gap"]
    assert gaps[0] >= gaps[1]


def test_a_proposal_stays_within_the_effort_of_the_user(verdict):
    friction = "damper_types.friction.friction_force"
    words = (f"{friction}=4", "--effort", "bodies=0.5", "--most-effort", "1")
    shown = json.loads(verdict("reference", "--effort", *words, "--json", "--out", "out").out)
    made = [row["keys"] for row in shown["changes"]]
    assert made
    assert sum(0.5 if key.startswith("bodies") else 1.0 for key in made) <= 1.0
    why = {row["key"]: row["why_not"] for row in shown["influences"]}
    assert why[friction] == "its effort, 4, is above 1"


def test_a_machine_of_which_a_run_fails_has_no_verdict_and_no_proposal(verdict):
    heavy = ("--set", "loads.back.unbalances.0.mass=30 kg", "--clearance", "5 mm")
    ended = verdict("reference", *heavy, "--only", "spring_types", "--out", "out")
    assert ended.code == 1
    assert "No verdict: the run of load back failed" in ended.out
    assert "a run of the machine as it is fails" in ended.out
    assert "–" not in re.sub(r"\s+", " ", ended.out).partition("What decides")[2]


class Refusing(Experiment):
    """Experiment with a machine that refuses stiff springs."""

    def can_run(self, machine):
        return machine.spring_types["suspension"].stiffness < 8000.0


def test_a_change_that_the_machine_refuses_is_listed():
    reference = wm.load_machine("reference")
    profile = SpinProfile(time=(0.0, 2.0), speed=(0.0, 30.0))
    case = wm.Case("middle", reference.loads["middle"], profile)
    experiment = Refusing(wm.build_machine(reference), ("gap",), loads=(case,))
    tried = influences(experiment, ["spring_types.suspension.stiffness"], 0.2)
    assert tried.is_refused.values.tolist() == [[False, True]]
    less, more = smallest(tried).values[0]
    assert less > 0.0
    assert more == -np.inf


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--clearance", "200 mm"), 1, "verdict: too near"),
        (("--set", "loads.back.unbalances.0.mass=12 kg"), 1, "verdict: touches"),
        (("--clearance", "10 N"), 2, "--clearance"),
        (("--clearance", "-1 mm"), 2, "allowed are 0 mm"),
        (("nothing.yaml",), 2, "nothing.yaml"),
        (("--limit", "G=5"), 2, "--limit: G: unknown response"),
        (("--limit", "F=-5"), 2, "is negative"),
        (("--effort", "gasket=-1"), 2, "--effort: gasket: is -1"),
        (("--only", "gaskett"), 2, "--only: gaskett: nothing that can change"),
        (("rodrigues_2010",), 0, ""),  # no springs, so no frequency of bouncing either
    ],
)
def test_exit_codes(verdict, words, code, message):
    ended = verdict(*words, "--out", "out")
    assert ended.code == code
    assert message in ended.err
    assert Path("out/report.html").exists() == (code != 2)


def test_machines_and_variants_are_judged_side_by_side_as_each_alone(verdict):
    Path("stiff.yaml").write_text(
        "extends: reference\nname: stiff\ngasket: {stiffness_x: 9 N/mm}\n"
    )
    pair = verdict("reference", "stiff.yaml", "--json", "--out", "pair")
    assert pair.code == 0, pair.err
    change = "gasket.stiffness_x=9 N/mm; gasket.stiffness_z=2 N/mm"
    variant = verdict("stiff.yaml", "--variant", change, "--json", "--out", "variant")
    assert variant.code == 0, variant.err
    sets = [word for text in change.split("; ") for word in ("--set", text)]
    alone = {
        "reference": verdict("reference", "--json", "--out", "a"),
        "stiff": verdict("stiff.yaml", "--json", "--out", "b"),
        change: verdict("stiff.yaml", *sets, "--json", "--out", "c"),
    }
    shown = {name: json.loads(ended.out) for name, ended in alone.items()}
    both = json.loads(pair.out)["verdicts"], json.loads(variant.out)["verdicts"]
    assert [[row["state"] for row in rows] for rows in both] == [
        ["reference", "stiff"],
        ["stiff", change],
    ]
    for rows in both:
        first = rows[0]["smallest_gap_mm"]
        for row in rows:
            one = shown[row["state"]]
            assert row["smallest_gap_mm"] == one["numbers"][0]["smallest_gap_mm"]
            assert row["upper_percent"] == one["laundry_probability"][0]["upper_percent"]
            assert row["difference_mm"] == pytest.approx(row["smallest_gap_mm"] - first)
    pages = sorted(path.name for path in Path("pair").glob("report_*.html"))
    assert pages == ["report_reference.html", "report_stiff.html"]
    again = verdict("reference", "reference", "--out", "same")
    assert again.code == 2
    assert "two have the name" in again.err


def test_the_same_changes_are_run_in_all_units(verdict):
    shown = {}
    for units in ("si", "us"):
        ended = verdict(
            "reference", "--only", "spring_types", "--units", units, "--json", "--out", units
        )
        shown[units] = json.loads(ended.out)
    si, us = shown["si"]["influences"], shown["us"]["influences"]
    assert [row["key"] for row in si] == [row["key"] for row in us]
    for one, other in zip(si, us, strict=True):
        for side in ("less", "more"):
            gap, inches = one[f"gap_with_{side}_mm"], other[f"gap_with_{side}_in"]
            assert inches * 25.4 == pytest.approx(gap, rel=1e-12)
