"""What an outline begins with along a direction, against corners and rims."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wm_drake.compiler.lanes import WIDTH
from wm_drake.model.outline import lowest_points

CENTRE, HALF, RADIUS = np.array([0.1, -0.2, 0.05]), np.array([0.03, 0.2, 0.11]), 0.17  # m
AXES = Rotation.from_euler("xyz", [0.3, -0.8, 1.1]).as_matrix()
BOX = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * HALF
AROUND = np.linspace(0.0, 2.0 * np.pi, 20_001)
RIMS = np.vstack(
    [
        np.column_stack([RADIUS * np.cos(AROUND), RADIUS * np.sin(AROUND), z + 0.0 * AROUND])
        for z in (-0.11, 0.11)
    ]
)


@pytest.mark.parametrize(
    ("points", "half", "is_round"),
    [(BOX, HALF, False), (RIMS, np.array([RADIUS, RADIUS, 0.11]), True)],
    ids=["box", "cylinder"],
)
def test_a_shape_begins_at_its_first_point_along_the_direction(points, half, is_round):
    rng = np.random.default_rng(51)
    poses = rng.uniform(-1.0, 1.0, (WIDTH + 3, 6)) * np.repeat([0.4, 0.05], 3)
    for direction in (*rng.normal(size=(4, 3)), AXES[2]):  # the last along a cylinder's own axis
        direction = direction / np.linalg.norm(direction)
        nearest = np.empty((len(poses), 1))
        shape = np.concatenate([CENTRE, AXES.ravel(), half])
        lowest_points(poses, direction, shape, is_round, nearest)
        for pose, found in zip(poses, nearest[:, 0], strict=True):
            placed = Rotation.from_euler("xyz", pose[:3]).apply(CENTRE + points @ AXES) + pose[3:]
            assert found == pytest.approx(np.min(placed @ direction), abs=1e-8)
