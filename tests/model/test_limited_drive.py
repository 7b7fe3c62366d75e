"""Sommerfeld effect: a drive of limited torque sticks at the resonance of an unbalanced rotor.

The rotor is that of an example of EXUDYN (J. Gerstmayr, Examples/rigidRotor3Drunup.py, commit
30ec2d5): 2 kg on two supports of 800 N/m, mass 1.48 mm off the axis, driven by a constant torque
for 200 s. Its comment says: 0.1 N m does not pass the critical speed of 28.3 rad/s, 0.2 N m does.
X of EXUDYN, its axis, is y here. A light carrier is the tub; bushings that are stiff
about the axis hold it. The demand of the controller is always above the limit of the torque.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import wm_drake as wm
from wm_drake.parameters import load_machine

MASS, STIFFNESS, OFFSET, POLAR, TRANSVERSE = 2.0, 800.0, 1.48e-3, 0.5625, 0.28791666666666665
CRITICAL = np.sqrt(2.0 * STIFFNESS / MASS)  # rad/s
DAMPING = 2.0 * CRITICAL * 0.002 * MASS  # N s/m, at each support
DURATION = 200.0  # s

SDF = f"""<sdf version="1.9"><model name="laval">
<link name="housing"/>
<joint name="fixed" type="fixed"><parent>world</parent><child>housing</child></joint>
<link name="tub"><inertial><mass>0.002</mass>
  <inertia><ixx>0.006</ixx><iyy>0.01</iyy><izz>0.006</izz></inertia></inertial></link>
<link name="drum"><inertial><mass>{MASS - 0.002}</mass>
  <inertia><ixx>{TRANSVERSE - 0.006}</ixx><iyy>{POLAR}</iyy><izz>{TRANSVERSE - 0.006}</izz>
  </inertia></inertial></link>
<joint name="drum_axis" type="revolute"><parent>tub</parent><child>drum</child>
  <axis><xyz>0 1 0</xyz><limit><lower>-inf</lower><upper>inf</upper></limit></axis></joint>
<frame name="rear" attached_to="tub"><pose>0 0.5 0 0 0 0</pose></frame>
<frame name="front" attached_to="tub"><pose>0 -0.5 0 0 0 0</pose></frame>
<frame name="ground_rear" attached_to="housing"><pose>0 0.5 0 0 0 0</pose></frame>
<frame name="ground_front" attached_to="housing"><pose>0 -0.5 0 0 0 0</pose></frame>
</model></sdf>"""

SUPPORT = f"""
    stiffness_x: {STIFFNESS} N/m
    stiffness_y: 10000 N/m
    stiffness_z: {STIFFNESS} N/m
    rotational_stiffness_x: 0 N m/rad
    rotational_stiffness_y: 500 N m/rad
    rotational_stiffness_z: 0 N m/rad
    damping_x: {DAMPING} N s/m
    damping_y: 10 N s/m
    damping_z: {DAMPING} N s/m
    rotational_damping_y: 0.5 N m s/rad"""

MACHINE = """
name: laval
model: laval.sdf
gravity: 0 m/s^2
step: 1 ms
bushings:
  rear:
    tub_frame: rear
    housing_frame: ground_rear{support}
  front:
    tub_frame: front
    housing_frame: ground_front{support}
drive:
  kind: motor
  belt_ratio: 1
  rotor_inertia: 0 kg m^2
  torque_limit: {{torque: {torque} N m}}
  controller: {{proportional_gain: 0.01 N m s/rad}}
sensors: {{X: {{frame: rear, axis: x}}}}
clearance: {{detergent_frame: rear}}
loads:
  offset: {{static: {{moment: {moment} kg*m}}}}
profile:
  time: (0, 0.001, {duration}) s
  speed: (0, 200, 200) rad/s
"""


def run(folder, torque):
    """Return the record of a run with a constant torque of the motor. [N m]"""
    (folder / "laval.sdf").write_text(SDF)
    text = MACHINE.format(support=SUPPORT, torque=torque, moment=MASS * OFFSET, duration=DURATION)
    (folder / "laval.yaml").write_text(text)
    machine = wm.build_machine(load_machine(str(folder / "laval.yaml")))
    return wm.simulate(machine, "offset")


def planar_rotor(torque):
    """Return the speed at the end from the plane equations of the rotor, own derivation. [rad/s]

    The centre of mass is at (x + e sin q, z + e cos q), with the shaft at (x, z) and its angle q.
    """

    def rates(_time, state):
        x, z, q, vx, vz, w = state
        sine, cosine = np.sin(q), np.cos(q)
        elastic = -2.0 * STIFFNESS * np.array([x, z]) - 2.0 * DAMPING * np.array([vx, vz])
        # unknowns: accelerations of the shaft, and of the angle
        matrix = np.array(
            [
                [MASS, 0.0, MASS * OFFSET * cosine],
                [0.0, MASS, -MASS * OFFSET * sine],
                [MASS * OFFSET * cosine, -MASS * OFFSET * sine, POLAR + MASS * OFFSET**2],
            ]
        )
        flow = MASS * OFFSET * w**2
        right = np.array([elastic[0] + flow * sine, elastic[1] + flow * cosine, torque])
        return [vx, vz, w, *np.linalg.solve(matrix, right)]

    span = 0.0, DURATION
    return solve_ivp(rates, span, np.zeros(6), "DOP853", rtol=1e-7, atol=1e-10).y[5, -1]


@pytest.mark.parametrize(("torque", "passes"), [(0.1, False), (0.2, True)])
def test_torque_passes_the_resonance_or_sticks_as_in_the_example(torque, passes, tmp_path):
    record = run(tmp_path, torque)
    np.testing.assert_allclose(record.motor_torque.values[1:], torque, rtol=1e-9)
    speed = float(record.drum_speed[-1])
    assert (speed > 1.2 * CRITICAL) == passes
    assert (0.9 * CRITICAL < speed < 1.1 * CRITICAL) != passes
    assert speed == pytest.approx(planar_rotor(torque), rel=0.01)
