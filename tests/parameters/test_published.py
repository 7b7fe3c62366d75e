"""Published results of a gasket study: what a file may contain, and what is refused."""

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, published_results
from wm_drake.parameters.published import OF_RESPONSE

HEADER = "load,response,term,percent,effects\n"


@pytest.fixture
def write(tmp_path):
    def written(text):
        path = tmp_path / "published.csv"
        path.write_text(HEADER + text)
        return str(path)

    return written


def test_reference_machine_has_tables_4_and_5(reference):
    found = published_results(reference.published)
    assert len(found) == 18
    assert found["middle", "My"]["constant"].effects == (5.72,)
    assert found["counter", "Dz"]["range"].effects == (2.1, 5.2)
    assert found["middle", "Dx"]["interactions"].percent == 29.41
    mains = [
        term
        for terms in found.values()
        for name, term in terms.items()
        if name not in OF_RESPONSE and ":" not in name
    ]
    assert len(mains) == 30
    assert all(len(term.effects) == 3 for term in mains)


def test_contributions_and_effects_of_table_5_belong_together(reference):
    """Sums of squares of the effects of a response have the ratios of its contributions.

    They do so only if the effect at level 1 is minus the sum of the two that are printed.
    """
    for terms in published_results(reference.published).values():
        ratios = [
            np.square(term.effects).sum() / term.percent
            for name, term in terms.items()
            if name not in OF_RESPONSE and ":" not in name
        ]
        assert max(ratios) / min(ratios) < 1.08
        sums = terms["main effects"].percent + terms["interactions"].percent
        assert 97.0 < sums <= 100.0


def test_means_contributions_and_effects_are_read(write):
    path = write(
        "middle,Dx,constant,,13.72\n"
        "middle,Dx,C_L,40.5,1.5 -0.5 -1\n"
        "middle,Dx,K_Lx,12,\n"
        "counter,Dx,C_L:C_T,6.1,1 2 3 4 5 6 7 8 9  # level of C_L changes slowest\n"
    )
    found = published_results([path])
    assert (found["middle", "Dx"]["C_L"].percent, found["middle", "Dx"]["K_Lx"].percent) == (
        40.5,
        12,
    )
    assert found["middle", "Dx"]["C_L"].effects == (1.5, -0.5, -1.0)
    assert found["middle", "Dx"]["K_Lx"].effects == ()
    assert found["counter", "Dx"]["C_L:C_T"].effects == tuple(range(1, 10))


def test_effects_at_two_levels_are_completed_to_a_sum_of_zero(write):
    """Take the levels -1 and 0 of each factor, as [B] Table 5 gives them."""
    path = write("middle,Dx,C_L,40,2 -0.5\nmiddle,Dx,C_L:C_T,6,1 2 3 5\n")
    terms = published_results([path])["middle", "Dx"]
    assert terms["C_L"].effects == (2.0, -0.5, -1.5)
    assert terms["C_L:C_T"].effects == (1.0, 2.0, -3.0, 3.0, 5.0, -8.0, -4.0, -7.0, 11.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("middle,Dx,constant,,\n", "constant has 0 percentages and 0 effects"),
        ("middle,Dx,C_L,40,1 2 3 4\n", "allowed are one percentage and 2 or 3 effects"),
        ("middle,Dx,a:b:c,40,\n", "a term has at most 2 factors"),
        ("middle,Dx,range,,1\n", "range has 0 percentages and 1 effects"),
        ("middle,Dx,main effects,90,1\n", "allowed are one percentage and no effects"),
        ("middle,Dx,C_L,40 50,\n", "has 2 percentages"),
        ("middle,Dx,C_L,much,\n", "percent: 'much' is not a finite number"),
        ("middle,Dx,C_L,40,1 inf 2\n", "effects: 'inf' is not a finite number"),
        ("middle,Dx,C_L,40,1_0 2 3\n", "'1_0' is not a finite number"),
        ("middle,,C_L,40,\n", "row 1 of the data: the column response is empty"),
        ("middle,Dx,C_L,40,\nmiddle,Dx,C_L,41,\n", "row 2 of the data: middle, Dx, C_L is given twice"),
    ],
)  # fmt: skip
def test_faulty_files_are_refused(write, text, message):
    path = write(text)
    with pytest.raises(InputError) as refused:
        published_results([path], "--published")
    (problem,) = refused.value.problems
    assert message in problem.message
    assert (problem.where, problem.key) == (path, "--published")


def test_machine_that_extends_another_has_no_published_results(tmp_path):
    (tmp_path / "mine.yaml").write_text("extends: reference\nname: mine\n")
    assert load_machine(str(tmp_path / "mine.yaml")).published == ()
    (tmp_path / "yours.yaml").write_text("extends: reference\npublished: [table.csv]\n")
    assert load_machine(str(tmp_path / "yours.yaml")).published == (str(tmp_path / "table.csv"),)
