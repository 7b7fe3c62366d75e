"""How long does a fit to twelve measured loops take, for each law and method?

The loops are computed at frequencies and amplitudes of [C] and [A], with noise of 2 %. The script
prints one line per fit: the time in seconds, the RMSE relative to the noise (1 means that the fit
explains everything but the noise), and the number of evaluated points. It takes about one minute.
"""

import argparse
import itertools
import os
import time
from pathlib import Path

import numpy as np

from wm_drake import load_machine
from wm_drake.parameters import DamperType, MeasuredLoop, load_component
from wm_drake.rigs import Harmonic, damper_bench, force_loops
from wm_drake.rigs.measured import MeasuredMotion, measured_motion
from wm_drake.studies.fitting import METHODS, identify
from wm_drake.studies.identification import damper_model, fit_problem

NOISE = 0.02
SAMPLES = 400


def dampers() -> dict[str, tuple[DamperType, list[Harmonic]]]:
    """Return the damper of each law with the motions of its test."""
    free_stroke = load_machine("free_stroke").damper_types["free_stroke"]
    tests = {
        "mstv": (
            load_component("mstv_damper").parameters,
            ((1.0, 3.0, 6.67, 10.0), (0.3, 0.5, 1.0)),
        ),
        "free_stroke": (free_stroke, ((1.0, 3.0, 5.0, 7.0), (3.0, 6.0, 10.0))),
    }
    return {
        law: (damper, [Harmonic(f, 1e-3 * a) for f, a in itertools.product(*grid)])  # type: ignore[misc]
        for law, (damper, grid) in tests.items()
    }


def measured(damper: DamperType, motions: list[Harmonic]) -> list[MeasuredMotion]:
    """Return computed loops over three periods, with noise added to the force."""
    rng, found = np.random.default_rng(0), []
    for number, (motion, loop) in enumerate(
        zip(motions, force_loops(damper_bench(damper), motions), strict=True)
    ):
        t = np.linspace(0.0, 3.0 / motion.frequency, SAMPLES)
        phase = (2.0 * np.pi * motion.frequency * t) % (2.0 * np.pi)
        force = np.interp(
            phase, loop.time * motion.angular_frequency, loop.force, period=2.0 * np.pi
        )
        force += NOISE * np.max(np.abs(force)) * rng.normal(size=SAMPLES)
        name = f"loop {number}"
        found.append(
            measured_motion(
                MeasuredLoop(name, name, t, motion.amplitude * np.sin(phase), force, False)
            )
        )
    return found


def main() -> None:
    """Run the fits and print one line per fit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two loops, one law, least squares")
    parser.add_argument(
        "--method",
        choices=list(METHODS),
        action="append",
        help="method of the fit; repeatable; default: least-squares",
    )
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    chosen = dampers()
    if arguments.quick:
        chosen = {"mstv": (chosen["mstv"][0], chosen["mstv"][1][:2])}
    lines = [f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.2f}"]
    print(lines[0])
    for (law, (damper, motions)), method in itertools.product(
        chosen.items(), arguments.method or ["least-squares"]
    ):
        loops = measured(damper, motions)
        problem = fit_problem(damper_model(law, loops), loops)
        begin = time.perf_counter()
        fit = identify(problem, method)
        wall_s = time.perf_counter() - begin
        noise = np.sqrt(np.mean([(NOISE * np.max(np.abs(loop.loop.force))) ** 2 for loop in loops]))
        lines.append(
            f"{law}, {method}: {len(fit.estimates)} unknowns, {len(loops)} loops, {wall_s:.1f} s; "
            f"RMSE {fit.rmse / noise:.2f} times the noise; {fit.evaluations} points; "
            f"{'; '.join(fit.notes)}"
        )
        print(lines[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
