"""Options of a bushing of rubber in machine files: what is allowed, and what messages say."""

import pytest
from pydantic import ValidationError

from wm_drake.errors import InputError
from wm_drake.parameters import with_value
from wm_drake.parameters.elements import Bushing
from wm_drake.parameters.rubber import CROSS_FIELDS, DAHL_FIELDS, MAXWELL_FIELDS, RubberBranches

BUSHING = {
    **{f"stiffness_{axis}": 4e3 for axis in "xyz"},
    **{f"rotational_stiffness_{axis}": 40.0 for axis in "xyz"},
    "tub_frame": "a",
    "housing_frame": "b",
}


def test_every_axis_has_each_option_once():
    named = [*sum((*DAHL_FIELDS, *MAXWELL_FIELDS), ()), *CROSS_FIELDS]
    assert sorted(named) == sorted(RubberBranches.model_fields)
    assert not Bushing(**BUSHING).branches_in_use


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"dahl_force_x": 5.0}, "dahl_displacement_x: must be above 0 where dahl_force_x is"),
        ({"dahl_torque_z": 5.0}, "dahl_angle_z: must be above 0"),
        ({"maxwell_stiffness_y": 5.0}, "both must be above 0 for a Maxwell branch"),
        ({"rotational_maxwell_damping_y": 5.0}, "both must be above 0 for a Maxwell branch"),
        ({"dahl_force_x": -1.0}, "greater than or equal to 0"),
        ({"cross_stiffness_x_y": 4.1e3}, "cross-stiffness is too large"),
        ({"cross_stiffness_x_about_y": -401.0}, "cross-stiffness is too large"),
    ],
)
def test_wrong_options_are_refused(numbers, message):
    with pytest.raises(ValidationError, match=message):
        Bushing(**BUSHING, **numbers)


def test_cross_stiffness_up_to_its_limit_and_units_of_files():
    limit = (4e3 * 40.0) ** 0.5
    bushing = Bushing(**BUSHING, cross_stiffness_x_about_y=f"{0.999 * limit} N/rad")
    assert (
        bushing.cross_matrix()[0, 4] == bushing.cross_matrix()[4, 0] == pytest.approx(0.999 * limit)
    )
    friction = Bushing(**BUSHING, dahl_torque_y="50 N*mm", dahl_angle_y="1 deg")
    assert friction.branches_in_use == ("dahl_torque_y",)
    assert friction.dahl_angle_y == pytest.approx(0.0174533, rel=1e-5)


def test_a_built_machine_keeps_its_branches(machine, reference):
    other = with_value(
        with_value(reference, "gasket.dahl_displacement_x", 1e-3), "gasket.dahl_force_x", 9.0
    )
    with pytest.raises(InputError, match=r"gasket: .*branches of rubber dahl_force_x, .* none"):
        machine.set_up(parameters=other)
