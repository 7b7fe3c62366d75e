"""`wm-drake identify` with several laws: fits, left-out tests, blind predictions, one page."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from simple_machines import SPONGES

from wm_drake.parameters import load_component, load_machine
from wm_drake.parameters.units import to_base

LAWS = "coulomb,mstv,havsin"


@pytest.fixture
def bench(wm_drake):
    """Write loops of the MSTV damper: four to fit, two to predict."""
    loops = ("rig", "damper", "--component", "mstv_damper", "-a", "0.5,2 mm")
    assert wm_drake(*loops, "-f", "1,10 Hz", "--out", "fitted").code == 0
    assert wm_drake(*loops, "-f", "3 Hz", "--out", "held").code == 0
    return [sorted(Path(name).glob("loop_*.csv")) for name in ("fitted", "held")]


def test_rival_laws_are_fitted_compared_and_predict_blind(wm_drake, bench):
    files, held = bench
    ended = wm_drake("identify", "damper", *files, "--law", LAWS, "--validate", *held, "--json")
    assert ended.code == 0
    found = json.loads(ended.out)
    laws = {row["law"]: row for row in found["laws"]}
    assert [law for law, row in laws.items() if row["supported"]] == ["mstv"]
    assert set(laws) == {"coulomb", "mstv", "havsin"}
    values = {
        row["unknown"]: to_base(row["value"], row["unit"])
        for row in found["estimates"]
        if row["law"] == "mstv"
    }
    for name in ("friction_force", "sponge_stiffness", "sponge_damping", "slider_damping"):
        planted = getattr(load_component("mstv_damper").parameters, name)
        assert values[name] == pytest.approx(planted, rel=0.01)
    for name in ("rmse_blind_N", "rmse_left_out_N"):
        assert laws["mstv"][name] < 0.01 * laws["coulomb"][name]
    out = Path("wm-drake-identify")
    errors = pd.read_csv(out / "errors.csv")
    assert list(errors.kind) == ["fitted"] * 4 + ["blind"] * 2
    assert list(errors.test[4:]) == [path.stem for path in held]
    assert errors.rmse_mstv_N[4:].max() < 0.01 * errors.rmse_coulomb_N[4:].min()
    columns = set(pd.read_csv(out / "loops.csv").columns)
    assert {"measured_N", "coulomb_N", "mstv_N", "havsin_N"} < columns
    page = (out / "report.html").read_text()
    assert page.count("<figure data-picture") == 4
    assert re.findall(r'(?:src|href)="(?!data:|#|https://doi.org/)', page) == []
    damper = load_machine(str(out / "identified_mstv.yaml")).damper_types["friction"]
    assert damper.sponge_stiffness == pytest.approx(176e3, rel=0.01)
    assert load_machine(str(out / "identified_coulomb.yaml")).damper_types["friction"].law == (
        "coulomb"
    )


def test_all_numbers_may_be_fixed_and_are_only_evaluated(wm_drake, bench):
    files, held = bench
    fix = [
        part
        for text in (
            "friction_force=45 N",
            "sponge_stiffness=176 N/mm",
            "sponge_damping=0.09 N s/mm",
            "slider_damping=0.4 N s/mm",
        )
        for part in ("--fix", text)
    ]
    one = wm_drake("identify", "damper", *files, "--law", "mstv", *fix, "--out", "one", "--json")
    assert one.code == 0
    (found,) = json.loads(one.out)["fit"]
    assert found["method"] == "evaluation"
    assert found["rmse_N"] < 0.05
    both = wm_drake(
        "identify", "damper", *files, "--law", "mstv,coulomb", *fix, "--validate", *held
    )
    assert both.code == 0
    laws = pd.read_csv("wm-drake-identify/laws.csv").set_index("law")
    assert laws.unknowns.to_dict() == {"mstv": 0, "coulomb": 1}
    assert laws.supported["mstv"]
    damper = load_machine("wm-drake-identify/identified_mstv.yaml").damper_types["friction"]
    assert damper.friction_force == 45.0


@pytest.mark.parametrize("law", ["stv", "havsin"])
def test_a_law_with_numbers_that_one_loop_does_not_show_reports_its_error(wm_drake, law):
    """Fit a loop of a dashpot, which shows no number of a friction that grows with velocity."""
    Path("dashpot.yaml").write_text("law: coulomb\nfriction_force: 0 N\ndamping: 0.5 N s/mm\n")
    bench = ("rig", "damper", "--component", "dashpot.yaml", "-f", "2 Hz", "-a", "5 mm")
    assert wm_drake(*bench, "--out", "bench").code == 0
    files = sorted(Path("bench").glob("loop_*.csv"))
    files += ["--machine", SPONGES]  # whose dampers have another law
    ended = wm_drake("identify", "damper", *files, "--law", law, "--out", "fit")
    assert ended.code == 0
    assert "identified.yaml is not written: the data do not determine" in ended.err
    assert pd.read_csv("fit/fit.csv").rmse_N[0] >= 0.0
    assert not Path("fit/identified.yaml").exists()
    assert Path("fit/report.html").exists()
    both = wm_drake("identify", "damper", *files, "--law", f"coulomb,{law}", "--out", "two")
    assert both.code == 0
    assert f"identified_{law}.yaml is not written" in both.err
    assert pd.read_csv("two/laws.csv").set_index("law").supported["coulomb"]


def test_all_names_after_validate_are_held_out(wm_drake, bench):
    """Expand held/*.csv to several names, as a shell does: none of them may reach the fit."""
    files, held = bench
    ended = wm_drake(
        "identify", "damper", "--validate", *held, "--law", "coulomb", *files[:0], "--json"
    )
    assert ended.code == 2
    assert "FILES" in ended.err
