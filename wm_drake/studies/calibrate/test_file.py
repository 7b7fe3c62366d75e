"""Write what a fit to records found, as test and vary file of the next one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from wm_drake.parameters.files import yaml_text
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.recorded_sensors import RecordedSensor, RecordedTest
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.records import RecordModel
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.free_numbers import FreeNumbers

VALUES = ("low", "high", "mean", "deviation")
"""Values of an entry of a vary file that a fit gives."""


def vary_text(free: FreeNumbers, fit: Fit, source: str) -> str:
    """Return the numbers of the machine that a fit determined, as the text of a vary file.

    Value and standard deviation are the prior of the next fit, to other records.

    Args:
        free: The numbers, which are the first unknowns of the fit.
        source: Where the values come from.
    """
    deviations, entries = np.sqrt(np.diag(fit.covariance)), {}
    for varied, estimate, deviation in zip(
        free.varying.every, fit.estimates, deviations.tolist(), strict=False
    ):
        if not (estimate.determined and np.isfinite(deviation)):
            continue
        at = {**varied.at, "mean": estimate.value, "deviation": deviation}
        posterior = replace(varied, at=at)
        entry = varied.entry.model_dump(mode="json", include={"keys", "sets", "about"})
        texts = {name: posterior.reading(name) for name in VALUES}
        entries[varied.name] = {key: each for key, each in entry.items() if each} | texts
        entries[varied.name]["source"] = source
    return yaml_text({"vary": entries})


def calibrated_test(model: RecordModel, fit: Fit, test: RecordedTest) -> RecordedTest:
    """Return a test whose sensors have the gains, tilts and places that a fit found."""
    off = model.sensors_at(fit.values)
    sensors = {
        name: _calibrated(sensor, model.points[name], values, model.has_places)
        for (name, sensor), values in zip(model.sensors.items(), off, strict=True)
    }
    return test.model_copy(update={"sensors": {**test.sensors, **sensors}})


def _calibrated(
    sensor: RecordedSensor, point: FloatArray, off: FloatArray, has_place: bool
) -> RecordedSensor:
    """Return a sensor as it was found.

    Its axis e, turned by its tilt R, is off by two small angles towards two other axes:
    a = R (e + t1 e1 + t2 e2). The new tilt turns R e to a on the shortest way, and |a| is part of
    the gain.

    Args:
        point: Its position in T as declared. (3,) [m]
        off: Gain, both angles [rad], and by what its place is off [m].
        has_place: Whether its place was sought.
    """
    place = "xyz".index(sensor.axis)
    axes = np.eye(3)[[place, *(k for k in range(3) if k != place)]]
    declared = Rotation.from_euler("xyz", sensor.tilt)
    axis = declared.apply(axes.T @ [1.0, *off[1:3]])
    size = float(np.linalg.norm(axis))
    turn, _ = Rotation.align_vectors([axis / size], [declared.apply(axes[0])])
    tilt = tuple((turn * declared).as_euler("xyz").tolist())
    changes = {"gain": float(sensor.gain * off[0] * size), "tilt": tilt}
    if has_place:
        changes |= {"point": tuple((point + off[3:]).tolist()), "frame": None}
    set_ = {**sensor.model_dump(exclude_unset=True), **changes}
    return RecordedSensor.model_validate({k: v for k, v in set_.items() if v is not None})


def test_text(test: RecordedTest, remarks: Sequence[str]) -> str:
    """Return a test as the text of its file, below remarks."""
    tree = test.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    for key, value, unit in quantities(test):
        *parents, name = key.split(".")
        node = tree
        for parent in parents:
            node = node.get(parent, {})
        if name in node:
            node[name] = unit.text(value)
    for name, sensor in test.sensors.items():
        if sensor.noise:
            tree["sensors"][name]["noise"] = sensor.signal_unit.text(sensor.noise)
    return "".join(f"# {remark}\n" for remark in remarks) + yaml_text(tree)


def clock_remarks(model: RecordModel, fit: Fit) -> list[str]:
    """Return a remark on the clock of each record, and on the mass of each load that was sought."""
    remarks = [
        f"{e.name}: {e.value:.4g} of that of the machine"
        for e in fit.estimates
        if e.name.startswith("mass of load ")
    ]
    for pair in model.pairs:
        clock = pair.alignment
        remarks.append(
            f"clock of {pair.recording.path.name}: begins at {clock.offset:.4f} s of the profile, "
            f"slow by {1e6 * clock.rate:.0f} ppm"
        )
    return remarks
