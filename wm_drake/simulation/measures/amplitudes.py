"""Amplitudes at the sensors, of the run and of its regions, and smooth substitutes for them."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.displacements import amplitudes, power_means
from wm_drake.simulation.measures.kind import Measure, Variable, detail, each_run
from wm_drake.simulation.measures.run import Run
from wm_drake.simulation.vibration import region_samples

MM, RPM = Unit("m", "mm"), Unit("rad/s", "rpm")


def _amplitudes(run: Run) -> Sequence[FloatArray]:
    size, at = run.amplitudes
    speed = run.drum_speed[at] if len(run.drum_speed) else size
    return size, np.where(np.isnan(size), np.nan, speed)


def _in_regions(run: Run) -> Sequence[FloatArray]:
    shape = len(run.profile.regions), run.displacement.shape[1]
    sizes, speeds = np.full(shape, np.nan), np.full(shape, np.nan)
    for row, part in enumerate(region_samples(run.profile, run.period, len(run.time))):
        size, at = amplitudes(run.filtered[part])
        known = ~np.isnan(size)
        sizes[row, known] = size[known]
        speeds[row, known] = run.drum_speed[part][at[known]]
    return sizes, speeds


AMPLITUDES = Measure(
    "amplitudes",
    (
        Variable(
            "amplitude",
            ("sensor",),
            MM,
            "amplitude",
            "largest absolute value of the envelopes",
            short="{}",
        ),
        Variable(
            "critical_speed",
            ("sensor",),
            RPM,
            "critical speed",
            "drum speed at which the amplitude occurs",
            better="",
            studio=None,
        ),
    ),
    each_run(_amplitudes),
    ("sensors",),
    has_table=False,
)

IN_REGIONS = Measure(
    "amplitudes in regions",
    (
        detail(
            "region_amplitude",
            ("region", "sensor"),
            MM,
            "amplitude in a region",
            "largest absolute value of the envelopes in each region of the spin profile",
        ),
        detail(
            "region_critical_speed",
            ("region", "sensor"),
            RPM,
            "critical speed in a region",
            "drum speed at which the amplitude of a region occurs",
            better="",
        ),
    ),
    each_run(_in_regions),
    ("sensors",),
)

POWER_MEANS = Measure(
    "power means",
    (
        Variable(
            "power_mean",
            ("sensor",),
            MM,
            "power mean",
            "power mean of order 20 of the filtered displacement; a smooth substitute of the "
            "amplitude",
            is_in_spin=False,
            studio=None,
        ),
    ),
    each_run(lambda run: [power_means(run.filtered)]),
    ("sensors",),
)
