"""A machine that is set up without load, and again with other numbers, for a page."""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from wm_drake.elements.cabinet import FEET_SIZE, FOOT, PADS
from wm_drake.elements.feet import FEET, packed_feet
from wm_drake.elements.friction_damper import FRICTION_DAMPER
from wm_drake.elements.sensor import MEASURED_POINT, POINT_SIZE
from wm_drake.elements.spring import SPRING
from wm_drake.engines.compiled.cabinet import FEET_BEGIN
from wm_drake.engines.compiled.mechanics import BODIES
from wm_drake.engines.compiled.packing import DrawnBodies, drum_joint, pack
from wm_drake.engines.compiled.stepping import Stepping, choose_stepping
from wm_drake.export.kernel import HARMONICS_BEGIN, HARMONICS_SIZE
from wm_drake.export.page_plan import (
    FREE_LENGTH,
    GIVEN,
    PUSHES,
    SOLVED,
)
from wm_drake.export.tunable import TOLERANCE
from wm_drake.model.bodies import drawn_frame
from wm_drake.model.machine import Machine, Setup
from wm_drake.model.scene import Scene
from wm_drake.model.state_layout import CARRIER
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.steps import checked_integrator, checked_step

Move = Callable[[Mapping[str, float]], MachineParameters]
"""Function that returns the machine with other values of some numbers. [SI]"""


class Contents:
    """The parts of the model of a page, one after the other."""

    def __init__(
        self, machine: Machine, move: Move, profile: SpinProfile, depths: Sequence[float]
    ) -> None:
        """Set the machine up without load.

        Args:
            move: Function that returns the machine with other values of some numbers.
            profile: Spin profile, which gives the step, the samples and the filter.
            depths: Where along the drum axis orbits are drawn. [m]
        """
        self.machine, self.move, self.profile, self.depths = machine, move, profile, depths
        self.context = machine.diagram.CreateDefaultContext()
        self.setup = self.set_up({})
        self.drawn = machine.drawn.bodies(None, machine.parameters)
        self.bodies = DrawnBodies(
            machine.drawn.plant, self.drawn, self.setup.parameters.drive.joint
        )
        self.packed, self.layout = pack(self.setup)
        parameters = self.setup.parameters
        self.period = profile.sample_period(parameters.output_period)
        self.band = pass_band(profile, self.period)
        self.scene = Scene(parameters)
        self.derived = self._derived()
        # now: the Context is that of every set-up to come
        self.packed_rows = self.full_rows(self.setup)
        self.start = self._given(self.packed_rows)

    def set_up(
        self, values: Mapping[str, float], *, gasket: bool = True, load: Load | None = None
    ) -> Setup:
        """Return the machine with other values of some numbers. [SI]

        Without a load it has no residual imbalance either.
        """
        parameters = self.move(values) if values else self.machine.parameters
        return self.machine.set_up(load, context=self.context, parameters=parameters, gasket=gasket)

    @functools.cached_property
    def stepping(self) -> Stepping:
        """Return how runs of the machine as exported are integrated."""
        return self.stepping_of(self.setup)

    def stepping_of(self, setup: Setup) -> Stepping:
        """Return how runs of the machine, as it is set up without load, are integrated."""
        step = checked_step(setup.parameters, None)
        integrator = checked_integrator(setup.parameters, None)
        return choose_stepping(setup, *pack(setup), self.profile, step, integrator)

    def rows(self, setup: Setup) -> FloatArray:
        """Return `full_rows` without what the functions compute from the others."""
        return self._given(self.full_rows(setup))

    def _given(self, rows: FloatArray) -> FloatArray:
        """Return rows with zeros in place of what the functions compute from the others."""
        given = rows.copy()
        given[self.derived] = 0.0
        return given

    def full_rows(self, setup: Setup) -> FloatArray:
        """Return packed numbers, free length of each spring, measured points, numbers of feet."""
        parameters = setup.parameters
        types = (parameters.spring_types[s.type] for s in parameters.springs.values())
        lengths = [t.free_length or 0.0 for t in types]
        orbits = [
            MEASURED_POINT.pack(p_ToM_T=(0.0, y, 0.0), direction_W=axis, at_rest=0.0)
            for y in self.depths
            for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        ]
        points = setup.measured_points.ravel(), *orbits
        rows: list[FloatArray] = [pack(setup)[0], np.array(lengths), *points]
        if parameters.cabinet:
            feet = packed_feet(parameters.cabinet, parameters.gravity)
            feet[FEET.offsets["friction"]] = 0.0  # the page shows nothing that depends on it
            rows.append(feet)
        return np.concatenate(rows)

    def _derived(self) -> np.ndarray:
        """Return the rows that the functions compute from others."""
        parameters, mounts = self.setup.parameters, self.layout
        rows: list[int] = []
        for at, kind in zip(mounts.springs, self.spring_kinds(), strict=True):
            names = ["rest_length", "taut_from"] + ["preload"] * (kind % PUSHES != GIVEN)
            rows += [at + SPRING.offsets[name] for name in names]
        for at in mounts.dampers:
            rows += range(
                at + FRICTION_DAMPER.offsets["axis"], at + FRICTION_DAMPER.offsets["axis"] + 3
            )
        if mounts.cabinet >= 0:
            first = mounts.cabinet + FEET_BEGIN
            sags = range(PADS.fixed_size + FOOT.offsets["at_rest"], FEET_SIZE, FOOT.fixed_size)
            rows += [first + at for at in (PADS.offsets["damping_growth"], *sags)]
        first = len(self.packed) + len(parameters.springs)
        count = len(self.setup.measured_points) + 2 * len(self.depths)
        rows += [first + POINT_SIZE * (k + 1) - 1 for k in range(count)]
        return np.array(rows, dtype=int)

    def spring_kinds(self) -> list[int]:
        """Return what gives the preload of each spring, and whether it pushes."""
        parameters, kinds = self.setup.parameters, []
        for name, spring in parameters.springs.items():
            free = parameters.spring_types[spring.type].free_length
            kind = (
                FREE_LENGTH if free is not None else GIVEN if spring.preload is not None else SOLVED
            )
            kinds.append(kind + PUSHES * self.setup.springs[name].pushes)
        return kinds

    def slopes(self, key: str, value: float, ends: Sequence[float]) -> FloatArray | None:
        """Return how all rows grow with a number; None if one does not by a straight line."""
        low, high = (self.rows(self.set_up({key: end})) - self.start for end in ends)
        slopes = (high - low) / (ends[1] - ends[0])
        straight = slopes * (ends[0] - value)
        size = np.abs(self.start) + np.abs(low) + np.abs(high)
        return None if np.any(np.abs(straight - low) > TOLERANCE * size) else slopes

    def body_constants(self, name: str) -> FloatArray | None:
        """Return the constants of a body that may change; None if it is in neither group."""
        plant, context = self.machine.drawn.plant, self.drawn
        tub, drum = plant.GetBodyByName("tub"), self._drum_joint.child_body()
        body = plant.GetBodyByName(name)
        groups = [{b.index() for b in plant.GetBodiesWeldedTo(of)} for of in (tub, drum)]
        if plant.HasBodyNamed(CARRIER) or not any(body.index() in group for group in groups):
            return None
        X_TB = plant.CalcRelativeTransform(context, drawn_frame(plant, tub), body.body_frame())
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        central = inertia.Shift(inertia.get_com()).ReExpress(X_TB.rotation().inverse())
        matrix = central.CalcRotationalInertia().CopyToFullMatrix3()
        override = self.setup.parameters.bodies.get(name)
        grows, origin = override is None or override.inertia is None, BODIES.offsets["origin"]
        return np.array([
            body.index() in groups[1], grows, inertia.get_mass(), *inertia.get_com(),
            *X_TB.rotation().matrix().ravel(),
            *(self.packed[origin : origin + 3] - X_TB.translation()),
            *matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        ])  # fmt: skip

    @property
    def _drum_joint(self) -> Any:
        return drum_joint(self.machine.drawn.plant, self.setup.parameters.drive.joint)

    def of_load(self, load: Load) -> FloatArray:
        """Return what a load adds to the harmonics of the drum beside its point masses."""
        points = self.bodies.packed(Load(unbalances=load.unbalances))
        whole = self.bodies.packed(load)
        return (whole - points)[HARMONICS_BEGIN : HARMONICS_BEGIN + HARMONICS_SIZE]
