"""Test one component on a bench: harmonic motion, steady force loops.

Enters: parameters of a component and motions, or recorded loops. Leaves: force loops, measures.
May import: `elements`, `laws`, `parameters`, `compiler` and `errors`; no pydrake.

    bench = damper_bench(parameters.damper_types["friction"])
    loop = force_loop(bench, Harmonic(frequency=3.0, amplitude=0.005))
    measures_of(loop).energy_per_cycle
"""

from wm_drake.rigs.bench import (
    AXES,
    Bench,
    BushingBench,
    DamperBench,
    Harmonic,
    bushing_bench,
    damper_bench,
)
from wm_drake.rigs.integration import NotSteadyError
from wm_drake.rigs.loops import ForceLoop, LoopMeasures, force_loop, force_loops, measures_of
from wm_drake.rigs.run import JIG_ARM, MATRICES, RigRun, beyond_tables, run_rig

__all__ = [
    "AXES",
    "JIG_ARM",
    "MATRICES",
    "Bench",
    "BushingBench",
    "DamperBench",
    "ForceLoop",
    "Harmonic",
    "LoopMeasures",
    "NotSteadyError",
    "RigRun",
    "beyond_tables",
    "bushing_bench",
    "damper_bench",
    "force_loop",
    "force_loops",
    "measures_of",
    "run_rig",
]
