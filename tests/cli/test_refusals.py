"""Bad input to a command: one message, exit code 2, nothing printed, nothing written."""

from pathlib import Path

import numpy as np
import pytest


def machine(text):
    """Return the file of a machine with one more line."""
    return {"machine.yaml": f"extends: reference\n{text}\n"}


def table(head, rows):
    return "\n".join([head, *rows]) + "\n"


LOOP = "time_s,displacement_mm,force_N"
AMPLITUDES = "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf"
PROFILE = "time: (0, 1) s\nspeed: (0, 60) rpm\n"
NO_LOADS = "middle: null, back: null, front: null, counter: null, extra: {unbalances: []}"
NO_SENSORS = "Xr: null, Yr: null, Zr: null, Xf: null, Yf: null, Zf: null"
TOLERANCES = """loads: middle
vary:
  mass: {keys: [loads.middle.unbalances.0.mass], distribution: uniform, low: 1 kg, high: 12 kg}
"""
DESIGN = """loads: [middle]
vary:
  k: {keys: [spring_types.suspension.stiffness], low: 50 %, high: 150 %}
  m: {keys: [bodies.motor.mass], low: 90 %, high: 110 %}
objectives:
- {quantity: Dx}
- {quantity: bodies.motor.mass}
"""
FREE = """vary:
  friction: {bounds: "(10, 60) N", prior: "(30, 10) N", sets: damper_types.friction.friction_force, source: test}
  radius: {bounds: "(230, 250) mm", prior: "(240, 5) mm", sets: loads.middle.unbalances.0.radius, source: test}
"""


def candidate(kind, what, accuracy):
    """Return the file of a candidate measurement."""
    return {"c.yaml": f"candidates: {{m: {{kind: {kind}, {what}, accuracy: {accuracy}}}}}\n"}


WALL = "meridian: [{radius: 160 mm, y: 0 mm, thickness: 2 mm}, {radius: 160 mm, y: 30 mm, thickness: 2 mm}]\nrubber: {c1: 0.3 MPa}\n"
STRAIGHT = [f"{0.01 * k},{(k % 20 - 10) ** 2},{k % 20}" for k in range(100)]
FILES = {
    "p.yaml": PROFILE,
    "q.yaml": PROFILE + "regions: [{name: A, begin: 0 s, end: 0.5 s}, {name: B, begin: 0.5 s, end: 1 s}]\n",
    "c.csv": "case,front_g,rear_g,phase_deg\nfront,400,0,0\nboth,400,400,180\n",
    "t.yaml": TOLERANCES,
    "d.yaml": DESIGN,
    "free.yaml": FREE,
    "short.yaml": "extends: reference\nname: short\nmeasured: []\nprofile: {time: '(0, 12) s', speed: '(40, 270) rpm'}\n",
    "measured.csv": table(AMPLITUDES, [f"{load},yes,experiment,1,2,3,4,5,6" for load in ("middle", "back")]),
    "rubber.yaml": "".join(f"stiffness_{a}: 1 N/mm\nrotational_stiffness_{a}: 1 N mm/rad\n" for a in "xyz"),
    "bad.csv": table(LOOP, [f"{0.1 * k},{k % 5},{k % 7}" for k in range(30)]),
    "good.csv": table(LOOP, [f"{t:.5f},{np.sin(7 * t):.5f},{np.cos(7 * t):.5f}" for t in np.linspace(0, 1, 50)]),
    "loop.csv": table(LOOP, STRAIGHT),
    "copy.csv": table(LOOP, STRAIGHT),
    "linear.yaml": "extends: reference\ngasket: {stiffness_x: 4 N/mm, stiffness_y: 4 N/mm, stiffness_z: 4 N/mm}\n",
    "soft.yaml": "name: soft\nextends: reference\nloads: {back: null, front: null, counter: null}\n",
    "odd.yaml": f"name: odd\nextends: reference\nloads: {{{NO_LOADS}}}\n",
    "blind.yaml": f"name: blind\nextends: reference\nsensors: {{{NO_SENSORS}, A: {{frame: sensor_Xr, axis: x}}}}\n",
    "bare.yaml": "name: bare\nextends: reference\ngasket: null\n",
    "twin.yaml": "extends: reference\nname: reference\n",
    "faulty.yaml": "name: faulty\nextends: reference\ngravity: 9.81\n",
    "unbuildable.yaml": "name: u\nextends: reference\nclearance: {detergent_frame: nowhere}\n",
    "file": "",
}  # fmt: skip
"""Files that are there in every case."""

CASES = {  # command -> arguments, message, more files
    "machine check machine.yaml": [
        ("", "no such file, and no shipped machine of that name", {}),
        ("", "unknown key 'stifness_x' (did you mean 'stiffness_x'?", machine("gasket: {stifness_x: 3 N/mm}")),
        ("", "bodies.tub", machine("bodies: {tub: {inertia: {xx: 1 kg m^2, yy: 1 kg m^2, zz: 1 kg m^2, xy: 2 kg m^2}}}")),
        ("", "bodies.tub", machine("bodies: {tub: {inertia: {xx: 1 kg m^2, yy: 1 kg m^2, zz: 5 kg m^2}}}")),
        ("", "machine.yaml", machine("bodies: {tub: {mass: 1e300 kg}}")),
        ("", "springs.extra", machine("springs: {extra: {type: suspension, tub_frame: tub, housing_frame: housing}}")),
        ("", "dampers.extra", machine("dampers: {extra: {type: friction, tub_frame: tub, housing_frame: housing}}")),
        ("", "no frame 'spring_lft_tub' in the SDF", machine("springs: {left: {tub_frame: spring_lft_tub}}")),
        ("", "no moving link 'tubb' in the SDF (did you mean 'tub'?", machine("bodies: {tubb: {mass: 1 kg}}")),
        ("", "no moving joint 'drum_axes' in the SDF (did you mean 'drum_axis'?", machine("drive: {joint: drum_axes}")),
        ("", "no SDF file 'nosuch.sdf'", machine("model: nosuch.sdf")),
        ("", "cannot be read", machine("model: machine.yaml")),
        ("", "machine.yaml:2: measured.0: file 'nosuch.csv': No such file or directory", machine("measured: [nosuch.csv]")),
        ("", "machine.yaml:2: published.0: file 'nosuch.csv': No such file or directory", machine("published: [nosuch.csv]")),
        ("", "springs.left: would be slack at rest", machine("frames: {spring_left_housing: {position: '(-250, 0, -600) mm'}}")),
    ],
    "machine show": [
        ("nosuch", "no such file, and no shipped machine of that name"),
        ("--set dampers.lft=null", "--set: dampers.lft: unknown key 'lft' (did you mean 'left'?"),
    ],
    "machine new": [
        ("soft", "soft.yaml: exists already"),
        ("no/such/folder", "no/such/folder.yaml: cannot be written to"),
        ("'two words'", "'two words' is no name of a machine"),
        ("''", "'.yaml' is no name"),
    ],
    "spin --out out": [
        ("--machine machine.yaml", "no frame 'spring_lft_tub' in the SDF", machine("springs: {left: {tub_frame: spring_lft_tub}}")),
        ("--machine machine.yaml --load a/b --profile p.yaml", "a/b", machine("loads: {a/b: {unbalances: [{mass: 1 kg, radius: 1 mm, y: 0 mm}]}}")),
        ("--load midle", "neither a load of machine 'reference' nor a file (did you mean 'middle'?"),
        ("--engine drak", "unknown engine 'drak' (did you mean 'drake'?"),
        ("--set gasket.stiffness_x", "'gasket.stiffness_x' does not have the form KEY=VALUE"),
        ("--set gasket.stiffness_x=3", "gasket.stiffness_x: '3' has no unit"),
        ("--set 'bodies.tubb.mass=1 kg'", "no moving link 'tubb' in the SDF"),
        ("--set 'gasket.stiffness_x=4e4 N/mm'", "step: 2.5 ms is too long for the tub"),
        ("--load middle --load middle", "'middle' is given twice"),
        ("--load middle --load middle.yaml", "'middle' is given twice", {"middle.yaml": "unbalances: []\n"}),
        ("--load l.yaml", "l.yaml:1: unbal", {"l.yaml": "unbalances: [{mass: -1 kg, radius: 1 mm, y: 0 mm}]\n"}),
        ("--profile nosuch.csv", "no such file, and no shipped profile"),
        ("--out file", "file: this path is a file, but a folder is needed"),
        ("--out file/out", "file/out: cannot be written to"),
        ("--out ''", "--out: is empty; name a folder"),
        ("--out ' '", "--out: is empty; name a folder"),
        ("--machine reference --machine reference", "'reference' is given twice"),
        ("--machine reference --machine twin.yaml", "2 machines have the name"),
        ("--machine reference --machine referenc", "referenc"),
        ("--machine reference --machine soft.yaml --load back", "--load: 'back' is neither a load of machine 'soft' nor a file"),
        ("--machine reference --machine odd.yaml", "the machines have no load of the same name: 'reference' has middle"),
        ("--machine reference --machine blind.yaml", "no sensor of the same name"),
        ("--machine reference --machine bare.yaml --set 'gasket.damping_x=1 N s/mm'", "--set in machine 'bare.yaml': gasket.damping_x"),
        ("--machine bare.yaml --compare-gasket", "--compare-gasket: machine 'bare' has no gasket"),
        ("--compare-gasket --no-gasket", "--compare-gasket: excludes"),
        ("--compare-gasket --machine reference --machine soft.yaml --machine odd.yaml --machine blind.yaml", "8 machines or variants are too many for one page; at most 6"),
        ("--machine reference --machine faulty.yaml", "faulty.yaml:3: gravity"),
        ("--machine reference --machine unbuildable.yaml", "unbuildable.yaml:3: "),
    ],
    "rig": [
        ("damper", "rig damper: needs -f and -a (for example -f '3 Hz' -a '5 mm'), or --matrix"),
        ("damper -f 3 -a '5 mm'", "--frequency: '3': '3' has no unit; write for example '1 Hz'"),
        ("damper -f '3 Hz' -a 'five mm'", "--amplitude: 'five mm' is not a number with a unit"),
        ("damper -f '3 Hz' -a '5 deg'", "--amplitude: '5 deg': unit 'deg' does not fit"),
        ("damper -f '-3 Hz' -a '5 mm'", "frequency: is -3; allowed is > 0"),
        ("damper -f '1 Hz' -a '1 mm' --out ''", "--out: is empty; name a folder"),
        ("damper --matrix B", "--matrix: no matrix 'B' for a damper (known: A, C)"),
        ("damper --matrix C -f '3 Hz'", "--matrix: has its own frequencies"),
        ("damper --name left --matrix C", "--name: no 'left' in damper_types of 'reference'"),
        ("damper --component rubber.yaml --matrix C", "--component: 'rubber.yaml' is a bushing, needs a damper"),
        ("damper --component s.yaml --matrix C", "s.yaml: law: ", {"s.yaml": "friction_force: 45 N\nsponge_stiffness: 176 N/mm\n"}),
        ("bushing --axis radial --matrix A", "--machine: 'reference' has no bushing_types; name another machine"),
        ("gasket --axis round --matrix A", "--axis: no axis 'round'"),
        ("gasket --axis x --name old --matrix A", "--name: a machine has one gasket"),
        ("gasket --axis x --arm '100 mm' -f 1Hz -a 1mm", "arm: an arm drives a rotation"),
        ("gasket --axis tilt --matrix A", "--matrix: [A] does not rotate the gasket"),
        ("bushing --machine free_stroke --axis twist --matrix A", "--matrix: [A] does not twist the bushing"),
    ],
    "identify damper": [
        ("none.csv", "none.csv: no such file"),
        ("bad.csv", "bad.csv: displacement is not resolved by its samples"),
        ("bad.csv --file-units s,mm", "--file-units: 's,mm' is not three units"),
        ("good.csv --method newton", "--method: no method 'newton'"),
        ("good.csv --law glue", "--law: no law 'glue' of a damper"),
        ("good.csv --bounds 'friction=1 N'", "--bounds: unknown number 'friction'"),
        ("good.csv --bounds 'friction_force=1 N'", "--bounds: friction_force: '1 N' is not a range"),
        ("good.csv --fix friction_force", "--fix: 'friction_force' does not have the form KEY=VALUE"),
        ("loop.csv --law mstv,glue", "--law: no law 'glue' of a damper"),
        ("loop.csv --law mstv,mstv", "--law: 'mstv' is there twice"),
        ("loop.csv --law mstv,stv --fix 'sponge=1 N'", "--fix: unknown number 'sponge'"),
        ("loop.csv --law coulomb,stv --fix 'sponge_stiffness=1 N/mm'", "--fix: none of these laws has a number 'sponge_stiffness'"),
        ("loop.csv --validate copy.csv", "copy.csv: has the same content as loop.csv, which is fitted"),
        ("loop.csv --validate none.csv", "none.csv: no such file"),
        ("loop.csv --cutoff '0 Hz'", "--cutoff: is 0 Hz; allowed is > 0"),
    ],
    "identify gasket": [
        ("good.csv --axis x --fix 'damping_x=-1 N s/mm'", "--fix: damping_x: '-1000.0' is out of range; allowed is >= 0"),
        ("good.csv --axis tilt", "good.csv: holds displacements and forces, needs angles and moments"),
        ("--static good.csv", "FILES: 'good.csv' names no axis"),
        ("--static radial=good.csv z=good.csv", "FILES: axis z is tested under two names"),
        ("--static tilt=good.csv", "good.csv: axis about_x needs angles and moments"),
        ("good.csv", "--axis: is needed"),
    ],
    "calibrate --machine short.yaml --targets measured.csv --out out": [
        ("--vary none.yaml", "none.yaml: no such file, and no shipped vary file of that name"),
        ("--vary free.yaml --targets none.csv", "--targets: no such file 'none.csv'"),
        ("--vary free.yaml --leave-out bck", "no measured load 'bck' (did you mean 'back'?"),
        ("--vary free.yaml --leave-out back,middle", "leaves no load"),
        ("--vary free.yaml --leave-out middle,middle", "--leave-out: 'middle' is given twice"),
        ("--vary free.yaml --limit Q=2", "--limit: 'Q' is no load, sensor"),
        ("--vary free.yaml --limit 0", "--limit: '0' is not allowed"),
        ("--vary free.yaml --weight Q=2", "'Q' is no load, sensor"),
        ("--vary free.yaml --weight middle=inf", "--weight: middle: 'inf' is not allowed"),
        ("--vary free.yaml --weight middle=٣", "--weight: middle: '٣' is not a number"),
        ("--vary free.yaml --weight middle", "--weight: 'middle' does not have the form KEY=VALUE"),
        ("--vary free.yaml --workers=0", "--workers"),
        ("--vary free.yaml --workers=-1", "--workers"),
        ("--vary free.yaml --seed=-1", "--seed"),
        ("--vary free.yaml --starts=0", "--starts"),
        ("--vary free.yaml --iterations=-1", "--iterations"),
        ("--vary free.yaml --resolution=inf", "resolution: Input should be a finite number"),
        ("--vary free.yaml --deviation=nan", "--deviation: amplitudes: 'nan' is not allowed; must be > 0 and finite"),
        ("--vary f.yaml", "f.yaml:2: vary.friction: 'damper_types.friction.fricton_force' is not a number", {"f.yaml": FREE.replace("friction_force", "fricton_force")}),
    ],
    "study gasket --design full --factor K_Lx --factor C_L --factor 'damper_types.friction.friction_force=20 N..30 N' --profile p.yaml --out out": [
        ("--design d-optmal", "--design: 'd-optmal' is neither a kind of design nor a file (did you mean"),
        ("--design d-optimal --trials 10", "10 trials cannot determine the 19 coefficients"),
        ("--design d-optimal --trials 19", "19 trials for 19 coefficients of main+2fi leave no degree of freedom"),
        ("--model mian", "no model 'mian' of this design (did you mean 'main'?"),
        ("--factor gasket.stifness_x", "gasket.stifness_x: unknown key 'stifness_x' (did you mean 'stiffness_x'?"),
        ("--factor K_Lx", "--factor: 'K_Lx' is given twice"),
        ("--response gpa", "--response: no response 'gpa' (did you mean 'gap'"),
        ("--response regions", "a spin profile with regions"),
        ("--tables curved", "unknown treatment 'curved'"),
        ("--vary nosuch.yaml", "nosuch.yaml: no such file"),
        ("--published k.csv", "'much' is not a finite number", {"k.csv": "load,response,term,percent,effects\nmiddle,Dx,C_L,50,much\n"}),
        ("--published nosuch.csv", "no such file 'nosuch.csv'"),
    ],
    "study spin-cycle --profile q.yaml --cases c.csv --machine reference --out out": [
        ("--profile nosuch", "no such file, and no shipped profile"),
        ("--cases nosuch.csv", "--cases: no such file"),
        ("--case fron", "unknown case 'fron' (did you mean 'front'?"),
        ("--engine drak", "unknown engine 'drak'"),
        ("--measured nosuch.csv", "--measured: no such file"),
        ("--accelerations nosuch", "has no file CASE.csv"),
        ("--set 'imperfections.phase_eror=1 deg'", "did you mean 'phase_error'"),
        ("--measured m.csv", "needs the columns", {"m.csv": "case,region,sensor,axis\n"}),
        ("--measured m.csv", "no region 'R9' in this study", {"m.csv": "case,region,sensor,axis,rms_mm\nfront,R9,S1,x,1\n"}),
        ("--measured m.csv", "not a number of at least 0", {"m.csv": "case,region,sensor,axis,rms_mm\nfront,A,S1,x,-1\n"}),
        ("--measured m.csv", "occurs twice", {"m.csv": "case,region,sensor,axis,rms_mm\nfront,A,S1,x,1\nfront,A,S1,x,2\n"}),
    ],
    "study spin-identify --machine linear.yaml --profile q.yaml --case 2 --case 5 --out out": [
        ("", "machine 'reference' does not have the numbers of [A] Table 8; give keys"),
        ("--unknown gasket.stiffness", "--unknown: gasket.stiffness: unknown key 'stiffness'"),
        ("--unknown 'gasket.stiffness_x=(2, 8) N'", "unit 'N' does not fit"),
        ("--unknown gasket.stiffness_x=2..8", "'2' has no unit; write for example '1 N/mm'"),
        ("--unknown 'gasket.stiffness_x=2 N/mm'", "'gasket.stiffness_x=2 N/mm' is not NAME=LOW..HIGH"),
        ("--unknown 'gasket.stiffness_x=(-5, 2) N/mm'", "-5 N/mm to 2 N/mm is out of range; allowed is >= 0"),
        ("--unknown 'gasket.stiffness_x=(8, 2) N/mm'", "bounds 8 N/mm to 2 N/mm are not a range"),
    ],
    "study gasket-damping --out out": [
        ("--record r.csv", "does not have the form LOAD=FILE with a load of the machine", {"r.csv": "time_s,Xr\n0,1\n"}),
        ("--record middle=nosuch.csv", "no such file 'nosuch.csv'"),
        ("--record middle=r.csv", "r.csv: has no channel 'Yr'; its channels are time_s, Xr", {"r.csv": "time_s,Xr\n0,1\n1,2\n"}),
        ("--planted-linear '3 N'", "unit 'N' does not fit"),
    ],
    "study tolerance t.yaml --profile p.yaml --subset 0 --out out": [
        ("--samples 100", "--samples: 100 is not a power of two"),
        ("--sensitivity 100", "--sensitivity: 100 is not a power of two"),
        ("--subset 1001", "--subset: 1001 is not allowed; allowed are 0 and multiples of 10 from 100"),
        ("--samples 16 --sensitivity 32", "--sensitivity: 32 is more than the samples, 16"),
        ("--samples 16", "lower end is not allowed", {"t.yaml": TOLERANCES.replace("low: 1 kg", "low: -1 kg")}),
        ("--samples 16", "t.yaml", {"t.yaml": TOLERANCES.replace("unbalances.0.mass", "unbalances.0.mas")}),
        ("--samples 16", "did you mean 'middle'", {"t.yaml": TOLERANCES.replace("loads: middle", "loads: midle")}),
    ],
    "study design d.yaml --profile p.yaml --population 8 --out out": [
        ("--evaluations 4", "--evaluations: 4 is less than the population"),
        ("", "no response 'Dq'", {"d.yaml": DESIGN.replace("Dx", "Dq")}),
        ("", "d.yaml:1: loads.0: 'midle' is not a load of machine", {"d.yaml": DESIGN.replace("[middle]", "[midle]")}),
        ("", "d.yaml:1: loads.1: 'back' is named twice", {"d.yaml": DESIGN.replace("[middle]", "[back, back]")}),
    ],
    "study next --out out": [
        ("--calibrated folder", "--calibrated: needs the vary file of the calibration; add --vary FILE"),
        ("--vary free.yaml --calibrated folder", "--calibrated: no such file 'folder/estimates.csv'"),
        ("--vary laundry", "--vary: only the laundry varies"),
        ("--for Dq", "--for: no response 'Dq'"),
        ("--vary free.yaml --candidates nosuch", "no shipped file of candidates of that name (known: usual)"),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.bodies.tubb: no link 'tubb' in the SDF (did you mean 'tub'?", candidate("number", "keys: [bodies.tubb.mass]", "1 g")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.accuracy: '0 g' is not a standard deviation above 0; write for example 2 % or 1 kg", candidate("number", "keys: [bodies.tub.mass]", "0 g")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.accuracy: '0 %' is not a standard deviation above 0", candidate("run", "load: middle", "0 %")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.load: no load 'midle' (did you mean 'middle'?", candidate("run", "load: midle", "5 %")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.sensors: no sensor 'Xq'", candidate("run", "load: middle, sensors: [Xq]", "5 %")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.component: no component 'damper_types.frction' (did you mean 'damper_types.friction'?", candidate("bench", "component: damper_types.frction, frequency: 1 Hz, amplitude: 1 mm", "5 %")),
        ("--vary free.yaml --candidates c.yaml", "candidates.m.axis: no axis 'radial'; allowed are x, y, z", candidate("bench", "component: gasket, axes: [radial], frequency: 1 Hz, amplitude: 1 mm", "5 %")),
        ("--vary free.yaml --candidates c.yaml", "c.yaml:1: candidates.m", candidate("weigh", "keys: [bodies.tub.mass]", "1 g")),
    ],
    "study cycle --out out": [("--load midle", "middle")],
    "gasket curves --out out": [
        ("nosuch", "nosuch: no such file, and no shipped gasket drawing"),
        ("folded --axial '0 mm'", "--axial: '0 mm': allowed is one number above 0"),
        ("folded --twist '3 mm'", "--twist"),
        ("folded --frequency '-1 Hz'", "--frequency: '-1 Hz': allowed is one number above 0"),
        ("folded --set gasket=null", "the machine has no gasket"),
    ],
    "study gasket-geometry --out out": [
        ("nosuch", "no shipped gasket drawing"),
        ("wall.yaml", "rubber.shore_a: needs shore_a", {"wall.yaml": WALL}),
        ("folded --set gasket=null", "the machine has no gasket"),
        ("folded --limit smallest_gap_mm=3", "'smallest_gap_mm': allowed are radial_N_per_mm"),
        ("folded --limit largest_stretch=x", "'largest_stretch=x': allowed is a number above 0"),
        ("bellows --folds 3", "with folds repeated 3 times"),
        ("folded --load nosuch", "neither a load of machine"),
    ],
    "study modes --out out": [
        ("--amplitude '0 mm'", "no amplitude"),
        ("--load midle", "middle"),
    ],
    "study response --out out": [
        ("--from '500 rpm'", "highest speed"),
        ("--rate '0 rpm/s'", "between 0.1 and 1000"),
        ("--load nothing", "nothing"),
    ],
    "record orders a.csv --out out": [
        ("", "speed_rpm", {"a.csv": "time_s,A\n0,1\n1,2\n"}),
        ("", "differ", {"a.csv": "time_s,speed_rpm,A [g]\n0,60,1\n0.1,60,2\n0.5,60,1\n"}),
        ("", "revolutions", {"a.csv": "time_s,speed_rpm,A [g]\n0,60,1\n0.1,60,2\n0.2,60,1\n"}),
        ("", "resolve no order", {"a.csv": "time [s],speed [rpm],A [g]\n" + "".join(f"{10 * k},1400,{k % 2}\n" for k in range(99))}),
        ("--unit 'A=furl'", "--unit: unit 'furl' is not known", {"a.csv": "time_s,speed_rpm,A\n0,60,1\n"}),
        ("--unit 'B=g'", "--unit: a.csv has no channel 'B'", {"a.csv": "time_s,speed_rpm,A\n0,60,1\n1,60,2\n"}),
    ],
}  # fmt: skip
COMMA = "the decimal sign is a point"
CASES |= {
    "": [
        ("machine check machine.yaml", COMMA, machine("gravity: 9,81 m/s^2")),
        ("spin --set 'gasket.damping_x=0,03 N s/mm'", COMMA),
        ("spin --profile p.csv", COMMA, {"p.csv": "time_s,speed_rpm\n0,0\n1,5,30\n"}),
        ("spin --profile p.csv", COMMA, {"p.csv": 'time_s,speed_rpm\n0,0\n"1,5",30\n'}),
        ("identify damper l.csv", COMMA, {"l.csv": "time [s];displacement [mm];force [N]\n0;0;0\n0,1;1,5;30\n"}),
        ("identify damper l.csv", COMMA, {"l.csv": "time [s],displacement [mm],force [N]\n0,0,0\n0,1,1,5,30\n"}),
        ("spin --measured m.csv", COMMA, {"m.csv": table(AMPLITUDES, ['middle,yes,exp,"1,5",1,1,1,1,1'])}),
    ],
}  # fmt: skip
ROWS = [
    (f"{command} {arguments}", message, *(files or [{}]))
    for command, rows in CASES.items()
    for arguments, message, *files in rows
]


@pytest.mark.parametrize(("words", "message", "files"), ROWS)
def test_bad_input_gets_one_message_and_nothing_is_written(wm_drake, words, message, files):
    for name, text in (FILES | files).items():
        Path(name).write_text(text, encoding="utf-8")
    before = {path: path.is_file() and path.read_bytes() for path in Path().rglob("*")}
    ended = wm_drake(words)
    assert (ended.code, ended.out) == (2, ""), ended.err
    assert len(ended.messages) == 1 or ended.err.startswith("Usage: ")  # typer's own, in a box
    assert message in ended.err
    assert max(map(len, ended.messages)) < 500
    assert {path: path.is_file() and path.read_bytes() for path in Path().rglob("*")} == before
