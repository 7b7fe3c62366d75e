"""RMS displacements in regions: hand values, integrated acceleration, batch and single runs."""

import tracemalloc

import numpy as np
import pytest
import xarray as xr
from simple_machines import constant_speed, isotropic_machine

from wm_drake.batch import simulate_many
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, Sensor, SpinProfile, Unbalance, with_value
from wm_drake.parameters.spin import Region
from wm_drake.simulation.cases import Case
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.runs import simulate
from wm_drake.simulation.vibration import (
    HIGH_PASS_HZ,
    high_passed,
    integrated_twice,
    point_accelerations,
    region_displacements,
    region_rms,
    relative_error,
    sensor_accelerations,
    tub_motion_of,
)

PERIOD = 5e-3
PROFILE = SpinProfile(
    time=(0.0, 6.0, 9.0),
    speed=(5.0, 30.0, 30.0),
    regions=(Region(name="A", begin=1.0, end=4.0), Region(name="B", begin=4.0, end=9.0)),
)


def pair(front, rear, phase=0.0, y=0.1):
    masses = (
        Unbalance(mass=front, radius=0.25, y=-y),
        Unbalance(mass=rear, radius=0.25, y=y, phase=phase),
    )
    return Load(unbalances=tuple(mass for mass in masses if mass.mass))


def test_rms_by_hand():
    signal = np.concatenate([np.full(200, 9.0), np.full(600, 3.0), np.tile([1.0, -7.0], 501)])[
        :, None
    ]
    np.testing.assert_allclose(region_rms(signal, PERIOD, PROFILE), [[3.0], [5.0]])


def test_regions_that_a_run_does_not_complete_are_nan():
    rms = region_rms(np.ones((1000, 2)), PERIOD, PROFILE)
    np.testing.assert_array_equal(rms, [[1.0, 1.0], [np.nan, np.nan]])


def test_more_points_do_not_need_more_memory_at_once():
    rng = np.random.default_rng(0)
    motion, acceleration = rng.normal(size=(1801, 13)), rng.normal(size=(1801, 6))

    def peak(points):
        tracemalloc.start()
        region_displacements(motion, acceleration, points, np.zeros(6), PERIOD, PROFILE)
        largest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return largest

    few, many = rng.normal(size=(2, 3)), rng.normal(size=(12, 3))
    peak(few)  # imports
    assert peak(many) < 1.2 * peak(few)


@pytest.mark.parametrize("frequency", [0.8, 3.0, 6.0, 20.0])
def test_acceleration_of_a_wave_gives_its_displacement_whatever_the_bias(frequency):
    time = PERIOD * np.arange(8000)
    growth = np.clip(time / 5.0, 0.0, 1.0) ** 3  # from rest
    wave = (1e-3 * growth * np.sin(2.0 * np.pi * frequency * time))[:, None]
    acceleration = np.gradient(np.gradient(wave[:, 0], PERIOD, edge_order=2), PERIOD, edge_order=2)
    exact = np.where(time > 5.0, -((2.0 * np.pi * frequency) ** 2) * wave[:, 0], acceleration)[
        :, None
    ]
    middle = slice(2500, 7000)  # away from what numpy's gradient makes of the growth
    biased = integrated_twice(exact + 0.2 - (exact + 0.2).mean(), PERIOD)
    for displacement in (integrated_twice(exact, PERIOD), biased):
        shown = high_passed(displacement, PERIOD, HIGH_PASS_HZ)
        rms = np.sqrt(np.mean(shown[middle] ** 2))
        assert rms == pytest.approx(1e-3 / np.sqrt(2.0), rel=0.03 if frequency < 1.0 else 0.005)


def test_too_few_samples_have_no_displacement():
    assert np.isnan(high_passed(np.ones((5, 2)), PERIOD, 0.5)).all()
    assert np.isnan(integrated_twice(np.ones((1, 2)), PERIOD)).all()
    assert integrated_twice(np.ones((0, 2)), PERIOD).shape == (0, 2)


def test_accelerations_of_points_are_the_second_differences_of_their_positions(machine, reference):
    profile = SpinProfile(time=(0.0, 2.0), speed=(20.0, 20.0))
    # a second difference shows an error of 1 um as 0.04 m/s^2: the scheme of smaller error
    record = simulate(
        machine, Case("middle", reference.loads["middle"], profile), integrator="runge_kutta"
    )
    angle = record.drum_angle.values[:, None]
    motion = np.hstack(
        [
            record.tub_angle, record.tub_position, angle, record.tub_angular_velocity,
            record.tub_velocity,
        ]
    )  # fmt: skip
    acceleration = np.hstack([record.tub_angular_acceleration, record.tub_acceleration])
    points = np.array([[0.1, -0.2, 0.25]])
    computed = point_accelerations(motion, acceleration, points)[:, 0]

    positions = point_positions(motion, points)[:, 0]
    differences = np.diff(positions, 2, axis=0) / PERIOD**2
    largest = np.abs(computed).max()
    np.testing.assert_allclose(computed[201:-1], differences[200:], atol=0.02 * largest)


def test_acceleration_at_a_sensor_of_a_spinning_tub():
    """Turn a tub about z with 3 rad/s, speeding up: a = a_To + alpha r - w^2 r."""
    sensors = {"A": Sensor(frame="f", axis="x"), "B": Sensor(frame="f", axis="y")}
    vector, count = np.array([[0.0, 0.0, 1.0]]), 4
    rows = dict.fromkeys(("tub_position", "tub_velocity"), np.zeros((count, 3)))
    rows |= {
        "tub_angular_velocity": np.repeat(3.0 * vector, count, axis=0),
        "tub_angular_acceleration": np.repeat(5.0 * vector, count, axis=0),
        "tub_acceleration": np.repeat([[0.5, 0.25, 0.0]], count, axis=0),
    }
    record = xr.Dataset(
        {name: (("time", "axis"), values) for name, values in rows.items()}
        | {
            "tub_angle": (("time", "angle"), np.zeros((count, 3))),
            "drum_angle": ("time", np.zeros(count)),
            "displacement": (("time", "sensor"), np.zeros((count, 2))),
            "sensor_point": (("sensor", "axis"), np.array([[0.2, 0.0, 0.7]] * 2)),
        },
        {"sensor": ["A", "B"]},
    )
    found = sensor_accelerations(record, sensors)
    assert found.attrs["units"] == "m/s^2"
    np.testing.assert_allclose(found.sel(sensor="A"), 0.5 - 9.0 * 0.2)
    np.testing.assert_allclose(found.sel(sensor="B"), 0.25 + 5.0 * 0.2)


def test_relative_error_by_hand():
    computed, measured = np.array([[3.0, 4.0], [1.0, 1.0]]), np.array([[3.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(relative_error(computed, measured), [4.0 / 3.0, np.nan])


def test_both_ways_agree(machine):
    cases = [Case(str(mass), pair(mass, 0.4), PROFILE) for mass in (0.0, 0.2, 0.5)]
    table = simulate_many(machine, cases, measures=["regions"], workers=2)
    error = relative_error(
        table.region_displacement_integrated.values.reshape(3, 2, -1),
        table.region_displacement.values.reshape(3, 2, -1),
    )
    assert 0.0 < error.max() < 0.01


def test_a_residual_imbalance_is_a_load_of_its_own(machine, reference):
    residual = reference
    for key, value in (("mass", "50 g"), ("radius", "240 mm"), ("y", "30 mm"), ("phase", "40 deg")):
        residual = with_value(residual, f"imperfections.residual_imbalance.{key}", value)
    as_load = Load(
        unbalances=(*pair(0.3, 0.2).unbalances, residual.imperfections.residual_imbalance)
    )
    cases = [
        Case("residual", pair(0.3, 0.2), PROFILE, parameters=residual),
        Case("load", as_load, PROFILE),
    ]
    table = simulate_many(
        machine, [*cases, Case("without", pair(0.3, 0.2), PROFILE)], measures=["regions"]
    )
    residual_rms, load_rms, without = table.region_displacement.values
    np.testing.assert_allclose(residual_rms, load_rms, rtol=1e-9)
    assert np.abs(residual_rms / without - 1.0).max() > 0.02


@pytest.fixture(scope="module")
def isotropic():
    return build_machine(isotropic_machine())


class TestClosedForms:
    """Static and dynamic unbalance at time 0; the centre of mass is on the drum axis."""

    SPEED, MASS, RADIUS, Y = 30.0, 0.4, 0.25, 0.1

    def rates(self, isotropic, phase):
        load = pair(self.MASS, self.MASS, phase, self.Y)
        record = simulate(isotropic, Case("pair", load, constant_speed(self.SPEED, 0.01)))
        return record.tub_acceleration.values[0], record.tub_angular_acceleration.values[0]

    def test_equal_masses_in_phase_push_and_do_not_turn(self, isotropic):
        acceleration, turning = self.rates(isotropic, 0.0)
        force = 2.0 * self.MASS * self.RADIUS * self.SPEED**2  # both up at the first instant
        # the masses add to the mass of the tub; the pair is symmetric in y: no moment about To
        np.testing.assert_allclose(
            acceleration, [0.0, 0.0, force / (42.0 + 2.0 * self.MASS)], rtol=2e-3, atol=1e-3
        )
        np.testing.assert_allclose(turning, 0.0, atol=1e-6)

    def test_equal_masses_in_opposition_turn_and_do_not_push(self, isotropic):
        acceleration, turning = self.rates(isotropic, np.pi)
        # front up, rear down: about -x
        couple = 2.0 * self.MASS * self.RADIUS * self.Y * self.SPEED**2
        inertia = 6 * 0.3 + 2.0 * self.MASS * (self.RADIUS**2 + self.Y**2)
        np.testing.assert_allclose(acceleration, 0.0, atol=1e-9)
        assert turning[0] == pytest.approx(-couple / inertia, rel=0.02)

    @pytest.mark.parametrize("phase", [0.0, 0.5 * np.pi, np.pi])
    def test_exchanged_masses_mirror_front_and_rear_of_a_symmetric_machine(self, isotropic, phase):
        points = np.array([[0.1, -0.2, 0.2], [0.1, 0.2, 0.2]])

        def displacements(load):
            record = simulate(isotropic, Case("pair", load, PROFILE))
            where = points, np.asarray(record.attrs["rest_pose"]), 5e-3, PROFILE
            return region_displacements(*tub_motion_of(record), *where)[0]

        forth, back = (
            displacements(load)
            for load in (
                pair(0.6, 0.2, phase),
                Load(  # the load mirrored between front and rear; the leading mass keeps leading
                    unbalances=(
                        Unbalance(mass=0.2, radius=0.25, y=-0.1, phase=phase),
                        Unbalance(mass=0.6, radius=0.25, y=0.1),
                    )
                ),
            )
        )
        np.testing.assert_allclose(forth, back[:, ::-1], rtol=1e-9, atol=1e-12)
        assert np.abs(forth / back - 1.0).max() > 0.1  # front and rear themselves differ
