"""Drawing of a gasket: relaxation of the rubber."""

import math
from pathlib import Path

import numpy as np
import pytest

from wm_drake.errors import InputError, InputNotice
from wm_drake.parameters.gasket_drawing import (
    PronySeries,
    falls_at,
    load_gasket_drawing,
    tension_stress,
)


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


SOFTENING = (
    "stretch: [1, 1.1, 1.2, 1.3, 1.4, 1.5], stress: '(0, 0.194, 0.356, 0.505, 0.619, 0.717) MPa'"
)
"""Test of 0.35 MPa over a short range with scatter of 2 %, from which c2 and c3 follow badly."""


def with_test(text):
    rim = "radius: 160 mm, thickness: 2 mm"
    points = f"[{{{rim}, y: 0 mm}}, {{{rim}, y: 30 mm}}]"
    Path("mine.yaml").write_text(f"meridian: {points}\nrubber: {{test: {{{text}}}}}\n")
    return load_gasket_drawing("mine.yaml")


def test_as_many_constants_are_fitted_as_make_a_stable_rubber():
    with pytest.warns(
        InputNotice,
        match=r"3 constants make an unstable rubber; 1 can be used, with a fit within 1.2 %",
    ):
        fallen = with_test(SOFTENING).rubber
    count = fallen.test.fitted_terms
    assert count == 1
    assert falls_at(fallen.constants) is None
    assert falls_at(fallen.test.fitted(count + 1)) is not None
    stretch, stress = np.array(fallen.test.stretch), np.array(fallen.test.stress)
    apart = tension_stress(stretch, fallen.constants) - stress
    assert fallen.test.deviation == pytest.approx(np.sqrt(np.mean(apart**2)) / stress.max())


def test_a_number_of_constants_that_is_unstable_names_those_that_are_not():
    with pytest.raises(InputError, match=r"unstable.*terms: 1 is stable and fits within 1.2 %"):
        with_test(f"{SOFTENING}, terms: 3")


def test_a_test_of_two_loads_gives_one_constant():
    test = with_test("stretch: [1, 1.5, 2], stress: '(0, 0.4, 0.6) MPa'").rubber.test
    assert (test.most_terms, test.fitted_terms) == (1, 1)
