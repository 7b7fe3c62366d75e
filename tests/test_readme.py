"""README and the how-to pages are checked where a machine can: commands, snippets, machine files."""

import itertools
import shlex
import subprocess
from collections import Counter

import numpy as np
import pytest
import typer
import yaml
from documents import CHECKOUT, HOW_TO, README, blocks, commands, name_of
from drag_damper import DRAG_DAMPER
from pydrake.systems.framework import Diagram

import wm_drake as wm
from wm_drake.cli import app
from wm_drake.errors import LIBRARIES
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_component, load_machine, quantities
from wm_drake.parameters.candidates import load_candidates
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.parameters.limits import load_limits
from wm_drake.parameters.recorded_sensors import load_recorded_test
from wm_drake.parameters.variation import number_at
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibrate.parameter_map import parameter_map_of

PAGES = [README, *HOW_TO, CHECKOUT / "docs" / "reference" / "vary-file.md"]
SHORT = SpinProfile(time=(0.0, 6.0), speed=(0.0, 12.0))


def page(name):
    return CHECKOUT / "docs" / "how-to" / f"{name}.md"


def written(tmp_path, path, index=0):
    """Return the path of a file with one of a page's YAML blocks."""
    file = tmp_path / "example.yaml"
    file.write_text(blocks(path, "yaml")[index], encoding="utf-8")
    return file


def parsed(arguments):
    """Return the command that arguments call; raise its error if it refuses what follows its name."""
    command, context, rest = typer.main.get_command(app), None, list(arguments)
    while hasattr(command, "commands") and rest:
        settings = {"parent": context, "info_name": "wm-drake", **command.context_settings}
        context = type(command).context_class(command, **settings)
        _, command, rest = command.resolve_command(context, rest)
    if rest:
        command.make_context(command.name, rest, parent=context)
    return command


def mermaid(diagram: Diagram) -> str:
    """Return a Mermaid flow chart of the systems of a diagram and the signals between them."""
    systems = diagram.GetSystems()
    lines = ["flowchart LR"]
    for system in systems:
        kind = type(system).__name__
        lines.append(
            f'  {system.get_name()}["{system.get_name().replace("_", " ")}<br/><i>{kind}</i>"]'
        )
    arrows = []
    for (to_system, to_port), (from_system, from_port) in diagram.connection_map().items():
        port = from_system.get_output_port(from_port)
        into = to_system.get_input_port(to_port).get_name().replace("_", " ")
        label = (
            port.get_name().replace("_", " ") if port.get_name().startswith("generalized") else into
        )
        arrows.append(f"  {from_system.get_name()} -- {label} --> {to_system.get_name()}")
    return "\n".join(lines + sorted(arrows))


def test_the_picture_is_the_diagrams_own_graph(machine):
    (drawn,) = blocks(README, "mermaid")
    assert drawn == mermaid(machine.diagram)


@pytest.mark.parametrize(
    "line", sorted({line for path in PAGES for line in commands(path)}), ids=str
)
def test_every_command_of_the_pages_is_one(line):
    name, *arguments = shlex.split(line)
    assert name == "wm-drake"
    assert parsed(arguments).name in arguments


@pytest.mark.parametrize(
    "line",
    [
        "spin --lod middle",
        "spinn",
        "rig damper --component",
        "study gasket --trials many",
        "rig gasket -f '1 Hz'",
    ],
)
def test_a_planted_fault_in_a_command_is_found(line):
    with pytest.raises(Exception, match=r"No such|requires an argument|valid integer|Missing"):
        parsed(shlex.split(line))


@pytest.fixture
def short_machine(monkeypatch):
    """Let `wm.load_machine` return machines with a profile of some seconds."""
    monkeypatch.setattr(
        "wm_drake.parameters.load_machine",
        lambda name: load_machine(name).model_copy(update={"profile": SHORT}),
    )


@pytest.mark.usefixtures("short_machine")
@pytest.mark.parametrize("path", [path for path in PAGES if blocks(path, "python")], ids=name_of)
def test_the_python_snippets_run(path, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    names = {}
    monkeypatch.chdir(tmp_path)
    for code in blocks(path, "python"):
        exec(code.replace("trials=1000", "trials=140"), names)
    if path == page("drake-users"):
        assert names["displacement"].shape == (6, 51)
        assert names["linear"].C().shape[0] == 6
        assert abs(names["rpm"][0] - 60.0) < 1.0  # held by a PidController
        return
    if path == page("modes-and-response"):
        assert all(mode.damping_ratio > 0.0 for mode in names["result"].modes["sliding"])
        assert names["response"].amplitude.sel(sensor="Zf").size >= names["speeds"].size
        return
    if path == page("detect-unbalance"):
        assert names["found"].tables()["errors"]["estimate"].iloc[0] == "mass"
        assert [key for key, _ in itertools.groupby(names["steps"])] == [1, 0, 1, 2]
        return
    if path == README:
        assert np.abs(names["displacement"]).max() < 1e-3  # 21 rpm
        shares = names["shares"].set_index(["load", "response", "term"])
        assert shares.contribution_percent[("counter", "Fz", "K_Lz")] > 80.0
        assert (tmp_path / "gasket" / "report.html").is_file()
        return
    assert names["record"].sizes["time"] == round(SHORT.duration / 5e-3) + 1
    if path == page("batch"):
        table = names["table"]
        assert list(table.case.values[:2]) == ["0 % less", "5 % less"]
        assert len(set(table.gasket_force.sel(axis="x").values)) == 8
        alone = measure(simulate(names["machine"], names["worn"](35)))
        assert table.gasket_force.values[7] == pytest.approx(alone.gasket_force.values, rel=1e-9)


def test_ci_runs_the_commands_of_the_readme():
    """Both install what Drake needs first; nothing else than the README has the commands."""
    main, tests = (
        subprocess.run(
            [CHECKOUT / ".ci" / "readme", marker], capture_output=True, text=True, check=True
        ).stdout.splitlines()
        for marker in ("main", "tests")
    )
    assert [*main, *tests] == "\n".join(blocks(README, "bash")).splitlines()
    assert main[-1].endswith(".venv/bin/wm-drake study gasket")
    assert tests[-1].endswith(".venv/bin/pytest")
    for first, *_ in (main, tests):
        assert first.split()[-1] == LIBRARIES["libglib-2.0.so.0"]


def test_the_snippets_of_the_readme_are_short():
    drake, design = blocks(README, "python")
    assert len([line for line in drake.splitlines() if line.strip()]) <= 8
    assert len(design.splitlines()) <= 10


MACHINES = [  # page, index of the block, a number in it by key path
    (page("own-machine"), 0, "bodies.upper_counterweight.mass", 9.5),
    (page("own-machine"), 1, "spring_types.suspension.stiffness", None),
    (page("own-machine"), 2, "imperfections.residual_imbalance.mass", 0.02),
    (page("own-machine"), 3, "elements.left_buffer.loss", 0.4),
    (page("own-machine"), 4, "elements.shell_and_box.loss", None),
    (page("balancers"), 0, "elements.front_ring.fill", 0.6),
    (page("compliant-bearing"), 0, "imperfections.bearing.y", None),
    (page("compliant-bearing"), 1, "imperfections.bearing.clearance", 1e-4),
    (page("cycle"), 0, "loads.towels.unbalances.0.water.time_constant", 25.0),
    (page("detect-unbalance"), 0, "elements.monitor.turns", 2.0),
    (page("drive"), 0, "drive.belt_ratio", 12.0),
    (page("extend"), 0, "elements.slow.coefficient", 400.0),
    (page("floor"), 0, "cabinet.friction", 0.5),
    (page("floor"), 1, "cabinet.foot_type.vertical_stiffness", 150e3),
    (page("rubber"), 0, "gasket.dahl_force_y", 4.0),
]
OTHERS = [
    (page("accelerometers"), 0, load_recorded_test),
    (page("bench-to-machine"), 0, load_component),
    (page("calibrate"), 0, load_vary),
    (page("designs"), 0, load_vary),
    (page("gasket-drawing"), 0, load_gasket_drawing),
    (page("gasket-drawing"), 1, load_gasket_drawing),
    (page("measure-next"), 0, load_candidates),
    (page("tolerances"), 0, load_vary),
    (CHECKOUT / "docs" / "reference" / "vary-file.md", 0, load_vary),
    (page("tolerances"), 1, load_limits),
]


@pytest.mark.parametrize(("path", "index", "key", "value"), MACHINES)
def test_the_machines_of_the_pages_are_in_order(path, index, key, value, tmp_path, wm_drake):
    wm.register_element(DRAG_DAMPER)
    file = written(tmp_path, path, index)
    text = file.read_text(encoding="utf-8")
    if "extends:" not in text:  # a part of a file
        file.write_text(f"name: part\nextends: reference\n{text}")
    mine = load_machine(file)
    numbers = {name: number for name, number, _ in quantities(mine)}
    assert numbers[key] == pytest.approx(value) or value is None
    setup = build_machine(mine).set_up(mine.loads.get("towel", mine.loads["middle"]))
    assert max(abs(setup.residual)) < 1e-9
    assert all(spring.preload > 0.0 for spring in setup.springs.values())
    assert wm_drake("machine", "check", file).code == 0


@pytest.mark.parametrize(("path", "index", "load"), OTHERS)
def test_other_files_of_the_pages_are_read(path, index, load, tmp_path):
    assert load(written(tmp_path, path, index))


def test_every_yaml_block_is_one_of_those_above():
    counted = {path: len(blocks(path, "yaml")) for path in PAGES if blocks(path, "yaml")}
    read = Counter(path for path, *_ in [*MACHINES, *OTHERS])
    assert counted == read + Counter([page("calibrate")])  # the relation below


def test_the_example_of_a_free_file_fits_the_reference_machine(tmp_path, machine):
    parameter_map = parameter_map_of(machine, load_vary(written(tmp_path, page("calibrate"))))
    frames = parameter_map.parameters_at(parameter_map.expected).frames
    assert (
        frames["damper_left_housing"].position[0]
        == -frames["damper_right_rear_housing"].position[0]
        == -0.05
    )


def test_the_example_of_a_relation_is_that_of_a_ring(machine):
    free = load_vary(CHECKOUT / "analyses" / "reference_free.yaml")
    (text,) = blocks(page("calibrate"), "yaml")[1:]
    names = ("gasket_torsion", "gasket_radial")
    few = VaryFile.model_validate(
        {
            "vary": {name: free.vary[name] for name in names},
            "relations": yaml.safe_load(text)["relations"],
        }
    )
    parameter_map = parameter_map_of(machine, few)
    (relation,) = parameter_map.relations
    torsion, radial = 0.9 * 2.0 * 3000.0 * 0.18**2, 3000.0
    assert relation.at(np.array([[torsion, radial]])) == pytest.approx([0.9])


def test_the_free_file_of_the_calibration_fits_the_reference_machine(machine):
    free = load_vary(CHECKOUT / "analyses" / "reference_free.yaml")
    parameter_map = parameter_map_of(machine, free)
    made = parameter_map.parameters_at(parameter_map.start)
    tilt, axial = (
        number_at(made, f"gasket.{name}").nominal
        for name in ("rotational_stiffness_x", "stiffness_y")
    )
    assert 2.0 * tilt < axial * 0.18**2
