"""Check of the fitted model of a gasket study: chosen settings are run and compared with it."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import pandas as pd
import xarray as xr

from wm_drake.parameters import at_places
from wm_drake.simulation.cases import Case
from wm_drake.studies.gasket.screening import Label, Responses
from wm_drake.studies.gasket.study import GasketTrials, as_responses
from wm_drake.studies.gasket.surface import Surfaces


@dataclass(frozen=True)
class Setting:
    """Setting of the factors that is to be checked.

    Attributes:
        text: As the user wrote it.
        places: A place from -1 to 1 for each factor.
    """

    text: str
    places: tuple[float, ...]


@dataclass(frozen=True)
class Check:
    """Settings with their predictions and runs.

    Attributes:
        responses: Responses of the runs, one row per setting.
    """

    settings: tuple[Setting, ...]
    surfaces: Surfaces
    responses: Responses

    def frame(self) -> pd.DataFrame:
        """Return prediction, 95 % half width, run and difference of each setting and response."""
        return self._frame.copy()

    @cached_property
    def _frame(self) -> pd.DataFrame:
        rows = []
        for number, setting in enumerate(self.settings):
            for load, values in self.responses.values.items():
                for name in map(str, values):
                    label = (load, name)
                    run = float(values[name].iloc[number])
                    rows.append(self._row(setting, label, run))
        return pd.DataFrame(rows)

    def _row(self, setting: Setting, label: Label, run: float) -> dict[str, object]:
        predicted = half = math.nan  # of a load that the study leaves out
        if label in self.surfaces.coefficients:
            predicted = self.surfaces.prediction(label, setting.places)
            half = self.surfaces.half_width(label, setting.places, of_run=True)
        return {
            "setting": setting.text,
            "load": label[0],
            "response": label[1],
            "unit": self.responses.units[label[1]],
            "predicted": predicted,
            "half_width": half,
            "run": run,
            "difference": run - predicted,
            "is_inside": abs(run - predicted) <= half,
        }


def run_check(
    trials: GasketTrials,
    settings: Sequence[Setting],
    surfaces: Surfaces,
    run: Callable[[Iterable[Case]], xr.Dataset],
) -> Check:
    """Run settings and return them with their predictions."""
    cases: list[Case] = []
    for number, setting in enumerate(settings, start=1):
        changed = at_places(trials.parameters, trials.factors, setting.places)
        cases += trials.cases_of(changed, f"check {number}")
    loads = [case.name for case in trials.loads]
    return Check(tuple(settings), surfaces, as_responses(run(cases), loads, trials.chosen))
