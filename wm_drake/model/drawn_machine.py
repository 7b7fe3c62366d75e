"""A machine as its SDF draws it: numbers and load set in a Context of its bodies, put to rest.

Set-ups of a built machine and the default Context of its diagram both come from here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context

from wm_drake.elements.cabinet import CabinetOnFeet
from wm_drake.errors import check_known
from wm_drake.model.bodies import add_bodies, add_load, drum_inertia, set_bodies
from wm_drake.model.cabinet import cabinet_at_rest
from wm_drake.model.equilibrium import force_as_drawn, preloaded, put_to_rest, rest_pose
from wm_drake.model.frame_poses import FramePoses, TubPoints, measured_points, tub_points
from wm_drake.model.placed_elements import ALL_PARTS, Parts, PlacedElements, placed_elements
from wm_drake.model.same_elements import check_same_elements
from wm_drake.model.scene import Scene
from wm_drake.model.state_layout import state_layout_of
from wm_drake.model.tub_statics import TubStatics, Weight, weight_of
from wm_drake.parameters import Load, MachineParameters
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.types import FloatArray


class SetUpCache:
    """Parameters, frame poses and weight of the last set-up, and scenes that no thread uses.

    Threads may share it: each value is replaced as a whole, and a thread that misses computes it.

    Attributes:
        scenes: Scenes to take from and to give back; many short batches share them.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.scenes: list[Scene] = []
        self._poses: FramePoses | None = None
        self._weight: tuple[Any, Weight] | None = None
        self._checked: MachineParameters | None = None

    def check(self, built: MachineParameters, requested: MachineParameters) -> None:
        """Check that a machine has the elements of the built one; see `check_same_elements`."""
        check_same_elements(built, requested, self._checked)
        self._checked = requested

    def frame_poses(self, plant: MultibodyPlant, parameters: MachineParameters) -> FramePoses:
        """Return the frame poses; those of the last set-up if its overrides were the same."""
        poses = self._poses
        if poses is None or poses.frames != parameters.frames:
            poses = self._poses = FramePoses(plant, parameters)
        return poses

    def weight(self, parameters: MachineParameters, compute: Callable[[], Weight]) -> Weight:
        """Return the weight on the springs; that of the last set-up if its bodies were the same."""
        bodies = parameters.bodies, parameters.frames, parameters.masses_on_drum
        last = self._weight
        if last is None or last[0] != bodies:
            last = self._weight = bodies, compute()
        return last[1]


@dataclass(frozen=True, repr=False)
class RestingMachine:
    """A machine with its load: numbers chosen, preloads solved, at rest at its rest pose.

    Attributes:
        parameters: The numbers in force.
        elements: The elements at their frames.
        points: Measured points of the tub.
        rest_pose: Equilibrium of the empty machine: roll, pitch, yaw, x, y, z. (6,) [rad, m]
        residual: Moment about To and force on the tub that remain there, in W. (6,) [N m, N]
        tube_rest: Angles and position of each outer tube and extension of the damper at rest.
            (telescopic dampers, 7) [rad, m]
        carrier_rest: Angles and position of the drum carrier at rest with a compliant bearing, else
            empty. (6,) [rad, m]
        measured_points: The measured points as packed numbers, from the function of this name.
        cabinet: The cabinet on its feet if it moves, else None. Its frame then takes the place of W
            for the tub; at rest they coincide.
        load: Point masses in the drum; None for the empty machine.
        drum: Inertia of the drum without load, about Do in D; None if `bodies` is.
        bodies: Context of `DrawnMachine.plant` with bodies, load and positions; None if the bodies
            were not asked for.
    """

    parameters: MachineParameters
    elements: PlacedElements
    points: TubPoints
    rest_pose: FloatArray
    residual: FloatArray
    tube_rest: FloatArray
    carrier_rest: FloatArray
    measured_points: FloatArray
    cabinet: CabinetOnFeet | None
    load: Load | None
    drum: SpatialInertia | None
    bodies: Context | None


class DrawnMachine:
    """The bodies of a machine as its SDF draws them.

    Attributes:
        parameters: The numbers it was built from.
        plant: A plant whose default Context has the numbers of the SDF, at the drawn pose.
        state_layout: Indices in the state of the plant, and of its copy in a diagram.
        cache: Values that set-ups and runs share.
    """

    def __init__(self, parameters: MachineParameters) -> None:
        """Read the SDF.

        Raises:
            InputError: the SDF has an error.
        """
        self.parameters, self.cache = parameters, SetUpCache()
        self.plant = MultibodyPlant(time_step=0.0)
        add_bodies(self.plant, parameters)
        self.state_layout = state_layout_of(self.plant, parameters)

    def at_rest(
        self,
        load: Load | str | None,
        parameters: MachineParameters,
        parts: Parts = ALL_PARTS,
        *,
        bodies: bool = True,
    ) -> RestingMachine:
        """Return the machine at rest; load and parameters as in `MachineSystems.set_up`.

        Args:
            parts: What acts.
            bodies: False for a machine without the Context of its bodies, which is faster.

        Raises:
            InputError: the elements are not those that were built, a name is not in the SDF, or
                there is no equilibrium.
        """
        self.cache.check(self.parameters, parameters)
        load = self._load(load, parameters)
        layout, poses = self.state_layout, self.cache.frame_poses(self.plant, parameters)
        moving = layout.attached.size or motor_of(parameters.drive) or parameters.cabinet_moves
        context = self.bodies(None, parameters) if bodies or moving else None
        unloaded = placed_elements(self.plant, poses, parameters)
        weight = self._weight(parameters, context)
        elements = self._preloaded(unloaded, poses, weight, context).with_parts(parts)
        q, residual = self._rest(elements, weight, context)
        places = parameters.sensors, parameters.clearance_frame, parameters.accelerometers
        points = poses.placed("points", places, lambda: tub_points(poses, parameters))
        measured = measured_points(points, q[layout.tub])
        cabinet, drum = None, None
        if context is not None:
            self.plant.SetPositions(context, q)
            cabinet = cabinet_at_rest(self.plant, context, layout, parameters)
            drum = drum_inertia(self.plant, context)
            self._add_load(context, parameters, load)
        rest = q[layout.tub], residual, q[layout.tubes], q[layout.carrier]
        placed = elements, points, *rest, measured
        return RestingMachine(parameters, *placed, cabinet, load, drum, context)

    def bodies(self, load: Load | None, parameters: MachineParameters) -> Context:
        """Return a Context of the plant with bodies, frames and load set, at the drawn pose.

        Raises:
            InputError: a name is not in the SDF.
        """
        context = self.plant.CreateDefaultContext()
        set_bodies(self.plant, context, parameters)
        self._add_load(context, parameters, load)
        return context

    def _preloaded(
        self,
        unloaded: PlacedElements,
        poses: FramePoses,
        weight: Weight | None,
        context: Context | None,
    ) -> PlacedElements:
        """Return the elements with the spring preloads that balance the machine as drawn."""
        if weight:
            as_drawn = TubStatics(unloaded.at_rest(), weight).wrench(np.zeros(6))
        else:
            assert context is not None  # bodies attached to the tub are asked for
            as_drawn = force_as_drawn(self.plant, context, self.state_layout, unloaded.at_rest())
        balanced = (*unloaded.springs.values(), as_drawn.tobytes())
        springs = poses.placed("preloads", balanced, lambda: preloaded(unloaded, as_drawn).springs)
        return replace(unloaded, springs=springs)

    def _rest(
        self, elements: PlacedElements, weight: Weight | None, context: Context | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the positions of the plant at rest, and the wrench that remains on the tub."""
        if weight:
            q = np.zeros(self.state_layout.size)
            q[self.state_layout.tub], residual = rest_pose(elements.at_rest(), weight)
            return q, residual
        assert context is not None  # bodies attached to the tub are asked for
        residual = put_to_rest(self.plant, context, self.state_layout, elements.at_rest())
        return self.plant.GetPositions(context), residual

    def _load(self, load: Load | str | None, parameters: MachineParameters) -> Load | None:
        """Return a load that may be given by its name."""
        if not isinstance(load, str):
            return load
        message = f"no load '{load}' in machine '{parameters.name}'"
        check_known(load, parameters.loads, message, key="loads")
        return parameters.loads[load]

    def _add_load(self, context: Context, parameters: MachineParameters, load: Load | None) -> None:
        """Add a load and the drum's residual imbalance to the drum; add neither without a load."""
        if load is not None:
            add_load(self.plant, context, load)
            imbalance = parameters.imperfections.residual_imbalance
            add_load(self.plant, context, Load(unbalances=(imbalance,)))

    def _weight(self, parameters: MachineParameters, context: Context | None) -> Weight | None:
        """Return the weight on the springs, maybe that of the last set-up.

        None with bodies attached to the tub, whose weight depends on their pose.
        """
        if self.state_layout.attached.size:
            return None

        def compute() -> Weight:
            return weight_of(self.plant, context or self.bodies(None, parameters))

        return self.cache.weight(parameters, compute)
