"""Imports read from the source: each room imports only rooms before it, and none runs in circles.

Imports inside functions and those for annotations count too.
"""

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import wm_drake
from wm_drake.registry import edge
from wm_drake.studies.study import SHIPPED, Study

PACKAGE = Path(wm_drake.__file__).parent
ORDER = (
    {"errors"},
    {"registry", "written_files"},
    {"compiler"},
    {"laws"},
    {"parameters"},
    {"solid"},
    {"elements"},
    {"systems"},
    {"model"},
    {"engines"},
    {"simulation"},
    {"export"},
    {"batch"},
    {"rigs"},
    {"report"},
    {"live"},
    {"studies"},
    {"studio"},
    {"cli"},
    {"__main__"},
)
LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}
DRAWING = {"page", "figures", "tables", "words"}
"""Modules of a study that may import a plotting library."""
PARTS = ("options", "study", "page", "task")
"""Parts of a study: each imports those before it only."""
# laws do without much more
WITHOUT_DRAKE = {"registry", "written_files", "errors", "compiler", "parameters", "solid"}
WITHOUT_DRAKE |= {"elements", "rigs", "cli"}


def imported(name, source, is_package=False):
    """Return full names of what a module imports, anywhere in it; `from a import b` gives a.b."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = name.split(".") if is_package else name.split(".")[:-1]
            base = parents[: len(parents) - node.level + 1] if node.level else []
            yield from (
                ".".join([*base, *filter(None, [node.module]), alias.name]) for alias in node.names
            )


def faults(name, source, is_package=False):
    """Return a text for each wrong import of a module."""
    room = name.split(".")[1]
    if room not in LEVEL:
        return [f"{name}: room '{room}' has no place in the order"]
    reasons = {target: _reason(name, target) for target in imported(name, source, is_package)}
    return [f"{name} imports {target}: {why}" for target, why in reasons.items() if why]


def _reason(name, target):
    """Return why a module must not import a target, or ""."""
    top, *below = target.split(".")
    room, *places = name.split(".")[1:]
    if top == "wm_drake":
        other = below[0] if below else ""
        if other != room and LEVEL.get(other, len(ORDER)) >= LEVEL[room]:
            return "not a room before it"
    if top in ("analyses", "tests", "conftest"):
        return "no part of the package"
    if top == "jinja2" and room not in ("report", "written_files"):
        return "only report and written files may"
    if top == "matplotlib" and not _draws(room, places):
        return "only report and pages of studies may"
    if top == "pydrake" and room in WITHOUT_DRAKE:
        return "this room does without Drake"
    if (
        room == "laws"
        and top not in {"numpy", "numba", "llvmlite", *sys.stdlib_module_names}
        and not target.startswith(("wm_drake.laws", "wm_drake.compiler"))
    ):
        return "laws need numpy and the compiler only"
    return ""


def circle(sources):
    """Return names of modules that import each other in a circle, or an empty list.

    Args:
        sources: Names and sources of all modules, and whether each is a package.
    """
    known = {name for name, _, _ in sources}
    imports = {
        name: {_module(target, known) for target in imported(name, source, is_package)}
        - {name, "", "wm_drake"}
        for name, source, is_package in sources
    }
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def _module(target, known):
    """Return the module that a full name is or is in, or ""."""
    while target and target not in known:
        target = target.rpartition(".")[0]
    return target


def parts_backwards(name, source):
    """Return what a part of a study imports of the parts after it."""
    folder, _, part = name.rpartition(".")
    later = {f"{folder}.{other}" for other in PARTS[PARTS.index(part) + 1 :]}
    return [
        f"{name} imports {target}"
        for target in imported(name, source)
        if target in later or target.rpartition(".")[0] in later
    ]


def _draws(room, places):
    return room == "report" or (room == "studies" and places[-1] in DRAWING)


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        if path.name == "__init__.py":
            yield ".".join(parts[:-1]), path.read_text(encoding="utf-8"), True
        else:
            yield ".".join(parts), path.read_text(encoding="utf-8"), False


def test_every_room_of_the_order_exists():
    rooms = {name.split(".")[1] for name, _, _ in modules() if name != "wm_drake"}
    assert set(LEVEL) <= rooms


def test_imports_point_upwards():
    assert [
        fault for module in modules() if module[0] != "wm_drake" for fault in faults(*module)
    ] == []


def is_edge(name):
    """Return whether a full name is one of the edge, see `wm_drake/edge.ini`."""
    return any(f"{name}.".startswith(f"{module}.") for module in edge("modules"))


def test_the_core_imports_nothing_of_the_edge():
    known = [name for name, _, _ in modules()]
    assert all(module in known for module in edge("modules"))
    assert [
        f"{name} imports {target}"
        for name, source, is_package in modules()
        if not is_edge(name)
        for target in imported(name, source, is_package)
        if is_edge(target)
    ] == []


def test_the_core_registers_nothing_of_the_edge():
    assert not any(is_edge(f"wm_drake.studies.{place.partition(':')[0]}") for place in SHIPPED)
    places = [
        place
        for group in ("elements", "studies", "blocks")
        for place in edge(f"wm_drake.{group}").values()
    ]
    assert len(places) >= 11
    assert all(is_edge(place.partition(":")[0]) for place in places)


def test_no_modules_import_each_other_in_a_circle():
    assert circle([*modules()]) == []


def test_parts_of_a_study_import_earlier_ones_only():
    assert [
        fault
        for name, source, _ in modules()
        if name.startswith("wm_drake.studies.") and name.rpartition(".")[2] in PARTS
        if name != "wm_drake.studies.study"
        for fault in parts_backwards(name, source)
    ] == []


def test_folder_of_a_study_has_the_name_of_its_command():
    for path in sorted((PACKAGE / "studies").glob("*/options.py")):
        folder = path.parent.name
        declared = vars(import_module(f"wm_drake.studies.{folder}.options")).values()
        many = (value if isinstance(value, tuple) else (value,) for value in declared)
        studies = [one for some in many for one in some if isinstance(one, Study)]
        assert studies, folder
        for study in studies:
            name = study.name.replace("-", "_")
            assert folder in (name, study.group, f"{study.group}_{name}")


def test_classes_of_a_study_begin_with_its_name():
    """Those of options and tasks: who knows the command finds them."""
    for name, source, is_package in modules():
        if not name.startswith("wm_drake.studies.") or name.count(".") != 3 or is_package:
            continue
        study = name.split(".")[2].title().replace("_", "")
        for node in ast.parse(source).body:
            if isinstance(node, ast.ClassDef):
                bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
                if any(base.endswith(("Options", "Task")) for base in bases):
                    assert node.name.startswith(study), name


@pytest.mark.parametrize("at", ["{}", "def f():\n    {}", "if TYPE_CHECKING:\n    {}"])
def test_planted_circle_is_found(at):
    back = at.format("from wm_drake.studies.spin.study import X")
    sources = [
        ("wm_drake.studies.spin.study", "from wm_drake.studies.spin import page", False),
        ("wm_drake.studies.spin.page", "from wm_drake.studies.spin.figures import Y", False),
        ("wm_drake.studies.spin.figures", back, False),
    ]
    assert len(set(circle(sources))) == 3
    assert circle(sources[:2]) == []


def test_planted_step_backwards_is_found():
    source = "def f():\n    from wm_drake.studies.spin.task import SpinTask"
    assert len(parts_backwards("wm_drake.studies.spin.page", source)) == 1
    assert parts_backwards("wm_drake.studies.spin.task", source) == []


def test_package_itself_imports_no_room_until_asked():
    (source,) = (source for name, source, _ in modules() if name == "wm_drake")
    targets = imported("wm_drake", source, is_package=True)
    rooms = {target for target in targets if not target.startswith("wm_drake.errors.")}
    assert {target.split(".")[0] for target in rooms} <= sys.stdlib_module_names


def test_no_room_imports_by_a_name_made_at_run_time():
    hidden = ("import_module", "__import__")
    assert [
        name
        for name, source, _ in modules()
        if name != "wm_drake" and any(word in source for word in hidden)
    ] == []


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("wm_drake.parameters.units", "from wm_drake.systems.element import X"),
        ("wm_drake.parameters.units", "from wm_drake import systems"),
        ("wm_drake.parameters.units", "from wm_drake import *"),
        ("wm_drake.parameters.units", "from ..systems import element"),
        ("wm_drake.parameters.units", "import wm_drake"),
        ("wm_drake.parameters.units", "import wm_drake.model.machine as m"),
        ("wm_drake.parameters.units", "from pydrake.math import RigidTransform"),
        ("wm_drake.errors", "from wm_drake.parameters import units"),
        ("wm_drake.laws.friction", "import pydrake"),
        ("wm_drake.laws.friction", "def f():\n    from pydrake.autodiffutils import AutoDiffXd"),
        ("wm_drake.laws.friction", "import scipy.interpolate"),
        ("wm_drake.laws.friction", "from wm_drake.errors import InputError"),
        ("wm_drake.model.scene", "from wm_drake.engines.drake import run_drake"),
        ("wm_drake.simulation.runs", "from wm_drake import batch"),
        ("wm_drake.studies.machine_show.description", "import matplotlib.pyplot as plt"),
        ("wm_drake.cli", "def f():\n    import matplotlib"),
        ("wm_drake.cli", "from tests.conftest import wm_drake"),
        ("wm_drake.studies.spin.study", "import analyses.run"),
        ("wm_drake.studies.spin.study", "try:\n    import wm_drake.cli\nexcept ImportError:\n    pass"),
        ("wm_drake.cellar", "import numpy"),
    ],
)  # fmt: skip
def test_planted_fault_is_found(name, source):
    assert len(faults(name, source)) == 1


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("wm_drake.systems.element", "from wm_drake.parameters import units\nfrom wm_drake.laws import table\nimport pydrake"),
        ("wm_drake.parameters.units", "from .elements import Frozen\nfrom ..errors import InputError\nimport pint"),
        ("wm_drake.report.figure", "import matplotlib\nfrom wm_drake.simulation.measures import measure"),
        ("wm_drake.laws.friction", "import numba, numpy, functools\nfrom wm_drake.compiler.compilation import law"),
    ],
)  # fmt: skip
def test_good_imports_pass(name, source):
    assert faults(name, source) == []
