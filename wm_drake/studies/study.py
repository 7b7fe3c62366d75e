"""Declare a study once: its options, its work, and what its result shows.

Everything else follows from the declaration: the command `wm-drake study NAME` with its help, the
Python call `wm_drake.run_study(NAME, ...)`, the form of the studio and the manual's reference. The
driver `wm_drake.studies.run` does the rest for every study: it loads, changes and builds the
machine, warns of what no fixed step resolves, opens the ledger, runs cases on all cores or on a
cluster with the step and the integrator of the machine, resumes, shows progress, ends on Ctrl-C,
and writes the result folder, the JSON, the terminal tables, the page and its figures.

A study has four parts, as in `studies/drive`:

    options.py   class DriveOptions(Options) and DRIVE = Study(...), which `SHIPPED` below lists.
                 It is imported for `--help`, so it must not import Drake, pandas, scipy or
                 plotting; `imported` names the task.
    study.py     the computation: functions that return labelled datasets, whose variables carry
                 their quantities (`wm_drake.report.quantity`).
    page.py      what is shown: a function that returns an `Answer` (`wm_drake.studies.answer`).
                 Files, JSON, terminal, page and notebook follow from it.
    task.py      class DriveTask(Task): checks the options and runs.

Each imports only those above it.

A task gets an `Executor` and makes an `Experiment` with it (`wm_drake.studies.experiment`), which
it calls as often as it needs: once for a plain study, many times for an adaptive one. So optimisers
of libraries and bisections are written as plain functions, and tests make up the runs.
"""

import functools
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field, create_model

from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.registry import Registry
from wm_drake.studies.blocks import blocks_of

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.answer import Answer
    from wm_drake.studies.executor import Executor


def option(default: Any, help_text: str, metavar: str = "", flag: str = "", **limits: Any) -> Any:
    """Return a field of an options model.

    The type of the field decides the form on the command line: `bool` is a flag, `tuple[str, ...]`
    a repeatable option.

    Args:
        default: Default value; ... if the user must give one.
        help_text: One sentence or a few; for the help, the manual and the studio.
        metavar: What a value is, such as NAME or FILE.
        flag: Option name, or several separated by blanks; by default made from the name of the
            field. "argument" makes it a positional argument.
        limits: Limits of pydantic, such as `ge` and `le`.
    """
    extra = {"metavar": metavar, "flag": flag}
    shown: dict[str, Any] = {name: text for name, text in extra.items() if text}
    return Field(default, description=help_text, json_schema_extra=shown, **limits)


class OptionModel(BaseModel):
    """Options of one kind, checked when they are set."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Options(OptionModel):
    """Options of all studies: the machine, and changes of its numbers."""

    machine: str = option("reference", "Name of a shipped machine, or machine file.", "NAME|FILE")
    sets: tuple[str, ...] = option(
        (),
        "Change a number of the machine file: gasket.stiffness_x='5 N/mm'; null removes an "
        "element: dampers.left=null. A symbol of the pages sets its numbers together: C_L='80 %'. "
        "Repeatable.",
        "KEY=VALUE",
        "--set",
    )


PROFILE: Any = option(
    None, "Spin profile, YAML or CSV (time_s, speed_rpm). Default: that of the machine.", "FILE"
)
LOADS: Any = option(
    (), "Load of the machine, or load file. Repeatable. Default: all loads.", "NAME|FILE"
)
MEASURED: Any = option(
    (),
    "Measured amplitudes to compare with: load, gasket, source, and a column per sensor in mm. "
    "Repeatable. Default: those of the machine file, for its own numbers, loads and profile.",
    "CSV",
)
ENGINE: Any = option(
    DEFAULT_ENGINE,
    "Engine that integrates the motion: compiled, or drake (the reference, seconds a run).",
    "NAME",
)
SEED: Any = option(0, "Seed of all random numbers.", "N", ge=0, le=2**32 - 1)


class Task(ABC):
    """A study with checked options, ready to run."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Return what determines the runs beside the machine, by short names.

        Texts are shown if a ledger belongs to another study; other values are shown by a hash. The
        number of runs should not be among them, so that a larger study continues a smaller one.
        """
        return {}

    @abstractmethod
    def run(self, executor: "Executor") -> "Answer":
        """Run the study; `executor.simulate` runs cases and returns the table of their measures."""


def imported(place: str) -> "Callable[..., Any]":
    """Return a function or class that is imported when it is called for the first time.

    Args:
        place: Module and name, such as "wm_drake.studies.drive.study:DriveTask".
    """
    return lambda *arguments: pkgutil.resolve_name(place)(*arguments)


@dataclass(frozen=True)
class Study:
    """Declaration of a study.

    Attributes:
        name: Name of the command and of the Python call.
        about: One line of help.
        begin: Called with the options and the built machine, which the driver has checked; returns
            the task. Mostly the class of the task, by `imported`. If the option `machine` is
            repeatable, it gets all machines. Whatever is wrong with the input raises an
            `InputError` here, before any work.
        quick: Options of `--quick`: small sizes, for a first look and for tests.
        has_runs: Whether the task has runs or other values that a ledger keeps. If so, the command
            has the options `--workers`, `--cluster` and `--resume`, and the folder a ledger.
        has_cluster: Whether the runs can be computed on a cluster: all by `Executor.simulate`.
        adapt: Change of a machine by the options of the study, before the options `--set`.
        group: Group of the command; "" for a command of its own.
        has_machine: Whether the driver loads, checks and builds the machine. If not, `begin` gets
            the options only: a study of a component finds it by them.
        folder: Default result folder; made from the name if empty.
    """

    name: str
    about: str
    options: type[OptionModel]
    begin: "Callable[..., Task]"
    quick: Mapping[str, Any] = field(default_factory=dict)
    has_runs: bool = True
    adapt: "Callable[[MachineParameters, Any], MachineParameters]" = lambda machine, _: machine
    has_cluster: bool = True
    group: str = "study"
    has_machine: bool = True
    folder: str = ""

    @functools.cached_property
    def all_options(self) -> type[OptionModel]:
        """Return the options with those of the blocks that packages add to the page."""
        added: dict[str, Any] = {
            k: v for block in blocks_of(self.command) for k, v in block.options.items()
        }
        if not added:
            return self.options
        return create_model(self.options.__name__, __base__=self.options, **added)

    @property
    def command(self) -> str:
        """Words of the command after the program's name."""
        return f"{self.group} {self.name}".strip()

    @property
    def folder_owner(self) -> str:
        """Command whose results a folder holds; those of `rig` or `identify` share one folder."""
        return self.group if self.group and self.group != "study" else self.command


SHIPPED = (
    "calibrate.options:CALIBRATE",
    "cycle.options:CYCLE",
    "drive.options:DRIVE",
    "gasket.options:GASKET",
    "gasket_damping.options:GASKET_DAMPING",
    "modes.options:MODES",
    "response.options:RESPONSE",
    "spin.options:SPIN",
    "spin_cycle.options:SPIN_CYCLE",
    "spin_identify.options:SPIN_IDENTIFY",
    "tolerance.options:TOLERANCE",
    "verdict.options:VERDICT",
)
"""Studies of the core: module below `wm_drake.studies`, and name."""

STUDIES: Registry[Study] = Registry(
    "study", "wm_drake.studies", [f"wm_drake.studies.{place}" for place in SHIPPED]
)
"""Studies by name."""


def register_study(study: Study) -> Study:
    """Add a study, and return it; see `wm_drake.studies.study` for its parts.

    Raises:
        ValueError: another study has this name.

    Example:
        The same declaration may be registered twice.

        >>> import wm_drake as wm
        >>> from wm_drake.studies.drive.options import DRIVE
        >>> wm.register_study(DRIVE).name
        'drive'
    """
    return STUDIES.register(study)
