"""Response surfaces over drawings of a gasket, and what each factor does."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.reading import SI, read_in
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit, plain_number
from wm_drake.report.quantity import SHARE, Quantity, of_measure
from wm_drake.solid.curves import MOTIONS, Gasket, Mesh
from wm_drake.solid.deformed import deformed
from wm_drake.studies.gasket_curves.study import GasketStiffness, stiffness_of
from wm_drake.studies.gasket_geometry.drawings import DrawingFactor
from wm_drake.studies.inputs import pairs_of

MEASURES = ("amplitudes", "gap", "extremes")
"""Measures of the runs."""

POINTS = 3
"""Points of a curve on each side, beside the one near rest."""

CANDIDATES = 4096
"""Drawings among which the best is chosen on the response surface."""

MM, STIFFNESS, TURN = Unit("m", "mm"), Unit("N/m", "N/mm"), Unit("N*m/rad", "N*m/rad")

RESPONSES = {
    "radial": Quantity("radial stiffness", STIFFNESS, 2),
    "axial": Quantity("axial stiffness", STIFFNESS, 2),
    "twist": Quantity("twist stiffness", TURN, 2),
    "tilt": Quantity("tilt stiffness", TURN, 2),
    "smallest_gap": of_measure("smallest_gap"),
    "largest_amplitude": Quantity("largest amplitude of a sensor", MM, 2),
    "largest_gasket_force": Quantity("largest gasket force", Unit("N", "N"), 2),
    "largest_stretch": Quantity("largest stretch of the rubber", decimals=2),
}
"""Responses of a drawing by name. Options and files name them with their units."""

GAP = "smallest_gap"
"""Response that the best drawing makes largest."""

ERROR = Quantity("error on fresh, of the range", Share(), 1)


@dataclass(frozen=True)
class ComputedDrawing:
    """What the curves of a drawing give: stiffness, and the largest stretch at their ends."""

    stiffness: GasketStiffness
    stretch: float


SPARE = 3
"""Runs beyond the number of coefficients that a surface of degree two needs."""


def basis(levels: FloatArray, degree: int) -> FloatArray:
    """Return polynomials that are orthogonal for even levels from -1 to 1. (n, terms)

    They are 1, x_i, and for degree two (3 x_i^2 - 1)/2 and x_i x_j.
    """
    count = levels.shape[1]
    columns = [np.ones(len(levels)), *levels.T]
    if degree == 2:
        columns += [0.5 * (3.0 * x * x - 1.0) for x in levels.T]
        columns += [levels[:, i] * levels[:, j] for i, j in itertools.combinations(range(count), 2)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Surface:
    """Response surface: a class, as it is evaluated at any levels.

    Attributes:
        factors: Number of factors.
        degree: Degree: 1, or 2 if there are enough runs.
        coefficients: Of the columns of `basis`. (terms,)
    """

    factors: int
    degree: int
    coefficients: FloatArray

    def at(self, levels: FloatArray) -> FloatArray:
        """Return the response at levels. (n, factors) to (n,)"""
        return np.asarray(basis(levels, self.degree) @ self.coefficients)

    def contributions(self, sample: FloatArray) -> FloatArray:
        """Return the part of each factor in the variance, and that of all pairs. (factors + 1,)

        Args:
            sample: Levels over which the variance is taken. (n, factors)
        """
        count, terms = self.factors, basis(sample, self.degree) * self.coefficients
        main = terms[:, 1 : count + 1]
        if self.degree == 2:
            main = main + terms[:, count + 1 : 2 * count + 1]
        pairs = terms[:, 2 * count + 1 :].sum(axis=1) if self.degree == 2 else np.zeros(len(terms))
        parts = np.append(main.var(axis=0), pairs.var())
        total = float(parts.sum())
        return parts / total if total else parts


def fit(levels: FloatArray, response: FloatArray) -> Surface:
    """Return the least-squares surface of runs at levels (n, factors).

    The square of a factor with two levels is constant: it has the coefficient 0.
    """
    terms = basis(levels[:1], 2).shape[1]
    degree = 2 if len(levels) >= terms + SPARE else 1
    columns = basis(levels, degree)
    columns[:, 1:] *= np.ptp(columns[:, 1:], axis=0) > 1e-12
    coefficients = np.linalg.lstsq(columns, response, rcond=None)[0]
    return Surface(levels.shape[1], degree, np.asarray(coefficients))


def excess(responses: Mapping[str, FloatArray], limits: Mapping[str, float]) -> FloatArray:
    """Return by how much drawings exceed limits at most, in parts of the limit; 0 if not. (n,)"""
    parts = [responses[name] / limit - 1.0 for name, limit in limits.items()]
    return np.max([np.zeros_like(responses[GAP]), *parts], axis=0)


def ranked(responses: Mapping[str, FloatArray], limits: Mapping[str, float]) -> np.ndarray:
    """Return the numbers of drawings, best first: within the limits, then the largest gap. (n,)"""
    return np.lexsort((-responses[GAP], excess(responses, limits)))


@read_in(SI)
def limits_of(entries: Sequence[str]) -> dict[str, float]:
    """Return limits by responses, in SI. The names of options do not change with the units.

    Raises:
        InputError: a response is unknown, or a limit is not a number above 0.
    """
    known = {f"{name}{quantity.suffix}": name for name, quantity in RESPONSES.items()}
    limits = {}
    for option, text in pairs_of(entries, "--limit"):
        name = known.get(option, GAP)
        if name == GAP:
            allowed = ", ".join(option for option, name in known.items() if name != GAP)
            raise input_error(f"'{option}': allowed are {allowed}", where="--limit")
        try:
            number = plain_number(text)
        except ValueError:
            number = 0.0
        if not 0.0 < number < np.inf:
            raise input_error(f"'{option}={text}': allowed is a number above 0", where="--limit")
        limits[name] = RESPONSES[name].reading.to_si(number)
    return limits


def computed_curves(
    work: tuple[GasketDrawing, Mesh, Mapping[str, Sequence[float]]],
) -> dict[str, Any] | str:
    """Return tables, coupling and largest stretch of a drawing; the reason if a curve ends early.

    Args:
        work: Drawing, mesh, and ends of the motion by name.
    """
    drawing, mesh, values = work
    gasket, curves = Gasket(drawing, mesh), {}
    for motion in MOTIONS:
        curve = gasket.curve(motion, values[motion.name], lambda _: None)
        if curve.stopped:
            return curve.stopped
        curves[motion.name] = curve
    made = stiffness_of(curves)
    stretch = max(
        deformed(curve.ring, drawing.rubber, curve.points[end].u).stretch
        for curve in curves.values()
        for end in (0, -1)
    )
    tables = {name: np.array(table.curve) for name, table in made.tables.items()}
    return {**tables, "coupling": made.coupling, "stretch": stretch}


def drawings_data(
    factors: Sequence[DrawingFactor],
    levels: FloatArray,
    responses: Mapping[str, FloatArray],
    surfaces: Mapping[str, Surface],
    kinds: Sequence[str],
) -> xr.Dataset:
    """Return drawings that were run.

    Args:
        levels: Levels of all drawings. (n, factors)
        responses: Their responses by name, in SI. (n,) each
        kinds: What each drawing is for. (n,)

    Returns:
        Over `drawing`: `kind`, the factors, the responses, and each again on its surface, as
        `smallest_gap_on_surface`; over `factor` too: `level`.
    """
    shown: dict[str, Any] = {"kind": ("drawing", list(kinds))}
    for factor, column in zip(factors, levels.T, strict=True):
        shown[factor.name] = factor.quantity.variable("drawing", factor.value(column))
    for name, quantity in RESPONSES.items():
        shown[name] = quantity.variable("drawing", responses[name])
    for name, quantity in RESPONSES.items():
        words = f"{quantity.words} on the surface"
        expected = quantity.named(words).variable("drawing", surfaces[name].at(levels))
        shown[f"{name}_on_surface"] = expected
    shown["level"] = (("drawing", "factor"), levels)
    return xr.Dataset(shown, {"factor": [factor.name for factor in factors]})


SECTION = np.linspace(-1.0, 1.0, 41)
"""Levels of a factor at which the surface of the gap is drawn."""


def surfaces_data(
    surfaces: Mapping[str, Surface], sample: FloatArray, drawings: xr.Dataset
) -> xr.Dataset:
    """Return what each factor does.

    Args:
        sample: Levels over which the variance is taken. (m, factors)
        drawings: As of `drawings_data`.

    Returns:
        `share` of each factor and of all pairs in the variance, over `response` and `source`;
        `error_on_fresh` over `response`, RMS error on fresh drawings by the range of the design;
        each response over `surface`: its mean over the sample, and its change from the low to the
        high end of each factor, with the others in the middle; `section`, the gap over `factor` and
        `level`, with the others in the middle.
    """
    names, fresh = drawings["factor"].values.tolist(), drawings.kind.values == "fresh"
    ends, section = (
        np.eye(len(names))[:, None, :] * levels[None, :, None]
        for levels in (np.array([-1.0, 1.0]), SECTION)
    )
    changes = {}
    for name, quantity in RESPONSES.items():
        low, high = np.array([surfaces[name].at(at) for at in ends]).T
        values = [surfaces[name].at(sample).mean(), *(high - low)]
        changes[name] = quantity.variable("surface", values)
    errors = []
    for name in RESPONSES:
        design = drawings[name].values[drawings.kind.values == "design"]
        error = (drawings[f"{name}_on_surface"] - drawings[name]).values[fresh]
        spread = float(np.ptp(design))
        errors.append(float(np.sqrt(np.mean(error**2))) / spread if spread else 0.0)
    shares = [surface.contributions(sample) for surface in surfaces.values()]
    gaps = [surfaces[GAP].at(at) for at in section]
    return xr.Dataset(
        {
            "share": SHARE.named("part of the variance").variable(("response", "source"), shares),
            "error_on_fresh": ERROR.variable("response", errors),
            **changes,
            "section": RESPONSES[GAP].variable(("factor", "level"), gaps),
        },
        {
            "response": list(RESPONSES),
            "source": [*names, "pairs"],
            "surface": ["mean", *(f"change over {name}" for name in names)],
            "factor": names,
            "level": SECTION,
        },
    )


def conditions_data(
    limits: Mapping[str, float], responses: Mapping[str, FloatArray], degree: int
) -> xr.Dataset:
    """Return the limits, whether the best drawing keeps them, and the degree of the surfaces."""
    best = ranked(responses, limits)[0]
    return xr.Dataset(
        {
            **{name: RESPONSES[name].variable((), limit) for name, limit in limits.items()},
            "keeps_limits": ((), not excess(responses, limits)[best]),
            "degree": Quantity("degree of the surfaces", decimals=0).variable((), degree),
            "best": Quantity("number of the best drawing", decimals=0).variable((), best),
        }
    )
