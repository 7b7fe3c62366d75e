"""The cross-section of a damper is drawn from its numbers."""

import numpy as np
import pytest
from pydantic import TypeAdapter

from wm_drake.parameters import DamperType, load_machine
from wm_drake.rigs import damper_bench
from wm_drake.studies.rig.section import section_plots, sponge_ways

MSTV = {
    "law": "mstv", "friction_force": 35.0, "sponge_stiffness": 176e3, "sponge_damping": 90.0,
    "slider_damping": 400.0,
}  # fmt: skip


def bench_of(numbers):
    return damper_bench(TypeAdapter(DamperType).validate_python(numbers))


def test_lengths_are_those_of_the_numbers():
    """Check [C]: 35 N over 176 N/mm; and the curve of the machine file of the damper of [A]."""
    assert sponge_ways(bench_of(MSTV).packed) == (0.0, pytest.approx(35.0 / 176e3, abs=1e-5))
    (damper,) = load_machine("free_stroke").damper_types.values()
    free, slides = sponge_ways(damper_bench(damper).packed)
    curve = damper.sponge
    assert free == pytest.approx(
        max(np.array(curve.displacement)[np.array(curve.force) == 0.0]), abs=4e-4
    )
    above = np.flatnonzero(np.array(curve.force) >= damper.friction_force)[0]
    assert curve.displacement[above - 1] < slides <= curve.displacement[above]


def test_stops_are_one_free_stroke_from_the_sponge():
    (damper,) = load_machine("free_stroke").damper_types.values()
    bench = damper_bench(damper)
    ((panel,),) = (plot.figure.panels for plot in section_plots(bench))
    ends = {mark.key: max(mark.x) for mark in panel.marks if getattr(mark, "key", "")}
    stop = min(min(m.x) for m in panel.marks if hasattr(m, "edge") and min(m.x) > ends["sponge"])
    assert stop - ends["sponge"] == pytest.approx(1e3 * sponge_ways(bench.packed)[0])


@pytest.mark.parametrize(
    "numbers", [{"law": "coulomb", "friction_force": 35.0}, MSTV | {"friction_force": 0.0}]
)
def test_a_law_without_a_sponge_that_slides_has_no_cross_section(numbers):
    assert section_plots(bench_of(numbers)) == []
