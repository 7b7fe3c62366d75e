"""How fast is the same run-up in MuJoCo, with the force laws in a compiled callback?

MuJoCo moves tub and drum with the inertia of the machine, a free joint and a hinge, by its own
Runge-Kutta scheme of fourth order at the default step. A callback that numba compiles evaluates the
forces of springs, dampers and gasket, with the laws of this package. The gasket has constant
stiffnesses, and the dampers have no states. The drum follows the profile as in the Drake
diagram: its hinge has an armature of 1e8 kg m2 and the torque that accelerates it.

MuJoCo leaves out: outputs of forces, motor torque and measures; corners of the profile between two
samples, where the acceleration is the mean over 5 ms; compliant bearings and tubes of dampers as
bodies, which it could represent with more bodies. The script needs the extra `mujoco`. It prints
the time per run and core of MuJoCo and of a batch of the compiled engine, and the difference of the
motion. It takes about a minute.
"""

import argparse
import time
from pathlib import Path

import mujoco
import numba
import numpy as np
from compare_speed import gasket_cases, linear_machine
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from scipy.spatial.transform import Rotation

from wm_drake import Case, build_machine, load_machine, simulate, simulate_many
from wm_drake.compiler.lanes import number_array
from wm_drake.compiler.matrices import plus
from wm_drake.elements.bushing import six_component_bushing_wrench
from wm_drake.elements.friction_damper import (
    friction_damper_line,
    friction_damper_tension,
    friction_damper_wrench,
)
from wm_drake.elements.motion import TubMotion
from wm_drake.elements.spring import spring_strut_wrench
from wm_drake.engines.compiled.packing import drum_joint, pack
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.machine import OUTPUT_PERIOD
from wm_drake.systems.speed_source import REFLECTED_INERTIA


@intrinsic
def at_address(_typing_context, address):  # type: ignore[no-untyped-def]
    """Return a pointer to floats at an address."""

    def emit(_context, builder, _signature, args):  # type: ignore[no-untyped-def]
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(address), emit


def inertial(inertia: object) -> str:
    """Return the MJCF element of a spatial inertia about the origin of its frame."""
    com, mass = inertia.get_com(), inertia.get_mass()  # type: ignore[attr-defined]
    full = inertia.Shift(com).CalcRotationalInertia()  # type: ignore[attr-defined]
    moments = [*full.get_moments(), *full.get_products()]
    numbers = [" ".join(f"{value:.17g}" for value in group) for group in (com, moments)]
    return f'<inertial pos="{numbers[0]}" mass="{mass:.17g}" fullinertia="{numbers[1]}"/>'


def mjcf(setup: Setup, step: float) -> str:
    """Return the MuJoCo model of tub and drum."""
    plant, context = setup.machine.plant, setup.plant_context
    joint = drum_joint(plant, setup.parameters.drive.joint)
    tub = plant.GetBodyByName("tub")
    X_TF = plant.CalcRelativeTransform(context, tub.body_frame(), joint.frame_on_parent())
    of_tub, of_drum = (
        plant.CalcSpatialInertia(
            context, tub.body_frame(), [part.index() for part in plant.GetBodiesWeldedTo(body)]
        )
        for body in (tub, joint.child_body())
    )
    axis, origin = (
        " ".join(f"{value:.17g}" for value in vector)
        for vector in (X_TF.rotation() @ joint.revolute_axis(), X_TF.translation())
    )
    return f"""<mujoco>
      <option timestep="{step}" integrator="RK4" gravity="0 0 {-setup.parameters.gravity}"/>
      <worldbody><body name="tub"><freejoint/>{inertial(of_tub)}
        <body name="drum"><joint name="drive" axis="{axis}" pos="{origin}"
          armature="{REFLECTED_INERTIA}"/>{inertial(of_drum)}</body></body></worldbody>
      </mujoco>"""


def set_forces(data: mujoco.MjData, setup: Setup) -> list[object]:
    """Let MuJoCo call compiled force laws; return what must live as long as it does."""
    packed, layout = pack(setup)
    arrays = (data.qpos, data.qvel, data.qfrc_passive, packed)
    qpos, qvel, force, p_at = (array.ctypes.data for array in arrays)
    size, dampers = len(packed), layout.dampers
    springs, bushings = layout.springs, layout.bushings

    @numba.njit(error_model="numpy", fastmath={"contract", "nsz"})
    def apply() -> None:
        q, v = numba.carray(at_address(qpos), 8), numba.carray(at_address(qvel), 7)
        total = numba.carray(at_address(force), 7)
        p = number_array(numba.carray(at_address(p_at), size))
        w, x, y, u = q[3], q[4], q[5], q[6]
        r = (
            1.0 - 2.0 * (y * y + u * u), 2.0 * (x * y - w * u), 2.0 * (x * u + w * y),
            2.0 * (x * y + w * u), 1.0 - 2.0 * (x * x + u * u), 2.0 * (y * u - w * x),
            2.0 * (x * u - w * y), 2.0 * (y * u + w * x), 1.0 - 2.0 * (x * x + y * y),
        )  # fmt: skip
        turn = (  # MuJoCo has the angular velocity and the moment in the frame of the body
            r[0] * v[3] + r[1] * v[4] + r[2] * v[5],
            r[3] * v[3] + r[4] * v[4] + r[5] * v[5],
            r[6] * v[3] + r[7] * v[4] + r[8] * v[5],
        )
        motion = TubMotion(r, (q[0], q[1], q[2]), turn, (v[0], v[1], v[2]))
        f = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for at in springs:
            f = plus(f, spring_strut_wrench(motion, p, at)[0])
        for at in bushings:
            f = plus(f, six_component_bushing_wrench(motion, p, at)[0])
        for at in dampers:
            arm, line = friction_damper_line(motion, p, at)
            tension, _ = friction_damper_tension(line[1], 0.0, p, at)
            f = plus(f, friction_damper_wrench(motion, arm, line, tension, p, at))
        for k in range(3):
            total[k] += f[3 + k]
            total[3 + k] += r[k] * f[0] + r[3 + k] * f[1] + r[6 + k] * f[2]

    @numba.cfunc(types.void(types.voidptr, types.voidptr))
    def passive(_model, _state):  # type: ignore[no-untyped-def]
        apply()

    mujoco.set_mjcb_passive(passive.ctypes)
    return [packed, apply, passive]


def run(setup: Setup, profile: SpinProfile, step: float) -> tuple[np.ndarray, float]:
    """Return the positions of the tub at the output period (n, 3) [m], and the CPU time [s]."""
    model = mujoco.MjModel.from_xml_string(mjcf(setup, step))
    data = mujoco.MjData(model)
    data.qpos[:3] = setup.rest_pose[3:]
    data.qpos[3:7] = np.roll(Rotation.from_euler("xyz", setup.rest_pose[:3]).as_quat(), 1)
    data.qvel[6] = profile.speed[0]
    alive = set_forces(data, setup)
    times = OUTPUT_PERIOD * np.arange(round(profile.duration / OUTPUT_PERIOD) + 1)
    torque = REFLECTED_INERTIA * np.diff(profile.speed_at(times)) / OUTPUT_PERIOD
    positions = [data.qpos[:3].copy()]
    begin = time.process_time()
    for drive in torque:
        data.qfrc_applied[6] = drive
        mujoco.mj_step(model, data, nstep=round(OUTPUT_PERIOD / step))
        positions.append(data.qpos[:3].copy())
    spent = time.process_time() - begin
    mujoco.set_mjcb_passive(None)
    assert alive
    return np.array(positions), spent


def compared(profile: SpinProfile, count: int) -> list[str]:
    """Return the lines of the comparison."""
    machine = build_machine(linear_machine())
    step = machine.parameters.step
    case = Case("middle", machine.parameters.loads["middle"], profile)
    positions, spent = run(machine.set_up(case.load), profile, step)
    record = simulate(machine, case)
    moved = record.tub_position.values
    largest = np.abs(moved - moved[0]).max()
    apart = np.abs(positions[: len(moved)] - moved).max()
    simulate_many(machine, [case] * 8)  # compiles
    begin = time.process_time()
    simulate_many(machine, gasket_cases(count, profile), measures=("extremes",))
    batch_s = (time.process_time() - begin) / count
    return [
        f"one run of {profile.duration:g} s in MuJoCo {mujoco.__version__}: "
        f"{1e3 * spent:.0f} ms of one core",
        f"a run in a batch of {count}, two loads for each gasket, with D, F, M: "
        f"{1e3 * batch_s:.2f} ms of one core; "
        f"ratio {spent / batch_s:.0f}",
        f"largest difference of the tub position: {1e6 * apart:.1f} um of {1e3 * largest:.2f} mm",
    ]


def main() -> None:
    """Print the comparison and write it to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="run 2 s and a small batch")
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    profile, count = load_machine("reference").profile, 400
    if arguments.quick:
        profile, count = SpinProfile(time=(0.0, 2.0), speed=(0.0, 9.0)), 16
    text = "\n".join(compared(profile, count))
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
