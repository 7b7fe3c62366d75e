"""Tubes of telescopic dampers: the compiled machine against the Drake diagram, at random states and along a run."""

import numpy as np
import pytest
from both_engines import LOAD, difference, redrawn
from telescopic_machine import changed, telescopic, with_bushing

from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate


@pytest.fixture(scope="module")
def built(shipped):
    return shipped("free_stroke")


def test_they_agree_for_crooked_tubes_and_without_friction(built):
    crooked = changed(
        telescopic(),
        bodies={
            "damper_left_outer": {
                "mass": 0.4,
                "centre_of_mass": (-0.2, 0.02, -0.28),
                "inertia": {
                    "xx": 1e-3,
                    "yy": 1.2e-3,
                    "zz": 9e-4,
                    "xy": 1e-4,
                    "xz": -2e-4,
                    "yz": 5e-5,
                },
            },
            "damper_left_inner": {"mass": 0.3, "centre_of_mass": (-0.25, -0.01, -0.35)},
        },
    )
    with pytest.raises(InputError, match="telescopic_dampers: the bushings cannot hold the tubes"):
        built.set_up(LOAD, parameters=crooked)
    held = with_bushing(crooked, rotational_stiffness_y=20.0)  # N m/rad
    assert difference(built, parameters=held) < 1e-10
    assert difference(built, dampers=False) < 1e-10


def test_they_agree_for_other_laws_along_the_joint_and_tables_in_the_bushings():
    table = {"angle": (-0.5, 0.0, 0.3), "torque": (-2.0, 0.0, 0.7)}
    mstv = {
        "law": "mstv",
        "friction_force": 60.0,
        "sponge_stiffness": 176e3,
        "sponge_damping": 90.0,
        "slider_damping": 400.0,
    }
    other = changed(
        with_bushing(telescopic(), rotational_stiffness_x=table), damper_types={"free_stroke": mstv}
    )
    machine = build_machine(other)
    assert difference(machine) < 1e-10


@pytest.mark.slow
def test_a_run_moves_as_in_drake(built):
    """Let Drake control its error; both are converged to much less than these tolerances."""
    profile = SpinProfile(time=(0.0, 0.301, 1.2), speed=(8.0, 10.0, 19.5))
    drake, compiled = (
        simulate(built, Case("two", LOAD, profile), engine)
        for engine in ("drake-accurate", "compiled")
    )
    assert list(drake.data_vars) == list(compiled.data_vars)
    motion = float(np.abs(drake.displacement).max())
    assert motion > 1e-3
    for variable in (
        "displacement",
        "tub_position",
        "tube_position",
        "tube_extension",
        "damper_deformation",
    ):
        np.testing.assert_allclose(compiled[variable], drake[variable], rtol=0.0, atol=1e-6)  # m
    np.testing.assert_allclose(
        compiled.bushing_force,
        drake.bushing_force,
        atol=1e-3 * float(np.abs(drake.bushing_force).max()),
    )


SDF = "free_stroke.sdf"
REVOLUTE = (
    r'<joint name="damper_left_telescope" type="prismatic">',
    '<joint name="damper_left_telescope" type="revolute">',
)
DAMPED = (
    r"(damper_left_telescope.*?<effort>0</effort></limit>)(</axis>)",
    r"\1<dynamics><damping>3</damping></dynamics>\2",
)
DRIVEN = (r"(damper_left_telescope.*?)<effort>0</effort>", r"\1")


def machine_of(sdf):
    return changed(telescopic(), model=sdf)


def test_a_joint_with_damping_of_its_own_is_refused_by_the_compiled_engine_only(tmp_path):
    setup = build_machine(machine_of(redrawn(tmp_path, SDF, DAMPED))).set_up()
    with pytest.raises(
        InputError,
        match="joint 'damper_left_telescope' has damping of its own; use the drake engine",
    ):
        run_compiled(
            setup, SpinProfile(time=(0.0, 1.0), speed=(0.0, 1.0)), 2.5e-4, lambda fraction: None
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (REVOLUTE, "joint 'damper_left_telescope' is revolute, not prismatic"),
        (DRIVEN, "must be the only one with an actuator"),
    ],
    ids=["revolute", "driven"],
)
def test_other_joints_are_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        build_machine(machine_of(redrawn(tmp_path, SDF, change)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint": "damper_lft_telescope"}, r"joint: no joint 'damper_lft_telescope' in the SDF \(did you mean 'damper_left_telescope'"),
        ({"outer_frame": "damper_left_tub"}, "outer_frame: frame 'damper_left_tub' is not fixed to the damper_left_outer"),
        ({"tub_bushing": "conecting"}, r"left.tub_bushing: 'conecting' is not in bushing_types \(did you mean 'connecting'"),
    ],
)  # fmt: skip
def test_wrong_names_are_refused(change, message):
    parameters = telescopic()
    dampers = parameters.model_dump()["telescopic_dampers"]
    with pytest.raises((InputError, ValueError), match=message):
        build_machine(
            changed(parameters, telescopic_dampers=dampers | {"left": dampers["left"] | change})
        )


def test_dampers_may_come_in_any_order():
    parameters = telescopic()
    dampers = dict(reversed(parameters.model_dump()["telescopic_dampers"].items()))
    machine = build_machine(changed(parameters, telescopic_dampers=dampers))
    assert difference(machine) < 1e-10
