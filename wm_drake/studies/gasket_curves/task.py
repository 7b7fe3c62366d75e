"""Check the options of the curves of a gasket, and compute them."""

from functools import partial

from wm_drake.errors import WmDrakeError
from wm_drake.model.machine import Machine
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.solid.curves import MOTIONS, Curve, Gasket, Mesh
from wm_drake.solid.deformed import deformed, wrinkles
from wm_drake.solid.touching import Faces
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.gasket_curves.options import GasketCurvesOptions
from wm_drake.studies.gasket_curves.page import curves_answer
from wm_drake.studies.gasket_curves.study import (
    FREQUENCY,
    WRINKLED,
    Checked,
    _first,
    check_gasket,
    curve_values,
    damping_per_stiffness,
    numbers_data,
    positive,
    stiffness_of,
    with_gasket,
)
from wm_drake.studies.study import Task


class GasketCurvesTask(Task):
    """The curves with checked options."""

    def __init__(self, options: GasketCurvesOptions, machine: Machine) -> None:
        """Read the drawing and the ranges, and mesh the gasket."""
        self.options, self.machine = options, machine.parameters
        check_gasket(self.machine)
        self.drawing = load_gasket_drawing(options.file)
        self.values = curve_values(options, options.points)
        self.frequency = positive(options.frequency, FREQUENCY.unit, "--frequency")
        self.mesh = Mesh(options.elements, options.around)
        self.gasket = Gasket(self.drawing, self.mesh)

    def run(self, executor: Executor) -> Answer:
        """Compute all curves."""
        curves = {}
        with executor.fractions([motion.name for motion in MOTIONS]) as progress:
            for number, motion in enumerate(MOTIONS):
                values, report = self.values[motion.name], partial(progress, number)
                curves[motion.name] = self._checked(self.gasket.curve(motion, values, report))
        name, options = self.options.file, self.options
        machine = with_gasket(
            self.machine,
            stiffness_of({motion: checked.curve for motion, checked in curves.items()}),
            damping_per_stiffness(self.drawing, self.frequency),
            f"wm-drake gasket curves {name}, {options.elements} by {options.around} elements",
        )
        numbers = numbers_data(self.drawing, self.mesh, self.frequency, curves)
        return curves_answer(name, self.drawing, curves, numbers, machine)

    def _checked(self, curve: Curve) -> Checked:
        """Return a curve with stretch, stress, touching folds and wrinkles.

        Raises:
            WmDrakeError: the curve has no point beside the one at rest.
        """
        points = curve.points
        if points[0].value == 0.0 or points[-1].value == 0.0:
            raise WmDrakeError(f"{curve.stopped}: there is no curve; nothing was written")
        rubber = self.drawing.rubber
        faces = Faces(curve.ring)
        depths = [faces.touching(point.u).depth for point in points]
        return Checked(
            curve,
            deformed(curve.ring, rubber, points[0].u),
            deformed(curve.ring, rubber, points[-1].u),
            _first(curve.values, [depth > 0.0 for depth in depths]),
            max(depths),
            _first(curve.values, [wrinkles(curve.ring, point.u) > WRINKLED for point in points]),
        )
