"""Designs of a machine, with functions of known answer in place of the runs."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

pytest.importorskip("pymoo")

from made_up_runs import made_up
from pages import data_of, drawings

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, varying
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.simulation.cases import Case, case_of
from wm_drake.studies.design.page import design_answer
from wm_drake.studies.design.problem import machine_designs
from wm_drake.studies.design.search import SearchSettings
from wm_drake.studies.design.study import (
    _is_kept,
    chosen_designs,
    front_envelopes,
    promises,
    run_designs,
    summary_of,
)
from wm_drake.studies.design.task import check_goals
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.facts import Facts
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.variables import uncertain_machine

SPRING = "spring_types.suspension.stiffness"
FRICTION = "damper_types.friction.friction_force"


@pytest.fixture(scope="module")
def machine():
    return load_machine("reference")


def task_of(**changes):
    tree = {
        "loads": ("middle", "counter"),
        "vary": {"k": {"keys": (SPRING,), "low": "50 %", "high": "150 %"}},
        "objectives": ({"quantity": "Dx"}, {"quantity": "Fx"}),
    }
    return VaryFile.model_validate(tree | changes)


def designs_of(machine, task):
    cases = [case_of(machine, load) for load in task.loads]
    return machine_designs(varying(machine, task.entries()), task, cases)


def run_of(machine):
    """Return runs whose displacement falls and whose force rises with the spring's stiffness.

    The second load has twice the displacement and half the force of the first one.
    """
    nominal = machine.spring_types["suspension"].stiffness

    def run(cases):
        k = np.array([c.parameters.spring_types["suspension"].stiffness for c in cases]) / nominal
        scale = np.array([2.0 if "counter" in c.name else 1.0 for c in cases])
        d, f = 1e-3 * scale / k, 10.0 * k / scale
        zeros = np.zeros((len(k), 3))
        table = {
            "detergent_displacement": (("run", "axis"), zeros + d[:, None]),
            "gasket_force": (("run", "axis"), zeros + f[:, None]),
            "gasket_moment": (("run", "axis"), zeros),
            "diverged": ("run", np.full(len(k), "", dtype=object)),
        }
        return xr.Dataset(table)

    return made_up(run)


def test_worst_mean_and_quantile_over_loads(machine):
    goals = [{"quantity": "Dx", "over": over} for over in ("worst", "mean", "50 %")]
    goals.append({"quantity": "Fx", "goal": "larger", "over": "worst"})
    designs = designs_of(machine, task_of(objectives=tuple(goals)))
    values, _ = designs.evaluate(np.array([[0.5], [1.0]]), run_of(machine))
    assert values[0] == pytest.approx([2.0e-3, 1.5e-3, 1.5e-3, 5.0])
    assert values[1] == pytest.approx([2.0e-3 / 1.5, 1.0e-3, 1.0e-3, 7.5])


def test_bounds_in_percent_value_and_distance_give_the_same_machine(machine):
    k = machine.spring_types["suspension"].stiffness
    for low, high in (
        ("90 %", "130 %"),
        (f"{0.9 * k} N/m", f"{1.3 * k} N/m"),
        (f"nominal - {0.1 * k} N/m", f"nominal + {0.3 * k} N/m"),
    ):
        variable = {"keys": (SPRING,), "low": low, "high": high}
        designs = designs_of(machine, task_of(vary={"k": variable}))
        assert designs.nominal() == pytest.approx([0.25])
        found = designs.machine_at(np.array([0.5])).spring_types["suspension"].stiffness
        assert found == pytest.approx(1.1 * k)


def test_choice_sets_its_option(machine):
    choices = {"damper": {"options": {"weak": {FRICTION: "20 N"}, "strong": {FRICTION: "60 N"}}}}
    designs = designs_of(machine, task_of(choices=choices))
    for place, force in ((0.0, 20.0), (0.49, 20.0), (0.51, 60.0), (1.0, 60.0)):
        found = designs.machine_at(np.array([0.5, place]))
        assert found.damper_types["friction"].friction_force == force


def test_front_under_a_constraint_is_found(machine, tmp_path):
    # Dx = 2 / k mm and Fx = 10 k N for k from 0.5 to 1.5; Dx at most 2.5 mm means k >= 0.8
    task = task_of(constraints=({"quantity": "Dx", "at_most": "2.5 mm"},))
    designs = designs_of(machine, task)
    front = run_designs(designs, run_of(machine), SearchSettings(640, 32))
    dx, fx = 1e3 * front.Dx.values, front.Fx.values
    assert dx * fx == pytest.approx(20.0)  # 2/k mm times 10 k N
    assert (dx.min(), dx.max()) == pytest.approx((2.0 / 1.5, 2.5), rel=0.01)
    assert 1e3 * front.constrained_Dx.values == pytest.approx(dx)
    assert (front.nominal_Dx, front.nominal_Fx) == (pytest.approx(2e-3), pytest.approx(10.0))
    assert front.evaluations[-1] == 640
    shown = front_envelopes(designs, front, histories_of(machine))
    answer = design_answer(designs, front, xr.Dataset(), shown, "about")
    assert answer.tables()["front"].columns.tolist() == [
        "design", "Dx_mm", "Fx_N", "constrained_Dx_mm", "k_percent",
    ]  # fmt: skip
    answer.write(tmp_path)
    for name, number in chosen_designs(designs, front).items():
        loaded = load_machine(tmp_path / f"machine_{name.replace(' ', '_')}.yaml")
        assert loaded.name == f"reference, {name}"
        part = front.k.sel(design=number).item()
        wanted = part * machine.spring_types["suspension"].stiffness
        assert loaded.spring_types["suspension"].stiffness == pytest.approx(wanted, rel=1e-12)
    page = answer.page(Facts())
    (shown,) = (one for one in data_of(page) if "envelopes" in one)
    assert np.array(shown["objectives"]) == pytest.approx(np.column_stack([dx, fx]))
    assert len(drawings(page)) == 3  # front, envelopes, search


def histories_of(machine):
    """Return an experiment whose records oscillate at 2 Hz, with amplitudes that rise with 1 / k."""
    nominal = machine.spring_types["suspension"].stiffness
    time = np.arange(0.0, machine.profile.duration, 0.005)

    def record(_machine, cases, keep, _what):
        for number, case in enumerate(cases):
            k = case.parameters.spring_types["suspension"].stiffness / nominal
            size = 1e-3 * (2.0 if "counter" in case.name else 1.0) / k
            motion = size * np.sin(4.0 * np.pi * time)[:, None] * np.ones(len(machine.sensors))
            keep(number, xr.Dataset(
                {"displacement": (("time", "sensor"), motion)},
                {"time": time, "sensor": list(machine.sensors)},
                {"diverged": ""},
            ))  # fmt: skip

    return Experiment(None, (), record=record)


def test_envelopes_are_the_largest_over_the_loads(machine):
    designs = designs_of(machine, task_of())
    front = run_designs(designs, run_of(machine), SearchSettings(32, 16))
    shown = front_envelopes(designs, front, histories_of(machine))
    assert shown["sensor"].values.tolist() == list(machine.sensors)
    # 2 mm / k of the counterweight's load; far from the ends, where the filter has settled
    middle = slice(30, 90)
    assert shown.nominal.values[:, middle] == pytest.approx(2e-3, rel=0.01)
    assert shown["design"].equals(front["design"])
    for k, lines in zip(front.k.values, shown.envelope.values, strict=True):
        assert lines[:, middle] == pytest.approx(2e-3 / k, rel=0.01)


def test_number_of_the_machine_is_an_objective(machine):
    designs = designs_of(machine, task_of(objectives=({"quantity": SPRING, "goal": "smaller"},)))
    values, _ = designs.evaluate(np.array([[0.0]]), run_of(machine))
    k = machine.spring_types["suspension"].stiffness
    assert values[0, 0] == pytest.approx(0.5 * k)


@pytest.mark.slow
def test_robust_front_keeps_its_promise_on_fresh_samples(machine):
    tolerances = VaryFile.model_validate(
        {
            "loads": "middle",
            "vary": {
                "k": {
                    "keys": (SPRING,),
                    "distribution": "normal",
                    "mean": "100 %",
                    "deviation": "5 %",
                }
            },
        }
    )
    case = Case("middle", machine.loads["middle"], machine.profile)
    task = task_of(
        loads=(),
        robust={"tolerances": "mine", "samples": 256},
        objectives=({"quantity": "Fx", "over": "95 %"}, {"quantity": "Dx", "over": "95 %"}),
    )

    def designs(seed):
        return machine_designs(
            varying(machine, task.entries()),
            task,
            [case],
            lambda changed: uncertain_machine(
                varying(changed, tolerances.entries()), tolerances, case
            ),
            base_samples(1, 256, seed)[0],
        )

    robust = designs(0)
    front = run_designs(robust, run_of(machine), SearchSettings(96, 32))
    fresh, _ = designs(7).evaluate(front.place.values, run_of(machine))
    # Fx = 10 k N with k within 5 %: its 95 % quantile is 1 + 1.645 * 0.05 times the nominal one
    nominal = 10.0 * front.k
    assert front.Fx.values == pytest.approx((1.0 + 1.645 * 0.05) * nominal.values, rel=2e-3)
    assert fresh == pytest.approx(np.column_stack([front.Fx, front.Dx]), rel=5e-3)
    kept = promises(robust, front, run_of(machine), 0)
    assert kept["chosen"].values.tolist() == ["best Fx", "best Dx"]  # no design gains in both
    assert set(np.concatenate([kept.Fx_kept, kept.Dx_kept])) == {"yes"}
    assert not (kept.Fx_is_broken | kept.Dx_is_broken).any()
    number = chosen_designs(robust, front)["best Fx"]
    best = kept.sel(chosen="best Fx")
    assert best.Fx.sel(samples="promised") == pytest.approx(front.Fx.sel(design=number).item())
    # the quantile of the normal distribution lies in both intervals
    exact = (1.0 + stats.norm.ppf(0.95) * 0.05) * nominal.sel(design=number)
    assert ((best.Fx_lower < exact) & (exact < best.Fx_upper)).all()
    promised, of_fresh = (best.Fx_upper - best.Fx_lower).sel(samples=["promised", "fresh"]).values
    assert of_fresh < promised
    envelopes = front_envelopes(robust, front, histories_of(machine))
    answer = design_answer(robust, front, kept, envelopes, "about")
    assert answer.tables()["robust_Dx"].columns.tolist() == [
        "chosen", "Dx_kept", "Dx_is_broken", "Dx_promised_mm", "Dx_lower_promised_mm",
        "Dx_upper_promised_mm", "Dx_fresh_mm", "Dx_lower_fresh_mm", "Dx_upper_fresh_mm",
    ]  # fmt: skip


def test_promise_of_too_few_samples_is_seen_to_break(machine):
    designs = designs_of(machine, task_of(objectives=({"quantity": "Fx", "over": "mean"},)))
    (goal,) = designs.objectives
    lucky, fresh = np.linspace(9.0, 10.0, 16), np.linspace(9.0, 12.0, 64)
    before, after = summary_of(goal, lucky), summary_of(goal, fresh)
    # t quantile 2.131 of 15 degrees of freedom
    assert before.upper - before.value == pytest.approx(2.1314 * np.std(lucky, ddof=1) / 4.0, 1e-4)
    assert _is_kept(goal, before, after) is False
    assert _is_kept(goal, before, before) is True


def test_failed_runs_are_not_on_the_front(machine):
    plain = run_of(machine)

    def run(cases):
        table = plain.simulate(None, (), cases, "")
        k = np.array([c.parameters.spring_types["suspension"].stiffness for c in cases])
        stiff = k > machine.spring_types["suspension"].stiffness
        return table.assign(diverged=("run", np.where(stiff, "at 3 s", "").astype(object)))

    front = run_designs(designs_of(machine, task_of()), made_up(run), SearchSettings(96, 32))
    assert front.sizes["design"]
    assert (front.Fx <= 10.0 + 1e-9).all()


def test_shipped_files_fit_the_reference_machine(machine):
    designs = designs_of(machine, load_vary("gasket"))
    assert len(designs.dimensions) == 8
    for corner in (0.0, 1.0):
        designs.machine_at(np.full(8, corner))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vary": {"k": {"keys": ("spring_types.x",), "low": "1 m", "high": "2 m"}}}, "x"),
        ({"vary": {"k": {"keys": (SPRING,), "low": "90 %", "high": "80 %"}}}, "below"),
        ({"objectives": ({"quantity": "D"},)}, "several responses"),
        ({"constraints": ({"quantity": "Dx", "at_most": "2 N"},)}, "N"),
        ({"choices": {"c": {"options": {"a": {FRICTION: "1 m"}, "b": {}}}}}, "options.a"),
    ],
)
def test_wrong_files_are_refused(machine, changes, message):
    with pytest.raises(InputError, match=message):
        designs_of(machine, task_of(**changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"vary": {}},
        {"loads": ()},
        {"objectives": ({"quantity": "Dx", "over": "often"},)},
        {"constraints": ({"quantity": "Dx"},)},
        {"loads": (), "robust": {"tolerances": "laundry", "samples": 100}},
    ],
)
def test_incomplete_files_are_refused(changes):
    with pytest.raises(
        (ValueError, InputError), match=r"nothing varies|loads|over|at_least|power of two"
    ):
        check_goals(task_of(**changes))
