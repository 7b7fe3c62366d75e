"""Does the treatment of the damper tubes' spin change the answer?

The friction about a damper's axis is stiff against the tiny inertia of its tubes about it. The machine file gives the outer
tubes more of it, so that explicit steps can follow. Here the tubes have their true inertia and the motion is found by an
implicit method (Radau IIA of fifth order) on the same right-hand side; RMS displacements per region are compared.
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
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.vibration import HIGH_PASS_HZ, high_passed, region_rms, relative_error

PERIOD = 5e-3


def by_radau(machine: Machine, case: Case, rtol: float) -> tuple[np.ndarray, np.ndarray]:
    """States every 5 ms, and displacements of the accelerometers."""
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
    """The machine with the tubes of its SDF."""
    bodies = {name: body for name, body in parameters.bodies.items() if not name.endswith("_outer")}
    return parameters.model_copy(update={"bodies": bodies})


def compared(quick: bool) -> list[str]:
    """One line a case."""
    parameters = load_machine("free_stroke")
    raised, true = build_machine(parameters), build_machine(physical(parameters))
    end, speed = (1.0, 8.0) if quick else (12.0, 37.0)
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
            f"{1e3 * front:.0f} g in front, {1e3 * rear:.0f} g at the rear, {np.rad2deg(phase):.0f} deg: RMS per region "
            f"differs by at most {100 * error.max():.4f} %, single numbers by "
            f"{100 * np.abs(rms[0] / rms[1] - 1.0).max():.4f} % "
            f"(Radau {wall:.0f} s)"
        )
    return lines


def main() -> None:
    """Prints the differences, and writes them to a file if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a second of one case")
    parser.add_argument(
        "--out", type=Path, default=Path(tempfile.gettempdir()) / "spin_of_tubes.txt"
    )
    arguments = parser.parse_args()
    text = "\n".join(compared(arguments.quick))
    arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
