"""Machines by name and by parameters, their text, and symbols of [B] in `--set`."""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.studies.inputs import with_sets


@pytest.fixture(scope="module")
def short():
    """Return the reference machine with a profile of one second."""
    parameters = wm.load_machine("reference")
    return wm.with_value(parameters, "profile.time", "(0, 0.5, 1) s")


def test_name_parameters_and_built_machine_run_alike(short):
    machine = wm.build_machine(short)
    case = wm.case_of(short, "middle")
    wanted = wm.simulate(machine, "middle").displacement.values
    assert np.array_equal(wm.simulate(short, "middle").displacement.values, wanted)
    by_name = wm.simulate("reference", case).displacement.values
    assert np.array_equal(by_name, wanted)
    table = wm.simulate_many(short, ["middle", case], measures=("extremes",))
    assert list(table.case.values) == ["middle", "middle"]
    assert wm.natural_modes("reference").frequency.values == pytest.approx(
        wm.natural_modes(machine).frequency.values
    )


def test_text_of_a_machine_is_short(short):
    machine = wm.build_machine(short)
    for shown in (short, machine, machine.set_up()):
        text = repr(shown)
        assert len(text) < 300
        assert "'reference': 3 springs, 3 dampers, a gasket, loads middle, counter" in text
    assert str(short) == repr(short)


def test_symbol_of_b_sets_all_its_numbers(short):
    changed, sources = with_sets(short, {}, ["C_L=0.03 N s/mm", "K_Ty=80 %"])
    gasket = changed.gasket
    assert (gasket.damping_x, gasket.damping_y, gasket.damping_z) == pytest.approx((30.0,) * 3)
    torques = short.gasket.rotational_stiffness_y.torque
    assert gasket.rotational_stiffness_y.torque == pytest.approx([0.8 * t for t in torques])
    assert "gasket.damping_z" in sources
    with pytest.raises(InputError, match="--set: C_L: unit 'kg' does not fit"):
        with_sets(short, {}, ["C_L=3 kg"])
