"""Drawing of a gasket: relaxation of the rubber."""

import math
from pathlib import Path

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters.gasket_drawing import PronySeries, load_gasket_drawing


@pytest.fixture(autouse=True)
def _in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_modulus_of_a_series_is_the_transform_of_its_relaxation():
    """E* = i w integral of k(t) exp(-i w t) dt, by that of the relaxed rubber."""
    series, frequency = PronySeries(time=(0.02, 0.3), share=(0.2, 0.1)), 2.5
    w, t = 2.0 * math.pi * frequency, np.linspace(0.0, 6.0, 600001)
    moving = sum(g * np.exp(-t / tau) for g, tau in zip(series.share, series.time, strict=True))
    transform = 0.7 + 1j * w * np.trapezoid(moving * np.exp(-1j * w * t), t)
    assert series.modulus(frequency) == pytest.approx(transform / 0.7, rel=1e-6)
    assert series.modulus(1e-9) == pytest.approx(1.0, abs=1e-6)
    assert series.modulus(1e9).real == pytest.approx(1.0 / 0.7)


@pytest.mark.parametrize(
    ("rubber", "message"),
    [
        ("prony: {time: '(0.1, 1) s', share: [0.1]}", "needs as many shares as times"),
        (
            "prony: {time: '(0.1, 1) s', share: [0.5, 0.5]}",
            "the shares add up to 1; allowed is below",
        ),
        ("prony: {time: '(0) s', share: [0.5]}", "rubber.prony.time"),
        ("prony: {time: '(0.1) s', share: [0.5]}, loss_factor: 0.1", "needs either loss_factor or"),
    ],
)
def test_a_wrong_series_is_one_message(rubber, message):
    rim = "radius: 160 mm, thickness: 2 mm"
    points = f"[{{{rim}, y: 0 mm}}, {{{rim}, y: 30 mm}}]"
    Path("mine.yaml").write_text(f"meridian: {points}\nrubber: {{shore_a: 40, {rubber}}}\n")
    with pytest.raises(InputError) as caught:
        load_gasket_drawing("mine.yaml")
    assert message in str(caught.value)
