"""Loads that dry: law, both engines, energy that leaves with the water, records and measures."""

import numpy as np
import pytest
from both_engines import BothEngines, check_alike, difference
from energy_book import EnergyBook
from side_by_side import check_runs_alone

import wm_drake as wm
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.errors import InputError
from wm_drake.laws.water import draining_rate
from wm_drake.parameters import Load, SpinProfile, load_machine
from wm_drake.simulation.cases import Case

WATER = {"share": 0.6, "speed": (0.0, 20.0, 60.0), "left": (1.0, 0.7, 0.3), "time_constant": 2.0}
QUICK = {**WATER, "left": (0.9, 0.5, 0.1), "time_constant": 1.0}
TOWELS = Load.model_validate(
    {
        "unbalances": [
            {"mass": 0.8, "radius": 0.24, "y": -0.08, "water": WATER},
            {"mass": 0.3, "radius": 0.2, "y": 0.1, "phase": 1.9},
            {"mass": 0.5, "radius": 0.22, "y": 0.05, "phase": -2.2, "water": QUICK},
        ]
    }
)
STEADY = SpinProfile(time=(0.0, 3.0), speed=(20.0, 20.0))
RAMP = SpinProfile(time=(0.0, 1.0, 3.0), speed=(5.0, 18.0, 18.0))
FILE = """\
extends: reference
loads:
  towels:
    unbalances:
      - mass: 800 g
        radius: 240 mm
        y: 0 mm
        water: {share: 0.6, speed: "(0, 400, 1400) rpm", left: "(1, 0.7, 0.3)", time_constant: 20 s}
"""


def with_towels(machine="reference", **changes):
    parameters = load_machine(machine)
    loads = {**parameters.loads, "towels": TOWELS}
    return parameters.model_copy(update={"loads": loads, **changes})


@pytest.fixture(scope="module")
def machine():
    return wm.build_machine(with_towels())


def test_water_leaves_with_the_time_constant_and_does_not_come_back():
    assert draining_rate(0.9, 0.5, 20.0) == pytest.approx(-0.02)
    assert draining_rate(0.5, 0.9, 20.0) == 0.0


@pytest.mark.slow
def test_masses_at_a_constant_speed_are_those_of_the_closed_form(machine):
    record = wm.simulate(machine, Case("towels", TOWELS, STEADY))
    time = record.time.values
    for column, mass, left, tau in ((0, 0.8, 0.7, 2.0), (2, 0.5, 0.5, 1.0)):
        share = left + (1.0 - left) * np.exp(-time / tau)
        expected = mass * (0.4 + 0.6 * share)
        np.testing.assert_allclose(record.mass_left[:, column], expected, rtol=1e-6)
    np.testing.assert_array_equal(record.mass_left[:, 1], 0.3)


def test_both_engines_agree_at_random_states(machine):
    assert difference(machine, load=TOWELS) < 1e-10


def test_rates_are_those_of_a_load_with_what_is_left(machine):
    both = BothEngines(machine, machine.set_up(TOWELS))
    left = np.array([0.55, 0.25])
    dry = TOWELS.with_masses(TOWELS.masses(left))
    assert dry.mass == pytest.approx(0.8 * (0.4 + 0.6 * 0.55) + 0.3 + 0.5 * (0.4 + 0.6 * 0.25))
    state = both.compiled_order(0.1 * both.sizes)
    state[-2:] = left
    of_dry = StateDerivative(machine.set_up(dry))(state[:-2], 3.0)
    np.testing.assert_allclose(both.derivative(state, 3.0)[:-2], of_dry, rtol=1e-10, atol=1e-10)


@pytest.mark.slow
def test_both_engines_move_alike(machine):
    case = Case("towels", TOWELS, RAMP)
    ours, drake = (wm.simulate(machine, case, engine) for engine in ("compiled", "drake-accurate"))
    check_alike(ours, drake, ("displacement", "mass_left", "motor_torque"), 1e-3)
    check_alike(ours, drake, ("mass_left",), 1e-5)


@pytest.mark.slow
def test_eight_runs_side_by_side_are_single_runs(machine):
    cases = [
        Case(f"{mass:g} kg", TOWELS.with_masses(np.array([mass, 0.3, 0.5])), RAMP)
        for mass in (0.2, 0.5)
    ]
    unbalances = TOWELS.unbalances
    one = TOWELS.model_copy(update={"unbalances": unbalances[:2]})
    cases += [Case("two wet", TOWELS, RAMP), Case("one wet", one, RAMP)]
    check_runs_alone(machine, cases)


@pytest.mark.slow
def test_energy_leaves_with_the_water():
    """Book what the water takes: its kinetic energy at the speed of the mass, and its height."""
    step = 1.5625e-4
    parameters = with_towels(step=step, output_period=step)
    machine = wm.build_machine(parameters)
    case = Case("towels", TOWELS, SpinProfile(time=(0.0, 2.0), speed=(20.0, 20.0)))
    record = wm.simulate(machine, case, integrator="runge_kutta")
    empty = Load(unbalances=())
    book = EnergyBook(machine.set_up(TOWELS), empty, record)
    masses = record.mass_left.values
    angle, rate = record.drum_angle.values, record.drum_speed.values
    energy, leaves = np.zeros((2, len(angle)))
    for k, unbalance in enumerate(TOWELS.unbalances):
        turned = angle + unbalance.phase
        place = np.column_stack(
            [
                unbalance.radius * np.sin(turned),
                np.full(len(angle), unbalance.y),
                unbalance.radius * np.cos(turned),
            ]
        )
        spin = np.column_stack([0.0 * rate, rate, 0.0 * rate])
        arm = book.rotation.apply(place)
        velocity = book.v + np.cross(book.w, arm)
        velocity += book.rotation.apply(np.cross(spin, place))
        height = (book.position + arm)[:, 2]
        of_unit_mass = 0.5 * np.sum(velocity**2, axis=1) + parameters.gravity * height
        energy += masses[:, k] * of_unit_mass
        leaves -= np.gradient(masses[:, k], record.time.values) * of_unit_mass
    work, change, dissipated = book.balance()
    gone = book.integral(leaves)
    assert gone > 2.0  # J
    assert work - change - (energy[-1] - energy[0]) - dissipated == pytest.approx(gone, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["motor", "free_stroke"])
def test_other_drives_and_dampers_dry_too(name):
    parameters = with_towels(name)
    record = wm.simulate(parameters, Case("towels", TOWELS, RAMP))
    assert not record.attrs["diverged"]
    left = record.mass_left.values
    assert np.all(np.diff(left, axis=0) <= 0.0)
    assert left[-1].sum() < TOWELS.mass - 0.2


@pytest.mark.slow
def test_measure_is_the_mass_at_the_end_in_record_and_batch(machine):
    cases = [Case("towels", TOWELS, RAMP), Case("middle", machine.parameters.loads["middle"], RAMP)]
    table = wm.simulate_many(machine, cases, measures=["water"])
    records = [wm.simulate(machine, case) for case in cases]
    assert "mass_left" not in records[1]
    alone = [wm.measure(record, measures=["water"]).table.mass_left for record in records]
    np.testing.assert_allclose(table.mass_left, alone)
    assert float(alone[0]) == pytest.approx(float(records[0].mass_left[-1].sum()))
    assert float(alone[1]) == machine.parameters.loads["middle"].mass


@pytest.mark.slow
def test_numbers_of_the_water_can_vary(machine):
    key = "loads.towels.unbalances.0.water.time_constant"
    faster = wm.with_value(machine.parameters, key, 0.5)
    cases = [Case("towels", p.loads["towels"], RAMP) for p in (machine.parameters, faster)]
    table = wm.simulate_many(machine, cases, measures=["water"])
    assert table.mass_left[1] < table.mass_left[0] - 0.03


def test_more_wet_masses_than_were_built_are_refused():
    with pytest.raises(InputError, match="loads: this load has 2 masses with water"):
        wm.build_machine("reference").set_up(TOWELS).follow_water()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("share: 0.6", "share: 1.2", "water.share: input should be less than 1"),
        ("(1, 0.7, 0.3)", "(1, 0.7)", "needs as many values of left as of speed"),
        ("(1, 0.7, 0.3)", "(0.5, 0.7, 0.3)", "left must be between 0 and 1 and never rise"),
        ("(0, 400, 1400) rpm", "(100, 400, 1400) rpm", "speed must rise .* begin at 0"),
        ("20 s", "20 m", "time_constant: unit"),
        ("time_constant", "time_konstant", "time_konstant"),
    ],
)
def test_errors_of_a_machine_file_name_the_key(old, new, message, check_refused):
    check_refused(FILE.replace(old, new), message)


def test_a_page_refuses_a_load_that_dries(tmp_path, wm_drake):
    path = tmp_path / "mine.yaml"
    path.write_text(FILE, encoding="utf-8")
    result = wm_drake("export", "page", "--machine", path, "--out", tmp_path / "page.html")
    assert result.code == 2
    assert "loads.towels" in result.err
