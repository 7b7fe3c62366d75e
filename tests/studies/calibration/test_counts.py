"""Counts of free quantities of `--fewer`."""

import pytest

from wm_drake.errors import InputError
from wm_drake.studies.calibration.fewer import check_counts


@pytest.mark.parametrize("counts", [[3], [0], [2, 2], [1, 2], [-1]])
def test_counts_must_fall_from_the_number_of_free_quantities(counts):
    with pytest.raises(InputError, match="falling numbers from 2 to 1; 3 quantities are free"):
        check_counts(counts, 3)


def test_no_count_and_falling_counts_are_allowed():
    check_counts([], 3)
    check_counts([2, 1], 3)
