"""Recordings of a load: runs are as long as what was measured."""

from pathlib import Path

import numpy as np
import pytest
from hand_made_records import harmonic_record

from wm_drake.parameters.recorded import Synchronous
from wm_drake.simulation.alignment import Alignment
from wm_drake.simulation.records import profile_of
from wm_drake.studies.calibrate.recorded import until_last_sample
from wm_drake.studies.compare.pairs import Pair
from wm_drake.studies.compare.recordings import TestRecording as Recorded


def test_runs_end_with_the_last_measured_sample_of_all_repeats(reference):
    run = harmonic_record(reference, "middle", True, 0.01)
    pairs = []
    for count in (200, 250):
        measured = np.ones((400, 1))
        measured[count:] = np.nan
        recording = Recorded(Synchronous(Path("x.csv"), run.time.values, {"S1_x": measured[:, 0]}))
        pairs.append(Pair(recording, run, Alignment(), measured, np.ones((400, 1))))
    shortened = until_last_sample(pairs)
    assert [np.isfinite(pair.measured).sum() for pair in shortened] == [200, 250]
    for pair in shortened:
        assert len(pair.run.time) == len(pair.predicted) == 250
        assert profile_of(pair.run).duration == pytest.approx(249 * 5e-3)
    assert profile_of(run).duration > 2.0
