"""A bench test: what is derived from its loops, the effect of masses, and the errors of [A]."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import SHARE, TIME, Quantity
from wm_drake.rigs import Bench, BushingBench, ForceLoop, Harmonic, RigRun
from wm_drake.studies.rig.quantities import LINEAR, loop_quantities

SAMPLES_KEPT = 4
"""Step between the samples of a loop that are kept."""

FREQUENCY = Quantity("frequency", Unit("Hz", "Hz"), form="{:.3g}".format)
SPONGE_MASS = Quantity("mass of the sponge", Unit("kg", "g"), form="{:g}".format)
DRIVEN_MASS = Quantity("mass at the driven end", Unit("kg", "kg"), form="{:g}".format)
ENERGY = Quantity("energy per cycle", Unit("J", "mJ"))
LOSS_ANGLE = Quantity("loss angle", Unit("rad", "deg"), 1)
RMSE_OF_A = Quantity("RMSE in [A]", decimals=4)
BY_PEAK = SHARE.named("largest difference by peak", form="{:.2g}".format)

WITHIN = "[A] calls all of them within 10 % of the largest force"
VERDICTS = {
    ("damper", ""): WITHIN,
    ("bushing", "radial"): f"{WITHIN}, 3 in its unit",
    ("bushing", "axial"): f"{WITHIN}, 3 in its unit",
    ("bushing", "rotational"): WITHIN,
    ("gasket", "radial"): f"{WITHIN}, 2 in its unit",
    ("gasket", "axial"): "[A] calls them above 10 % of the largest force, 0.8 in its unit",
}
"""What the text of [A] says of its errors, sections 3.1 to 3.3."""


def printed_table() -> pd.DataFrame:
    """Return [A] Tables 2, 4, 5, 7: component, axis, frequency_hz, amplitude_mm, rmse."""
    return pd.read_csv(COMPONENTS_FOLDER / "rmse_of_a.csv", comment="#", keep_default_na=False)


def printed_axis(bench: Bench) -> str:
    """Return the name that the tables of [A] have for the axis of a bench; "" for a damper.

    The axis of a bushing or gasket is y; x and z are radial.
    """
    if not isinstance(bench, BushingBench):
        return ""
    if bench.axis.startswith("about"):
        return "rotational"
    return "axial" if bench.axis == "y" else "radial"


def printed_errors(kind: str, bench: Bench, motions: Sequence[Harmonic]) -> list[float]:
    """Return the printed RMSE of each test, in the unit of [A], which is not printed.

    Args:
        kind: damper, bushing or gasket.
        motions: Motions of the test matrix of [A].
    """
    table = printed_table()
    rows = table[(table.component == kind) & (table.axis == printed_axis(bench))]
    rmse = rows.set_index(["frequency_hz", "amplitude_mm"])["rmse"]
    unit = LINEAR["displacement"].unit  # that of the table, whatever the reader's is
    return [float(rmse[m.frequency, round(unit.from_si(m.amplitude), 6)]) for m in motions]


def printed_verdict(kind: str, bench: Bench) -> str:
    """Return what [A] says of the errors of a component, as a sentence."""
    return (
        "RMSE in [A]: of its own model against its tests, in a unit of force that is not printed. "
        f"{VERDICTS[kind, printed_axis(bench)]}."
    )


def loop_data(loop: ForceLoop) -> xr.Dataset:
    """Return a loop over its samples: time, displacement, velocity, force; or angle, moment."""
    quantities = loop_quantities(loop.rotates)
    values = {
        TIME: loop.time,
        quantities["displacement"]: loop.displacement,
        quantities["velocity"]: loop.velocity,
        quantities["load"]: loop.force,
    }
    return xr.Dataset(
        {q.words: q.variable("sample", signal[::SAMPLES_KEPT]) for q, signal in values.items()}
    )


def measures_data(run: RigRun) -> xr.Dataset:
    """Return the quantities derived from each loop, as of `LoopMeasures`, over `loop`."""
    quantities, measures = loop_quantities(run.bench.rotates), run.measures
    load = quantities["load"]
    numbers = {
        **_motions_of(run),
        f"peak_{load.words}": (
            load.named(f"peak {load.words}"),
            [m.peak_force for m in measures],
        ),
        "energy_per_cycle": (ENERGY, [m.energy_per_cycle for m in measures]),
        "equivalent_damping": (quantities["damping"], [m.equivalent_damping for m in measures]),
        "dynamic_stiffness": (quantities["stiffness"], [m.dynamic_stiffness for m in measures]),
        "loss_angle": (LOSS_ANGLE, [m.loss_angle for m in measures]),
    }
    return xr.Dataset({name: q.variable("loop", values) for name, (q, values) in numbers.items()})


def effect_of_masses(run: RigRun, massless: RigRun) -> xr.Dataset:
    """Return differences of each loop from that without masses, over `loop`.

    Returns:
        `frequency` [Hz], `amplitude` [m], `peak_force_without` masses, `peak_force`,
        `rms_difference` and `largest_difference` [N], the last one by the peak without masses.
    """
    load = replace(
        loop_quantities(run.bench.rotates)["load"], decimals=None
    )  # differences may be small
    loops, bare = (np.array([loop.force for loop in one.loops]) for one in (run, massless))
    peaks, largest = (np.abs(forces).max(axis=1) for forces in (bare, loops - bare))
    by_peak = np.divide(largest, peaks, out=np.full(len(peaks), np.nan), where=peaks > 0.0)
    rms = np.sqrt(np.mean(np.square(loops - bare), axis=1))
    numbers = {
        **_motions_of(run),
        "peak_force_without": (load.named("peak force without masses"), peaks),
        "peak_force": (load.named("peak force"), np.abs(loops).max(axis=1)),
        "rms_difference": (load.named("root mean square of the difference"), rms),
        "largest_difference": (load.named("largest difference"), largest),
        "largest_difference_by_peak": (BY_PEAK, by_peak),
    }
    return xr.Dataset({name: q.variable("loop", values) for name, (q, values) in numbers.items()})


def _motions_of(run: RigRun) -> dict[str, tuple[Quantity, list[float]]]:
    """Return frequency and amplitude of each loop."""
    amplitude = loop_quantities(run.bench.rotates)["displacement"].named("amplitude")
    return {
        "frequency": (FREQUENCY, [loop.motion.frequency for loop in run.loops]),
        "amplitude": (amplitude, [loop.motion.amplitude for loop in run.loops]),
    }
