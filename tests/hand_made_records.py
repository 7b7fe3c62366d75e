"""Hand-made records and results of spin runs, for tests of pages and tables."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.model.scene import Gap
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.study import CaseResult, SpinRuns

SENSOR_POINTS = {
    "Xr": (0.0, 0.2, -0.2),
    "Yr": (0.2, 0.2, 0.18),
    "Zr": (-0.17, 0.2, 0.0),
    "Xf": (0.0, -0.16, -0.1),
    "Yf": (-0.2, -0.16, 0.0),
    "Zf": (0.02, -0.16, 0.0),
}


def harmonic_record(
    parameters: MachineParameters, load: str, gasket: bool, size: float, samples: int = 400
) -> Record:
    """Return a hand-made record of 2 s, with the tub moving at 4 Hz and the drum at 240 rpm.

    It has every variable of a real record.
    """
    time = 5e-3 * np.arange(samples)
    wave = np.sin(2.0 * np.pi * 4.0 * time)[:, None]
    angle, position = wave * [0.01, 0.002, 0.02], wave * [size, 0.3 * size, 0.5 * size]
    pose = np.column_stack([angle, position])
    axes = {name: "xyz".index(sensor.axis) for name, sensor in parameters.sensors.items()}
    displacement = [
        point_displacements(pose, np.array([SENSOR_POINTS[n]]), np.zeros(6))[:, 0, axis]
        for n, axis in axes.items()
    ]
    force = 1000.0 * position[:, None, :] * float(gasket)
    mounts = [*(f"springs.{n}" for n in parameters.springs)]
    mounts += [*(f"dampers.{n}" for n in parameters.dampers), "gasket"]
    on_cabinet = np.zeros((samples, len(mounts), 3))
    on_cabinet[:, : len(parameters.springs), 2] = -190.0
    on_cabinet[:, -1] = force[:, 0]
    variables = {
        "mount_force": (("time", "mount", "axis"), on_cabinet),
        "cabinet_force": (("time", "axis"), on_cabinet.sum(axis=1)),
        "cabinet_moment": (("time", "axis"), 0.1 * on_cabinet.sum(axis=1)),
        "tub_angle": (("time", "angle"), angle),
        "tub_position": (("time", "axis"), position),
        "tub_angular_velocity": (("time", "axis"), np.zeros((samples, 3))),
        "tub_velocity": (("time", "axis"), np.zeros((samples, 3))),
        "tub_angular_acceleration": (("time", "axis"), -((8.0 * np.pi) ** 2) * angle),
        "tub_acceleration": (("time", "axis"), -((8.0 * np.pi) ** 2) * position),
        "drum_angle": (("time",), 8.0 * np.pi * time),
        "drum_speed": (("time",), np.full(samples, 8.0 * np.pi)),
        "motor_torque": (("time",), np.zeros(samples)),
        "displacement": (("time", "sensor"), np.stack(displacement, axis=1)),
        "sensor_point": (("sensor", "axis"), np.array([SENSOR_POINTS[name] for name in axes])),
        "detergent_displacement": (("time", "axis"), position),
        "spring_tension": (("time", "spring"), np.full((samples, 3), 190.0)),
        "damper_tension": (("time", "damper"), np.zeros((samples, 3))),
        "damper_deformation": (("time", "damper"), np.zeros((samples, 3))),
        "bushing_force": (("time", "bushing", "axis"), force),
        "bushing_moment": (("time", "bushing", "axis"), 0.1 * force),
    }
    labels = {
        "time": time,
        "axis": list("xyz"),
        "angle": ["roll", "pitch", "yaw"],
        "sensor": list(parameters.sensors),
        "spring": list(parameters.springs),
        "damper": list(parameters.dampers),
        "bushing": ["gasket"],
        "mount": mounts,
    }
    attrs = {
        "machine": parameters.name,
        "load": load,
        "gasket": "yes" if gasket else "no",
        "rest_pose": np.zeros(6),
        "parameters": json.dumps(parameters.model_dump(mode="json", exclude={"sources"})),
        "load_parameters": parameters.loads[load].model_dump_json(),
        "profile": parameters.profile.model_dump_json(),
        "diverged": "",
        "version_wm-drake": "0.0.1",
        "version_drake": "9.9.9",
        "engine": "drake",
        "step_s": 2.5e-3,
    }
    return xr.Dataset(variables, labels, attrs)


def case_result(
    parameters: MachineParameters,
    load: str = "middle",
    gasket: bool = True,
    size: float = 0.02,
    gap: float = 0.012,
    **record: int,
) -> CaseResult:
    made = harmonic_record(parameters, load, gasket, size, **record)
    smallest = Gap(gap, 0.5, "tub_shell", "wall_right", (0.28, 0.16, 0.0))
    measures = measure(made)
    table = measures.table.assign(smallest_gap=smallest.distance)
    measures = replace(measures, table=table, smallest_gap=smallest)
    return CaseResult(
        Case(load, parameters.loads[load], parameters.profile, gasket), made, measures, 1.5
    )


def spin_result(parameters: MachineParameters, results: Sequence[CaseResult]) -> SpinRuns:
    return SpinRuns(parameters, "drake", tuple(results))
