"""How long do sixty measured loops and three damper laws take, with the report?

The loops are computed with the law MSTV at six frequencies and ten amplitudes, with noise of 1 %,
and written as CSV. The script runs `wm-drake identify damper` on them and prints the processor time
of the command, all of its threads and the start of Python included. With more work on the computer
the time on a clock is longer, the processor time hardly. It takes about one minute.
"""

import argparse
import itertools
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from wm_drake.parameters import load_component
from wm_drake.rigs import Harmonic, damper_bench, force_loops

NOISE, EVERY = 0.01, 4
FREQUENCIES = (1.0, 2.0, 3.0, 5.0, 6.67, 10.0)  # Hz
AMPLITUDES = (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)  # mm
LAWS = ("mstv,coulomb,havsin", "mstv,stv_sponge,havsin")


def write_loops(folder: Path, motions: list[Harmonic]) -> list[str]:
    """Write the computed loops with noise; return their paths."""
    rng, paths = np.random.default_rng(0), []
    bench = damper_bench(load_component("mstv_damper").parameters)  # type: ignore[arg-type]
    for motion, loop in zip(motions, force_loops(bench, motions), strict=True):
        force = loop.force + NOISE * np.abs(loop.force).max() * rng.normal(size=len(loop.force))
        path = folder / f"loop_{motion.frequency:g}_{1e3 * motion.amplitude:g}.csv"
        np.savetxt(
            path,
            np.column_stack([loop.time, 1e3 * loop.displacement, force])[::EVERY],
            delimiter=",",
            header="time_s,displacement_mm,force_N",
            comments="",
        )
        paths.append(str(path))
    return paths


def processor_time(arguments: list[str]) -> float:
    """Return the processor time of a run of wm-drake. [s]"""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "wm_drake", *arguments], check=True, stdout=subprocess.DEVNULL
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Run the command for each set of laws, once to compile and once to measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two loops and one set of laws only")
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    options = parser.parse_args()
    grid = itertools.product(FREQUENCIES, AMPLITUDES)
    motions = [Harmonic(f, 1e-3 * a) for f, a in grid][: 2 if options.quick else None]
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        loops = write_loops(Path(folder), motions)
        common = [
            "--component",
            "mstv_damper",
            "--out",
            f"{folder}/result",
            "--overwrite",
            "--quiet",
        ]
        for laws in LAWS[: 1 if options.quick else None]:
            command = ["identify", "damper", "--law", laws, *common]
            processor_time([*command, *loops[:2]])  # compiles
            seconds = processor_time([*command, *loops])
            lines.append(f"{len(loops)} loops, laws {laws}: {seconds:.1f} s of processor time")
            print(lines[-1], flush=True)
    if options.out:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
