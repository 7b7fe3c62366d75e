"""Commands `study modes`, `study response` and `record orders`."""

import json

import numpy as np
import pandas as pd
import pytest


def test_study_modes_prints_the_documented_json(wm_drake, tmp_path):
    result = wm_drake("study", "modes", "--json", "--amplitude", "1 mm", "--out", "m")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    modes = pd.DataFrame(found["modes"])
    assert modes["mode"].is_unique
    for name in ("stuck", "amplitude", "sliding"):
        assert {f"frequency_{name}_Hz", f"damping_ratio_{name}"} <= set(modes)
    campbell = pd.DataFrame(found["campbell"])
    sliding = campbell[campbell["linearisation"] == "sliding"]
    at_rest = sliding[sliding["speed_rpm"] == 0.0]
    assert sorted(at_rest["mode"]) == sorted(modes["mode"])
    assert at_rest.set_index("mode")["frequency_Hz"].to_dict() == pytest.approx(
        modes.set_index("mode")["frequency_sliding_Hz"].to_dict()
    )
    # at a critical speed, the frequency of a curve is its order of the speed
    curves = dict(list(sliding.groupby("curve")))
    for row in found["critical"]:
        if row["linearisation"] == "sliding":
            rpm = row["speed_rpm"]
            hertz = [np.interp(rpm, c["speed_rpm"], c["frequency_Hz"]) for c in curves.values()]
            assert np.min(np.abs(np.array(hertz) - row["order"] * rpm / 60.0)) < 5e-3
    page = (tmp_path / "m" / "report.html").read_text(encoding="utf-8")
    assert "Campbell diagram" in page
    table = pd.read_csv(tmp_path / "m" / "sensitivities.csv")
    assert {"stuck", "sliding"} == set(table["linearisation"])


def test_study_response_prints_the_documented_json(wm_drake, tmp_path):
    command = "study response --json --load front --points 6 --harmonics 3 --out r"
    result = wm_drake(command, "--from", "150 rpm", "--to", "200 rpm", "--rate", "50 rpm/s")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    branches = pd.DataFrame(found["response"])
    assert set(branches["load"]) == {"front"}
    of_gasket = dict(list(branches.groupby("gasket")))
    assert set(of_gasket) == {"yes", "no"}
    for branch in of_gasket.values():
        assert branch["speed_rpm"].iloc[[0, -1]].tolist() == pytest.approx([150.0, 200.0])
        assert branch.filter(like="amplitude_").gt(0.0).all(axis=None)
    assert of_gasket["yes"]["gasket_force_x_N"].gt(0.0).all()
    assert of_gasket["no"]["gasket_force_x_N"].eq(0.0).all()
    sweeps = pd.read_csv(tmp_path / "r" / "sweeps.csv")
    assert set(sweeps["direction"]) == {"up", "down"}
    assert sweeps["amplitude_mm"].gt(0.0).all()


def test_orders_of_measured_accelerations(wm_drake, tmp_path):
    """Plant order 2 of 3 m/s^2 while the drum speeds up."""
    time = np.arange(0.0, 40.0, 5e-3)
    rpm = 100.0 + 5.0 * time
    angle = (100.0 * time + 2.5 * time**2) * np.pi / 30.0
    table = pd.DataFrame({"time_s": time, "speed_rpm": rpm, "A": 3.0 * np.cos(2.0 * angle + 0.4)})
    table.to_csv(tmp_path / "a.csv", index=False)
    result = wm_drake("record", "orders", "a.csv", "--json", "--out", "o")
    assert result.code == 0, result.err
    orders = pd.DataFrame(json.loads(result.out)["orders"]).set_index("order")
    amplitudes = orders["amplitude_m_per_s2"]
    assert amplitudes[2.0].to_numpy() == pytest.approx(3.0, rel=0.01)
    assert amplitudes[1.0].max() < 0.03
    assert orders["speed_rpm"][1.0].is_monotonic_increasing
    assert (tmp_path / "o" / "report.html").exists()
