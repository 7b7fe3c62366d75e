"""Write the first files of a machine from a few numbers: a commented machine file and its SDF.

Attachment points follow from the numbers, so that the machine balances: the hooks of the springs
are placed around the centre of mass of all that hangs in them, and above it. All of them are
assumptions, which the files say; they are meant to be replaced.
"""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wm_drake.errors import InputError, InputNotice, Problem, input_error, shortened
from wm_drake.parameters import units as u
from wm_drake.parameters.csv_files import data_lines, finite_numbers, read_csv
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.inertia import (
    fault_of_mass_properties,
    inertia_matrix,
    unlikely_mass_properties,
    unlikely_reference,
)
from wm_drake.parameters.types import FloatArray
from wm_drake.written_files import filled

TEMPLATES = Path(__file__).parents[1] / "data" / "first_machine"
"""Folder of the templates of the two files."""

COLUMNS = [
    "part", "body", "mass_kg", "x_mm", "y_mm", "z_mm",
    "ixx_kgm2", "iyy_kgm2", "izz_kgm2", "ixy_kgm2", "ixz_kgm2", "iyz_kgm2",
]  # fmt: skip
"""Columns of a table of parts: name, `tub` or `drum`, mass, centre of mass in T, and inertia about
the centre of mass. Products are elements of the matrix: ixy = -sum(m x y)."""

VERTICAL_HZ = 2.5
"""Vertical natural frequency on the springs where no rate is given. [Hz] Assumption: usual are 2 to
3 Hz."""

FRICTION_N = 80.0
"""Friction of all dampers together where none is given. [N] Assumption: usual are 60 to 120 N."""

SPRING_M, LEAN_M = 0.2, 0.015
"""Length of the springs as drawn, and how far their upper ends lean outwards. [m] Assumptions."""


class FirstNumbers(Frozen):
    """Numbers that a person has of a machine; each has a default that the files call an assumption.

    Attributes:
        tub_mass, drum_mass: All that hangs in the springs without turning, and all that turns.
        tub_centre: Centre of mass of the tub with all that is fixed to it, in T.
        springs, dampers: Numbers of them, 2 to 4.
        spring_rate: Rate of one spring; None for the vertical natural frequency `VERTICAL_HZ`.
        friction: Friction force of one damper; None for `FRICTION_N` in all of them.
        gasket_stiffness: Stiffness of the door gasket along every axis.
        drum_radius, drum_depth: Size of the drum.
        gap: Distance between tub and cabinet at the sides.
        unbalance: Mass of the unbalance in the drum.
        speed: Highest drum speed.
    """

    tub_mass: Annotated[u.Mass, Field(gt=0.0)] = 35.0
    drum_mass: Annotated[u.Mass, Field(gt=0.0)] = 9.0
    tub_centre: u.Position = (0.0, 0.0, 0.0)
    springs: Annotated[int, Field(ge=2, le=4)] = 2
    dampers: Annotated[int, Field(ge=2, le=4)] = 2
    spring_rate: Annotated[u.LinearStiffness, Field(gt=0.0)] | None = None
    friction: Annotated[u.Force, Field(ge=0.0)] | None = None
    gasket_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)] = 2000.0
    drum_radius: Annotated[u.Length, Field(gt=0.05, lt=1.0)] = 0.24
    drum_depth: Annotated[u.Length, Field(gt=0.05, lt=2.0)] = 0.34
    gap: Annotated[u.Length, Field(gt=0.0, lt=1.0)] = 0.038
    unbalance: Annotated[u.Mass, Field(gt=0.0)] = 0.5
    speed: Annotated[u.Speed, Field(gt=0.0)] = 1200.0 * np.pi / 30.0


@dataclass(frozen=True)
class Mass:
    """Mass properties of a body.

    Attributes:
        mass: [kg]
        centre: Centre of mass, in T. (3,) [m]
        inertia: About the centre of mass, in the axes of T. (3, 3) [kg m^2]
        about: Where the numbers come from.
    """

    mass: float
    centre: FloatArray
    inertia: FloatArray
    about: str


def combined(masses: list[Mass], about: str) -> Mass:
    """Return the mass properties of parts that are fixed to each other.

        m = sum m_i,  c = sum m_i c_i / m,
        I = sum (I_i + m_i (d_i.d_i 1 - d_i d_i^T)),  d_i = c_i - c      (Huygens, Steiner)

    Args:
        masses: Parts, at least one.
    """
    mass = sum(part.mass for part in masses)
    centre = sum(part.mass * part.centre for part in masses) / mass
    inertia = np.zeros((3, 3))
    for part in masses:
        d = part.centre - centre
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Mass(mass, np.asarray(centre), inertia, about)


def shell(mass: float, radius: float, length: float) -> FloatArray:
    """Return the inertia of a thin cylindrical shell about y. (3, 3) [kg m^2]

    Iyy = m r^2, Ixx = Izz = m (r^2 / 2 + l^2 / 12). [kg, m]
    """
    across = mass * (0.5 * radius**2 + length**2 / 12.0)
    return np.diag([across, mass * radius**2, across])


def read_parts(path: Path) -> dict[str, Mass]:
    """Return tub and drum, combined from a table of parts (`COLUMNS`).

    Raises:
        InputError: the file cannot be read, or a body has no part; or, for each row, its body is
            neither tub nor drum, its part is there already, or no part of a machine has its
            numbers.
    """
    table = read_csv(path, COLUMNS)
    numbers = finite_numbers(table[COLUMNS[2:]], path)
    parts, problems, known = dict[str, list[Mass]](tub=[], drum=[]), list[Problem](), set[str]()
    names, bodies = (table[name].fillna("").astype(str).str.strip() for name in COLUMNS[:2])
    lines = data_lines(path)
    sums = {lines[k]: ", ".join(names[list(of)]) for k, of in _sums(numbers[:, :4]).items()}
    for line, name, body, row in zip(lines, names, bodies, numbers, strict=True):
        part = Mass(float(row[0]), 1e-3 * row[1:4], inertia_matrix(*row[4:]), "")
        if body not in parts:
            fault = f"has the body '{body}'; allowed are tub, drum"
        elif line in sums:
            fault = (
                f"has the mass and the centre of mass of {shortened(sums[line], 100)} together; a "
                "total, or an assembly beside its parts, counts them twice: leave out either"
            )
        elif not name:
            fault = "has no name"
        elif name in known:
            fault = "is there already; give parts that occur several times a number each"
        else:
            parts[body].append(part)
            fault = _fault_of_part(part)
        known.add(name)
        if fault:
            problems.append(Problem(f"{path}:{line}", "", f"part '{shortened(name, 60)}' {fault}"))
        elif remark := _remark_on_part(part):
            message = str(Problem(f"{path}:{line}", "", f"part '{shortened(name, 60)}': {remark}"))
            warnings.warn(message, InputNotice, stacklevel=2)
    if problems:
        raise InputError(problems)
    empty = [body for body, of in parts.items() if not of]
    if empty:
        raise input_error(f"has no part of the {empty[0]}", where=str(path))
    _check_places(parts, path)
    return {
        body: combined(of, f"{len(of)} parts of {path.name}, combined")
        for body, of in parts.items()
    }


MOST_SUBSETS = 14
"""Most parts of which all subsets are added up; of more, those of rows below each other are."""

SAME_MASS, SAME_PLACE_MM = 2e-3, 1.0
"""Largest relative difference of two masses, and largest of two centres of mass that are rounded,
that count as the same."""


def _sums(rows: FloatArray) -> dict[int, tuple[int, ...]]:
    """Return the rows that have the mass and the centre of mass of others together, and which.

    Args:
        rows: Mass [kg] and centre of mass [mm] of each part, (n, 4).
    """
    count = len(rows)
    windows = [range(a, b) for a in range(count) for b in range(a + 2, count + 1)]
    subsets = np.zeros((len(windows), count), dtype=bool)
    for row, window in zip(subsets, windows, strict=True):
        row[window.start : window.stop] = True
    if count <= MOST_SUBSETS:
        subsets = (np.arange(2**count)[:, None] >> np.arange(count)) & 1 > 0
    sums = {}
    moments = rows[:, :1] * rows[:, 1:]
    for number, (mass, *centre) in enumerate(rows):
        others = subsets.copy()
        others[:, number] = False
        others = others[others.sum(axis=1) > 1]
        totals = others @ rows[:, 0]
        near = np.abs(totals - mass) <= SAME_MASS * abs(mass)
        centres = (others[near] @ moments) / totals[near, None]
        same = np.abs(centres - np.array(centre)).max(axis=1, initial=0.0) <= SAME_PLACE_MM
        if same.any():
            sums[number] = tuple(np.flatnonzero(others[near][same][0]).tolist())
    return sums


LARGEST_MM = 1500.0
"""Largest distance of a part from the middle of the drum. [mm]"""


def _fault_of_part(part: Mass) -> str:
    """Return why no part of a machine has the numbers of a row; empty if one may have."""
    farthest = 1e3 * float(np.abs(part.centre).max())
    if farthest > LARGEST_MM:
        return (
            f"has its centre of mass {farthest:.4g} mm from the middle of the drum; allowed are "
            f"{LARGEST_MM:g} mm"
        )
    return fault_of_mass_properties(part.mass, part.inertia)


def _remark_on_part(part: Mass) -> str:
    """Return what is unlikely about the numbers of a row; empty for nothing."""
    return unlikely_mass_properties(part.mass, part.inertia) or unlikely_reference(
        part.mass, part.inertia, part.centre
    )


def _check_places(parts: dict[str, list[Mass]], path: Path) -> None:
    """Warn if the places of several parts are so near to each other that they are in metres."""
    centres = np.array([part.centre for of in parts.values() for part in of])
    moved = centres[np.abs(centres).max(axis=1) > 0.0]
    if len(moved) > 1 and np.abs(moved).max() < 2e-3:
        message = "all centres of mass are within 2 mm of the middle of the drum; are they in m?"
        warnings.warn(str(Problem(str(path), "", message)), InputNotice, stacklevel=3)


@dataclass(frozen=True)
class FirstMachine:
    """A machine from a few numbers.

    Attributes:
        numbers: What is known of it.
        parts: Tub and drum of a table of parts; empty for shells of the masses of `numbers`.
    """

    name: str
    numbers: FirstNumbers
    parts: dict[str, Mass]

    @property
    def tub_radius(self) -> float:
        """Outer radius of the tub: 22 mm around the drum. [m] Assumption."""
        return self.numbers.drum_radius + 0.022

    @property
    def tub_depth(self) -> float:
        """Length of the tub: 90 mm more than the drum. [m] Assumption."""
        return self.numbers.drum_depth + 0.09

    @cached_property
    def bodies(self) -> dict[str, Mass]:
        """Tub and drum."""
        if self.parts:
            return self.parts
        n = self.numbers
        tub = shell(n.tub_mass, self.tub_radius, self.tub_depth)
        drum = shell(n.drum_mass, n.drum_radius, n.drum_depth)
        about = {
            body: f"mass {self.source(f'{body}_mass')}; inertia of a thin shell (assumption)"
            for body in ("tub", "drum")
        }
        return {
            "tub": Mass(n.tub_mass, np.array(n.tub_centre), tub, about["tub"]),
            "drum": Mass(n.drum_mass, np.zeros(3), drum, about["drum"]),
        }

    def source(self, name: str, reason: str = "") -> str:
        """Return "given" for a number that is; else that it is an assumption, with its reason."""
        if name in self.numbers.model_fields_set:
            return "given"
        return f"assumption: {reason}" if reason else "assumption"

    @cached_property
    def whole(self) -> Mass:
        """Mass of all that hangs in the springs."""
        return combined(list(self.bodies.values()), "")

    @property
    def spring_rate(self) -> float:
        """Rate of one spring. [N/m]"""
        n, rate = self.numbers, self.whole.mass * (2.0 * np.pi * VERTICAL_HZ) ** 2
        return n.spring_rate or float(rate / n.springs)

    @property
    def friction(self) -> float:
        """Friction force of one damper. [N]"""
        n = self.numbers
        return FRICTION_N / n.dampers if n.friction is None else n.friction

    def hooks(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the ends of the springs on tub and housing by name. [m]

        They lie around the vertical line through the centre of mass, so that the springs hold it.
        """
        x, y, _ = self.whole.centre
        height, across = 0.7 * self.tub_radius, 0.7 * self.tub_radius
        ends = {}
        for name, (side, along) in SPRING_PLACES[self.numbers.springs].items():
            on_tub = np.array([x + side * across, y + along * self.tub_depth, height])
            ends[name] = on_tub, on_tub + np.array([LEAN_M * np.sign(side), 0.0, SPRING_M])
        return ends

    def struts(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the ends of the dampers on tub and housing by name. [m]"""
        y = self.whole.centre[1]
        r = self.tub_radius
        ends = {}
        for name, (side, along) in DAMPER_PLACES[self.numbers.dampers].items():
            on_tub = np.array([0.5 * side * r, y + along * self.tub_depth, -0.8 * r])
            ends[name] = on_tub, on_tub + np.array([0.3 * side * r, 0.0, -0.17])
        return ends

    def frames(self) -> list[tuple[str, str, FloatArray]]:
        """Return name, link and position of all frames. [m]"""
        listed = []
        for kind, ends in (("spring", self.hooks()), ("damper", self.struts())):
            for name, (tub, housing) in ends.items():
                listed.append((f"{kind}_{name}_tub", "tub", tub))
                listed.append((f"{kind}_{name}_housing", "housing", housing))
        front, rear = -0.5 * self.tub_depth, 0.5 * self.tub_depth
        ring = np.array([0.0, front - 0.03, 0.0])
        listed += [(f"gasket_{link}", link, ring) for link in ("tub", "housing")]
        listed.append(("sensor_r", "tub", np.array([0.0, rear, self.tub_radius])))
        listed.append(("sensor_f", "tub", np.array([0.0, front, self.tub_radius])))
        corner = self.tub_radius * np.sqrt(0.5)
        listed.append(("corner", "tub", np.array([corner, front, corner])))
        return listed

    def walls(self) -> list[tuple[str, FloatArray, FloatArray]]:
        """Return name, centre and size of the walls of the cabinet; they are 10 mm thick. [m]"""
        wide, deep = self.tub_radius + self.numbers.gap, 0.5 * self.tub_depth + 0.06
        top = max(end[2] for _, end in self.hooks().values()) + 0.02
        low = min(end[2] for _, end in self.struts().values()) - 0.02
        middle, height = 0.5 * (top + low), top - low
        walls = []
        for name, axis, at in (
            ("left", 0, -wide), ("right", 0, wide), ("front", 1, -deep), ("rear", 1, deep),
            ("bottom", 2, low), ("top", 2, top),
        ):  # fmt: skip
            centre, size = np.array([0.0, 0.0, middle]), np.array([2 * wide, 2 * deep, height])
            centre[axis], size[axis] = at + 0.005 * np.sign(at), 0.01
            walls.append((f"wall_{name}", centre, size))
        return walls

    @property
    def rpm(self) -> float:
        """Highest drum speed. [rpm]"""
        return self.numbers.speed * 30.0 / np.pi

    @property
    def hold(self) -> int:
        """Time until which the profile holds the highest speed: for 10 s. [s]"""
        return math.ceil(25.0 + abs(self.rpm - 90.0) / 15.0)

    def sdf(self) -> str:
        """Return the text of the SDF file."""
        return self._filled("bodies.sdf")

    def yaml(self, file: str, model: str) -> str:
        """Return the text of the machine file.

        Args:
            file: Its path, for the commands in its comments.
            model: Path of the SDF from its folder.
        """
        return self._filled("machine.yaml", file=file, model=model)

    def _filled(self, template: str, **values: str) -> str:
        """Return the text of a file; numbers and vectors pass the filters `digits` and `row`."""
        filters: dict[str, Any] = {"digits": _text, "row": _row}
        path = TEMPLATES / f"{template}.template"
        usual = {"VERTICAL_HZ": VERTICAL_HZ, "FRICTION_N": FRICTION_N}
        return filled(path, filters, machine=self, **usual, **values)


SPRING_PLACES = {
    2: {"left": (-1.0, 0.0), "right": (1.0, 0.0)},
    3: {"left": (-1.0, -0.15), "right": (1.0, -0.15), "rear": (0.0, 0.3)},
    4: {
        "left_front": (-1.0, -0.2), "right_front": (1.0, -0.2),
        "left_rear": (-1.0, 0.2), "right_rear": (1.0, 0.2),
    },
}  # fmt: skip
"""Places of the hooks by number of springs: side, and part of the depth of the tub along y."""

DAMPER_PLACES = {
    2: {"left": (-1.0, 0.0), "right": (1.0, 0.0)},
    3: {"left": (-1.0, -0.1), "right": (1.0, -0.1), "rear": (0.0, 0.4)},
    4: SPRING_PLACES[4],
}
"""Places of the dampers by their number, in the same way. The third of three is at the rear, as in
[C] Fig. 1."""


def _text(value: float) -> str:
    """Return a number with four significant digits."""
    return np.format_float_positional(value, precision=4, fractional=False, trim="-")


def _row(vector: FloatArray) -> str:
    return " ".join(f"{value + 0.0:.6g}" for value in vector)
