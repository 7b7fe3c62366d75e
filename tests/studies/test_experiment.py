"""An experiment: order and place of its runs, runs that fail, and the memory that it keeps."""

import gc
import tracemalloc

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up

from wm_drake.batch import simulate_many
from wm_drake.batch.ledger import open_ledger
from wm_drake.batch.work_items import KEPT_NUMBERS
from wm_drake.parameters import SpinProfile, with_value
from wm_drake.report.quantity import shown
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures.responses import chosen_responses
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment, failures, response_of, responses

SHORT = SpinProfile(time=(0.0, 0.5), speed=(5.0, 20.0))
MASS = "loads.counter.unbalances.0.mass"


def case(name, load):
    return Case(name, load, SHORT)


def damped(reference, count):
    """Yield machines with a gasket of more and more damping; of those before, nothing is left."""
    for index in range(count):
        if index % 50 == 0:
            gc.collect()
        yield with_value(reference, "gasket.damping_x", 10.0 + 0.01 * index)


def test_each_run_has_its_point_and_load(machine, reference):
    """Compare each place of the dataset with a run of its own, for a change of one of the loads."""
    loads = [case(name, reference.loads[name]) for name in ("middle", "counter")]
    own = case("mine", reference.loads["back"])
    machines = [with_value(reference, MASS, mass) for mass in (0.5, 2.0)]
    experiment = Experiment(machine, ("extremes", "amplitudes"), loads=(*loads, own))
    data = experiment.at(["light", "heavy"], machines)
    assert data.gasket_force.dims == ("point", "load", "axis")
    for point, changed in zip(("light", "heavy"), machines, strict=True):
        for name, load in (("middle", "middle"), ("counter", "counter"), ("mine", "back")):
            single = Case("", changed.loads[load], SHORT, parameters=changed)
            table = simulate_many(machine, [single], measures=experiment.measures)
            found = data.sel(point=point, load=name)
            assert found.gasket_force.values.tolist() == table.gasket_force.values[0].tolist()
            assert found.amplitude.values.tolist() == table.amplitude.values[0].tolist()
    table = simulate_many(
        machine, experiment.cases_of(machines[1], ""), measures=experiment.measures
    )
    for response in chosen_responses(reference, SHORT, ["D", "amplitude"]):
        array = response_of(data, response)
        assert array.dims == ("point", "load")
        np.testing.assert_array_equal(shown(array)[1], response.values(table))


def test_a_run_that_failed_has_no_measures_and_says_so(reference):
    def run(cases):
        texts = ["at 3 s: far" if c.name == "b, 2" else "" for c in cases]
        values = {"detergent_displacement": (("run", "axis"), np.ones((len(cases), 3)))}
        return xr.Dataset(values | {"diverged": ("run", np.array(texts, dtype=object))})

    loads = [case(name, reference.loads["middle"]) for name in "ab"]
    data = made_up(run, reference, loads).at([1, 2], [reference] * 2)
    missing = data.detergent_displacement.isnull().all("axis").values
    assert missing.tolist() == [[False, False], [False, True]]
    assert failures(data) == ("2, b: at 3 s: far",)
    shown = responses(data, chosen_responses(reference, SHORT, ["D"]))
    assert list(shown) == ["Dx", "Dy", "Dz"]
    assert shown.Dx.isnull().sum() == 1


def test_changes_that_machine_or_step_refuse_are_left_out(machine):
    experiment = Experiment(machine, ())
    stiff = {"gasket.stiffness_x": 1e9}
    changes = {"good": {"gasket.damping_x": 20.0}, "stiff": stiff, "none": {"gasket.mass": "1 kg"}}
    allowed = experiment.allowed(changes)
    assert list(allowed) == ["good"]
    assert allowed["good"].gasket.damping_x == 20.0


@pytest.mark.hours
def test_what_is_kept_of_a_run_are_its_numbers(machine, reference, tmp_path):
    """Compare the memory of three times as many runs; a machine alone takes 4.6 kB."""
    count, grown = KEPT_NUMBERS + 200, []
    with open_ledger(tmp_path / "ledger", {"study": "test"}) as ledger:
        experiment = Experiment(
            machine,
            ("extremes",),
            Executor(ledger, 1).simulate,
            (case("middle", reference.loads["middle"]),),
        )
        for size in (count, 3 * count):
            tracemalloc.start()
            try:
                experiment.at(range(size), damped(reference, size))
                grown.append(tracemalloc.get_traced_memory()[1])
            finally:
                tracemalloc.stop()
    assert grown[1] - grown[0] < 2 * count * 2000
