"""The gasket study of [B], section 4, of a machine, and how well it agrees with the paper."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

import wm_drake as wm
from wm_drake.parameters import MachineParameters
from wm_drake.studies.gasket.screening import (
    is_main,
    leaders,
    mean_difference,
    sign_differs,
)

ORTHOGONAL = 243
"""Trials of the orthogonal array; a study of fewer trials has a D-optimal design."""

LOADS = ("middle", "counter")
"""Loads of the study."""


def screening_of(
    machine: MachineParameters,
    trials: int = ORTHOGONAL,
    tables: str = "linear",
    loads: Sequence[str] = LOADS,
) -> xr.Dataset:
    """Return the gasket study of a machine, as of `screening.run_screening`.

    Args:
        machine: The machine.
        trials: Number of trials.
        tables: How a level changes a stiffness table; "linear" as in [B].
        loads: Names of the loads.
    """
    factors = wm.factors(machine, tables=tables)
    kind = "orthogonal" if trials >= ORTHOGONAL else "d-optimal"
    design = wm.make_design(kind, factors.names, trials=trials)
    return wm.anova(wm.run_trials(factors, design, loads, ["D", "F", "M"])).table


@dataclass(frozen=True)
class Agreement:
    """How well a gasket study agrees with the published one.

    Attributes:
        leaders: Number of responses whose largest main effect is the published one.
        responses: Number of responses.
        points: Absolute differences of the contributions of main effects. [points]
        means: Absolute differences of the grand means. [%]
        other_signs: Number of terms whose effects have another sign.
    """

    leaders: int
    responses: int
    points: np.ndarray
    means: np.ndarray
    other_signs: int

    def row(self) -> dict[str, float]:
        """Return the numbers by name, for a table."""
        return {
            "responses": self.responses,
            "same_leading_factor": self.leaders,
            "contributions_mean_points": float(self.points.mean()),
            "contributions_largest_points": float(self.points.max()),
            "means_mean_percent": float(self.means.mean()),
            "means_largest_percent": float(self.means.max()),
            "other_signs": self.other_signs,
        }


def agreement(screening: xr.Dataset, published: xr.Dataset) -> Agreement:
    """Return how well a study agrees with the published one.

    Args:
        screening: As of `wm_drake.studies.gasket.screening.run_screening`.
        published: As of `published_for` there.
    """
    lead = leaders(screening, published).values()
    points = screening.share - published.share
    points = points.isel(term=is_main(points.term)).values
    means = mean_difference(screening, published).fillna(0.0).values
    return Agreement(
        sum(ours == theirs for ours, theirs in lead),
        len(lead),
        100.0 * np.abs(points[np.isfinite(points)]),
        100.0 * np.abs(means.ravel()),
        int(sign_differs(screening, published).sum()),
    )
