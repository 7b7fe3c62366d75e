"""Independent energy balance of a machine, from a record and the parameters, without its laws."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation
from tube_energy import rotation_vector_rate

from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.bodies import add_bodies, add_load, set_bodies
from wm_drake.simulation.records import as_record
from wm_drake.systems.speed_source import REFLECTED_INERTIA


def elastic_energy(stiffness, x):
    """Return the elastic energy of a stiffness, a number or a table, at displacement x. [J]

    For a table it is the integral of the monotone cubic through its points.
    """
    if isinstance(stiffness, float):
        return 0.5 * stiffness * x**2
    at, force = stiffness.model_dump().values()
    curve = PchipInterpolator(at, force)
    slope = curve.derivative()
    energy = curve.antiderivative()
    inside = np.clip(x, at[0], at[-1])
    beyond = x - inside  # the force is linear there
    return energy(inside) - energy(0.0) + beyond * curve(inside) + 0.5 * slope(inside) * beyond**2


class EnergyBook:
    """Stored energy [J] and dissipated power [W] of a machine, at all samples of a record.

    The machine has linear springs, MSTV dampers and a gasket, and a rigid bearing.
    """

    def __init__(self, setup, load, record):
        self.setup, self.parameters, self.time = setup, setup.parameters, record.time.values
        self.rpy, self.position = record.tub_angle.values, record.tub_position.values
        self.w, self.v = record.tub_angular_velocity.values, record.tub_velocity.values
        self.rotation = Rotation.from_euler("xyz", self.rpy)  # space-fixed
        self.record = record
        self.plant = MultibodyPlant(0.0)
        add_bodies(self.plant, self.parameters)
        self.context = self.plant.CreateDefaultContext()
        set_bodies(self.plant, self.context, self.parameters)
        add_load(self.plant, self.context, load)
        # the reflected inertia of the drive is numerical and stores no energy of the machine
        actuator = self.plant.get_joint_actuator(self.plant.GetJointActuatorIndices()[0])
        actuator.SetRotorInertia(self.context, 0.0)

    def bodies(self, index):
        """Return the kinetic and gravitational energy at a sample. [J]"""
        state = np.concatenate(
            [self.rpy[index], self.position[index], [self.record.drum_angle.values[index]],
             self.w[index], self.v[index], [self.record.drum_speed.values[index]]]
        )  # fmt: skip
        self.plant.SetPositionsAndVelocities(self.context, state)
        return self.plant.CalcKineticEnergy(self.context) + self.plant.CalcPotentialEnergy(
            self.context
        )

    def _strut(self, element):
        arm = self.rotation.apply(element.p_ToA_T)
        line = self.position + arm - element.p_WH
        length = np.linalg.norm(line, axis=1)
        direction = line / length[:, None]
        velocity = self.v + np.cross(self.w, arm)
        return length, direction, velocity

    def springs(self):
        """Return the elastic energy of the springs relative to the rest pose. [J]"""
        total = 0.0
        for name, spring in self.setup.springs.items():
            stretch = self._strut(spring)[0] - np.linalg.norm(spring.p_ToA_T - spring.p_WH)
            k = self.parameters.spring_types[self.parameters.springs[name].type].stiffness
            total = total + spring.preload * stretch + 0.5 * k * stretch**2
        return total

    def gasket(self):
        """Return elastic energy [J] and dissipated power [W] of the gasket.

        The axes of both of its frames are those of W at rest.
        """
        g, placed = self.parameters.gasket, self.setup.bushings["gasket"]
        arm = self.rotation.apply(placed.tub_side_point)
        d = self.position + arm - placed.ground_side_point
        d_rate = self.v + np.cross(self.w, arm)
        r = self.rotation.as_rotvec()
        c = np.array([g.damping_x, g.damping_y, g.damping_z])
        cr = np.array([g.rotational_damping_x, g.rotational_damping_y, g.rotational_damping_z])
        r_rate = rotation_vector_rate(r, self.w)
        branch_stored, branch_power = self._branches(
            g, np.hstack([d, r]), np.hstack([d_rate, r_rate])
        )
        stored = branch_stored + sum(
            elastic_energy(getattr(g, f"stiffness_{axis}"), d[:, i]) for i, axis in enumerate("xyz")
        )
        stored += sum(
            elastic_energy(getattr(g, f"rotational_stiffness_{axis}"), r[:, i])
            for i, axis in enumerate("xyz")
        )
        return stored, d_rate**2 @ c + r_rate**2 @ cr + branch_power

    def _branches(self, gasket, moved, rate):
        """Return energy [J] and dissipated power [W] of cross-stiffness, friction and Maxwell branches."""
        stored = 0.5 * np.einsum("ni,ij,nj->n", moved, gasket.cross_matrix(), moved)
        power = np.zeros(len(moved))
        for k, key in enumerate(gasket.stretched_branches):
            z = self.record.branch_stretch.values[:, k]
            axis = "xyz".index(key[-1]) + 3 * ("torque" in key or "rotational" in key)
            other = getattr(
                gasket,
                key.replace("force", "displacement").replace("torque", "angle")
                if key.startswith("dahl")
                else key.replace("stiffness", "damping"),
            )
            number = getattr(gasket, key)
            if key.startswith("dahl"):  # all that does not stretch the element is friction
                stiffness = number / other
                power = power + stiffness * z * np.abs(rate[:, axis]) * z / other
            else:
                stiffness = number
                # the dashpot carries the force of the spring
                power = power + (stiffness * z) ** 2 / other
            stored = stored + 0.5 * stiffness * z**2
        return stored, power

    def dampers(self):
        """Return stored energy [J] and dissipated power [W] of sponges and end bushings."""
        stored, power = 0.0, 0.0
        for index, (name, placed) in enumerate(self.setup.dampers.items()):
            kind = self.parameters.damper_types[self.parameters.dampers[name].type]
            length, direction, velocity = self._strut(placed)
            rate = np.sum(direction * velocity, axis=1)
            tension = self.record.damper_tension.values[:, index]
            if hasattr(kind, "sponge_stiffness"):
                energy, lost = self._sponge(kind, index, rate, tension)
                stored, power = stored + energy, power + lost
            else:
                power = power + tension * rate
            line = placed.p_ToA_T - placed.p_WH
            axis = line / np.linalg.norm(line)
            w_strut = np.cross(direction, velocity) / length[:, None]
            for body_axis, body_w in (
                (self.rotation.apply(axis), self.w),
                (np.broadcast_to(axis, direction.shape), 0.0),
            ):
                angle = np.arctan2(
                    np.linalg.norm(np.cross(body_axis, direction), axis=1),
                    np.sum(body_axis * direction, axis=1),
                )
                relative = w_strut - body_w
                bend = relative - np.sum(relative * direction, axis=1)[:, None] * direction
                speed = np.linalg.norm(bend, axis=1)
                b = kind.end_bushing
                full = np.minimum(speed / b.full_friction_rate, 1.0)
                stored = stored + 0.5 * b.stiffness * angle**2
                power = (
                    power
                    + b.damping * speed**2
                    + b.friction_torque * np.sin(np.pi / 2 * full) * speed
                )
        return stored, power

    def _sponge(self, kind, index, rate, tension):
        """Return stored energy [J] and dissipated power [W] of a damper with a sponge."""
        deformation = self.record.damper_deformation.values[:, index]
        # s = k1 delta + c1 delta' gives delta', and w = v - delta'
        deformation_rate = (tension - kind.sponge_stiffness * deformation) / kind.sponge_damping
        w = rate - deformation_rate
        power = kind.sponge_damping * deformation_rate**2 + tension * w
        return 0.5 * kind.sponge_stiffness * deformation**2, power

    def balance(self):
        """Return work of the drive, change of stored energy and dissipated energy. [J]"""
        gasket_stored, gasket_power = self.gasket()
        damper_stored, damper_power = self.dampers()
        elastic = self.springs() + gasket_stored + damper_stored
        drive = self.record.motor_torque.values * self.record.drum_speed.values
        change = self.bodies(-1) - self.bodies(0) + elastic[-1] - elastic[0]
        return self.integral(drive), change, self.integral(gasket_power + damper_power)

    def integral(self, power):
        """Integrate a power over the record, which has two samples at each corner. [J]"""
        return np.trapezoid(power, self.time)


def dense_record(machine, case, step):
    """Return set-up and record of a run with a sample at every step.

    A sample every 5 ms is too coarse to integrate the power of friction to 1e-5.
    """
    setup = machine.set_up(case.load, gasket=case.gasket)
    profile, context = case.profile, setup.context
    simulator = Simulator(machine.diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", step).set_fixed_step_mode(True)
    plant_context = setup.plant_context
    accelerations = machine.plant.get_generalized_acceleration_output_port()
    dampers = [damper.GetMyContextFromRoot(context) for damper in machine.dampers.values()]
    bushings = [bushing.GetMyContextFromRoot(context) for bushing in machine.bushings.values()]
    time, state, deformation, torque, acceleration, stretches = [], [], [], [], [], []

    def sample(alpha):
        time.append(context.get_time())
        state.append(machine.plant.GetPositionsAndVelocities(plant_context))
        deformation.append([sum(c.get_continuous_state_vector().CopyToVector()) for c in dampers])
        stretches.append(
            np.concatenate([c.get_continuous_state_vector().CopyToVector() for c in bushings])
        )
        rates = accelerations.Eval(plant_context).copy()
        torque.append(REFLECTED_INERTIA * (alpha - rates[6]))
        acceleration.append(rates[:6])

    for begin, stop, alpha in zip(
        profile.time, profile.time[1:], profile.acceleration(), strict=False
    ):
        machine.set_drum_acceleration(context, alpha)
        simulator.Initialize()
        sample(alpha)
        for moment in np.linspace(begin, stop, int(np.ceil((stop - begin) / step)) + 1)[1:]:
            simulator.AdvanceTo(moment)
            sample(alpha)
    arrays = map(np.array, (time, state, deformation, torque, acceleration))
    trajectory = Trajectory(
        *arrays,
        tubes=np.empty((len(time), 0, 14)),
        carrier=np.empty((len(time), 0)),
        stretches=np.array(stretches).reshape(len(time), -1),
    )
    return setup, as_record(setup, case, trajectory)
