"""Does the raised spin inertia of the damper tubes change the results?

The friction torque about the axis of a damper is large compared with the small inertia of its tubes
about this axis, which makes the motion stiff. The machine file therefore raises the inertia of the
outer tubes, so that explicit steps are stable. This script gives the tubes their true inertia and
integrates the same right-hand side with an implicit method (Radau IIA of fifth order). It prints
the differences of the RMS displacements per region, one line per case. It takes about five minutes.
"""

import argparse
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from wm_drake import Case, build_machine, load_machine, simulate
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.simulation.band import HIGH_PASS_HZ
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.vibration import high_passed, region_rms, relative_error

PERIOD = 5e-3
"""Sampling period. [s]"""


def by_radau(machine: Machine, case: Case, rtol: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the states every 5 ms, and the displacements of the accelerometers."""
    setup = machine.set_up(case.load)
    derivative, x = StateDerivative(setup), initial_state(setup, case.profile)
    (acceleration,) = case.profile.acceleration()

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        return derivative(x, acceleration)

    samples = np.arange(round(case.profile.duration / PERIOD) + 1) * PERIOD
    limits = {"rtol": rtol, "atol": 1e-3 * rtol, "max_step": 0.01}
    solution = solve_ivp(rate, (0.0, samples[-1]), x, method="Radau", t_eval=samples, **limits)
    assert solution.success, solution.message
    points = np.stack(list(setup.accelerometer_points.values()))
    return solution.y.T, point_displacements(solution.y.T, points, setup.rest_pose).reshape(
        len(samples), -1
    )


def physical(parameters: MachineParameters) -> MachineParameters:
    """Return the machine with the tube inertia of its SDF."""
    bodies = {name: body for name, body in parameters.bodies.items() if not name.endswith("_outer")}
    return parameters.model_copy(update={"bodies": bodies})


def compared(quick: bool) -> list[str]:
    """Return one line of differences per case."""
    parameters = load_machine("free_stroke")
    raised, true = build_machine(parameters), build_machine(physical(parameters))
    end, speed = (0.3, 6.0) if quick else (12.0, 37.0)
    edges = np.linspace(0.0, end, 3 if quick else 7)
    regions = tuple(
        Region(name=f"R{k + 1}", begin=a, end=b) for k, (a, b) in enumerate(pairwise(edges))
    )
    profile = SpinProfile(time=(0.0, end), speed=(5.0, speed), regions=regions)
    lines = []
    for front, rear, phase in (
        ((0.4, 0.0, 0.0),) if quick else ((0.4, 0.0, 0.0), (0.6, 0.6, 0.0), (0.4, 0.4, np.pi))
    ):
        load = UnbalanceCase(name="case", front=front, rear=rear, phase=phase).load(parameters)
        case, begin = Case("case", load, profile), time.perf_counter()
        _, implicit = by_radau(true, case, 1e-5 if quick else 1e-6)
        wall = time.perf_counter() - begin
        record = simulate(raised, case)
        pose = np.hstack([record.tub_angle, record.tub_position])
        points = record.accelerometer_point.values
        explicit = point_displacements(pose, points, record.attrs["rest_pose"]).reshape(
            len(pose), -1
        )
        rms = [
            region_rms(high_passed(signal, PERIOD, HIGH_PASS_HZ), PERIOD, profile)
            for signal in (explicit, implicit)
        ]
        error = relative_error(*rms)
        lines.append(
            f"{1e3 * front:.0f} g at the front, {1e3 * rear:.0f} g at the rear, "
            f"{np.rad2deg(phase):.0f} deg: RMS per region differs by at most "
            f"{100 * error.max():.4f} %, single values by at most "
            f"{100 * np.abs(rms[0] / rms[1] - 1.0).max():.4f} % (Radau: {wall:.0f} s)"
        )
    return lines


def main() -> None:
    """Print the differences and write them to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="run 0.3 s of one case")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(tempfile.gettempdir()) / "spin_of_tubes.txt",
        help="file for the result",
    )
    arguments = parser.parse_args()
    text = "\n".join(compared(arguments.quick))
    arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
