"""The gasket study step by step, in public names only."""

import pytest

import wm_drake as wm
from wm_drake.errors import InputError


def test_steps_give_what_the_study_gives(tmp_path):
    factors = wm.factors(wm.load_machine("reference"))
    design = wm.make_design("d-optimal", factors.names, trials=20, model="main")
    analysis = wm.anova(wm.run_trials(factors, design, ["middle"]))
    ours = wm.contributions(analysis).set_index(["load", "response", "term"])
    study = wm.run_study("gasket", load=["middle"], trials=20, model="main", quiet=True)
    theirs = study.to_dataframe("contributions").set_index(["load", "term"])
    assert len(ours) == 10 * 8
    for (load, response, term), row in ours.iterrows():
        share = theirs.loc[(load, term), f"{response}_percent"]
        assert row.contribution_percent == pytest.approx(share, rel=1e-12)
    assert ours.published_percent[("middle", "Fz", "K_Lz")] == 99.01  # [B] Table 5
    wm.doe_report(analysis).save(tmp_path / "new")
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert "<dt>Engine</dt>" in page
    assert "published" in page


def test_both_engines_run_the_same_trials():
    machine = wm.load_machine("reference")
    profile = machine.profile.model_copy(update={"time": (0.0, 0.1), "speed": (30.0, 31.0)})
    factors = wm.factors(wm.with_value(machine, "profile", profile), ["C_L", "K_Lx=80 %..120 %"])
    design = wm.make_design("full", factors.names)
    compiled, drake = (
        wm.run_trials(factors, design, ["middle"], ["F", "gap"], engine=engine, workers=1)
        for engine in ("compiled", "drake")
    )
    assert not compiled.runs.value.identical(drake.runs.value)
    difference = abs(drake.runs.value / compiled.runs.value - 1.0)
    assert difference.max() < 1e-3
    assert compiled.runs.value.std("trial").sel(response="Fx").item() > 0.0


def test_a_design_without_residual_is_refused_before_its_runs(no_runs):
    factors = wm.factors(wm.load_machine("reference"))
    design = wm.make_design("d-optimal", factors.names, trials=17, model="main")
    no_runs()
    with pytest.raises(InputError, match="17 trials for 17 coefficients"):
        wm.run_trials(factors, design)
