"""Responses: the single numbers of a run that studies choose by name, with words and unit."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.errors import input_error, nearest_names
from wm_drake.model.bodies import sdf_path
from wm_drake.model.scene import Scene
from wm_drake.model.sdf_files import sdf_roots
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.feet import cabinet_of
from wm_drake.simulation.measures.kind import Better, Variable
from wm_drake.simulation.measures.labels import LABELS
from wm_drake.simulation.measures.registry import MEASURES

GAP = "gap"
"""Name of the response that tells whether the tub touches the housing."""

TENSIONS = "spring tensions"
"""Measure that tells whether a spring goes slack."""

DEFAULT = ("D", "F", "M", GAP)
"""Responses of a study that names none: those of [B] section 4 and the smallest gap."""


@dataclass(frozen=True)
class Response:
    """One response: a number of the table of runs.

    Attributes:
        place: Index of the number in the variable, without the dimension `run`.
        labels: Labels of this place.
    """

    measure: str
    variable: Variable
    place: tuple[int, ...] = ()
    labels: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Symbol, such as `Dx`; it is part of file headers."""
        return self.variable.response_name(self.labels)

    @property
    def names(self) -> tuple[str, str, str]:
        """Names by which it is chosen, alone or together with others."""
        return self.name, self.group, self.measure

    @property
    def group(self) -> str:
        """Name under which it is chosen together with others, such as `D`."""
        return self.variable.group_name

    @property
    def kind(self) -> str:
        """Quantity in words."""
        return self.variable.kind

    @property
    def title(self) -> str:
        """Words for reading, without the symbol."""
        return self.variable.title_of(self.labels)

    @property
    def better(self) -> Better:
        """Return the change that is an improvement."""
        return self.variable.better

    @property
    def unit(self) -> Unit:
        """Unit in the table, and for reading."""
        return self.variable.unit

    @property
    def unit_text(self) -> str:
        """Unit for reading."""
        return self.variable.unit_text

    def of_runs(self, table: xr.Dataset) -> FloatArray:
        """Return the response of each run of a table. [SI]"""
        values = table[self.variable.name].values
        for index in self.place:
            values = values[:, index]
        return np.asarray(values)

    def values(self, table: xr.Dataset) -> FloatArray:
        """Return the response of each run of a table. [unit for reading]"""
        return np.asarray(self.unit.from_si(1.0) * self.of_runs(table))


def known_responses(parameters: MachineParameters, profile: SpinProfile) -> tuple[Response, ...]:
    """Return all responses that a machine has over a spin profile."""
    return tuple(
        response
        for measure in MEASURES.values()
        if measure.applies(parameters)
        for variable in measure.variables
        if variable.is_response
        for response in _responses_of(measure.name, variable, parameters, profile)
    )


def _responses_of(
    measure: str, variable: Variable, parameters: MachineParameters, profile: SpinProfile
) -> Iterator[Response]:
    """Yield a response for each number of a variable."""
    along = [list(enumerate(LABELS[dim](parameters, profile))) for dim in variable.dims]
    for places in itertools.product(*along):
        yield Response(
            measure, variable, tuple(at for at, _ in places), tuple(label for _, label in places)
        )


def chosen_responses(
    parameters: MachineParameters, profile: SpinProfile, names: Sequence[str] = ()
) -> tuple[Response, ...]:
    """Return the responses that a user names.

    Args:
        names: Symbols (Dx), groups (D) or measures of `simulate_many` (extremes). If empty, the
            responses are those of `DEFAULT`, without the gap if the SDF has no shapes.

    Raises:
        InputError: a name is unknown, or the gap is named and the SDF has no shapes.
    """
    known, chosen = known_responses(parameters, profile), list[Response]()
    allowed = sorted({name for response in known for name in response.names})
    for name in names or DEFAULT:
        new = [response for response in known if name in response.names]
        if not new and any(
            "feet" in measure.needs and name in (measure.name, *measure.names)
            for measure in MEASURES.values()
        ):
            cabinet_of(parameters)
        if not new and name in MEASURES:
            raise input_error(f"'{name}' needs a spin profile with regions", key="response")
        if not new:
            raise input_error(f"no response '{name}'{nearest_names(name, allowed)}", key="response")
        chosen += [response for response in new if response not in chosen]
    if any(response.name == GAP for response in chosen) and not has_gap(parameters):
        if GAP in names:
            raise input_error(
                "the SDF has no shapes on both tub and housing, so no gap can be measured",
                key="response",
            )
        chosen = [response for response in chosen if response.name != GAP]
    return tuple(chosen)


def measures_of(parameters: MachineParameters, responses: Iterable[Response]) -> tuple[str, ...]:
    """Return the measures of `simulate_many` that a study needs, in the order of `MEASURES`.

    These are the measures of its responses, the gap and the spring tensions: a run in which the tub
    touches the housing or a spring goes slack is marked whatever the responses are.
    """
    needed = {response.measure for response in responses} | {TENSIONS}
    if has_gap(parameters):
        needed.add(GAP)
    return tuple(name for name in MEASURES if name in needed)


def has_gap(parameters: MachineParameters) -> bool:
    """Return whether the SDF has shapes on both the tub and the housing.

    Its files are read again only if one of them has changed: their shapes take a while to build.
    """
    files = tuple((file, file.stat().st_mtime_ns) for file in sdf_roots(sdf_path(parameters.model)))
    if files not in _HAVE_PAIRS:
        _HAVE_PAIRS[files] = bool(Scene(parameters).pair_names())
    return _HAVE_PAIRS[files]


_HAVE_PAIRS: dict[tuple[tuple[Path, int], ...], bool] = {}
"""Answers of `has_gap`, by the files of the SDF and when they were changed."""
