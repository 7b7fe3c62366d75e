"""Independent energy balance of the machine with telescopic dampers, without the package's laws."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from wm_drake.engines.compiled.run import run_compiled
from wm_drake.model.bodies import add_bodies, add_load, set_bodies


def dense_run(setup, profile, step):
    """Return the trajectory of a run with a sample at every step."""
    return run_compiled(setup, profile, step, lambda fraction: None, period=step)


class Motion:
    """Rotation, position and velocities of a body at all samples."""

    def __init__(self, states):
        self.rotation = Rotation.from_euler("xyz", states[:, :3])
        self.position, self.w, self.v = states[:, 3:6], states[:, 7:10], states[:, 10:13]

    def point(self, p):
        """Return position and velocity of a point fixed to the body."""
        arm = self.rotation.apply(p)
        return self.position + arm, self.v + np.cross(self.w, arm)


def still(count):
    """Return the motion of a body at rest at the origin, for a number of samples."""
    states = np.zeros((count, 14))
    return Motion(states)


def rotation_vector_rate(r, w):
    """Return the time derivative of a rotation vector at an angular velocity, from a series."""
    x = np.swapaxes(np.cross(r[:, None], np.eye(3)), 1, 2)  # x @ b is the cross product r x b
    left = np.eye(3) + x / 2 + x @ x / 6 + x @ x @ x / 24 + x @ x @ x @ x / 120
    return np.linalg.solve(left, w[..., None])[..., 0]


def havsin(v, v_t, p):
    """Return the HAVSIN friction at a velocity."""
    return p * np.where(np.abs(v) < v_t, np.sin(np.pi * v / (2 * v_t)), np.sign(v))


def potential(curve, x):
    """Return the elastic energy of a stiffness, a number or a table, at displacement x. [J]"""
    if isinstance(curve, float):
        return 0.5 * curve * x**2
    pchip = PchipInterpolator(curve.displacement, curve.force)
    assert np.abs(x).max() < max(curve.displacement)
    integral = pchip.antiderivative()
    return integral(x) - integral(0.0)


def bushing(kind, a, p_a, r_a, b, p_b, r_b):
    """Return stored energy [J] and dissipated power [W] of a bushing between two bodies.

    Args:
        kind: Numbers of the bushing.
        a, p_a, r_a: Motion of the first body; point and rotation of the bushing's frame on it.
        b, p_b, r_b: The same for the second body, which is the ground side.
    """
    ground = b.rotation * Rotation.from_matrix(r_b)
    place, velocity = a.point(p_a)
    ground_place = b.point(p_b)[0]
    # velocity of the point of the second body that is at the same place
    of_ground = b.v + np.cross(b.w, place - b.position)
    d, d_rate = ground.inv().apply(place - ground_place), ground.inv().apply(velocity - of_ground)
    r = (ground.inv() * a.rotation * Rotation.from_matrix(r_a)).as_rotvec()
    r_rate = rotation_vector_rate(r, ground.inv().apply(a.w - b.w))
    stored, power = 0.0, 0.0
    for k, axis in enumerate("xyz"):
        stored = stored + potential(getattr(kind, f"stiffness_{axis}"), d[:, k])
        stored = stored + potential(getattr(kind, f"rotational_stiffness_{axis}"), r[:, k])
        power = power + getattr(kind, f"damping_{axis}") * d_rate[:, k] ** 2
        power = power + getattr(kind, f"rotational_damping_{axis}") * r_rate[:, k] ** 2
        rubbing = havsin(
            r_rate[:, k],
            getattr(kind, f"full_friction_rate_{axis}"),
            getattr(kind, f"friction_torque_{axis}"),
        )
        power = power + rubbing * r_rate[:, k]
    return stored, power


def energy_of_bushings(parts):
    """Return stored energy [J] and dissipated power [W] of bushings.

    Args:
        parts: Numbers, motion of the first body, place, motion of the second body of each bushing.
    """
    stored, power = 0.0, 0.0
    for kind, a, placed, b in parts:
        more_stored, more_power = bushing(
            kind,
            a,
            placed.tub_side_point,
            placed.tub_side_rotation,
            b,
            placed.ground_side_point,
            placed.ground_side_rotation,
        )
        stored, power = stored + more_stored, power + more_power
    return stored, power


def energies_of_bodies(machine, parameters, load, states):
    """Return kinetic plus potential energy of all bodies at some states. [J]

    Args:
        machine, parameters, load: What is in the bodies.
        states: At each time, the state of each tree in the order of the machine's layout.
    """
    plant = MultibodyPlant(0.0)
    add_bodies(plant, parameters)
    context = plant.CreateDefaultContext()
    set_bodies(plant, context, parameters)
    add_load(plant, context, load)
    # the reflected inertia of the drive is numerical and stores no energy of the machine
    plant.get_joint_actuator(plant.GetJointActuatorIndices()[0]).SetRotorInertia(context, 0.0)
    energies = []
    for blocks in states:
        state = np.zeros(plant.num_multibody_states())
        trees = list(zip(machine.state_layout.states(), blocks, strict=True))
        for tree, block in reversed(trees):  # a drum carrier shares the joint of the first tree
            state[tree] = block
        plant.SetPositionsAndVelocities(context, state)
        energies.append(plant.CalcKineticEnergy(context) + plant.CalcPotentialEnergy(context))
    return energies


def balance(machine, setup, load, profile, step):
    """Return work of the drive, change of stored energy and dissipated energy of a run. [J]"""
    parameters = setup.parameters
    run = dense_run(setup, profile, step)
    time, motion, deformation, tubes = run.time, run.state, run.deformation, run.tubes
    tub, ground = Motion(motion), still(len(time))
    stored, power = 0.0, 0.0
    for name, spring in setup.springs.items():
        length = np.linalg.norm(tub.point(spring.p_ToA_T)[0] - spring.p_WH, axis=1)
        stretch = length - np.linalg.norm(spring.p_ToA_T - spring.p_WH)
        stiffness = parameters.spring_types[parameters.springs[name].type].stiffness
        stored = stored + spring.preload * stretch + 0.5 * stiffness * stretch**2
    parts = [(parameters.gasket, tub, setup.bushings["gasket"], ground)]
    for index, (name, damper) in enumerate(parameters.telescopic_dampers.items()):
        placed, states = setup.telescopes[name], tubes[:, index]
        outer, inner = Motion(states), Motion(states)
        along = outer.rotation.apply(placed.axis)
        extension, v, delta = states[:, 6], states[:, 13], deformation[:, index]
        inner.position = outer.position + extension[:, None] * along
        inner.v = outer.v + np.cross(outer.w, extension[:, None] * along) + v[:, None] * along
        kinds = [
            parameters.bushing_types[kind] for kind in (damper.tub_bushing, damper.housing_bushing)
        ]
        parts += [
            (kinds[0], tub, placed.tub_bushing, outer),
            (kinds[1], inner, placed.housing_bushing, ground),
        ]
        law = parameters.damper_types[damper.type]
        sponge = PchipInterpolator(law.sponge.displacement, law.sponge.force)
        stored = stored + potential(law.sponge, delta)
        slider = v - np.gradient(delta, time, edge_order=2)
        power = (
            power
            + havsin(v, law.basic_full_friction_velocity, law.basic_friction_force) * v
            + sponge(delta) * slider
        )
    more_stored, more_power = energy_of_bushings(parts)
    stored, power = stored + more_stored, power + more_power
    states = [(motion[sample], *tubes[sample]) for sample in (0, -1)]
    bodies = energies_of_bodies(machine, parameters, load, states)
    drive = np.trapezoid(run.motor_torque * motion[:, 13], time)
    return drive, bodies[1] - bodies[0] + stored[-1] - stored[0], np.trapezoid(power, time)
