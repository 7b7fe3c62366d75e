"""Natural frequencies of rotors on flexible bearings against ROSS (petrobras/ross).

ROSS has elastic shafts, ours are rigid. Two rotors, both of steel (7810 kg/m^3) with a solid shaft
of 50 mm diameter and discs 70 mm thick, on a bearing at each end:

- one disc of 280 mm in the middle of 0.5 m, bearings of 1e6 N/m; frequencies as printed in
  ross/tests/test_rotor_assembly.py (rotor2, commit 631a249). Its shaft bends: with rigid shafts all
  frequencies are higher, here by up to 4 %.
- discs of 280 and 350 mm at 0.5 and 1 m of 1.5 m (rotor3 there), on bearings of 1000 N/m along x
  and 800 N/m along y, a thousandth of those of ROSS, so that the shaft is rigid to 1e-3.
  ROSS prints no rotor like that; the frequencies are what ROSS 2.3.0 gives when it is run. It also
  gives those printed of the first rotor, to all digits. On bearings of a tenth of these, 100 and
  80 N/m, the difference from ours at rest is a tenth: it is the bending of the shaft.

x and y of ROSS are x and z here. A light carrier is the tub.
"""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import load_machine
from wm_drake.studies.modes.linearisation import Linearisation

DENSITY, SHAFT, THICKNESS, CARRIER = 7810.0, 0.05, 0.07, 1e-3
PRINTED = 215.37072557, 598.02474114  # rad/s, at rest, each twice
SOFT = {
    0.0: (3.8546145, 4.3089743, 9.520881, 10.6441758),
    20.0: (3.8545293, 4.3088489, 8.8723614, 11.4223736),
    100.0: (3.8517443, 4.3042296, 5.8506009, 17.3378579),
}  # rad/s, at speeds in rad/s

SDF = """<sdf version="1.9"><model name="rotor">
<link name="housing"/>
<joint name="fixed" type="fixed"><parent>world</parent><child>housing</child></joint>
<link name="tub"><inertial><mass>{carrier}</mass>
  <inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia></inertial></link>
<link name="drum"><inertial><mass>{mass}</mass>
  <inertia><ixx>{transverse}</ixx><iyy>{polar}</iyy><izz>{transverse}</izz></inertia>
  </inertial></link>
<joint name="drum_axis" type="revolute"><parent>tub</parent><child>drum</child>
  <axis><xyz>0 1 0</xyz><limit><lower>-inf</lower><upper>inf</upper></limit></axis></joint>
<frame name="first" attached_to="tub"><pose>0 {first} 0 0 0 0</pose></frame>
<frame name="last" attached_to="tub"><pose>0 {last} 0 0 0 0</pose></frame>
<frame name="ground_first" attached_to="housing"><pose>0 {first} 0 0 0 0</pose></frame>
<frame name="ground_last" attached_to="housing"><pose>0 {last} 0 0 0 0</pose></frame>
</model></sdf>"""

BEARING = """
    stiffness_x: {x} N/m
    stiffness_y: 1e7 N/m
    stiffness_z: {z} N/m
    rotational_stiffness_x: 0 N m/rad
    rotational_stiffness_y: 1e5 N m/rad
    rotational_stiffness_z: 0 N m/rad"""

MACHINE = """
name: rotor
model: rotor.sdf
gravity: 0 m/s^2
bushings:
  first:
    tub_frame: first
    housing_frame: ground_first{bearing}
  last:
    tub_frame: last
    housing_frame: ground_last{bearing}
sensors: {{X: {{frame: first, axis: x}}}}
clearance: {{detergent_frame: first}}
loads:
  none: {{static: {{moment: 0 kg*m}}}}
profile:
  time: (0, 1) s
  speed: (0, 0) rad/s
"""


def rigid_rotor(length, discs):
    """Return mass, place of the centre of mass, transverse and polar inertia of a rotor.

    Args:
        length: Length of the shaft. [m]
        discs: Place and diameter of each disc on the shaft. [m]
    """
    parts = [(0.5 * length, 0.0, SHAFT, length)]
    parts += [(place, SHAFT, diameter, THICKNESS) for place, diameter in discs]
    rows = []
    for place, inner, outer, width in parts:
        mass = DENSITY * np.pi * width * (outer**2 - inner**2) / 4.0
        polar = mass * (outer**2 + inner**2) / 8.0
        rows.append((mass, place, 0.5 * polar + mass * width**2 / 12.0, polar))
    mass, place, transverse, polar = np.array(rows).T
    centre = mass @ place / mass.sum()
    return mass.sum(), centre, transverse.sum() + mass @ (place - centre) ** 2, polar.sum()


def frequencies(folder, length, discs, stiffness, speed):
    """Return the four lowest natural frequencies, those across the axis. [rad/s]"""
    mass, centre, transverse, polar = rigid_rotor(length, discs)
    places = {"first": -centre, "last": length - centre}
    bodies = {"mass": mass - CARRIER, "transverse": transverse - 1e-5, "polar": polar}
    (folder / "rotor.sdf").write_text(SDF.format(carrier=CARRIER, **bodies, **places))
    bearing = BEARING.format(x=stiffness[0], z=stiffness[1])
    (folder / "rotor.yaml").write_text(MACHINE.format(bearing=bearing))
    machine = wm.build_machine(load_machine(str(folder / "rotor.yaml")))
    values = Linearisation(machine.set_up("none")).spectrum(speed).values
    return np.sort(np.abs(values[values.imag > 0.0]))[:4]


def test_rigid_rotor_is_just_above_the_printed_frequencies(tmp_path):
    found = frequencies(tmp_path, 0.5, [(0.25, 0.28)], (1e6, 1e6), 0.0)
    excess = found / np.repeat(PRINTED, 2) - 1.0
    np.testing.assert_allclose(excess, [0.035, 0.035, 0.0153, 0.0153], atol=1e-3)


@pytest.mark.parametrize("speed", SOFT)
def test_rigid_rotor_on_soft_anisotropic_bearings_is_that_of_ross(speed, tmp_path):
    found = frequencies(tmp_path, 1.5, [(0.5, 0.28), (1.0, 0.35)], (1000.0, 800.0), speed)
    np.testing.assert_allclose(found, SOFT[speed], rtol=1e-3)
