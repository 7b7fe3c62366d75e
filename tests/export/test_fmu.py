"""The FMU of a machine: what validators say, and that it computes what the engine computes."""

import pathlib
import shutil
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from typer.testing import CliRunner

import wm_drake as wm
from wm_drake.cli import app
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.export.fmu import real_time_factor
from wm_drake.export.options import FmuOptions
from wm_drake.model.scene import Scene
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.outputs import variables_of

fmpy = pytest.importorskip("fmpy", reason="headers and importer are FMPy's: install wm-drake[fmu]")
from fmpy.fmi1 import FMICallException  # noqa: E402

if not shutil.which("cc"):
    pytest.skip("no C compiler on this computer", allow_module_level=True)

STEP = 2.5e-3
PROFILE = SpinProfile(time=(0.0, 3.0, 4.0), speed=(0.0, 15.0, 15.0))


@pytest.fixture(scope="module")
def machine():
    return wm.build_machine(wm.load_machine("reference"))


@pytest.fixture(scope="module")
def record(machine):
    """Return what the engine computes: trajectory and variables."""
    setup = machine.set_up("middle")
    trajectory = run_compiled(setup, PROFILE, STEP, lambda _: None, integrator="runge_kutta")
    return trajectory, variables_of(setup, trajectory)


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI2", "FMI3"])
def fmu(request, machine, tmp_path_factory):
    path = tmp_path_factory.mktemp("fmu") / "machine.fmu"
    return wm.export_fmu(machine.parameters, "middle", path, FmuOptions(fmi=request.param)).path


def inputs(**more):
    """Return the motion of the drum through `PROFILE` as input signals."""
    rows = []
    for begin, end in ((0, 1), (1, 2)):
        length = PROFILE.time[end] - PROFILE.time[begin]
        rate = (PROFILE.speed[end] - PROFILE.speed[begin]) / length
        rows += [(PROFILE.time[k], PROFILE.speed[k], rate, *more.values()) for k in (begin, end)]
    names = ("time", "drum_speed", "drum_acceleration", *more)
    return np.array(rows, dtype=[(name, float) for name in names])


def simulated(path, outputs, kind="CoSimulation", interval=5e-3, **options):
    return fmpy.simulate_fmu(
        path,
        stop_time=PROFILE.duration,
        output_interval=interval,
        input=options.pop("signals", inputs()),
        output=outputs,
        fmi_type=kind,
        **options,
    )


def at(result, name, time):
    """Return the last value of an output at each time."""
    return result[name][np.searchsorted(result["time"], time + 1e-9) - 1]


@pytest.mark.slow
def test_validator_has_nothing_to_say(fmu):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu)) == []


@pytest.mark.slow
def test_library_needs_libc_and_libm_only(fmu, tmp_path):
    with zipfile.ZipFile(fmu) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".so"))
        library = archive.extract(name, tmp_path)
    needs = subprocess.run(["ldd", library], capture_output=True, text=True, check=True).stdout
    names = {line.split()[0].split("/")[-1].split(".")[0] for line in needs.splitlines()}
    assert names <= {"linux-vdso", "libm", "libc", "ld-linux-x86-64"}
    symbols = subprocess.run(
        ["nm", "-D", "--undefined-only", library], capture_output=True, text=True, check=True
    ).stdout
    assert not [word for word in ("Py", "numba", "NRT") if word in symbols]


@pytest.mark.parametrize(
    ("variable", "names", "size"),
    [
        ("displacement", [f"displacement.{s}" for s in ("Xr", "Yr", "Zr", "Xf", "Yf", "Zf")], 1e-3),
        ("cabinet_force", [f"cabinet_force.{axis}" for axis in "xyz"], 100.0),
        ("cabinet_moment", [f"cabinet_moment.{axis}" for axis in "xyz"], 10.0),
        ("bushing_force", [f"gasket_force.{axis}" for axis in "xyz"], 10.0),
        ("bushing_moment", [f"gasket_moment.{axis}" for axis in "xyz"], 0.1),
        ("drum_angle", ["drum_angle"], 1.0),
    ],
)
def test_run_equals_engine(fmu, record, variable, names, size):
    trajectory, variables = record
    result = simulated(fmu, names)
    expected = variables[variable][1].reshape(len(trajectory.time), -1)
    for column, name in enumerate(names):
        actual = at(result, name, trajectory.time)
        assert np.abs(actual - expected[:, column]).max() < 1e-9 * size
    assert np.abs(expected).max() > size


@pytest.mark.parametrize("sensor", ["Xr", "Yf", "Zr"])
def test_acceleration_is_the_second_derivative_of_displacement(fmu, sensor):
    names = [f"{kind}.{sensor}" for kind in ("displacement", "acceleration")]
    interval = 1e-3
    result = simulated(fmu, names, interval=interval)
    time = interval * np.arange(100, 2900)  # the rate of the speed jumps at 0 and 3 s
    displacement, acceleration = (at(result, name, time) for name in names)
    expected = np.diff(displacement, 2) / interval**2
    # dampers reverse their friction within some samples, where differences are coarse
    assert np.abs(expected - acceleration[1:-1]).max() < 3e-3 * np.abs(expected).max()


def test_gap_is_a_lower_bound_of_the_smallest_distance(fmu, record, machine):
    trajectory, _ = record
    setup = machine.set_up("middle")
    scene, poses = Scene(machine.parameters), trajectory.state[:, :6]
    bound = at(simulated(fmu, ["gap"]), "gap", trajectory.time)
    rows = range(0, len(poses), 40)
    distance = np.array(
        [
            scene.smallest_gap(trajectory.time[[k]], poses[[k]], setup.rest_pose).distance
            for k in rows
        ]
    )
    assert bound[0] == pytest.approx(distance[0], abs=2e-6)  # the accuracy of Drake's distance
    assert np.all(bound[rows] < distance + 2e-6)
    assert np.all(bound[rows] > distance - 1e-3)
    assert np.ptp(distance) > 2e-3


@pytest.mark.parametrize("interval", [1e-4, 1e-3, 1e-2])
def test_any_communication_step_gives_the_run(fmu, record, interval):
    trajectory, variables = record
    time, expected = trajectory.time[::2], variables["displacement"][1][::2, 0]
    actual = at(simulated(fmu, ["displacement.Xr"], interval=interval), "displacement.Xr", time)
    assert np.abs(actual - expected).max() < 1e-4 * np.abs(expected).max()


def test_model_exchange_agrees_with_engine(fmu, record):
    trajectory, variables = record
    result = simulated(fmu, ["displacement.Xr"], kind="ModelExchange", relative_tolerance=1e-6)
    expected = variables["displacement"][1][:, 0]
    actual = at(result, "displacement.Xr", trajectory.time)
    assert np.abs(actual - expected).max() < 1e-3 * np.abs(expected).max()


def test_parameters_and_unbalances_are_those_of_the_machine_file(fmu, machine):
    changed = wm.with_values(
        machine.parameters, {"gasket.damping_z": 60.0, "loads.middle.unbalances.0.mass": 0.6}
    )
    case = changed.loads["middle"].unbalances[0]
    setup = machine.set_up("middle", parameters=changed)
    trajectory = run_compiled(setup, PROFILE, STEP, lambda _: None, integrator="runge_kutta")
    expected = variables_of(setup, trajectory)["displacement"][1][:, 2]
    signals = inputs(**{"unbalance[1].mass": 0.6})
    result = simulated(
        fmu,
        ["displacement.Zr"],
        signals=signals,
        start_values={"gasket.damping_z": 60.0, "unbalance[1].phase": case.phase},
    )
    actual = at(result, "displacement.Zr", trajectory.time)
    assert np.abs(actual - expected).max() < 1e-12


def slave(path):
    """Return an instance of an FMU for co-simulation in initialization, and its references."""
    description = fmpy.read_model_description(path)
    kinds = {"2.0": fmpy.fmi2.FMU2Slave, "3.0": fmpy.fmi3.FMU3Slave}
    instance = kinds[description.fmiVersion](
        guid=description.guid,
        unzipDirectory=fmpy.extract(path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="machine",
    )
    instance.instantiate()
    references = {v.name: v.valueReference for v in description.modelVariables}
    if description.fmiVersion == "2.0":
        instance.setupExperiment(startTime=0.0)
        instance.get, instance.set = instance.getReal, instance.setReal
        instance.save, instance.restore = instance.getFMUstate, instance.setFMUstate
        instance.write, instance.read = instance.serializeFMUstate, instance.deSerializeFMUstate
    else:
        instance.get, instance.set = instance.getFloat64, instance.setFloat64
        instance.save, instance.restore = instance.getFMUState, instance.setFMUState
        instance.write = instance.serializeFMUState
        instance.read = instance.deserializeFMUState
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    return instance, references


def advanced(instance, references, begin, count):
    """Take steps of 5 ms; return the displacement after each."""
    values = []
    for k in range(begin, begin + count):
        names = ("drum_speed", "drum_acceleration")
        instance.set([references[name] for name in names], [0.025 * k, 5.0])
        instance.doStep(5e-3 * k, 5e-3)
        values += instance.get([references["displacement.Xr"]])
    return values


def configure(simulator):
    """Choose fixed steps of 0.5 ms of Drake's scheme of third order."""
    integrator = ResetIntegratorFromFlags(simulator, "runge_kutta3", 5e-4)
    integrator.set_fixed_step_mode(True)


@pytest.mark.parametrize("through_bytes", [False, True])
def test_saved_state_continues_bit_for_bit(fmu, through_bytes):
    instance, references = slave(fmu)
    advanced(instance, references, 0, 100)
    state = instance.save()
    if through_bytes:
        state = instance.read(instance.write(state))
    first = advanced(instance, references, 100, 50)
    instance.restore(state)
    assert advanced(instance, references, 100, 50) == first
    assert len(set(first)) == 50


def test_instances_do_not_share_anything(fmu):
    alone, references = slave(fmu)
    expected = advanced(alone, references, 0, 40)
    first, _ = slave(fmu)
    second, _ = slave(fmu)
    second.set([references["unbalance[1].mass"]], [5.0])
    both = [
        (advanced(first, references, k, 1)[0], advanced(second, references, k, 1)[0])
        for k in range(40)
    ]
    assert [one for one, _ in both] == expected
    assert both[-1][1] != expected[-1]


def test_threads_compute_what_one_computes(fmu):
    alone, references = slave(fmu)
    expected = advanced(alone, references, 0, 200)
    instances = [slave(fmu)[0] for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda instance: advanced(instance, references, 0, 200), instances))
    assert runs == [expected] * 4
    assert len(set(expected)) == 200


def test_unbalance_that_changes_in_a_run_is_that_of_drake(fmu, machine):
    """Both have 1.5 times the mass of the load from 1 s on; in Drake the bodies change."""
    instance, references = slave(fmu)
    advanced(instance, references, 0, 200)
    instance.set([references["unbalance[1].mass"]], [1.5])
    actual = np.array(advanced(instance, references, 200, 200))

    profile = SpinProfile(time=(0.0, 2.0), speed=(0.0, 10.0))
    setup = machine.set_up("middle", profile=profile)
    simulator = Simulator(machine.diagram, setup.context)
    configure(simulator)
    simulator.AdvanceTo(1.0)
    state = setup.context.get_continuous_state_vector().CopyToVector()
    heavy = wm.with_value(machine.parameters, "loads.middle.unbalances.0.mass", 1.5)
    machine.set_up("middle", context=setup.context, parameters=heavy, profile=profile)
    setup.context.SetContinuousState(state)
    expected = []
    for k in range(200):
        simulator.AdvanceTo(1.0 + 5e-3 * (k + 1))
        port = machine.outputs["displacement"]
        expected.append(port.Eval(port.get_system().GetMyContextFromRoot(setup.context))[0])
    assert np.abs(actual - expected).max() < 1e-3 * np.abs(expected).max()
    same = np.array(advanced(slave(fmu)[0], references, 0, 400)[200:])
    assert np.abs(actual - same).max() > 0.1 * np.abs(same).max()


def test_run_is_faster_than_real_time(fmu):
    assert real_time_factor(fmu) > 50.0  # 550 on an idle core


def test_value_out_of_range_is_refused(fmu):
    instance, references = slave(fmu)
    with pytest.raises(FMICallException):
        instance.set([references["unbalance[1].mass"]], [-1.0])
    assert instance.get([references["unbalance[1].mass"]]) == [1.0]


def run_to(instance, end):
    for k in range(round(end / 5e-3)):
        instance.doStep(5e-3 * k, 5e-3)


def test_run_that_diverges_is_an_error(fmu):
    instance, references = slave(fmu)
    instance.set([references["unbalance[1].mass"], references["drum_speed"]], [20.0, 200.0])
    with pytest.raises(FMICallException, match="DoStep"):
        run_to(instance, 10.0)


@pytest.mark.parametrize("fmi", [2, 3])
def test_sources_give_the_same_run(tmp_path, machine, fmi):
    path = tmp_path / "machine.fmu"
    wm.export_fmu(machine.parameters, "middle", path, FmuOptions(fmi=fmi, sources=True))
    expected = simulated(path, ["displacement.Xr"])["displacement.Xr"]
    folder = tmp_path / "fmu"
    files = fmpy.read_model_description(path).buildConfigurations[0].sourceFileSets[0].sourceFiles
    fmpy.extract(path, folder)
    (library,) = folder.glob("binaries/*/*")
    library.unlink()
    headers = pathlib.Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-shared", "-fPIC", "-O2", f"-I{headers}", *files, "-o", library, "-lm"]
    subprocess.run(command, check=True, cwd=folder / "sources")
    assert np.array_equal(simulated(folder, ["displacement.Xr"])["displacement.Xr"], expected)
    assert np.abs(expected).max() > 1e-3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--fmi", "1"], "there is no version 1; allowed are 2 and 3"),
        (["--input", "current"], "no input 'current'"),
        (["--platform", "linux"], "no platform 'linux'"),
        (["--load", "centre"], "no load 'centre'"),
        (["--step", "1"], "at most 0.01 s"),
        (["--set", "gasket.stiffness_x=-1 N/mm"], "gasket.stiffness_x"),
    ],
)
def test_bad_option_writes_nothing(tmp_path, arguments, message):
    out = tmp_path / "machine.fmu"
    result = CliRunner().invoke(app, ["export", "fmu", "--out", str(out), *arguments])
    assert isinstance(result.exception, InputError)
    assert message in str(result.exception)
    assert not list(tmp_path.iterdir())


def test_missing_compiler_is_one_clear_message(tmp_path, machine, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "ziglang", None)
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "ziglang" else fmpy.__spec__
    )
    with pytest.raises(InputError, match="no compiler for 'linux64'"):
        wm.export_fmu(machine.parameters, "middle", tmp_path / "machine.fmu")
    assert not list(tmp_path.iterdir())


def test_compiler_that_fails_leaves_the_old_file(tmp_path, machine, monkeypatch):
    out = tmp_path / "machine.fmu"
    out.write_text("old")
    monkeypatch.setattr("wm_drake.export.fmu._compiler", lambda _: ["/bin/false"])
    with pytest.raises(InputError, match="the compiler failed"):
        wm.export_fmu(machine.parameters, "middle", out)
    assert out.read_text() == "old"
