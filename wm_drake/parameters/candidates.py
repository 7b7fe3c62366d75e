"""Files of candidate measurements: what could be measured of a machine, how well, at which cost."""

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.spin import Load
from wm_drake.parameters.text_files import DATA, ShippedFiles
from wm_drake.parameters.types import Name

CANDIDATES = ShippedFiles("file of candidates", DATA / "candidates")
"""Files of candidates of the package."""


class Candidate(Frozen):
    """A measurement that could be made, or one for each part that a pattern names.

    Attributes:
        accuracy: Standard deviation of the error of each number: a part of it ("2 %") or a value
            with a unit ("20 g").
        cost: Cost in any unit, the same for all; None if it is not known.
        words: Words for a reader; {} stands for the part. If empty, the name.
        source: Where accuracy and cost come from.
    """

    accuracy: str
    cost: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None
    words: str = ""
    source: str = ""


class NumberCandidate(Candidate):
    """Numbers of a part that are read off: weigh it, find its centre of mass, load a spring.

    Attributes:
        keys: Key paths of the machine. With * in one, each part that matches is a candidate of its
            own; without, all keys are measured together.
    """

    kind: Literal["number"]
    keys: tuple[str, ...] = Field(min_length=1)


class BenchCandidate(Candidate):
    """Steady loops of a component on the bench: the in-phase and the out-of-phase modulus of each.

    Attributes:
        component: Key path of a damper type, a bushing type, or gasket; * stands for all.
        axes: Axes of a bushing, each a candidate of its own.
        frequency, amplitude: Of the motion; a list of amplitudes gives a loop each.
    """

    kind: Literal["bench"]
    component: str
    axes: tuple[str, ...] = ()
    frequency: str
    amplitude: str


class RunCandidate(Candidate):
    """Amplitudes of sensors in a run over the spin profile.

    Attributes:
        load: Load of the machine or of this file; * stands for each of the machine.
        sensors: Sensors of the machine or of this file; "all" of the machine, or "each" for a
            candidate of its own.
        gasket: Whether the gasket is in place.
    """

    kind: Literal["run"]
    load: str
    sensors: Literal["all", "each"] | tuple[str, ...] = "all"
    gasket: bool = True


class ModesCandidate(Candidate):
    """Natural frequencies of the knocked tub, with the dampers taken out.

    Attributes:
        count: Number of frequencies, from the lowest.
        gasket: Whether the gasket is in place.
    """

    kind: Literal["modes"]
    count: Annotated[int, Field(ge=1, le=6)] = 6
    gasket: bool = True


AnyCandidate: TypeAlias = Annotated[
    NumberCandidate | BenchCandidate | RunCandidate | ModesCandidate, Field(discriminator="kind")
]


class MoreSensor(Frozen):
    """A displacement sensor on the tub that the machine file does not have.

    Attributes:
        position: Place in the frame of the tub.
        axis: Axis of W.
    """

    position: u.Position
    axis: Literal["x", "y", "z"]


class CandidateFile(Frozen):
    """Candidates by name, and loads and sensors that only they have."""

    about: str = ""
    loads: dict[Name, Load] = {}
    sensors: dict[Name, MoreSensor] = {}
    candidates: dict[Name, AnyCandidate] = Field(min_length=1)


def load_candidates(name_or_path: str | Path = "usual") -> CandidateFile:
    """Read a file of candidates.

    Args:
        name_or_path: Name of a shipped file or path of a YAML file.
    """
    return read_model(CandidateFile, CANDIDATES.path(name_or_path))
