"""Every measure of the registry: lanes equal records bit by bit, declarations are complete."""

import re
import warnings

import numpy as np
import pytest
import xarray as xr
from moving_cabinet import with_moving_cabinet

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine
from wm_drake.parameters.spin import Region
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES, measure, register_measure
from wm_drake.simulation.measures.labels import LABELS
from wm_drake.simulation.measures.responses import known_responses
from wm_drake.simulation.runs import DivergenceWarning

PROFILE = SpinProfile(
    time=(0.0, 3.0, 4.5),
    speed=(8.0, 28.0, 28.0),
    regions=(Region(name="up", begin=0.5, end=3.0), Region(name="steady", begin=3.0, end=4.5)),
)
WITHOUT_LENGTHS = "smallest_spring_elongation"
"""A record does not have the lengths of the springs."""


def load(mass):
    return Load(unbalances=(Unbalance(mass=mass, radius=0.25, y=-0.05),))


CASES = [
    Case("light", load(0.2), PROFILE),
    Case("heavy", load(3.0), PROFILE),
    Case("no gasket", load(0.5), PROFILE, gasket=False),
    Case("diverges", Load(unbalances=(Unbalance(mass=90.0, radius=0.3, y=0.1),)), PROFILE),
]


SLOW = ("free_stroke", "moving cabinet")  # each is compiled for this test alone
MACHINES = ["reference", "motor", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)]


@pytest.fixture(scope="module", params=MACHINES)
def both(request):
    """Return the table of a batch of a machine, and all measures of the record of each run."""
    is_moving = request.param == "moving cabinet"
    parameters = with_moving_cabinet() if is_moving else load_machine(request.param)
    machine, scene, records = build_machine(parameters), Scene(parameters), {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        table = simulate_many(
            machine,
            CASES,
            measures=MEASURES,
            histories=True,
            finished=lambda run: records.__setitem__(run.number, run.record),
        )
    assert table.diverged.values[3] or request.param == "motor"  # it is too weak for this load
    return table, [measure(records[index], scene, MEASURES).table for index in range(len(CASES))]


@pytest.mark.parametrize("name", MEASURES)
def test_lanes_equal_records_bit_by_bit(both, name):
    table, records = both
    for variable in MEASURES[name].variables:
        assert table[variable.name].attrs["units"] == variable.units
        values = table[variable.name].values[:2]  # empty without what is measured, such as stops
        assert not values.size or np.isfinite(values).any() or not variable.is_response
        for run, record in enumerate(records):
            if variable.name != WITHOUT_LENGTHS:
                np.testing.assert_array_equal(
                    table[variable.name].values[run], record[variable.name].values, variable.name
                )


@pytest.mark.parametrize("name", MEASURES)
def test_declarations_are_complete(name):
    assert MEASURES[name].name == name
    for variable in MEASURES[name].variables:
        assert set(variable.dims) <= {*LABELS, "pair"}
        assert variable.kind
        assert not variable.about.endswith(".")
        assert np.isfinite(variable.unit.from_si(1.0))


def test_responses_have_names_of_their_own(reference):
    responses = known_responses(reference, PROFILE)
    names = [response.name for response in responses]
    assert len(names) == len(set(names))
    assert {"Dx", "My", "amplitude_Xr", "gap", "spring_tension_left"} < set(names)
    assert {"region_displacement_up_front_x", "region_turn_margin_steady"} < {
        re.sub("displacement_up_[^_]*", "displacement_up_front", name) for name in names
    }


def test_measures_that_a_record_lacks_are_nan(machine):
    """Measure a record as a campaign of version 0.1 wrote it: without forces of the mounts."""
    records = []
    simulate_many(
        machine, CASES[:1], histories=True, finished=lambda run: records.append(run.record)
    )
    record = records[0].drop_vars(["mount_force", "cabinet_force", "cabinet_moment"])
    measures = measure(record)
    assert np.isnan(measures.cabinet_force_peak).all()
    assert measures.feet is None
    assert measures.smallest_gap is None
    assert np.isnan(measures.table.smallest_gap)
    xr.testing.assert_equal(measures.amplitude, measure(records[0]).amplitude)
    with pytest.raises(AttributeError, match="no measure 'amplitud'"):
        _ = measures.amplitud


@pytest.mark.parametrize("name", ["amplitudes", "amplitude", "critical_speed"])
def test_a_measure_has_the_names_of_its_variables_too(machine, name):
    """Choose a measure by its variable, as studies choose responses."""
    table = simulate_many(machine, CASES[:1], measures=["amplitudes", name])
    assert set(table.data_vars) == {"amplitude", "critical_speed", "diverged"}


def test_unknown_and_repeated_names_are_refused(machine):
    with pytest.raises(InputError, match=r"no measure 'amplitud'.*did you mean 'amplitudes'"):
        simulate_many(machine, CASES[:1], measures=["amplitud"])
    again = type(MEASURES["gap"])("gap", (), MEASURES["gap"].evaluate)
    with pytest.raises(ValueError, match="measure 'gap' is registered already"):
        register_measure(again)
