"""Fits beside [C] Table 2, and the trend with frequency that [C] claims."""

import pytest
from analysis_tools.coulomb_table import coulomb_fits, frequency_trend, mstv_motions, mstv_of_c

from wm_drake.parameters import StvSpongeDamper
from wm_drake.rigs import Harmonic


def test_force_grows_with_frequency_because_of_the_dashpots_alone():
    trend = frequency_trend(mstv_of_c(), (1.0, 10.0), 1e-3)
    assert trend.printed[1] > 1.3 * trend.printed[0]
    assert trend.without_dashpots[1] == pytest.approx(trend.without_dashpots[0], rel=1e-4)
    assert trend.friction[1] < 0.7 * trend.friction[0]


def test_tests_are_fitted_one_by_one_beside_the_printed_values():
    """Find k1 and c1 of a damper of Coulomb friction again."""
    coulomb = StvSpongeDamper(
        law="stv_sponge",
        friction_force=45.0,
        sponge_stiffness=140e3,
        sponge_damping=3e3,
        slider_damping=400.0,
    )
    motions = mstv_motions(coulomb, [Harmonic(3.0, 0.3e-3), Harmonic(3.0, 2e-3)])
    fits = coulomb_fits(motions, 45.0, 400.0)
    assert fits["k1 fitted"].tolist() == pytest.approx([140.0] * 2, rel=0.02)
    assert fits["c1 fitted"].tolist() == pytest.approx([3.0] * 2, rel=0.03)
    assert (fits.k1[0], fits.c1[0]) == (140.0, 3.0)
    assert fits["k1 ratio"][0] == pytest.approx(1.0, rel=0.02)
    assert fits[["k1", "k1 ratio"]].iloc[1].isna().all()
