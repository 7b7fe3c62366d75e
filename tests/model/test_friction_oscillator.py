"""Friction oscillator of another program: a mass on a spring that slides against dry friction.

The numbers are those of an example of EXUDYN (J. Gerstmayr, Examples/coordinateSpringDamper.py,
commit 30ec2d5, with its friction): 1.6 kg on 4000 N/m, friction of 4 N that is complete from
0.01 m/s on. It starts 100 mm beside the rest position at 1 m/s towards it. The file prints 11.83 mm
at 1 s for its other damper, a dashpot; EXUDYN 1.13.6 gives the same, so the printed machine is the
one that runs. The positions below are those of EXUDYN 1.13.6 with friction, steps of 0.01 ms.
"""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.engines.compiled import run as compiled
from wm_drake.engines.drake import run_drake_accurately
from wm_drake.parameters import SpinProfile, load_machine

MASS, STIFFNESS, FRICTION, START, SPEED = 1.6, 4000.0, 4.0, -0.1, 1.0
TURNS_MM = 100.0, -98.0, 96.0, -94.0, 92.0, -90.0, 88.0, -86.0, 84.0, -82.0, 80.0, -78.0, 76.0
TENTHS_MM = -45.3252, 68.8993, 80.2276, -20.5104, -85.8116, -27.7885, 64.2795, 60.6986, -26.2886
VISCOUS_MM, VISCOUS_DAMPING = 11.834933407066539 - 20.0, 8.0  # printed; about the rest position

SDF = f"""<sdf version="1.9"><model name="oscillator">
<link name="housing"/>
<joint name="fixed" type="fixed"><parent>world</parent><child>housing</child></joint>
<link name="tub"><inertial><mass>{MASS - 0.1}</mass>
  <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial></link>
<link name="drum"><inertial><mass>0.1</mass>
  <inertia><ixx>0.001</ixx><iyy>0.001</iyy><izz>0.001</izz></inertia></inertial></link>
<joint name="drum_axis" type="revolute"><parent>tub</parent><child>drum</child>
  <axis><xyz>0 1 0</xyz><limit><lower>-inf</lower><upper>inf</upper></limit></axis></joint>
<frame name="tub_mount" attached_to="tub"/>
<frame name="ground" attached_to="housing"/>
<frame name="damper_ground" attached_to="housing"><pose>0 0 -0.4 0 0 0</pose></frame>
</model></sdf>"""

MACHINE = f"""
name: oscillator
model: oscillator.sdf
gravity: 0 m/s^2
step: 0.1 ms
output_period: 0.1 ms
bushings:
  spring:
    tub_frame: tub_mount
    housing_frame: ground
    stiffness_x: {STIFFNESS} N/m
    stiffness_y: {STIFFNESS} N/m
    stiffness_z: {STIFFNESS} N/m
    rotational_stiffness_x: 10 N m/rad
    rotational_stiffness_y: 10 N m/rad
    rotational_stiffness_z: 10 N m/rad
    damping_z: {{viscous}} N s/m
damper_types:
  friction: {{{{law: stv, friction_force: {{friction}} N, transition_velocity: 0.01 m/s}}}}
dampers:
  slider: {{{{type: friction, tub_frame: tub_mount, housing_frame: damper_ground}}}}
sensors: {{{{Z: {{{{frame: tub_mount, axis: z}}}}}}}}
clearance: {{{{detergent_frame: tub_mount}}}}
loads:
  none: {{{{static: {{{{moment: 0 kg*m}}}}}}}}
profile:
  time: (0, 1) s
  speed: (0, 0) rad/s
"""


def position_mm(folder, engine, friction, viscous, monkeypatch, duration=1.0):
    """Return the position about rest over some seconds, every 0.1 ms. [mm]"""
    (folder / "oscillator.sdf").write_text(SDF)
    (folder / "oscillator.yaml").write_text(MACHINE.format(friction=friction, viscous=viscous))
    machine = wm.build_machine(load_machine(str(folder / "oscillator.yaml")))
    setup = machine.set_up("none")
    profile = SpinProfile(time=(0.0, duration), speed=(0.0, 0.0))
    if engine == "drake":
        machine.plant.SetPositions(setup.plant_context, [0, 0, 0, 0, 0, START, 0])
        machine.plant.SetVelocities(setup.plant_context, [0, 0, 0, 0, 0, SPEED, 0])
        motion = run_drake_accurately(setup, profile, 1e-4, lambda _fraction: None)
    else:
        start = compiled.initial_state(setup, profile)
        start[[5, 12]] = START, SPEED
        monkeypatch.setattr(compiled, "initial_state", lambda _setup, _profile: start)
        motion = compiled.run_compiled(setup, profile, 1e-4, lambda _fraction: None)
    return 1e3 * motion.state[:, 5]


def test_dashpot_gives_the_position_that_the_example_prints(tmp_path, monkeypatch):
    found = position_mm(tmp_path, "compiled", 0.0, VISCOUS_DAMPING, monkeypatch)
    # the steps of the example, 1 ms, change its result by 0.036 %
    assert found[-1] == pytest.approx(VISCOUS_MM, rel=5e-4)


@pytest.mark.parametrize(("engine", "duration"), [("compiled", 1.0), ("drake", 0.3)])
def test_friction_oscillator_moves_as_in_exudyn(engine, duration, tmp_path, monkeypatch):
    found = position_mm(tmp_path, engine, FRICTION, 0.0, monkeypatch, duration)
    rates = np.diff(found)
    turns = found[1:-1][rates[1:] * rates[:-1] < 0.0]
    compared = min(len(turns), len(TURNS_MM))
    assert compared == (13 if duration == 1.0 else 4)
    np.testing.assert_allclose(turns[:compared], TURNS_MM[:compared], rtol=1e-5)
    # dry friction takes 2 F/k of the amplitude in each half turn
    np.testing.assert_allclose(-np.diff(np.abs(turns)), 2e3 * FRICTION / STIFFNESS, rtol=3e-4)
    tenths = found[1000:10000:1000]
    np.testing.assert_allclose(tenths, TENTHS_MM[: len(tenths)], atol=1e-3)
