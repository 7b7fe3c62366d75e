"""`wm-drake identify table2`: fits beside the printed ones, and the trend that [C] claims."""

import json
from pathlib import Path

import numpy as np
import pytest

from wm_drake.studies.identify.table2 import frequency_trend, mstv_of_c


def test_force_grows_with_frequency_because_of_the_dashpots_alone():
    trend = frequency_trend(mstv_of_c(), (1.0, 10.0), 1e-3)
    assert trend.printed[1] > 1.3 * trend.printed[0]
    assert trend.without_dashpots[1] == pytest.approx(trend.without_dashpots[0], rel=1e-4)
    assert trend.friction[1] < 0.7 * trend.friction[0]


def test_measured_files_are_fitted_one_by_one_beside_the_printed_values(wm_drake):
    """Find k1 and c1 of a damper of Coulomb friction again."""
    Path("coulomb.yaml").write_text(
        "law: stv_sponge\nfriction_force: 45 N\nsponge_stiffness: 140 N/mm\n"
        "sponge_damping: 3 N s/mm\nslider_damping: 0.4 N s/mm\n"
    )
    bench = ("rig", "damper", "--component", "coulomb.yaml", "-f", "3 Hz", "-a", "0.3,2 mm")
    assert wm_drake(*bench, "--out", "bench").code == 0
    files = sorted(Path("bench").glob("loop_*.csv"))
    ended = wm_drake("identify", "table2", *files, "--json")
    assert ended.code == 0
    first, second = json.loads(ended.out)["tests"]
    assert (first["k1"], first["c1"]) == (140.0, 3.0)
    for row in (first, second):
        assert row["k1 fitted"] == pytest.approx(140.0, rel=0.02)
        assert row["c1 fitted"] == pytest.approx(3.0, rel=0.03)
    assert first["k1 ratio"] == pytest.approx(1.0, rel=0.02)
    assert second["k1"] is None
    assert np.isfinite(second["RMSE/peak"])
    assert Path("wm-drake-table2/report.html").read_text().count("<figure data-picture") == 1
