"""Distances between tub and housing: against brute force and a closed form."""

import numpy as np
import pytest

from wm_drake.model.scene import Scene
from wm_drake.parameters import load_machine

REST = np.zeros(6)


@pytest.fixture(scope="module")
def scene():
    return Scene(load_machine("reference"))


def pair_named(scene, moving, fixed):
    return next(
        pair
        for pair in scene._pairs
        if (scene._name(pair[0]), scene._name(pair[1])) == (moving, fixed)
    )


def random_poses(count, seed):
    return np.random.default_rng(seed).normal(0.0, 1.0, (count, 6)) * np.repeat([0.01, 0.008], 3)


def test_shapes_of_tub_weights_and_housing_are_measured(scene):
    moving = {scene._name(pair[0]) for pair in scene._pairs}
    fixed = {scene._name(pair[1]) for pair in scene._pairs}
    assert {"tub_shell", "motor_block", "upper_counterweight_block"} <= moving
    assert {
        "wall_left", "wall_right", "wall_top", "wall_bottom", "wall_rear", "wall_front",
        "detergent_box",
    } == fixed  # fmt: skip


def test_tub_shell_to_side_wall_is_the_support_function_of_a_cylinder(scene):
    pair = pair_named(scene, "tub_shell", "wall_right")
    at_rest, _ = scene.distance(REST, pair)
    # a cylinder about y, turned by yaw: its extent in x is r cos(yaw) + l/2 sin(yaw), about its
    # centre 30 mm to the front
    radius, length, centre, wall = 0.262, 0.40, -0.03, 0.30
    assert at_rest == pytest.approx(wall - radius, abs=1e-7)
    yaw, x = 0.03, 0.01
    moved, point = scene.distance(np.array([0, 0, yaw, x, 0, 0]), pair)
    extent = radius * np.cos(yaw) + 0.5 * length * np.sin(yaw) + x - centre * np.sin(yaw)
    assert moved == pytest.approx(wall - extent, abs=1e-7)
    assert point[0] == pytest.approx(extent, abs=1e-7)


def test_distances_of_shapes_that_are_apart_are_exact(scene):
    """A distance lies between that of two of their points and the gap along a direction."""
    for pose in random_poses(5, 3):
        for (moving, fixed, away, distance), names in zip(
            scene.separations(pose), scene.pair_names(), strict=True
        ):
            bound = moving.lower_extent(away, pose[None]) + fixed.lower_extent(-away, REST[None])
            _, points = scene.nearest_points(pose, *names.split("|"))
            assert distance > 0.0
            assert bound[0] - 1e-9 <= distance <= bound[0] + 2e-7
            assert np.linalg.norm(points[0] - points[1]) == pytest.approx(distance, abs=2e-7)


def test_smallest_gap_is_that_of_brute_force(scene):
    poses, time = random_poses(60, 3), np.arange(60.0)
    every = {
        (i, pair): scene.distance(pose, pair)[0]
        for i, pose in enumerate(poses)
        for pair in scene._pairs
    }
    (index, pair), smallest = min(every.items(), key=lambda entry: entry[1])
    gap = scene.smallest_gap(time, poses, REST)
    assert gap.distance == smallest
    assert gap.time == time[index]
    assert (gap.moving, gap.fixed) == (scene._name(pair[0]), scene._name(pair[1]))


def test_gaps_of_runs_side_by_side_are_those_of_each(scene):
    time, good = np.arange(60.0), [60, 17, 0]
    runs = [random_poses(60, seed) for seed in range(3)]
    samples = np.stack([*runs, *runs[-1:] * 5], axis=-1)
    rests = [REST, np.full(6, 0.002), REST]
    paths = scene.paths(time, samples, good, rests)
    for poses, count, rest, path in zip(runs, good, rests, paths, strict=True):
        expected = scene.smallest_gap(time[:count], poses[:count], rest)
        assert scene.smallest_gap(time[:count], poses[:count], rest, path) == expected
    assert paths[2] is None


def test_overlap_is_a_negative_gap_and_no_samples_are_no_gap(scene):
    gap = scene.smallest_gap(np.array([1.5]), np.array([[0, 0, 0, 0.06, 0, 0]]), REST)
    assert gap.distance == pytest.approx(0.038 - 0.06, abs=1e-4)
    assert gap.fixed == "wall_right"
    assert scene.smallest_gap(np.empty(0), np.empty((0, 6)), REST) is None


def test_clearance_at_rest_is_that_of_a_real_machine(scene):
    gap = scene.smallest_gap(np.array([0.0]), REST[None, :], REST)
    assert 0.020 < gap.distance < 0.040  # m; [B] section 1: 20 to 40 mm


def test_contacts_are_those_of_brute_force(scene):
    poses, time = 4.0 * random_poses(40, 5), np.arange(40.0)
    every = np.array(
        [min(scene.distance(pose, pair)[0] for pose in poses) for pair in scene._pairs]
    )
    touching = every <= 0.0
    assert 3 < touching.sum() < len(every)
    found = scene.contacts(time, poses, REST)
    assert np.array_equal(np.isfinite(found), touching)
    assert found[touching] == pytest.approx(every[touching], abs=1e-5)
    assert len(set(scene.pair_names())) == len(found)
    assert np.isnan(scene.contacts(time[:1], REST[None, :], REST)).all()
