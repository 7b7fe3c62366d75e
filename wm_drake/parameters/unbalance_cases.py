"""Cases of a spin-cycle study: unbalance at front and rear and the angle between ([A] Table 9)."""

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters import units as u
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import CYCLES_FOLDER
from wm_drake.parameters.machine import MachineParameters, UnbalancePlace, UnbalancePlanes
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.spin import Load, Unbalance

TABLE_9 = CYCLES_FOLDER / "cases_table9.csv"
"""File with the 33 cases of [A] Table 9, in the same order."""

_COLUMNS = {"front_g": "front", "rear_g": "rear", "phase_deg": "phase"}
_PUBLISHED = "published_error_percent"


class UnbalanceCase(Frozen):
    """One row of a table of cases.

    Attributes:
        name: Name of the case.
        front, rear: Masses in the two planes. [kg]
        phase: Angle by which the rear mass leads the front mass, in the direction of rotation of
            the drum. [rad]
        published_error_percent: Error of the model of [A] against its experiment, from Table 9.
    """

    name: str
    front: Annotated[u.Mass, Field(ge=0.0)]
    rear: Annotated[u.Mass, Field(ge=0.0)]
    phase: u.Angle = 0.0
    published_error_percent: float | None = None

    def load(self, parameters: MachineParameters) -> Load:
        """Return the load of this case in the drum of a machine.

        The front mass is at the top at drum angle 0. The rear mass leads by the phase of the case
        plus the phase error of the machine.

        Raises:
            InputError: the machine does not define the planes of the masses.
        """
        planes = unbalance_planes(parameters)
        lead = self.phase + (
            parameters.imperfections.phase_error if self.front and self.rear else 0.0
        )
        masses = ((self.front, planes.front, 0.0), (self.rear, planes.rear, lead))
        return Load(
            unbalances=tuple(
                Unbalance(mass=mass, radius=place.radius, y=place.y, phase=phase)
                for mass, place, phase in masses
                if mass > 0.0
            )
        )


def unbalance_planes(parameters: MachineParameters) -> UnbalancePlanes:
    """Return the positions of the unbalance masses of a machine.

    They are `unbalance_planes` of the machine if given. Otherwise they are the positions of the
    masses in its loads 'front' and 'back' (or 'rear').

    Raises:
        InputError: the machine has neither.
    """
    if parameters.unbalance_planes:
        return parameters.unbalance_planes
    planes = []
    for names in (("front",), ("back", "rear")):
        masses = [parameters.loads[name].unbalances for name in names if name in parameters.loads]
        if not masses or len(masses[0]) != 1:
            raise input_error(
                "is missing; give it, or loads 'front' and 'back' with one mass each, whose "
                "positions are then used",
                key="unbalance_planes",
            )
        planes.append(UnbalancePlace(radius=masses[0][0].radius, y=masses[0][0].y))
    return UnbalancePlanes(front=planes[0], rear=planes[1])


def load_unbalance_cases(path: Path = TABLE_9) -> list[UnbalanceCase]:
    """Read a CSV file of cases.

    The columns are case, front_g, rear_g, phase_deg and, optionally, published_error_percent.

    Raises:
        InputError: the file has other columns or no row, a value is not allowed, or two cases have
            the same name.
    """
    table = read_csv(path, ["case", *_COLUMNS], optional=_PUBLISHED)
    if table.empty:
        raise input_error("has no case; at least one row is needed", where=str(path))
    cases = [_case(path, row) for row in table.to_dict("records")]
    names = [case.name for case in cases]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise input_error(f"case '{twice[0]}' occurs twice; names must differ", where=str(path))
    return cases


def _case(path: Path, row: Mapping[Hashable, Any]) -> UnbalanceCase:
    units = {"front_g": "g", "rear_g": "g", "phase_deg": "deg"}
    fields: dict[str, object] = {
        name: f"{row[column]} {units[column]}" for column, name in _COLUMNS.items()
    }
    if row.get(_PUBLISHED):
        fields[_PUBLISHED] = row[_PUBLISHED]
    try:
        return UnbalanceCase.model_validate({"name": row["case"], **fields})
    except ValidationError as error:
        problems = problems_of(error, UnbalanceCase)
        raise InputError(
            Problem(str(path), f"case {row['case']}.{p.key}", p.message) for p in problems
        ) from None
