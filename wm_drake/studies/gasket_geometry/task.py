"""Check the options of the study of drawings of a gasket, and run it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wm_drake.batch import sources_version
from wm_drake.batch.ledger import key_of
from wm_drake.errors import WmDrakeError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.solid.curves import MOTIONS, Gasket, Mesh
from wm_drake.studies.executor import Executor
from wm_drake.studies.gasket_curves.study import (
    GasketStiffness,
    check_gasket,
    curve_values,
    damping_per_stiffness,
    positive,
    with_gasket,
)
from wm_drake.studies.gasket_geometry import drawings
from wm_drake.studies.gasket_geometry.options import GeometryOptions
from wm_drake.studies.gasket_geometry.page import GeometryResult
from wm_drake.studies.gasket_geometry.study import (
    CANDIDATES,
    GAP,
    MEASURES,
    POINTS,
    Computed,
    Surface,
    _table,
    computed_curves,
    fit,
    limits_of,
    ranked,
)
from wm_drake.studies.inputs import selected_cases
from wm_drake.studies.study import Result, Task


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
