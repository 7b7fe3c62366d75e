"""Measured samples with equal time stamps are averaged, with a notice."""

import warnings

import numpy as np
import pytest

from wm_drake.errors import InputNotice
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.loop_files import read_loop


def test_neighbours_of_equal_time_become_their_mean():
    samples = np.array([[0.0, 1.0], [0.1, 2.0], [0.1, 4.0], [0.1, 9.0], [0.2, 3.0], [0.2, 5.0]])
    with pytest.warns(InputNotice, match=r"^file.csv: 5 samples share .* averaged to 2$"):
        found = with_distinct_times(samples, "file.csv")
    np.testing.assert_array_equal(found, [[0.0, 1.0], [0.1, 5.0], [0.2, 4.0]])


def test_other_samples_are_untouched():
    samples = np.array([[0.0, 1.0], [0.1, 2.0], [0.05, 3.0], [0.1, np.nan]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert with_distinct_times(samples, "file.csv") is samples


def test_a_loop_with_a_coarse_clock_is_that_of_the_fine_one(tmp_path):
    """Repeat every second stamp; samples lie in the middle of their ticks, half a step earlier."""
    time = 0.01 * np.arange(200)
    rows = [f"{t:.6f},{np.sin(7 * t):.9f},{np.cos(7 * t):.9f}" for t in time]
    coarse = [f"{time[k - k % 2]:.6f}{row[row.index(',') :]}" for k, row in enumerate(rows)]
    path = tmp_path / "loop.csv"
    path.write_text("\n".join(["time [s],displacement [mm],force [N]", *coarse]))
    with pytest.warns(InputNotice, match="ticks of 0.02 s"):
        loop = read_loop(path)
    assert len(loop.time) == 200
    expected = np.sin(7 * (loop.time - loop.time[0]))
    np.testing.assert_allclose(1e3 * loop.displacement, expected, atol=1e-8)
