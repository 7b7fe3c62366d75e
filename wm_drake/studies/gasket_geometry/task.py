"""Check the options of the study of drawings; compute, run, fit, and verify the best drawing."""

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
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.solid.curves import MOTIONS, Gasket, Mesh
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket_curves.study import (
    GasketStiffness,
    check_gasket,
    curve_values,
    damping_per_stiffness,
    positive,
    with_gasket,
)
from wm_drake.studies.gasket_geometry import drawings
from wm_drake.studies.gasket_geometry.options import GasketGeometryOptions
from wm_drake.studies.gasket_geometry.page import geometry_answer
from wm_drake.studies.gasket_geometry.study import (
    CANDIDATES,
    GAP,
    MEASURES,
    POINTS,
    RESPONSES,
    ComputedDrawing,
    Surface,
    computed_curves,
    conditions_data,
    drawings_data,
    fit,
    limits_of,
    ranked,
    surfaces_data,
)
from wm_drake.studies.inputs import selected_cases
from wm_drake.studies.study import Task

FREQUENCY = Unit("Hz", "Hz")


class GasketGeometryTask(Task):
    """The study with checked options."""

    def __init__(self, options: GasketGeometryOptions, machine: Machine) -> None:
        """Read the drawing, make the design, and check that each of its drawings can be built."""
        from scipy.stats.qmc import LatinHypercube

        self.options, self.machine = options, machine.parameters
        check_gasket(self.machine)
        self.drawing, self.limits = load_gasket_drawing(options.file), limits_of(options.limit)
        self.factors = drawings.factors_of(self.drawing, options.folds)
        if len(set(options.folds)) == 1:
            self.drawing = drawings.with_folds(self.drawing, options.folds[0])
        self.cases = selected_cases(self.machine, options.load, True, options.profile)
        self.frequency = positive(options.frequency, FREQUENCY, "--frequency")
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

    def run(self, executor: Executor) -> Answer:
        """Compute all drawings, fit the surfaces, and verify the best drawing."""
        assert executor.ledger is not None
        levels = np.concatenate([self.design, self.fresh])
        with executor.progress(len(levels), "drawings") as progress:
            computed = self._all_computed(executor, levels, progress)
        responses = self._responses(executor, levels, computed)
        count = len(self.design)
        surfaces = {name: fit(self.design, responses[name][:count]) for name in RESPONSES}
        proposed = self._best(surfaces)
        (made,) = self._all_computed(executor, proposed[None], lambda _: None)
        verified = self._responses(executor, proposed[None], [made])
        levels = np.vstack([levels, proposed])
        every = {name: np.concatenate([responses[name], verified[name]]) for name in responses}
        kinds = ["design"] * count + ["fresh"] * len(self.fresh) + ["best of surface"]
        data = {"drawings": drawings_data(self.factors, levels, every, surfaces, kinds)}
        data["conditions"] = conditions_data(self.limits, every, surfaces[GAP].degree)
        best = drawings.changed(self.drawing, self.factors, levels[int(data["conditions"].best)])
        data["surfaces"] = surfaces_data(surfaces, self.candidates, data["drawings"])
        loads = [case.name for case in self.cases]
        return geometry_answer(self.factors, data, best, self.options.file, loads)

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
    ) -> list[ComputedDrawing]:
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
    def _kept(values: Mapping[str, Any]) -> ComputedDrawing:
        """Return what the ledger has of a drawing."""
        tables = {motion.name: _table(motion.rotates, values[motion.name]) for motion in MOTIONS}
        stiffness = GasketStiffness(tables, float(values["coupling"]))
        return ComputedDrawing(stiffness, float(values["stretch"]))

    def _responses(
        self, executor: Executor, levels: FloatArray, computed: Sequence[ComputedDrawing]
    ) -> dict[str, FloatArray]:
        """Return the responses of drawings in SI: stiffness, then worst of all loads. (n,)"""
        machines = [
            self._machine(at, one.stiffness) for at, one in zip(levels, computed, strict=True)
        ]
        experiment = Experiment(
            build_machine(machines[0]), MEASURES, executor.simulate, tuple(self.cases)
        )
        runs = experiment.at(range(len(machines)), machines)
        for at, reasons in zip(levels, runs.diverged.values, strict=True):
            if any(reasons):
                where, reason = drawings.text_at(self.factors, at), next(filter(None, reasons))
                raise WmDrakeError(f"{reason}, with the gasket of the drawing with {where}")
        slopes = {
            name: np.array([one.stiffness.tables[name].nominal_stiffness for one in computed])
            for name in (motion.name for motion in MOTIONS)
        }
        force = np.linalg.norm(runs.gasket_force, axis=-1)
        return {
            **slopes,
            GAP: runs.smallest_gap.min("load").values,
            "largest_amplitude": runs.amplitude.max(("load", "sensor")).values,
            "largest_gasket_force": force.max(axis=1),
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
