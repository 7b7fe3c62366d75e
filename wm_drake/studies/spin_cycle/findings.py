"""What a study of a spin cycle found, in sentences: summary and warnings."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import listed, slack_warning
from wm_drake.report.quantity import SHARE, Quantity, text_of
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.simulation.vibration import MOST_MISSING
from wm_drake.studies.experiment import failures
from wm_drake.studies.spin.study import gap_size
from wm_drake.studies.spin_cycle.study import (
    ERROR,
    GRAMS,
    INTEGRATED,
    PHASE,
    average_errors,
    compared_of,
    disagreement,
    largest,
    missing_regions,
)

LARGE_DISAGREEMENT = 0.01
"""Relative error of integrated displacements from which on a page warns of it."""


def case_description(case: UnbalanceCase) -> str:
    """Return the masses and the phase of a case, for example `400 g at the front`."""
    masses = [
        f"{GRAMS.text(mass)} {where}"
        for mass, where in ((case.front, "at the front"), (case.rear, "at the rear"))
        if mass > 0.0
    ]
    phase = f", {PHASE.number(case.phase)}° apart" if len(masses) == 2 else ""
    return (" and ".join(masses) or "empty drum") + phase


def summary(cases: Sequence[UnbalanceCase], data: xr.Dataset, engine: str) -> str:
    """Return one paragraph about displacements, gaps, and errors against a measurement."""
    about = {case.name: f"case {case.name} ({case_description(case)})" for case in cases}
    sentences = [
        f"{len(cases)} unbalance case{'s were' if len(cases) > 1 else ' was'} run over the spin "
        f"profile with the {engine} engine."
    ]
    worst, gaps = largest(data.rms), data.smallest_gap.dropna("case")
    if worst.notnull():
        sentences.append(
            f"The largest RMS displacement is {text_of(worst)}. It occurs in "
            f"{about[worst.case.item()]}, in region {worst.region.item()}, at sensor "
            f"{worst.accelerometer.item()}, axis {worst.axis.item()}."
        )
    if gaps.size:
        smallest = gaps.isel(case=gaps.argmin("case"))
        sentences.append(
            "The smallest gap between tub and housing is "
            f"{gap_size(smallest.item())}, in {about[smallest.case.item()]}."
        )
    apart = float(disagreement(data).max())
    if np.isfinite(apart):
        sentences.append(
            "The RMS displacements computed directly and by integrating the acceleration twice "
            f"differ by at most {INTEGRATED.text(apart)} in any region."
        )
    return " ".join([*sentences, _about_measurement(data)])


def _about_measurement(data: xr.Dataset) -> str:
    if "measured" not in data:
        return "No measurement was given for comparison."
    errors = average_errors(compared_of(data), data.measured)
    missing = missing_regions(compared_of(data), data.measured)
    without = f" without {listed(list(missing))}" if missing else ""
    return (
        f"Compared with the measurement{without}, the average error is "
        f"{ERROR.text(errors.mean())}, with a standard deviation of {ERROR.text(errors.std())} "
        "over the cases. ([A] reports 20.1 % and 4.1 % for its own model and machine.)"
    )


def warnings_of(parameters: MachineParameters, data: xr.Dataset, period: str) -> list[str]:
    """Return warnings about divergence, overlap, slack springs, feet, integration, imperfections.

    Args:
        period: Time between samples, as text.
    """
    texts = [
        f"Case {text}. Regions that this run did not complete have no values."
        for text in failures(data)
    ]
    texts += missing_warnings(compared_of(data), data.measured) if "measured" in data else []
    touching = data.case.values[data.smallest_gap.values <= 0.0].tolist()
    if touching:
        texts.append(
            f"Tub and housing overlap in case {', '.join(touching)}. The model has no contact "
            "forces. In the real machine, tub and housing would collide."
        )
    tensions = data.smallest_spring_tension
    slack = {name: slack_springs(tensions.sel(case=name)) for name in data.case.values.tolist()}
    texts += slack_warning(slack, "case")
    texts += floor_warnings(parameters, data)
    apart = float(disagreement(data).max())
    if apart > LARGE_DISAGREEMENT:
        texts.append(
            "In at least one region, the RMS displacements from integrated acceleration differ by "
            f"{ERROR.text(apart)} from the direct ones. The motion there is too small for "
            f"the integration, or too fast for a sampling interval of {period}."
        )
    return texts + _imperfections(parameters)


def missing_warnings(computed: xr.DataArray, measured: xr.DataArray) -> list[str]:
    """Return a warning of the regions that the errors leave out, or none."""
    missing = missing_regions(computed, measured)
    if not missing:
        return []
    parts = [f"{region} in case {', '.join(cases)}" for region, cases in missing.items()]
    return [
        f"The errors leave regions out, which have no measured value or were not completed by the "
        f"run: {'; '.join(parts)}. A record counts for a region if at most "
        f"{SHARE.text(MOST_MISSING)} of it is missing at its end."
    ]


def floor_warnings(parameters: MachineParameters, data: xr.Dataset) -> list[str]:
    """Return a warning that names the cases in which the cabinet would slide, turn or tip."""
    if parameters.cabinet is None:
        return []
    margins = np.min([data[name].values for name in MARGINS[1:]], axis=0)
    moving = data.case.values[(margins <= 0.0) & (data.diverged.values == "")].tolist()
    if not moving:
        return []
    if parameters.cabinet_moves:
        return [f"The cabinet slides, turns or lifts a side in case {', '.join(moving)}."]
    return [
        f"The cabinet would slide, turn or tip over in case {', '.join(moving)}. The model keeps "
        "it in its place."
    ]


def _imperfections(parameters: MachineParameters) -> list[str]:
    """Return a sentence for each imperfection of a machine."""
    texts, faults = [], parameters.imperfections
    if faults.residual_imbalance.mass > 0.0:
        mass = Quantity("", GRAMS.unit, 1).text(faults.residual_imbalance.mass)
        texts.append(f"The drum has a residual imbalance of {mass}.")
    if faults.phase_error != 0.0:
        angle = Quantity("", PHASE.unit, 1).number(faults.phase_error)
        texts.append(f"The phase between front and rear masses has an error of {angle}°.")
    if faults.bearing:
        radial = Quantity("", Unit("N/m", "N/mm"), 0).text(faults.bearing.radial_stiffness)
        tilting = Quantity("", Unit("N*m/rad", "N*m/rad"), 0)
        texts.append(
            "The drum bearing is compliant, so the drum can whirl: the radial stiffness is "
            f"{radial} and the tilting stiffness {tilting.text(faults.bearing.tilting_stiffness)}."
        )
    return texts
