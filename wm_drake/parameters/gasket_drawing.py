"""Drawing of a rubber gasket: meridian, wall thickness, rubber."""

import itertools
import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError, model_validator

from wm_drake.errors import InputError, InputNotice, Problem
from wm_drake.parameters import units as u
from wm_drake.parameters.dxf import MOST_CORNERS, DxfLine, corners_of_line
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model, read_yaml
from wm_drake.parameters.plausibility import unusual_values
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.text_files import DATA, ShippedFiles
from wm_drake.parameters.types import FloatArray

GASKETS = ShippedFiles("gasket drawing", DATA / "gaskets")
"""Gasket drawings of the package."""

STIFFEST_STRETCH = 3.0
"""Stretch up to which a rubber must stiffen in tension and compression: beyond folded gaskets."""

NEARLY_INCOMPRESSIBLE = 500.0
"""Bulk modulus in shear moduli if none is given (assumption): Poisson's ratio 0.4990. Rubber has
1000 and more, which changes no curve of a thin wall: its sides are free."""

_Positive = Annotated[u.Length, Field(gt=0.0)]
_Pressure = Annotated[float, u.Unit("Pa", "MPa")]


def tension_stress(stretch: FloatArray, constants: Sequence[float]) -> FloatArray:
    """Return the stress of rubber in tension, force over first cross-section. [Pa]

        s = 2 (L - L^-2) (c1 + 2 c2 x + 3 c3 x^2),    x = L^2 + 2/L - 3

    Yeoh (1993) without change of volume, the sides free of stress.

    Args:
        stretch: Length over first length [L].
        constants: Constants of Yeoh [c1, c2, c3]. [Pa]
    """
    return np.asarray(_tension_terms(stretch) @ np.asarray(constants))


def falls_at(constants: Sequence[float]) -> float | None:
    """Return the stretch at which the force of a rubber falls most; None if it rises everywhere."""
    stretch = np.linspace(1.0 / STIFFEST_STRETCH, STIFFEST_STRETCH, 201)
    rise = np.diff(tension_stress(stretch, constants))
    return None if np.all(rise > 0.0) else float(stretch[int(np.argmin(rise))])


def _tension_terms(stretch: FloatArray) -> FloatArray:
    """Return the stress in tension per constant of Yeoh. (n, 3)"""
    x = stretch**2 + 2.0 / stretch - 3.0
    return 2.0 * (stretch - stretch**-2.0)[:, None] * np.stack([x**0, 2.0 * x, 3.0 * x**2], axis=1)


class TensionTest(Frozen):
    """Tension test of a strip of the rubber, to which the constants of Yeoh are fitted.

    Attributes:
        stretch: Length over first length, at each point.
        stress: Force over first cross-section, at each point.
        terms: Number of constants that are fitted: c1, then c2, then c3. None for the most with
            which the rubber is stable, one less than there are stretches beside 1, up to 3.
    """

    stretch: tuple[Annotated[float, u.PureNumber(), Field(gt=0.05, lt=20.0)], ...]
    stress: Annotated[tuple[float, ...], u.Unit("Pa", "MPa")]
    terms: Annotated[int, Field(ge=1, le=3)] | None = None

    @model_validator(mode="after")
    def _can_be_fitted(self) -> "TensionTest":
        if len(self.stretch) != len(self.stress):
            raise ValueError(
                f"needs as many stretches as stresses; has {len(self.stretch)} and "
                f"{len(self.stress)}"
            )
        loaded = len({stretch for stretch in self.stretch if abs(stretch - 1.0) > 1e-6})
        needed = self.terms or 1
        if loaded <= needed:
            raise ValueError(
                f"has {loaded} stretches beside 1; {needed} constants need at least {needed + 1}"
            )
        return self

    @property
    def most_terms(self) -> int:
        """Largest number of constants that the test can give."""
        loaded = {stretch for stretch in self.stretch if abs(stretch - 1.0) > 1e-6}
        return min(3, len(loaded) - 1)

    @property
    def fitted_terms(self) -> int:
        """Number of constants that are fitted."""
        stable = (n for n in range(self.most_terms, 0, -1) if falls_at(self.fitted(n)) is None)
        return self.terms or next(stable, self.most_terms)

    @property
    def constants(self) -> tuple[float, float, float]:
        """Constants of Yeoh. [Pa]"""
        return self.fitted(self.fitted_terms)

    def fitted(self, count: int) -> tuple[float, float, float]:
        """Return constants with the smallest sum of squared differences of the stress. [Pa]"""
        terms = _tension_terms(np.array(self.stretch))[:, :count]
        numbers = np.linalg.lstsq(terms, np.array(self.stress), rcond=None)[0]
        c1, c2, c3 = (*numbers.tolist(), 0.0, 0.0)[:3]
        return c1, c2, c3

    @property
    def deviation(self) -> float:
        """Root mean square of fitted less measured stress, by the largest measured one."""
        return self.deviation_of(self.fitted_terms)

    def deviation_of(self, count: int) -> float:
        """Return the deviation with a number of constants."""
        error = tension_stress(np.array(self.stretch), self.fitted(count)) - np.array(self.stress)
        return float(np.sqrt(np.mean(error**2)) / np.max(np.abs(self.stress)))

    def stable_fits(self) -> str:
        """Return which numbers of constants make a stable rubber, and how well they fit."""
        fits = [
            f"terms: {count} is stable and fits within {100.0 * self.deviation_of(count):.2g} %"
            for count in range(1, self.most_terms + 1)
            if falls_at(self.fitted(count)) is None
        ]
        return "; ".join(fits) or "no number of constants is stable"


class PronySeries(Frozen):
    """Relaxation of the rubber: its stiffness after a step, by that at once.

        k(t) / k(0) = 1 - sum of share_i (1 - exp(-t / time_i))

    The hardness, the constants and the tension test are those of the relaxed rubber.

    Attributes:
        time: Relaxation times.
        share: Part of the stiffness at once that relaxes with each; together below 1.
    """

    time: Annotated[tuple[Annotated[float, Field(gt=0.0)], ...], u.Unit("s", "s")]
    share: tuple[Annotated[float, u.Fraction(), Field(gt=0.0, lt=1.0)], ...]

    @model_validator(mode="after")
    def _is_a_series(self) -> "PronySeries":
        if not self.time or len(self.time) != len(self.share):
            raise ValueError(
                f"needs as many shares as times, at least one; has {len(self.time)} times and "
                f"{len(self.share)} shares"
            )
        if sum(self.share) >= 1.0:
            raise ValueError(f"the shares add up to {sum(self.share):.3g}; allowed is below 1")
        return self

    def modulus(self, frequency: float) -> complex:
        """Return storage + i loss modulus at a frequency [Hz], by that of the relaxed rubber."""
        turn = 2j * math.pi * frequency * np.array(self.time)
        moving = np.array(self.share) / (1.0 - sum(self.share))
        return complex(1.0 + np.sum(moving * turn / (1.0 + turn)))


class Rubber(Frozen):
    """Rubber: a hardness, constants of Yeoh, or a tension test.

    Attributes:
        shore_a: Hardness Shore A, 20 to 80. Young's modulus follows from Gent, Rubber Chemistry and
            Technology 31 (1958) 896: E = 0.0981 (56 + 7.62336 s) / (0.137505 (254 - 2.54 s)) MPa.
        c1, c2, c3: Constants of Yeoh; Neo-Hookean with c1 alone, whose shear modulus is 2 c1.
        test: Tension test, in place of a hardness or constants.
        bulk_modulus: Bulk modulus; 500 times the shear modulus if not given.
        loss_factor: Ratio of loss to storage modulus at the frequency of the resonances.
        prony: Relaxation, in place of a loss factor.
    """

    shore_a: Annotated[float, u.PureNumber(), Field(ge=20.0, le=80.0)] | None = None
    c1: Annotated[_Pressure, Field(gt=0.0)] | None = None
    c2: _Pressure = 0.0
    c3: _Pressure = 0.0
    test: TensionTest | None = None
    bulk_modulus: Annotated[_Pressure, Field(gt=0.0)] | None = None
    loss_factor: Annotated[float, u.PureNumber(), Field(ge=0.0, le=2.0)] = 0.0
    prony: PronySeries | None = None

    @model_validator(mode="after")
    def _is_one_rubber(self) -> "Rubber":
        if sum(given is not None for given in (self.shore_a, self.c1, self.test)) != 1:
            raise ValueError("needs either shore_a or c1 or test")
        if self.c1 is None and (self.c2 or self.c3):
            raise ValueError("c2 and c3 belong to c1, not to shore_a or test")
        if self.prony is not None and self.loss_factor:
            raise ValueError("needs either loss_factor or prony")
        return self

    @model_validator(mode="after")
    def _is_stable(self) -> "Rubber":
        at = falls_at(self.constants)
        if at is not None:
            fits = f"; of the test, {self.test.stable_fits()}" if self.test else ""
            raise ValueError(
                f"the rubber is unstable: its force falls at stretch {at:.2g}; allowed are "
                f"constants with which it rises from {1.0 / STIFFEST_STRETCH:.2g} to "
                f"{STIFFEST_STRETCH:g}{fits}"
            )
        return self

    @property
    def constants(self) -> tuple[float, float, float]:
        """Constants of Yeoh. [Pa]"""
        if self.c1 is not None:
            return self.c1, self.c2, self.c3
        if self.test is not None:
            return self.test.constants
        assert self.shore_a is not None
        s = self.shore_a
        young = 1e6 * 0.0981 * (56.0 + 7.62336 * s) / (0.137505 * (254.0 - 2.54 * s))
        return young / 6.0, 0.0, 0.0

    def modulus(self, frequency: float) -> complex:
        """Return storage + i loss modulus at a frequency [Hz], by the modulus of the curves."""
        if self.prony is not None:
            return self.prony.modulus(frequency)
        return 1.0 + 1j * self.loss_factor

    @property
    def bulk(self) -> float:
        """Bulk modulus. [Pa]"""
        return self.bulk_modulus or NEARLY_INCOMPRESSIBLE * 2.0 * self.constants[0]


class MeridianPoint(Frozen):
    """Corner of the middle line of the wall, in a plane through the axis.

    Attributes:
        radius: Distance from the axis.
        y: Position along the axis, in the direction of y of the tub.
        thickness: Wall thickness; between corners it changes evenly.
        fillet: Radius of the arc that rounds the corner; 0 at both rims.
    """

    radius: _Positive
    y: u.Length
    thickness: _Positive
    fillet: Annotated[u.Length, Field(ge=0.0)] = 0.0


class _Described(Frozen):
    about: str = ""
    rubber: Rubber
    contact: bool = True


class _DxfDrawing(_Described):
    """File of a gasket whose middle line is in a DXF file."""

    dxf: DxfLine


class GasketDrawing(_Described):
    """A gasket: a wall turned about the axis, from the rim at the housing to the rim at the tub.

    Attributes:
        about: Description.
        meridian: Corners of the middle line; the first is clamped to the housing, the last is moved
            by the tub.
        rubber: The rubber.
        contact: Whether folds hold each other off; without it they may overlap.
    """

    meridian: tuple[MeridianPoint, ...] = Field(max_length=MOST_CORNERS)

    @model_validator(mode="after")
    def _can_be_built(self) -> "GasketDrawing":
        if len(self.meridian) < 2:
            raise ValueError("meridian: needs at least two points")
        ends = self.meridian[0], self.meridian[-1]
        if any(point.fillet for point in ends):
            raise ValueError("meridian: a rim has no fillet")
        line = self.stations(200)
        self._check_thickness(line)
        self._check_distance(line)
        return self

    def _check_thickness(self, line: FloatArray) -> None:
        if np.any(line[:, 0] <= 0.5 * line[:, 2] * np.abs(line[:, 3])):
            raise ValueError("meridian: the wall reaches the axis; allowed is a larger radius")
        for number, point in enumerate(self.meridian[1:-1], start=1):
            if point.fillet <= 0.5 * point.thickness and self._turn(number) > math.radians(20.0):
                raise ValueError(
                    f"meridian.{number}: fillet {1e3 * point.fillet:g} mm is too sharp for the "
                    f"wall; allowed is more than half the thickness, {500.0 * point.thickness:g} mm"
                )

    def _check_distance(self, line: FloatArray) -> None:
        """Check that no two parts of the wall overlap."""
        step = float(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).max())
        apart = line[:, None, :2] - line[None, :, :2]
        thickness = 0.5 * (line[:, None, 2] + line[None, :, 2])
        along = step * np.abs(np.subtract.outer(np.arange(len(line)), np.arange(len(line))))
        overlaps = (np.hypot(apart[..., 0], apart[..., 1]) < thickness) & (along > 2.0 * thickness)
        if np.any(overlaps):
            first, second = (line[index] for index in np.argwhere(overlaps)[0])
            places = " and ".join(
                f"({1e3 * p[0]:.1f}, {1e3 * p[1]:.1f}) mm" for p in (first, second)
            )
            raise ValueError(f"meridian: the wall crosses itself, at radius and y {places}")

    @property
    def sizes(self) -> dict[str, tuple[float, ...]]:
        """Sizes that have a usual range, by the keys of `plausibility.RANGES`. [m]"""
        along = [point.y for point in self.meridian]
        return {
            "meridian.radius": tuple(point.radius for point in self.meridian),
            "meridian.height": (max(along) - min(along),),
            "meridian.thickness": tuple(point.thickness for point in self.meridian),
        }

    def _turn(self, number: int) -> float:
        """Return the angle by which the line turns at a corner. [rad]"""
        before, at, after = (self._places[number + shift] for shift in (-1, 0, 1))
        first, second = at - before, after - at
        size = float(np.linalg.norm(first) * np.linalg.norm(second))
        return math.acos(min(1.0, max(-1.0, float(first @ second) / size)))

    @cached_property
    def _places(self) -> FloatArray:
        places = np.array([(point.radius, point.y) for point in self.meridian])
        if np.any(np.linalg.norm(np.diff(places, axis=0), axis=1) < 1e-6):
            raise ValueError("meridian: two neighbouring points are at the same place")
        return places

    def stations(self, count: int) -> FloatArray:
        """Return points of the middle line at equal distances along it, with the thickness.

        Returns:
            Radius, y, thickness, radius and y of the normal. (count, 5) [m]

        Raises:
            ValueError: a fillet does not fit between its neighbours.
        """
        path = np.array(list(self._path()))
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)))
        places = np.linspace(0.0, along[-1], count)
        line = np.column_stack([np.interp(places, along, path[:, k]) for k in range(3)])
        tangent = np.gradient(line[:, :2], axis=0, edge_order=2 if count > 2 else 1)
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        return np.column_stack([line, -tangent[:, 1], tangent[:, 0]])

    def _path(self) -> Iterable[tuple[float, float, float]]:
        """Yield points of the middle line with rounded corners, and the thickness. [m]"""
        places, count = self._places, len(self._places)
        cut = [0.0] * count
        for number in range(1, count - 1):
            cut[number] = self.meridian[number].fillet * math.tan(0.5 * self._turn(number))
        for number, (left, right) in enumerate(itertools.pairwise(cut)):
            length = float(np.linalg.norm(places[number + 1] - places[number]))
            if left + right > length * (1.0 + 1e-9):
                raise ValueError(
                    f"meridian.{number}: the fillets need {1e3 * (left + right):.1f} mm of the "
                    f"{1e3 * length:.1f} mm to the next point"
                )
        for number, point in enumerate(self.meridian):
            if cut[number] == 0.0:
                yield (*places[number], point.thickness)
                continue
            yield from ((*place, point.thickness) for place in self._arc(number, cut[number]))

    def _arc(self, number: int, cut: float) -> FloatArray:
        """Return points of the arc at a corner. (n, 2) [m]"""
        corner = self._places[number]
        before, after = (
            (self._places[number + shift] - corner)
            / np.linalg.norm(self._places[number + shift] - corner)
            for shift in (-1, 1)
        )
        begin, turn = corner + cut * before, self._turn(number)
        side = np.sign(-before[0] * after[1] + before[1] * after[0])
        normal = side * np.array([before[1], -before[0]])
        centre = begin + normal * self.meridian[number].fillet
        angles = np.linspace(0.0, turn, 2 + round(turn / 0.05)) * side
        c, s, arm = np.cos(angles), np.sin(angles), begin - centre
        return centre + np.column_stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])


def load_gasket_drawing(name_or_path: str | Path) -> GasketDrawing:
    """Read a drawing of a gasket, with a notice for each kind of size that is unusual.

    Args:
        name_or_path: Name of a shipped drawing, or path of a YAML file.
    """
    path = GASKETS.path(name_or_path)
    drawing = _of_dxf(path) if "dxf" in read_yaml(path) else read_model(GasketDrawing, path)
    for key, values in drawing.sizes.items():
        for remark in unusual_values(key, values, u.Unit("m", "mm")):
            warnings.warn(str(replace(remark, where=str(path))), InputNotice, stacklevel=2)
    test = drawing.rubber.test
    if test and not test.terms and test.fitted_terms < test.most_terms:
        message = (
            f"{test.most_terms} constants make an unstable rubber; {test.fitted_terms} can be "
            f"used, with a fit within {100.0 * test.deviation:.2g} % of the largest stress"
        )
        warnings.warn(str(Problem(str(path), "rubber.test", message)), InputNotice, stacklevel=2)
    return drawing


def _of_dxf(path: Path) -> GasketDrawing:
    """Return the drawing of a YAML file that names a DXF file."""
    read = read_model(_DxfDrawing, path)
    meridian = [
        {"radius": radius, "y": y, "thickness": read.dxf.thickness, "fillet": fillet}
        for radius, y, fillet in corners_of_line(read.dxf, path.parent)
    ]
    try:
        described = read.model_dump(exclude={"dxf"})
        return GasketDrawing.model_validate({**described, "meridian": meridian})
    except ValidationError as error:
        raise InputError(
            replace(problem, where=str(path.parent / read.dxf.file))
            for problem in problems_of(error, GasketDrawing)
        ) from None
