"""Check the options of the study of a cycle, and run it."""

from pathlib import Path

from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, load_load, load_profile
from wm_drake.parameters.files import CYCLES_FOLDER
from wm_drake.parameters.text_files import is_file
from wm_drake.simulation.cases import Case
from wm_drake.studies.answer import Answer
from wm_drake.studies.cycle.options import CycleOptions
from wm_drake.studies.cycle.page import cycle_answer
from wm_drake.studies.cycle.study import parts_of, run_cycle
from wm_drake.studies.executor import Executor
from wm_drake.studies.study import Task

WET_LAUNDRY = CYCLES_FOLDER / "load_wet_laundry.yaml"
"""The shipped load that dries."""


class CycleTask(Task):
    """The study with checked options."""

    def __init__(self, options: CycleOptions, machine: Machine) -> None:
        """Read load and profile."""
        self.machine = machine
        name, load = _load(options.load, machine)
        self.case = Case(name, load, load_profile(options.profile))

    def run(self, executor: Executor) -> Answer:
        """Run the cycle."""
        cycle = run_cycle(self.machine, self.case)
        executor.steps.add(self.case.name, cycle.accuracy)
        parts = parts_of(cycle.course, self.case)
        return cycle_answer(self.machine.parameters, self.case, cycle, parts)


def _load(name: str, machine: Machine) -> tuple[str, Load]:
    """Return the name and the load of the option `--load`."""
    loads = machine.parameters.loads
    if not name:
        return "wet laundry", load_load(WET_LAUNDRY)
    if name in loads:
        return name, loads[name]
    if is_file(Path(name)):
        return Path(name).stem, load_load(Path(name))
    raise input_error(
        f"'{name}' is neither a load of machine '{machine.parameters.name}' nor a file"
        f"{nearest_names(name, loads)}",
        where="--load",
    )
