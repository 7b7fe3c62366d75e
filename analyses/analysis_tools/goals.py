"""How near a machine is to the printed results of [B], in the numbers that were set as goals."""

import numpy as np
from calibrate_reference import adams_targets

from analysis_tools.gasket_study import agreement, screening_of
from wm_drake.batch import simulate_many
from wm_drake.model.build import build_machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import measured_changes
from wm_drake.parameters.published import published_results
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.solutions import DIFFERENCE, sizes_of
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.gasket.screening import published_for

GOALS = {
    "leading factors": "18 of 18",
    "signs of effects": "30 of 30",
    "contributions, points": "5 / 15",
    "means, %": "4 / 12",
    "amplitudes of the Adams model, %": "4 / 15",
    "amplitudes without gasket, %": "10, without Yf of 0.55 mm",
    "signs of Table 1": "12 of 12",
}
"""Goals by quantity; pairs are mean and largest."""

TINY = 1e-3
"""An amplitude below this is left out of the amplitudes without gasket. [m]"""

EFFECTS = 30
"""Number of terms of [B] Table 5 that have effects."""


def goals_of(machine: MachineParameters, reference: MachineParameters) -> dict[str, str]:
    """Return what a machine reaches, by the names of `GOALS`.

    Args:
        machine: The machine.
        reference: Machine whose files have the printed numbers.
    """
    targets = adams_targets(reference)
    cases = [
        Case(name, machine.loads[name], machine.profile, gasket) for name, gasket in targets.loads
    ]
    table = simulate_many(build_machine(machine), cases, measures=("amplitudes",), workers=1)
    amplitude = table.amplitude.values
    errors = targets.errors(amplitude)
    has_gasket = np.array([gasket for _, gasket in targets.loads])
    without = errors[~has_gasket][targets.amplitude[~has_gasket] > TINY]
    signs = (changes_of(targets, amplitude) * printed_changes(reference, targets) > 0.0).sum()
    screening = screening_of(machine)
    study = agreement(screening, published_for(published_results(reference.published), screening))
    reached = [
        f"{study.leaders} of {study.responses}",
        f"{EFFECTS - study.other_signs} of {EFFECTS}",
        f"{study.points.mean():.1f} / {study.points.max():.0f}",
        f"{study.means.mean():.1f} / {study.means.max():.0f}",
        sizes_text(errors[has_gasket]),
        sizes_text(without),
        f"{signs} of 12",
    ]
    return dict(zip(GOALS, reached, strict=True))


def sizes_text(errors: FloatArray) -> str:
    """Return mean and largest absolute value of errors in percent."""
    mean, largest = DIFFERENCE.values(sizes_of(errors))
    return f"{mean:.1f} / {largest:.0f}"


def changes_of(targets: Targets, amplitude: FloatArray) -> FloatArray:
    """Return the changes by the gasket as logarithms of ratios (..., load, sensor).

    Args:
        targets: Targets with amplitudes with and without gasket.
        amplitude: (..., case, sensor) [m]
    """
    row = {case: index for index, case in enumerate(targets.loads)}
    pairs = [(row[name, True], row[name, False]) for name, gasket in targets.loads if not gasket]
    return np.stack(
        [np.log(amplitude[..., a, :] / amplitude[..., b, :]) for a, b in pairs], axis=-2
    )


def printed_changes(reference: MachineParameters, targets: Targets) -> FloatArray:
    """Return the changes of [B] Table 1 as logarithms of ratios, as `changes_of`."""
    table = measured_changes(reference).drop_duplicates("load").set_index("load")
    loads = [name for name, gasket in targets.loads if not gasket]
    percent = table.loc[loads, list(targets.sensors)].to_numpy(dtype=float)
    return np.asarray(np.log1p(percent / 100.0))
