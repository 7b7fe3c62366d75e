"""Derivatives of each element by its packed numbers: AutoDiffXd against finite differences."""

import numpy as np
import pytest
from machines_of_each_kind import DAMPERS, END_BUSHING, LINEAR_TABLE, TORQUE_TABLE, damper_of
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from scipy.spatial.transform import Rotation

from wm_drake.compiler.compilation import generic
from wm_drake.elements.bearing import DRUM_BEARING_NUMBERS, evaluate_drum_bearing
from wm_drake.elements.bearing import FORCE_SIZE as BEARING_FORCE_SIZE
from wm_drake.elements.bushing import (
    SixComponentBushingParameters,
    evaluate_six_component_bushing,
    packed_bushing_law,
)
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FrictionDamperParameters, evaluate_friction_damper
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.spring import SPRING, SpringStrutParameters, evaluate_spring_strut
from wm_drake.elements.telescopic_damper import (
    FORCE_SIZE,
    TelescopicDamperParameters,
    evaluate_telescopic_damper,
)
from wm_drake.parameters import DAMPER_LAWS, BushingType, EndBushing, ForceTable

HOOK, GROUND = np.array([0.2, 0.05, 0.3]), np.array([0.3, 0.1, 0.6])  # m
R_TB, R_WG = (Rotation.from_rotvec(r).as_matrix() for r in ((0.3, -0.1, 0.2), (0.1, 0.2, -0.4)))
BUSHING = BushingType(
    stiffness_x=8e3,
    stiffness_y=LINEAR_TABLE,
    stiffness_z=3e3,
    rotational_stiffness_x=70.0,
    rotational_stiffness_y=80.0,
    rotational_stiffness_z=TORQUE_TABLE,
    **{f"damping_{axis}": 50.0 for axis in "xyz"},
    **{f"rotational_damping_{axis}": 3.0 for axis in "xyz"},
    **{f"friction_torque_{axis}": 0.5 for axis in "xyz"},
    **{f"full_friction_rate_{axis}": 1.5 for axis in "xyz"},
)
PLACED = SixComponentBushingParameters(HOOK, R_TB, GROUND, R_WG, packed_bushing_law(BUSHING))


def law(name):
    return packed_damper_law(damper_of(name))


def spring(stiffness, **changes):
    placed = SpringStrutParameters(HOOK, GROUND, 90.0, packed_stiffness(stiffness))
    return SPRING.replaced(placed.packed(), **changes)


def damper(name):
    bushing = EndBushing(**END_BUSHING)
    return FrictionDamperParameters(HOOK, GROUND, bushing, law(name)).packed()


def telescope(name):
    second = SixComponentBushingParameters(
        HOOK, R_WG, GROUND, R_TB, packed_bushing_law(BUSHING), engaged=0.5
    )
    return TelescopicDamperParameters(R_WG[:, 1], PLACED, second, law(name)).packed()


# element -> packed numbers, function, trees of the plant, own forces, states
LOOSE = DRUM_BEARING_NUMBERS.pack(
    clearance=2e-4, contact_stiffness=1e5, contact_damping=50.0, bushing=PLACED.packed()
)
ELEMENTS = {
    "spring, number": (spring(5e3), evaluate_spring_strut, 1, 1, 0),
    "spring, table": (spring(ForceTable(**LINEAR_TABLE)), evaluate_spring_strut, 1, 1, 0),
    "spring, nearly slack": (spring(5e3, taut_from=300.0), evaluate_spring_strut, 1, 1, 0),
    "bushing": (PLACED.packed(), evaluate_six_component_bushing, 1, 6, 0),
    "bearing": (LOOSE, evaluate_drum_bearing, 2, BEARING_FORCE_SIZE, 0),
    "telescopic damper": (telescope("mstv"), evaluate_telescopic_damper, 2, FORCE_SIZE, 1),
} | {
    f"damper, {name}": (damper(name), evaluate_friction_damper, 1, 1, int(entry.has_sponge))
    for name, entry in DAMPER_LAWS.items()
}


class CountedNumber(float):
    """A number that keeps its index where a law uses it as a whole number, which has no derivative."""

    def numbered(self, index, found):
        self.index, self.found = index, found
        return self

    def value(self):
        self.found.add(self.index)
        return float(self)


def answers(evaluate, x, state, p, sizes, kind):
    """Return generalized force, own force and rate as one vector."""
    written = [np.empty(size, kind) for size in sizes]
    evaluate(x, state, p, *written)
    return np.concatenate(written)


@pytest.mark.parametrize("name", ELEMENTS)
def test_derivatives_by_packed_numbers_agree_with_finite_differences(name):
    packed, evaluate, trees, force_size, states = ELEMENTS[name]
    sizes = 7 * trees, force_size, states
    rng, interpreted = np.random.default_rng(3), generic(evaluate)
    small = np.tile([0.06, 0.06, 0.06, 0.01, 0.01, 0.01, 0.3, 2, 2, 2, 0.4, 0.4, 0.4, 9.0], trees)
    for _ in range(3):
        x = rng.uniform(0.3, 1.0, len(small)) * rng.choice([-1.0, 1.0], len(small)) * small
        state = rng.uniform(2e-4, 8e-3, states)  # m
        whole = set()
        counted = np.array(
            [CountedNumber(value).numbered(k, whole) for k, value in enumerate(packed)], object
        )
        answers(interpreted, x, state, counted, sizes, object)
        found = answers(interpreted, x, state, InitializeAutoDiff(packed).ravel(), sizes, object)
        found = found.reshape(-1, 1)
        values = ExtractValue(found).ravel()
        plain = answers(evaluate, x, state, packed, sizes, float)
        np.testing.assert_allclose(values, plain, rtol=1e-10, atol=1e-12 * np.max(np.abs(plain)))
        gradient = ExtractGradient(found)
        for k in set(range(len(packed))) - whole:
            step = 1e-6 * max(abs(packed[k]), 1e-3) * np.eye(len(packed))[k]
            above, below = (
                answers(evaluate, x, state, packed + sign * step, sizes, float)
                for sign in (1.0, -1.0)
            )
            expected = (above - below) / (2.0 * step[k])
            rounding = 1e-13 * np.abs(plain) / step[k]
            error = np.abs(gradient[:, k] - expected) - rounding
            assert np.max(error) <= 1e-5 * np.max(np.abs(expected)) + 1e-12, k
        assert np.any(gradient)


def test_every_whole_number_of_an_element_is_found():
    """Check numbers of laws and of table points; all other packed numbers have a derivative."""
    packed = damper("free_stroke")
    whole = set()
    counted = np.array(
        [CountedNumber(value).numbered(k, whole) for k, value in enumerate(packed)], object
    )
    x, state = np.linspace(0.01, 0.02, 14), np.array([0.012])
    answers(generic(evaluate_friction_damper), x, state, counted, (7, 1, 1), object)
    numbers = [packed[k] for k in sorted(whole)]
    assert numbers == [
        DAMPER_LAWS["free_stroke"].number,
        len(DAMPERS["free_stroke"]["sponge"]["force"]),
    ]
