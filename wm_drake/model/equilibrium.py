"""The machine at rest: preloads of the springs, and the pose at which no force is left, in a Context of the whole diagram."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context
from scipy.optimize import root

from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.errors import InputError, Problem, input_error
from wm_drake.model.state_layout import Indices, StateLayout
from wm_drake.parameters.types import FloatArray

EQUILIBRIUM_TOLERANCE = 1e-9
"""Largest force [N] or moment [N m] that may remain at the rest pose."""

TUBES_TOLERANCE = 1e-6
"""The same on the tubes of a damper: what is left turns them about their axis, by 1e-6 rad/s, where friction alone holds."""

_FARTHEST_REST_POSITION = 0.02
_FARTHEST_REST_ANGLE = np.deg2rad(3.0)


def generalized_force(plant: MultibodyPlant, context: Context) -> FloatArray:
    """All elements and gravity, at the pose of the plant's Context: moments and forces on bodies that float in W. [N m, N]"""
    elements = plant.get_applied_generalized_force_input_port().Eval(context)
    return np.asarray(elements + plant.CalcGravityGeneralizedForces(context))


def preloaded(
    plant: MultibodyPlant,
    context: Context,
    state_layout: StateLayout,
    unloaded: Mapping[str, SpringStrutParameters],
) -> dict[str, SpringStrutParameters]:
    """Springs with the preloads that balance the empty machine when T coincides with W, as well as they can.

    Args:
        plant, context: The plant and its Context, in which the springs have no preload.
        state_layout: Of the plant. What hangs on the tub is moved to where it hangs.
        unloaded: The springs.

    Raises:
        InputError: springs that would have to push, or nothing balances what hangs on the tub.
    """
    if state_layout.hanging.size:
        _balance(
            plant, context, state_layout, state_layout.hanging
        )  # its weight is the tub's to bear
    hooks = np.stack([spring.p_ToA_T for spring in unloaded.values()])
    lines = np.stack([spring.p_WH for spring in unloaded.values()]) - hooks
    pulls = lines / np.linalg.norm(lines, axis=1, keepdims=True)
    wrenches = np.column_stack([np.cross(hooks, pulls), pulls]).T
    solution = np.linalg.lstsq(
        wrenches, -generalized_force(plant, context)[state_layout.tub], rcond=None
    )[0]
    preloads = dict(zip(unloaded, map(float, solution), strict=True))
    weightless = not np.any(plant.gravity_field().gravity_vector())
    slack = [name for name, preload in preloads.items() if preload <= 0.0 and not weightless]
    if slack:
        raise InputError(
            Problem("", f"springs.{name}", f"would be pushed, not pulled, at rest (preload {preloads[name]:.1f} N); "
                    "move its hooks or the centre of mass")
            for name in slack
        )  # fmt: skip
    return {name: replace(spring, preload=preloads[name]) for name, spring in unloaded.items()}


def put_to_rest(plant: MultibodyPlant, context: Context, state_layout: StateLayout) -> FloatArray:
    """Moves all coordinates but the drum angle to equilibrium, near T = W, where springs alone may not quite balance the tub.

    Returns:
        What remains of moment about To and force on the tub, in W. [N m, N]

    Raises:
        InputError: no equilibrium there.
    """
    tolerance = EQUILIBRIUM_TOLERANCE
    if state_layout.hanging.size:
        every = np.setdiff1d(np.arange(state_layout.size), state_layout.drum)
        tolerance = max(tolerance, _balance(plant, context, state_layout, every))
    q = plant.GetPositions(context)

    def residual(pose: FloatArray) -> FloatArray:
        if not np.all(
            np.abs(pose) < 10.0
        ):  # a step of the root solver into nowhere, which Drake would abort on
            return np.full(6, 1e9)
        q[state_layout.tub] = pose
        plant.SetPositions(context, q)
        return generalized_force(plant, context)[state_layout.tub]

    pose = q[state_layout.tub]
    remains = residual(pose)
    if not np.all(np.isfinite(remains)):
        raise input_error(
            "forces at rest are not finite numbers; some mass, stiffness or distance is out of all bounds"
        )
    if np.max(np.abs(remains)) > EQUILIBRIUM_TOLERANCE and not state_layout.hanging.size:
        pose = np.asarray(root(residual, pose, tol=1e-12).x)
        remains = residual(pose)
    far = (
        np.max(np.abs(pose[:3])) > _FARTHEST_REST_ANGLE
        or np.max(np.abs(pose[3:])) > _FARTHEST_REST_POSITION
    )
    if not np.max(np.abs(remains)) <= tolerance or far:
        plant.SetPositions(context, np.zeros(state_layout.size))
        m_x, m_y, m_z, f_x, f_y, f_z = generalized_force(plant, context)[state_layout.tub]
        raise input_error(
            "the springs cannot hold the empty machine near its drawn pose: there remain force "
            f"({f_x:.3g}, {f_y:.3g}, {f_z:.3g}) N and moment ({m_x:.3g}, {m_y:.3g}, {m_z:.3g}) N m; "
            "move hooks or masses so that they balance"
        )
    return remains


def _balance(
    plant: MultibodyPlant, context: Context, state_layout: StateLayout, chosen: Indices
) -> float:
    """Moves the chosen coordinates to where no force is left on them.

    Newton's method; a tube that may spin freely stays as it is, by least squares. The drum's carrier goes with the tub, so
    that a bearing of any stiffness does not hide what little the springs give.

    Returns:
        The largest force or moment that rounding may leave. [N, N m]

    Raises:
        InputError: it finds no such place nearby.
    """
    ways = np.eye(state_layout.size)[chosen]
    if state_layout.carrier.size:
        ways[np.ix_(np.isin(chosen, state_layout.tub), state_layout.carrier)] = np.eye(6)[
            np.isin(state_layout.tub, chosen)
        ]

    def forces(q: FloatArray) -> FloatArray:
        if not np.all(np.abs(q) < 1.0):
            return np.full(len(chosen), np.inf)
        plant.SetPositions(context, q)
        return np.asarray(ways @ generalized_force(plant, context))

    q = plant.GetPositions(context)
    remains, finest = forces(q), 0.0
    for number in range(100):
        if not max(0.1 * EQUILIBRIUM_TOLERANCE, finest) < np.max(np.abs(remains)) < np.inf:
            break
        if number % 10 == 0:  # springs are nearly linear: one stiffness serves for several steps
            slopes = np.column_stack([(forces(q + step) - remains) / 1e-6 for step in 1e-6 * ways])
            stiffness = np.linalg.pinv(slopes, rcond=1e-9)
            finest = np.finfo(float).eps * float(np.max(np.abs(slopes)))  # of places of a metre
        q += ways.T @ -(stiffness @ remains)
        remains = forces(q)
    _check_held(
        q,
        remains[np.isin(chosen, state_layout.hanging)],
        max(TUBES_TOLERANCE, finest),
        state_layout,
    )
    return finest


def _check_held(
    q: FloatArray, remains: FloatArray, tolerance: float, state_layout: StateLayout
) -> None:
    """Refuses what does not come to rest where it hangs."""
    held = np.max(np.abs(remains)) <= tolerance
    if state_layout.carrier.size:
        sag = np.abs(q[state_layout.carrier] - q[state_layout.tub])
        near = (
            np.max(sag[3:]) <= _FARTHEST_REST_POSITION and np.max(sag[:3]) <= _FARTHEST_REST_ANGLE
        )
        if not near or not (held or state_layout.tubes.size):
            raise input_error(
                "cannot hold the drum: at rest it would sag by more than "
                f"{1e3 * _FARTHEST_REST_POSITION:g} mm or tilt by more than {np.rad2deg(_FARTHEST_REST_ANGLE):g} deg",
                key="imperfections.bearing",
            )
    if not held:
        raise input_error(
            "their bushings cannot hold the tubes near where they are drawn: nothing resists a turn about the damper's "
            "axis, say, of a tube whose centre of mass is beside it",
            key="telescopic_dampers",
        )
