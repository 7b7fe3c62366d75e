"""A damper law is added in three places of the source: law function, class, registry entry."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import wm_drake
from wm_drake.model.bodies import SDF_FOLDER

PACKAGE, TESTS = Path(wm_drake.__file__).parent, Path(__file__).parents[1]

LAW = '''

@law
def relaxation_damper(rate, deformation, leak_damping, sponge_stiffness, guard):
    """Return tension and deformation rate of a spring in series with a dashpot, beside a guard spring.

        s = k delta,   s = c w,   tension = s + guard(delta)

    Args:
        rate: Rate of elongation v. [m/s]
        deformation: Deformation of the spring delta. [m]
        leak_damping: Dashpot [c]. [N s/m]
        sponge_stiffness: Spring [k]. [N/m]
        guard: Packed curve, as array and index. [m, N]
    """
    tension = sponge_stiffness * deformation
    return tension + stiffness_force(deformation, *guard), rate - tension / leak_damping
'''
CLASS = '''class RelaxationDamper(DamperNumbers):
    """A spring in series with a dashpot."""

    law: Literal["relaxation"]
    leak_damping: PositiveDamping
    sponge_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    guard: ForceTable


'''.replace("PositiveDamping", "Annotated[u.LinearDamping, Field(gt=0.0)]")
ENTRY = """    DamperLaw(
        number=17,
        parameters=RelaxationDamper,
        response=damper.relaxation_damper,
        equations="none: a test",
        unknowns={"leak_damping": "damping", "sponge_stiffness": (1e2, 1e5)},
    ),
"""
PLACES = (  # file, text before which the piece goes; "" for the end of the file
    ("laws/damper.py", "", LAW),
    ("parameters/damper_laws.py", "@dataclass(frozen=True)\nclass DamperLaw:", CLASS),
    ("parameters/damper_laws.py", "    DamperLaw(\n        number=0,", ENTRY),
)

SCRIPT = """
import json, sys
import numpy as np
sys.path[:0] = [TESTS, TESTS + "/engines"]
import wm_drake
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, with_value
from wm_drake.rigs import Harmonic, damper_bench, force_loops, measures_of
from wm_drake.parameters.loop_files import MeasuredLoop
from wm_drake.rigs.measured import measured_motion
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.identify.models import Given, damper_model
from wm_drake.studies.identify.problem import fit_problem
from both_engines import difference
from machines_of_each_kind import changed

assert wm_drake.__file__.startswith(ROOT), wm_drake.__file__
X = (-0.03, -0.01, 0.0, 0.01, 0.03)
numbers = {"law": "relaxation", "leak_damping": 300.0, "sponge_stiffness": 4000.0,
           "guard": {"displacement": X, "force": (-90.0, -10.0, 0.0, 10.0, 90.0)}}
parameters = changed(damper_types={"friction": numbers}, gasket=None)
machine = build_machine(parameters)
found = {"derivatives": difference(machine)}  # of the compiled engine and of the diagram

plain = with_value(parameters.damper_types["friction"], "guard",
                   {"displacement": (-1.0, 1.0), "force": (0.0, 0.0)})
motions = [Harmonic(f, 5e-3) for f in (0.5, 2.0, 6.0)]
found["stiffness"] = [measures_of(loop).dynamic_stiffness
                      for loop in force_loops(damper_bench(plain), motions)]
try:
    damper_bench(plain, 0.01)
except InputError as error:
    found["mass"] = str(error)

guard = {"displacement": tuple(5e-3 * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])),
         "force": (-60.0, -10.0, 0.0, 10.0, 60.0)}
planted = with_value(plain, "guard", guard)
loops = []
for motion, loop in zip(motions, force_loops(damper_bench(planted), motions)):
    time = np.concatenate([loop.time, loop.time[-1] + loop.time[1] + loop.time])[::20]
    twice = lambda values: np.tile(values, 2)[::20]
    loops.append(measured_motion(MeasuredLoop(
        f"{motion.frequency}", "", time, twice(loop.displacement), twice(loop.force), False)))
fit = identify(fit_problem(damper_model("relaxation", loops, Given(knots=2)), loops), starts=3)
found["fit"] = {estimate.name: estimate.value for estimate in fit.estimates}
try:
    damper_model("relax", loops)
except InputError as error:
    found["unknown"] = str(error)
try:
    changed(damper_types={"friction": numbers | {"law": "relax"}})
except ValueError as error:
    found["file"] = str(error)
print(json.dumps(found))
"""
RUNS = """
quick = with_value(parameters, "profile", {"time": (0.0, 2.0), "speed": (0.0, 9.0)})
load = next(iter(quick.loads))
peaks = [
    float(np.max(np.abs(wm_drake.measure(record).detergent_displacement)))
    for engine in ("compiled", "drake-accurate")
    for record in [wm_drake.simulate(build_machine(quick), load, engine=engine, step=1e-3)]
]
many = wm_drake.simulate_many(build_machine(quick), [wm_drake.case_of(quick, load)] * 3, step=1e-3)
sizes = np.max(np.abs(many.detergent_displacement.values), axis=-1)
print(json.dumps({"peaks": peaks, "many": sizes.tolist()}))
"""


@pytest.fixture(scope="module")
def with_new_law(tmp_path_factory):
    """Return a copy of the package with the law in it, and its environment."""
    root = tmp_path_factory.mktemp("with_new_law")
    shutil.copytree(PACKAGE, root / "wm_drake", ignore=shutil.ignore_patterns("__pycache__"))
    if not (root / "wm_drake" / "sdf").is_dir():
        shutil.copytree(SDF_FOLDER, root / "sdf")
    for file, before, piece in PLACES:
        path = root / "wm_drake" / file
        text = path.read_text()
        assert text.count(before) == 1 or not before
        path.write_text(text.replace(before, piece + before) if before else text + piece)
    return root, os.environ | {"PYTHONPATH": str(root), "COLUMNS": "200"}


def printed(with_new_law, script):
    """Return what a script prints last, in a process with the new law."""
    root, environment = with_new_law
    script = f"TESTS, ROOT = {str(TESTS)!r}, {str(root)!r}\n{script}"
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout.splitlines()[-1])


@pytest.mark.slow
def test_a_law_added_in_three_places_runs_everywhere(with_new_law):
    found = printed(with_new_law, SCRIPT)
    assert found["derivatives"] < 1e-10
    for frequency, stiffness in zip((0.5, 2.0, 6.0), found["stiffness"], strict=True):
        dashpot = 2j * 3.141592653589793 * frequency * 300.0
        assert stiffness == pytest.approx(abs(4000.0 * dashpot / (4000.0 + dashpot)), rel=1e-5)
    assert found["mass"] == (
        "sponge_mass: only the law mstv or free_stroke has a sponge that can have a mass on the bench"
    )
    fit = found["fit"]
    assert fit["leak_damping"] == pytest.approx(300.0, rel=0.02)
    assert fit["sponge_stiffness"] == pytest.approx(4000.0, rel=0.02)
    assert {name for name in fit if name.startswith("guard")} == {"guard.rise_1", "guard.rise_2"}
    assert "did you mean 'relaxation'?" in found["unknown"]
    assert "'relaxation'" in found["file"]


@pytest.mark.hours
def test_both_engines_and_lanes_run_an_added_law(with_new_law):
    """Compile whole engines anew, for half a minute; other tests hold derivatives and lanes alike."""
    found = printed(with_new_law, SCRIPT + RUNS)
    assert found["peaks"][0] > 1e-4  # m
    assert found["peaks"][0] == pytest.approx(found["peaks"][1], rel=1e-3)
    assert found["many"] == pytest.approx([found["peaks"][0]] * 3, rel=1e-9)


def test_help_names_an_added_law(with_new_law):
    root, environment = with_new_law
    code = "from wm_drake.cli import main; main()"
    ended = subprocess.run(
        [sys.executable, "-c", code, "identify", "damper", "--help"],
        cwd=root,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "relaxation, coulomb, stv," in ended.stdout
