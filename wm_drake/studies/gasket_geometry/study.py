"""The study: a design of drawings, finite elements of each, runs, surfaces, the best drawing."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wm_drake.batch import sources_version
from wm_drake.batch.ledger import key_of
from wm_drake.errors import WmDrakeError, input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing, load_gasket_drawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, plain_number
from wm_drake.simulation.cases import Case
from wm_drake.solid.curves import MOTIONS, Gasket, Mesh
from wm_drake.solid.deformed import deformed
from wm_drake.studies.executor import Executor
from wm_drake.studies.gasket_curves.study import (
    GasketStiffness,
    check_gasket,
    curve_values,
    damping_per_stiffness,
    positive,
    stiffness_of,
    with_gasket,
)
from wm_drake.studies.gasket_geometry import drawings
from wm_drake.studies.gasket_geometry.options import GeometryOptions
from wm_drake.studies.inputs import pairs_of, selected_cases
from wm_drake.studies.study import Result, Task

MEASURES = ("amplitudes", "gap", "extremes")
"""Measures of the runs."""

POINTS = 3
"""Points of a curve on each side, beside the one near rest."""

CANDIDATES = 4096
"""Drawings among which the best is chosen on the response surface."""

RESPONSES = {
    "radial_N_per_mm": "radial stiffness, N/mm",
    "axial_N_per_mm": "axial stiffness, N/mm",
    "twist_Nm_per_rad": "twist stiffness, N m/rad",
    "tilt_Nm_per_rad": "tilt stiffness, N m/rad",
    "smallest_gap_mm": "smallest gap, mm",
    "largest_amplitude_mm": "largest amplitude of a sensor, mm",
    "largest_gasket_force_N": "largest gasket force, N",
    "largest_stretch": "largest stretch of the rubber",
}
"""Responses of a drawing: words by names."""

GAP = "smallest_gap_mm"
"""Response that the best drawing makes largest."""


@dataclass(frozen=True)
class Computed:
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
    """Response surface.

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


def limits_of(entries: Sequence[str]) -> dict[str, float]:
    """Return limits by responses.

    Raises:
        InputError: a response is unknown, or a limit is not a number above 0.
    """
    limits = {}
    for name, text in pairs_of(entries, "--limit"):
        if name not in RESPONSES or name == GAP:
            allowed = ", ".join(response for response in RESPONSES if response != GAP)
            raise input_error(f"'{name}': allowed are {allowed}", where="--limit")
        try:
            limits[name] = plain_number(text)
        except ValueError:
            limits[name] = 0.0
        if not 0.0 < limits[name] < np.inf:
            raise input_error(f"'{name}={text}': allowed is a number above 0", where="--limit")
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


class GeometryTask(Task):
    """The study with checked options."""

    def __init__(self, options: GeometryOptions, machine: Machine) -> None:
        """Read the drawing, make the design, and check that each of its drawings can be built."""
        from scipy.stats.qmc import LatinHypercube

        self.options, self.machine = options, machine.parameters
        check_gasket(self.machine)
        self.drawing, self.limits = load_gasket_drawing(options.file), limits_of(options.limit)
        self.factors = drawings.factors_of(self.drawing, options.folds)
        if len(set(options.folds)) == 1:
            self.drawing = drawings.with_folds(self.drawing, options.folds[0])
        self.cases = selected_cases(self.machine, options.load, True, options.profile)
        self.frequency = positive(options.frequency, Unit("Hz", "Hz"), "--frequency")
        self.values = curve_values(options, POINTS)
        self.mesh = Mesh(options.elements, options.around)
        sampler = LatinHypercube(len(self.factors), rng=options.seed)
        parts = [sampler.random(count) for count in (options.drawings, options.fresh, CANDIDATES)]
        self.design, self.fresh, self.candidates = (
            np.column_stack([
                factor.levels(column) for factor, column in zip(self.factors, part.T, strict=True)
            ])
            for part in parts
        )  # fmt: skip
        for levels in (*self.design, *self.fresh):
            self._gasket(levels)

    def _mesh(self, levels: FloatArray) -> Mesh:
        """Return the mesh of a drawing: more elements along the meridian for more folds."""
        values = drawings.values_at(self.factors, levels)
        times = round(values.get(drawings.FOLDS, max(self.options.folds)))
        return replace(self.mesh, meridian=times * self.mesh.meridian)

    def _gasket(self, levels: FloatArray) -> Gasket:
        """Return the gasket of a drawing."""
        return Gasket(drawings.changed(self.drawing, self.factors, levels), self._mesh(levels))

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        options = self.options
        return {
            "drawing": self.drawing,
            "folds": sorted(set(self.options.folds)),
            "mesh": self.mesh,
            "values": self.values,
            "profile": self.cases[0].profile,
            "loads": [case.load for case in self.cases],
            "seed": str(options.seed),
        }

    def run(self, executor: Executor) -> Result:
        """Compute all drawings, fit the surfaces, and verify the best drawing."""
        from wm_drake.studies.gasket_geometry.page import GeometryResult

        assert executor.ledger is not None
        levels = np.concatenate([self.design, self.fresh])
        with executor.progress(len(levels), "drawings") as progress:
            computed = self._all_computed(executor, levels, progress)
        responses = self._responses(executor, levels, computed)
        count = len(self.design)
        surfaces = {
            name: fit(self.design, response[:count]) for name, response in responses.items()
        }
        proposed = self._best(surfaces)
        (made,) = self._all_computed(executor, proposed[None], lambda _: None)
        verified = self._responses(executor, proposed[None], [made])
        levels = np.vstack([levels, proposed])
        every = {name: np.concatenate([responses[name], verified[name]]) for name in responses}
        return GeometryResult(
            self.options.file,
            self.factors,
            levels,
            every,
            count,
            surfaces,
            drawings.changed(self.drawing, self.factors, levels[ranked(every, self.limits)[0]]),
            tuple(case.name for case in self.cases),
            self.limits,
            self.candidates,
        )

    def _best(self, surfaces: dict[str, Surface]) -> FloatArray:
        """Return the levels of the best candidate on the surfaces that can be built."""
        expected = {name: surface.at(self.candidates) for name, surface in surfaces.items()}
        for at in ranked(expected, self.limits):
            try:
                self._gasket(self.candidates[at])
            except WmDrakeError:
                continue
            return np.asarray(self.candidates[at])
        raise WmDrakeError("no drawing of the range can be built")

    def _all_computed(
        self, executor: Executor, levels: FloatArray, progress: Callable[[int], None]
    ) -> list[Computed]:
        """Return what the curves of drawings give, from the ledger where it has them.

        Raises:
            WmDrakeError: a curve ends early.
        """
        ledger = executor.ledger
        assert ledger is not None
        sources = sources_version()
        works = [
            (drawings.changed(self.drawing, self.factors, at), self._mesh(at), self.values)
            for at in levels
        ]
        keys = [
            key_of(drawing=drawing, mesh=mesh, values=values, sources=sources)
            for drawing, mesh, values in works
        ]
        missing = [number for number, key in enumerate(keys) if key not in ledger]
        done = len(keys) - len(missing)
        progress(done)
        for place, made in executor.each(computed_curves, [works[number] for number in missing]):
            if isinstance(made, str):
                where = drawings.text_at(self.factors, levels[missing[place]])
                raise WmDrakeError(
                    f"{made}, in the drawing with {where}; choose smaller ranges of motion. "
                    "Finished drawings are kept"
                )
            ledger.put(keys[missing[place]], made)
            done += 1
            progress(done)
        return [self._kept(ledger.get(key).values) for key in keys]

    @staticmethod
    def _kept(values: Mapping[str, Any]) -> Computed:
        """Return what the ledger has of a drawing."""
        tables = {motion.name: _table(motion.rotates, values[motion.name]) for motion in MOTIONS}
        stiffness = GasketStiffness(tables, float(values["coupling"]))
        return Computed(stiffness, float(values["stretch"]))

    def _responses(
        self, executor: Executor, levels: FloatArray, computed: Sequence[Computed]
    ) -> dict[str, FloatArray]:
        """Return the responses of drawings: stiffness, then worst of all loads. (n,) each"""
        machines = [
            self._machine(at, one.stiffness) for at, one in zip(levels, computed, strict=True)
        ]
        cases = [
            Case(case.name, case.load, case.profile, parameters=machine)
            for machine in machines
            for case in self.cases
        ]
        table = executor.simulate(build_machine(machines[0]), MEASURES, cases)
        shape = (len(machines), len(self.cases), -1)

        def of_runs(name: str) -> FloatArray:
            return np.asarray(table[name].values, dtype=float).reshape(shape)

        slopes = {
            name: np.array([one.stiffness.tables[name].nominal_stiffness for one in computed])
            for name in (motion.name for motion in MOTIONS)
        }
        force = np.linalg.norm(of_runs("gasket_force"), axis=-1)
        return {
            "radial_N_per_mm": 1e-3 * slopes["radial"],
            "axial_N_per_mm": 1e-3 * slopes["axial"],
            "twist_Nm_per_rad": slopes["twist"],
            "tilt_Nm_per_rad": slopes["tilt"],
            GAP: 1e3 * of_runs("smallest_gap").min(axis=(1, 2)),
            "largest_amplitude_mm": 1e3 * of_runs("amplitude").max(axis=(1, 2)),
            "largest_gasket_force_N": force.max(axis=1),
            "largest_stretch": np.array([one.stretch for one in computed]),
        }

    def _machine(self, levels: FloatArray, stiffness: GasketStiffness) -> MachineParameters:
        drawing = drawings.changed(self.drawing, self.factors, levels)
        damping = damping_per_stiffness(drawing, self.frequency)
        return with_gasket(self.machine, stiffness, damping, "gasket-geometry")


def _table(rotates: bool, curve: FloatArray) -> ForceTable | TorqueTable:
    """Return a table of its abscissas and ordinates. (2, n)"""
    x, y = map(tuple, curve.tolist())
    return TorqueTable(angle=x, torque=y) if rotates else ForceTable(displacement=x, force=y)
