"""Responses of the gasket study: what is measured of each run, with words, unit and goal."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.batch import MEASURES
from wm_drake.batch.many import FORCE_KINDS
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.drive import VARIABLES as DRIVE_VARIABLES
from wm_drake.simulation.feet import BY_FOOT, FOOT_VARIABLES, WORDS, cabinet_of
from wm_drake.simulation.mounts import mount_names
from wm_drake.simulation.outputs import AXES
from wm_drake.studies.gasket.screening import Goal, Meaning

MM = Unit("m", "mm")
NEWTON = Unit("N", "N")

LOADS_OF_FEET = ("foot_normal_largest", "foot_tangential_largest")
"""Measures of the feet that are better when smaller."""

OF_DRIVE: dict[str, tuple[Unit, Goal]] = {
    "drive_peak_torque": (Unit("N*m", "N*m"), "smaller"),
    "drive_mean_torque": (Unit("N*m", "N*m"), "smaller"),
    "drive_mean_torque_speed": (Unit("rad/s", "rpm"), ""),
    "drive_peak_power": (Unit("W", "W"), "smaller"),
    "drive_energy": (Unit("J", "J"), "smaller"),
    "drive_speed_ripple": (Unit("dimensionless", "percent"), "smaller"),
    "drive_end_speed": (Unit("rad/s", "rpm"), "larger"),
}
"""Measures of the drive that every run has, with their units and goals."""

KIND_TITLES = {"peak": "peak", "rms": "RMS", "dynamic_rms": "dynamic RMS"}
"""Title of each kind of measure of a force, `wm_drake.simulation.mounts.KINDS`."""

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
        name: Symbol, such as `Dx`; it is part of file headers.
        group: Name under which it is chosen together with others, such as `D`.
        measure: Measure of `simulate_many`, key of `wm_drake.batch.MEASURES`.
        variable: Variable of the table of runs.
        place: Index of the number in the variable, without the dimension `run`.
        unit: Unit in the table and for reading.
        meaning: Words for reading.
    """

    name: str
    group: str
    measure: str
    variable: str
    place: tuple[int, ...]
    unit: Unit
    meaning: Meaning

    @property
    def unit_text(self) -> str:
        """Unit for reading."""
        return self.unit.shown.replace("*", " ")

    def values(self, table: xr.Dataset) -> FloatArray:
        """Return the response of each run of a table. [unit for reading]"""
        found = table[self.variable].values
        for index in self.place:
            found = found[:, index]
        return np.asarray(self.unit.from_si(1.0) * found)


def known_responses(parameters: MachineParameters, profile: SpinProfile) -> tuple[Response, ...]:
    """Return all responses that a machine has over a spin profile."""
    found = [*_extremes(), _gap(), *_by_sensor(parameters), *_by_region(parameters, profile)]
    found += [*_on_cabinet(parameters), *_of_feet(parameters, profile), *_of_drive()]
    found += _by_spring(parameters)
    return tuple(found)


def chosen_responses(
    parameters: MachineParameters, profile: SpinProfile, names: Sequence[str] = ()
) -> tuple[Response, ...]:
    """Return the responses that a user names.

    Args:
        parameters: The machine.
        profile: Its spin profile.
        names: Symbols (Dx), groups (D) or measures of `simulate_many` (extremes). If empty, the
            responses are those of `DEFAULT`, without the gap if the SDF has no shapes.

    Raises:
        InputError: a name is unknown, or the gap is named and the SDF has no shapes.
    """
    known, found = known_responses(parameters, profile), list[Response]()
    allowed = sorted({text for r in known for text in (r.name, r.group, r.measure)})
    for name in names or DEFAULT:
        new = [r for r in known if name in (r.name, r.group, r.measure)]
        if not new and name in ("feet", *FOOT_VARIABLES):
            cabinet_of(parameters)
        if not new and name in MEASURES:
            raise input_error(f"'{name}' needs a spin profile with regions", key="response")
        if not new:
            raise input_error(f"no response '{name}'{nearest_names(name, allowed)}", key="response")
        found += [r for r in new if r not in found]
    if any(r.name == GAP for r in found) and not has_gap(parameters):
        if GAP in names:
            raise input_error(
                "the SDF has no shapes on both tub and housing, so no gap can be measured",
                key="response",
            )
        found = [r for r in found if r.name != GAP]
    return tuple(found)


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
    """Return whether the SDF has shapes on both the tub and the housing."""
    at_origin = np.zeros((1, 6))
    return Scene(parameters).smallest_gap(np.zeros(1), at_origin, at_origin[0]) is not None


def _extremes() -> Iterator[Response]:
    """Yield the responses D, F and M of [B] section 4."""
    words = {
        "D": (
            "displacement",
            "largest displacement, from the rest position, of the tub point nearest to the "
            "detergent box",
            "detergent_displacement",
            MM,
        ),
        "F": (
            "force",
            "largest force of the gasket on the housing",
            "gasket_force",
            Unit("N", "N"),
        ),
        "M": (
            "moment",
            "largest moment of the gasket on the housing",
            "gasket_moment",
            Unit("N*m", "N*m"),
        ),
    }
    for letter, (kind, about, variable, unit) in words.items():
        for index, axis in enumerate(AXES):
            meaning = Meaning(f"{kind} {axis}", about, kind)
            yield Response(f"{letter}{axis}", letter, "extremes", variable, (index,), unit, meaning)


def _gap() -> Response:
    about = "smallest distance between tub group and housing; the tub touches at 0 and below"
    meaning = Meaning("smallest gap", about, "smallest gap", "larger")
    return Response(GAP, GAP, "gap", "smallest_gap", (), MM, meaning)


def _by_sensor(parameters: MachineParameters) -> Iterator[Response]:
    """Yield amplitude, critical speed and power mean of each sensor."""
    for index, sensor in enumerate(parameters.sensors):
        for variable, measure, unit, meaning in (
            (
                "amplitude",
                "amplitudes",
                MM,
                Meaning(f"amplitude {sensor}", "largest value of the envelopes", "amplitude"),
            ),
            (
                "critical_speed",
                "amplitudes",
                Unit("rad/s", "rpm"),
                Meaning(
                    f"critical speed {sensor}",
                    "drum speed at which the amplitude occurs",
                    "critical speed",
                    goal="",
                ),
            ),
            (
                "power_mean",
                "power means",
                MM,
                Meaning(
                    f"power mean {sensor}",
                    "power mean of order 20 of the filtered displacement",
                    "power mean",
                ),
            ),
        ):
            name = f"{variable}_{sensor}"
            yield Response(name, variable, measure, variable, (index,), unit, meaning)


def _on_cabinet(parameters: MachineParameters) -> Iterator[Response]:
    """Yield peak and RMS of the force of each mount, and of force and moment of all of them."""
    for kind, words in FORCE_KINDS.items():
        for index, mount in enumerate(mount_names(parameters)):
            variable = f"mount_force_{kind}"
            title = f"{KIND_TITLES[kind]} force {mount}"
            about = f"{words} of the force of this mount on the cabinet"
            meaning = Meaning(title, about, f"{KIND_TITLES[kind]} force of a mount")
            name = f"{variable}_{mount}"
            yield Response(name, variable, "mounts", variable, (index,), NEWTON, meaning)
        for quantity, unit in (("force", NEWTON), ("moment", Unit("N*m", "N*m"))):
            for index, axis in enumerate(AXES):
                variable = f"cabinet_{quantity}_{kind}"
                title = f"{KIND_TITLES[kind]} {quantity} on the cabinet {axis}"
                about = f"{words} of the {quantity} of all mounts on the cabinet"
                meaning = Meaning(title, about, f"{KIND_TITLES[kind]} {quantity} on the cabinet")
                name = f"{variable}_{axis}"
                yield Response(name, variable, "cabinet", variable, (index,), unit, meaning)


def _by_spring(parameters: MachineParameters) -> Iterator[Response]:
    """Yield the smallest tension of each spring."""
    for index, spring in enumerate(parameters.springs):
        about = "smallest tension; the spring goes slack at 0"
        meaning = Meaning(f"smallest tension {spring}", about, "spring tension", "larger")
        name, variable = f"spring_tension_{spring}", "smallest_spring_tension"
        yield Response(
            name, "spring_tension", TENSIONS, variable, (index,), Unit("N", "N"), meaning
        )


def _of_feet(parameters: MachineParameters, profile: SpinProfile) -> Iterator[Response]:
    """Yield loads and margins of the feet, of the run and of each region; none without cabinet."""
    if parameters.cabinet is None:
        return
    for variable, (unit_text, about) in WORDS.items():
        unit, kind = (
            Unit(unit_text.replace(" ", "*"), unit_text.replace(" ", "*")),
            _words(variable),
        )
        goal: Goal = "smaller" if variable in LOADS_OF_FEET else "larger"
        if variable in BY_FOOT:
            for index, foot in enumerate(parameters.cabinet.corners):
                meaning = Meaning(f"{kind} {foot}", about, kind, goal)
                name = f"{variable}_{foot}"
                yield Response(name, variable, "feet", variable, (index,), unit, meaning)
            continue
        yield Response(
            variable, variable, "feet", variable, (), unit, Meaning(kind, about, kind, goal)
        )
        for index, region in enumerate(profile.regions):
            own = f"region_{variable}"
            meaning = Meaning(f"{kind} {region.name}", f"{about}, in a region", kind, goal)
            name = f"{own}_{region.name}"
            yield Response(name, own, "feet regions", own, (index,), unit, meaning)


def _of_drive() -> Iterator[Response]:
    """Yield the measures of the drive; one with a prescribed speed has them too."""
    for variable, (unit, goal) in OF_DRIVE.items():
        about, kind = DRIVE_VARIABLES[variable][2], _words(variable.removeprefix("drive_"))
        meaning = Meaning(f"{kind} of the drive", about, f"{kind} of the drive", goal)
        yield Response(variable, variable, "drive", variable, (), unit, meaning)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _by_region(parameters: MachineParameters, profile: SpinProfile) -> Iterator[Response]:
    words = {
        "region_displacement": "RMS displacement",
        "region_displacement_integrated": "RMS displacement from acceleration",
    }
    for variable, kind in words.items():
        for r, region in enumerate(profile.regions):
            for a, sensor in enumerate(parameters.accelerometer_frames()):
                for i, axis in enumerate(AXES):
                    title = f"{kind} {region.name} {sensor} {axis}"
                    meaning = Meaning(title, f"{kind} in a region of the profile", kind)
                    name = f"{variable}_{region.name}_{sensor}_{axis}"
                    place = (r, a, i)
                    yield Response(name, variable, "regions", variable, place, MM, meaning)
