"""Steps and drum motion from a spin profile."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from wm_drake.engines import schedule as module
from wm_drake.engines.schedule import schedule_of
from wm_drake.parameters import SpinProfile

PERIOD = 5e-3  # s
PROFILES = {
    "one ramp": SpinProfile(time=(0.0, 2.0), speed=(0.0, 15.0)),
    "corners on samples": SpinProfile(time=(0.0, 0.5, 0.505, 2.0), speed=(3.0, 15.0, 14.0, -2.0)),
    "corners off samples": SpinProfile(time=(0.0, 0.33331, 0.3334, 1.00017, 1.5021), speed=(0.0, 12.0, 12.0, -5.0, -5.0)),
    "shorter than a sample": SpinProfile(time=(0.0, 0.003), speed=(1.0, 2.0)),
    "corner a rounding away from a sample": SpinProfile(time=(0.0, 0.1 + 0.2, 1.0), speed=(0.0, 9.0, 9.0)),
}  # fmt: skip


def angle_at(profile, time):
    """Integrate the speed by quadrature, exact for straight pieces."""
    grid = np.union1d(np.array(profile.time), np.append(time, 0.0))
    grid = grid[grid <= time]
    return np.trapezoid(profile.speed_at(grid), grid)


@pytest.mark.parametrize("step", [5e-3, 2.5e-3, 1e-3])
@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_steps_end_at_corners_and_samples_and_are_no_longer_than_asked(profile, step):
    schedule = schedule_of(profile, step, PERIOD)
    ends = np.cumsum(schedule.step)
    begins = ends - schedule.step
    assert np.all(schedule.step[:-1] > 0.0)
    assert schedule.step[-1] == 0.0
    assert np.all(schedule.step <= step * (1.0 + 1e-9))
    assert ends[-1] == pytest.approx(profile.duration, abs=1e-12)
    for corner in profile.time[1:]:
        assert np.min(np.abs(ends - corner)) < 1e-10
    sampled = schedule.row >= 0
    np.testing.assert_array_equal(schedule.row[sampled], np.arange(len(schedule.time)))
    np.testing.assert_allclose(begins[sampled], schedule.time, atol=1e-10)
    np.testing.assert_allclose(schedule.time, PERIOD * np.arange(len(schedule.time)))
    assert profile.duration - schedule.time[-1] < PERIOD * (1.0 + 1e-9)


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_drum_follows_the_profile_exactly(profile):
    schedule = schedule_of(profile, 2.5e-3, PERIOD)
    ends = np.cumsum(schedule.step)
    begins = ends - schedule.step
    nodes = np.append(np.column_stack([begins, 0.5 * (begins + ends)]).ravel(), ends[-1])
    rate, cosine, sine, angle = schedule.drum.T
    np.testing.assert_allclose(rate, profile.speed_at(nodes), atol=1e-9)
    for index in range(0, len(nodes), max(1, len(nodes) // 50)):
        assert angle[index] == pytest.approx(angle_at(profile, nodes[index]), abs=1e-9)
    np.testing.assert_allclose((cosine, sine), (np.cos(angle), np.sin(angle)), atol=1e-15)
    # over a step the speed changes by what its acceleration says
    np.testing.assert_allclose(
        rate[2::2] - rate[:-1:2], schedule.acceleration * schedule.step, atol=1e-9
    )


def test_acceleration_at_a_sample_is_that_of_the_piece_that_begins_there():
    profile = PROFILES["corners on samples"]
    schedule = schedule_of(profile, 2.5e-3, PERIOD)
    expected = [profile.acceleration()[i] for i in (0, 0, 1, 2, 2)]
    np.testing.assert_allclose(
        schedule.acceleration[schedule.row >= 0][[0, 99, 100, 101, -1]], expected
    )


def test_threads_share_one_schedule():
    profile = SpinProfile(time=(0.0, 7.0), speed=(0.0, 15.0))
    with ThreadPoolExecutor(4) as pool:
        schedules = list(pool.map(partial(schedule_of, profile, 1e-3), [PERIOD] * 4))
    assert len({id(schedule) for schedule in schedules}) == 1


def test_pieces_of_the_drum_motion_are_those_of_the_whole(monkeypatch):
    given = PROFILES["corners off samples"], 2.4e-3, PERIOD, 0.0
    whole = schedule_of(*given)
    monkeypatch.setattr(module, "MOST_NODES", 7)
    np.testing.assert_array_equal(module._schedule_of.__wrapped__(*given).drum, whole.drum)
