"""Static equilibrium of the empty machine: spring preloads and rest pose."""

from dataclasses import replace

import numpy as np
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.compiler.matrices import NEGLIGIBLE
from wm_drake.errors import InputError, Problem, input_error
from wm_drake.model.placed_elements import AppliedForce, PlacedElements
from wm_drake.model.state_layout import Indices, StateLayout
from wm_drake.model.tub_statics import TubStatics, Weight, about_tub
from wm_drake.parameters.types import FloatArray

EQUILIBRIUM_TOLERANCE = 1e-9
"""Largest force [N] or moment [N m] that may remain on the tub at the rest pose."""

TUBES_TOLERANCE = 1e-6
"""Largest force [N] or moment [N m] that may remain on the tubes of a damper. It turns them about
their axis by some 1e-6 rad/s, where nothing but friction resists."""

_LARGEST_REST_POSITION = 0.02
_LARGEST_REST_ANGLE = np.deg2rad(3.0)

_LARGEST_SAG = 0.1
"""Largest distance of the rest pose from the drawn one if preloads are given. [m]"""

_LARGEST_SAG_ANGLE = np.deg2rad(15.0)

_STARTS = (0.0, -0.01, -0.03)
"""Heights from which an equilibrium is looked for: as drawn, given springs may be slack. [m]"""


class Statics:
    """Forces of gravity and placed elements at the pose of a plant Context."""

    def __init__(
        self,
        plant: MultibodyPlant,
        context: Context,
        state_layout: StateLayout,
        elements: PlacedElements,
    ) -> None:
        """Keep what a solution of the equilibrium needs. The Context's pose is moved by it."""
        self.plant, self.context, self.state_layout = plant, context, state_layout
        self.bearing = elements.bearing
        self._applied = AppliedForce(elements, state_layout)

    def generalized_force(self) -> FloatArray:
        """Return the generalized force of elements and gravity at the Context's state.

        Returns:
            (n,) [N m, N]
        """
        state = self.plant.GetPositionsAndVelocities(self.context)
        gravity = self.plant.CalcGravityGeneralizedForces(self.context)
        return np.asarray(self._applied(state) + gravity)

    def force_on_tub(self) -> FloatArray:
        """Return moment about To and force on the tub, in W. (6,) [N m, N]"""
        return self.generalized_force()[self.state_layout.tub]


def force_as_drawn(
    plant: MultibodyPlant, context: Context, state_layout: StateLayout, elements: PlacedElements
) -> FloatArray:
    """Return the wrench on the tub as drawn, with the bodies attached to it at their equilibrium.

    Args:
        plant, context: The plant and its Context, at the drawn pose; attached bodies (damper tubes,
            drum in a compliant bearing) are moved, so that their weight is on the tub.
        elements: All elements, springs without the preloads to find.

    Returns:
        Moment about To and force, in W. (6,) [N m, N]

    Raises:
        InputError: the attached bodies have no equilibrium.
    """
    statics = Statics(plant, context, state_layout, elements)
    _balance(statics, state_layout.attached)
    return statics.force_on_tub()


def preloaded(elements: PlacedElements, force: FloatArray) -> PlacedElements:
    """Return the elements with the spring preloads that balance the empty machine as drawn (T = W).

    The balance is a least-squares one of the force [N] and the moment about To [N m]: fewer than
    six springs cannot balance both. What remains moves the machine to its rest pose. Springs that
    can replace each other, such as four vertical ones, take the smallest sum of squares. Given
    preloads stay; the others balance what these leave. If all are given, the machine sags.

    Args:
        force: Moment about To and force of these elements and of gravity on the tub as drawn, in W.
            (6,) [N m, N]

    Raises:
        InputError: a tension-only spring would have to push.
    """
    springs = {name: spring for name, spring in elements.springs.items() if not spring.is_given}
    if not springs:
        return elements
    hooks = np.stack([spring.p_ToA_T for spring in springs.values()])
    lines = np.stack([spring.p_WH for spring in springs.values()]) - hooks
    pulls = lines / np.linalg.norm(lines, axis=1, keepdims=True)
    wrenches = np.column_stack([np.cross(hooks, pulls), pulls]).T
    solution = np.linalg.lstsq(wrenches, -force, rcond=NEGLIGIBLE)[0]
    preloads = dict(zip(springs, map(float, solution), strict=True))
    slack = [name for name in springs if preloads[name] <= 0.0 and not springs[name].pushes]
    if slack:
        raise InputError(
            Problem(
                "",
                f"springs.{name}",
                f"would be slack at rest (preload {preloads[name]:.1f} N); move its hooks or the "
                "centre of mass, or give its type the action tension-compression",
            )
            for name in slack
        )
    loaded = {name: replace(spring, preload=preloads[name]) for name, spring in springs.items()}
    return replace(elements, springs=elements.springs | loaded)


def rest_pose(elements: PlacedElements, weight: Weight) -> tuple[FloatArray, FloatArray]:
    """Return the pose of the tub at rest, near the drawn pose (T = W).

    Args:
        elements: All elements, springs with preload, none with bodies of its own.

    Returns:
        Roll, pitch, yaw, x, y, z (6,) [rad, m]; moment about To and force that remain on the tub,
        in W (6,) [N m, N].

    Raises:
        InputError: there is no equilibrium near the drawn pose, or a tension-only spring is slack
            there.
    """
    statics = TubStatics(elements, weight)
    pose, wrench = statics.balance(0.1 * EQUILIBRIUM_TOLERANCE)
    remaining = about_tub(wrench, pose)
    if not _is_at_rest(elements, pose, remaining, EQUILIBRIUM_TOLERANCE):
        pose, remaining = _search(statics, elements)
        as_drawn = statics.wrench(np.zeros(6))
        try:
            _check_rest(elements, pose, remaining, EQUILIBRIUM_TOLERANCE, as_drawn)
        except InputError as error:
            raise _with_way_out(error, elements, weight) from None
    return pose, remaining


def _with_way_out(error: InputError, elements: PlacedElements, weight: Weight) -> InputError:
    """Return the error of a machine that cannot rest as drawn, with preloads with which it sags.

    Springs without a preload get the one that balances the weight as well as they can; with all
    of them given, the tub may move to its own rest pose, up to the limits of a sag. The preloads
    are named only if that works.
    """
    if _sags(elements) or not elements.springs:
        return error
    given = {
        name: replace(spring, preload=float(f"{spring.preload:.4g}"), is_given=True)
        for name, spring in elements.springs.items()
    }
    sagging = replace(elements, springs=given)
    try:
        pose, _ = rest_pose(sagging, weight)
    except InputError:
        return error
    texts = ", ".join(f"springs.{name}.preload: {s.preload:.4g} N" for name, s in given.items())
    move, turn = 1e3 * np.abs(pose[3:]).max(), np.rad2deg(np.abs(pose[:3]).max())
    return InputError(
        replace(
            problem,
            message=f"{problem.message}; or let it find its own rest pose: with {texts} (or a "
            f"free_length of their type) it moves by {move:.0f} mm and turns by {turn:.1f} deg",
        )
        for problem in error.problems
    )


def _search(statics: TubStatics, elements: PlacedElements) -> tuple[FloatArray, FloatArray]:
    """Return the pose at rest and what remains there, for springs that may be slack on the way."""
    from scipy.optimize import root  # slow to import, and seldom needed

    def residual(pose: FloatArray) -> FloatArray:
        if not np.abs(pose).max() < 10.0:
            return np.full(6, 1e9)
        return about_tub(statics.wrench(pose), pose)

    pose = np.zeros(6)
    remaining = residual(pose)
    _check_finite(remaining)
    for height in _STARTS if _sags(elements) else (0.0,):
        pose = np.asarray(root(residual, [*np.zeros(5), height], tol=1e-12).x)
        remaining = residual(pose)
        if np.max(np.abs(remaining)) <= EQUILIBRIUM_TOLERANCE:
            break
    return pose, remaining


def put_to_rest(
    plant: MultibodyPlant, context: Context, state_layout: StateLayout, elements: PlacedElements
) -> FloatArray:
    """Move all positions but the drum angle to equilibrium, near the drawn pose (T = W).

    Args:
        elements: All elements, springs with preload.

    Returns:
        Moment about To and force that remain on the tub, in W. (6,) [N m, N]

    Raises:
        InputError: there is no equilibrium near the drawn pose, or a tension-only spring is slack
            there.
    """
    statics = Statics(plant, context, state_layout, elements)
    every = np.union1d(state_layout.tub, state_layout.attached)
    tolerance = max(EQUILIBRIUM_TOLERANCE, _balance(statics, every))
    q = plant.GetPositions(context)
    remaining, pose = statics.force_on_tub(), q[state_layout.tub]
    _check_finite(remaining)
    if not _is_at_rest(elements, pose, remaining, tolerance):
        plant.SetPositions(context, np.zeros(state_layout.size))
        as_drawn = statics.force_on_tub()
        plant.SetPositions(context, q)
        _check_rest(elements, pose, remaining, tolerance, as_drawn)
    return remaining


def _check_finite(force: FloatArray) -> None:
    """Raise InputError if a force is not a number."""
    if not np.all(np.isfinite(force)):
        raise input_error(
            "forces at rest are not finite numbers: a mass, a stiffness or a distance is out of "
            "range"
        )


def _sags(elements: PlacedElements) -> bool:
    """Return whether preloads are given, so that the tub rests away from its drawn pose."""
    return any(spring.is_given for spring in elements.springs.values())


def _is_far(elements: PlacedElements, pose: FloatArray) -> bool:
    """Return whether a pose is too far from the drawn one, or not finite."""
    largest = largest_rest(sags=_sags(elements))
    near = np.abs(pose[:3]).max() <= largest[0] and np.abs(pose[3:]).max() <= largest[1]
    return not near


def largest_rest(*, sags: bool) -> tuple[float, float]:
    """Return the largest angle and displacement of a rest pose from the drawn one. [rad, m]

    Args:
        sags: Whether preloads are given, so that the tub rests away from its drawn pose.
    """
    if sags:
        return _LARGEST_SAG_ANGLE, _LARGEST_SAG
    return _LARGEST_REST_ANGLE, _LARGEST_REST_POSITION


def _is_at_rest(
    elements: PlacedElements, pose: FloatArray, remaining: FloatArray, tolerance: float
) -> bool:
    """Return whether the tub is balanced near the drawn pose, without a slack spring."""
    balanced = np.abs(remaining).max() <= tolerance and not _is_far(elements, pose)
    return bool(balanced and not (_sags(elements) and _slack_at(elements, pose)))


def _check_rest(
    elements: PlacedElements,
    pose: FloatArray,
    remaining: FloatArray,
    tolerance: float,
    as_drawn: FloatArray,
) -> None:
    """Raise InputError if a pose is not one of rest; `as_drawn` is the wrench at the drawn pose."""
    far, balanced = _is_far(elements, pose), np.abs(remaining).max() <= tolerance
    if balanced and _sags(elements):
        _check_sag(elements, pose, far=far)
    if not balanced or far:
        m_x, m_y, m_z, f_x, f_y, f_z = as_drawn
        raise input_error(
            "the springs cannot hold the empty machine near its drawn pose; force "
            f"({f_x:.3g}, {f_y:.3g}, {f_z:.3g}) N and moment ({m_x:.3g}, {m_y:.3g}, {m_z:.3g}) N m "
            "remain; move spring frames or masses"
        )


def weight_on_cabinet(
    plant: MultibodyPlant, context: Context, state_layout: StateLayout
) -> FloatArray:
    """Return the wrench of the mounts on the cabinet at rest: the weight of all that hangs on them.

    Returns:
        Moment about the origin of W and force, in W. (6,) [N m, N]
    """
    weight, q = plant.CalcGravityGeneralizedForces(context), plant.GetPositions(context)
    total = np.zeros(6)
    for body in (state_layout.tub, state_layout.carrier):
        if body.size:
            moment, force = np.split(weight[body], 2)
            total += [*(moment + np.cross(q[body][3:], force)), *force]
    return total


def tensions_at(elements: PlacedElements, pose: FloatArray) -> dict[str, float]:
    """Return the tension of each spring at a pose of the tub: roll, pitch, yaw, x, y, z. [N]"""
    return {
        name: elements.springs[name].tension(float(np.linalg.norm(line)))
        for name, line in _spring_lines(elements, pose).items()
    }


def spring_force(elements: PlacedElements, pose: FloatArray) -> FloatArray:
    """Return the sum of the forces of the springs on the tub at a pose, in W. (3,) [N]"""
    tensions = tensions_at(elements, pose)
    lines = _spring_lines(elements, pose)
    forces = (-tensions[name] * line / np.linalg.norm(line) for name, line in lines.items())
    return sum(forces, start=np.zeros(3))


def _spring_lines(elements: PlacedElements, pose: FloatArray) -> dict[str, FloatArray]:
    """Return the vector from the housing hook to the tub hook of each spring, in W. [m]"""
    rotation = RollPitchYaw(pose[:3]).ToRotationMatrix().matrix()
    return {
        name: pose[3:] + rotation @ spring.p_ToA_T - spring.p_WH
        for name, spring in elements.springs.items()
    }


def _check_sag(elements: PlacedElements, pose: FloatArray, *, far: bool) -> None:
    """Raise InputError for a rest pose that is far from the drawn one, or with slack springs."""
    if far:
        x, y, z = 1e3 * pose[3:]
        raise input_error(
            f"with the given preloads or free lengths the tub rests at ({x:.0f}, {y:.0f}, {z:.0f}) "
            f"mm from its drawn pose; allowed are {1e3 * _LARGEST_SAG:g} mm and "
            f"{np.rad2deg(_LARGEST_SAG_ANGLE):g} deg",
            key="springs",
        )
    slack = _slack_at(elements, pose)
    if slack:
        raise InputError(
            Problem(
                "",
                f"springs.{name}",
                "is slack at rest; it needs a shorter free length or more preload",
            )
            for name in slack
        )


def _slack_at(elements: PlacedElements, pose: FloatArray) -> list[str]:
    """Return the names of the springs that are slack at a pose of the tub."""
    return [
        name
        for name, tension in tensions_at(elements, pose).items()
        if tension <= 0.0 and not elements.springs[name].pushes
    ]


def _balance(statics: Statics, chosen: Indices) -> float:
    """Move the chosen positions to where the force on them vanishes, by Newton's method.

    A step is a least-squares solution, so that a tube that can spin freely stays where it is. The
    drum carrier moves with the tub, so that the stiffness of a bearing does not hide the small
    stiffness of the springs.

    Returns:
        Largest force or moment that rounding may leave. [N, N m]

    Raises:
        InputError: there is no equilibrium near the pose.
    """
    layout, plant, context = statics.state_layout, statics.plant, statics.context
    directions = np.eye(layout.size)[chosen]
    if layout.carrier.size:
        with_tub = np.ix_(np.isin(chosen, layout.tub), layout.carrier)
        directions[with_tub] = np.eye(6)[np.isin(layout.tub, chosen)]

    def forces(q: FloatArray) -> FloatArray:
        if not np.all(np.abs(q) < 1.0):
            return np.full(len(chosen), np.inf)
        plant.SetPositions(context, q)
        return np.asarray(directions @ statics.generalized_force())

    q = plant.GetPositions(context) + _sag_in_clearance(statics)
    remaining, rounding = forces(q), 0.0
    for iteration in range(100):
        if not max(0.1 * EQUILIBRIUM_TOLERANCE, rounding) < np.max(np.abs(remaining)) < np.inf:
            break
        if iteration % 10 == 0:  # springs are nearly linear: one stiffness serves several steps
            slopes = np.column_stack(
                [(forces(q + step) - remaining) / 1e-6 for step in 1e-6 * directions]
            )
            inverse_stiffness = np.linalg.pinv(slopes, rcond=1e-9)
            # rounding of positions of about a metre
            rounding = np.finfo(float).eps * float(np.max(np.abs(slopes)))
        q += directions.T @ -(inverse_stiffness @ remaining)
        remaining = forces(q)
    on_attached = remaining[np.isin(chosen, layout.attached)]
    _check_held(q, on_attached, max(TUBES_TOLERANCE, rounding), layout)
    return rounding


def _sag_in_clearance(statics: Statics) -> FloatArray:
    """Return how far the drum carrier moves from its drawn pose into contact with its bearing.

    Within a clearance almost nothing holds the drum, so Newton's method must begin beyond it.

    Returns:
        Change of the positions of the plant, 0 if the carrier has moved already. (n,) [rad, m]
    """
    layout, plant, context = statics.state_layout, statics.plant, statics.context
    q, change = plant.GetPositions(context), np.zeros(layout.size)
    if statics.bearing is None or np.any(q[layout.carrier] != q[layout.tub]):
        return change
    rotation = statics.bearing.ground_side_rotation
    weight = plant.CalcGravityGeneralizedForces(context)[layout.carrier[3:]]
    change[layout.carrier[3:]] = rotation @ statics.bearing.sag(rotation.T @ weight)
    return change


def _check_held(
    q: FloatArray, remaining: FloatArray, tolerance: float, state_layout: StateLayout
) -> None:
    """Raise InputError if an attached body has no equilibrium near its drawn pose."""
    held = np.max(np.abs(remaining)) <= tolerance
    if state_layout.carrier.size:
        sag = np.abs(q[state_layout.carrier] - q[state_layout.tub])
        near = np.max(sag[3:]) <= _LARGEST_REST_POSITION and np.max(sag[:3]) <= _LARGEST_REST_ANGLE
        if not near or not (held or state_layout.tubes.size):
            raise input_error(
                "cannot hold the drum: at rest it would sag by more than "
                f"{1e3 * _LARGEST_REST_POSITION:g} mm or tilt by more than "
                f"{np.rad2deg(_LARGEST_REST_ANGLE):g} deg",
                key="imperfections.bearing",
            )
    if not held:
        raise input_error(
            "the bushings cannot hold the tubes near their drawn pose; a tube whose centre of mass "
            "is not on the damper's axis needs a rotational stiffness about this axis",
            key="telescopic_dampers",
        )
