"""Cases are chosen by name; `all` is the whole table."""

import pytest

from wm_drake.errors import InputError
from wm_drake.studies.spin_cycle.study import cases_of_table


@pytest.mark.parametrize(
    ("names", "count"), [(None, 33), ((), 33), (["all"], 33), (["2", "5", "2"], 2)]
)
def test_names_choose_cases_of_table_9(names, count):
    assert len(cases_of_table(None, names)) == count


def test_all_is_no_case_among_others():
    with pytest.raises(InputError, match="unknown case 'all'"):
        cases_of_table(None, ["2", "all"])
