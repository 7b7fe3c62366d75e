"""Task of the command `wm-drake spin`: one machine, or a comparison of several variants."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from wm_drake.errors import check_known, input_error, shortened
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import ENGINES
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import selected_cases
from wm_drake.studies.spin.options import MOST_VARIANTS, SpinOptions
from wm_drake.studies.spin.page import Files, spin_answer
from wm_drake.studies.spin.study import ComparedCases, SpinRuns, natural_modes_of, run_spin
from wm_drake.studies.study import Task

LONGEST_FILE_PART = 60
"""Largest number of characters of a variant in the name of a file."""


@dataclass(frozen=True)
class _Planned:
    """A variant that is not yet run."""

    name: str
    machine: Machine
    cases: list[Case]


class SpinTask(Task):
    """Spin runs of one machine, or of variants that are compared."""

    def __init__(self, options: SpinOptions, *machines: Machine) -> None:
        """Check the options."""
        self.options = options
        self.engine = options.engine
        check_known(self.engine, ENGINES, f"unknown engine '{self.engine}'", where="--engine")
        self._check_variants(machines)
        parameters = [machine.parameters for machine in machines]
        loads = list(options.load) or (_common_loads(parameters) if len(machines) > 1 else [])
        gaskets = (False, True) if options.compare_gasket else (not options.no_gasket,)
        self.planned = [
            _Planned(
                self._name(machine.parameters, gasket),
                machine,
                selected_cases(machine.parameters, loads, gasket, options.profile),
            )
            for machine in machines
            for gasket in gaskets
        ]

    def _check_variants(self, machines: Sequence[Machine]) -> None:
        """Raise an InputError if the machines or variants cannot be compared."""
        options = self.options
        for name in options.machine:
            if options.machine.count(name) > 1:
                raise input_error(f"'{name}' is given twice", where="--machine")
        if options.no_gasket and options.compare_gasket:
            raise input_error("excludes --no-gasket; give one of them", where="--compare-gasket")
        count = len(machines) * (2 if options.compare_gasket else 1)
        if count > MOST_VARIANTS:
            raise input_error(
                f"{count} machines or variants are too many for one page; at most {MOST_VARIANTS} "
                "can be compared",
                where="--machine",
            )
        if len(machines) > 1:
            from wm_drake.studies.spin.comparison import check_comparable

            check_comparable([machine.parameters for machine in machines], "--machine")
        for machine in machines if options.compare_gasket else ():
            if machine.parameters.gasket is None:
                name = machine.parameters.name
                raise input_error(f"machine '{name}' has no gasket", where="--compare-gasket")

    def _name(self, parameters: MachineParameters, gasket: bool) -> str:
        """Return the name of a variant: that of its machine, or what it does with the gasket."""
        machine = shortened(parameters.name, LONGEST_FILE_PART)
        words = "with gasket" if gasket else "without gasket"
        if not self.options.compare_gasket:
            return machine
        return words if len(self.options.machine) == 1 else f"{machine}, {words}"

    def run(self, executor: Executor) -> Answer:
        """Run all cases of all variants."""
        is_one, options = len(self.planned) == 1, self.options
        is_changed = options.sets or options.drive
        comparison = ComparedCases.NONE if is_changed else ComparedCases.AS_MEASURED
        comparison = ComparedCases.ALL if options.measured else comparison
        names = [
            case.name if is_one else f"{planned.name}: {case.name}"
            for planned in self.planned
            for case in planned.cases
        ]
        variants, finished = dict[str, SpinRuns](), 0
        with executor.fractions(names) as progress:
            for planned in self.planned:

                def of_all(index: int, fraction: float, before: int = finished) -> None:
                    progress(before + index, fraction)

                variants[planned.name] = run_spin(
                    planned.machine,
                    planned.cases,
                    self.engine,
                    progress=of_all,
                    comparison=comparison,
                )
                for result in variants[planned.name].results:
                    if result.accuracy is not None:
                        name = result.case.name if is_one else f"{planned.name}: {result.case.name}"
                        executor.steps.add(name, result.accuracy)
                finished += len(planned.cases)
        return self._answer(variants)

    def _answer(self, variants: Mapping[str, SpinRuns]) -> Answer:
        """Return the answer of one machine, or of the comparison of several variants."""
        options, names = self.options, list(variants)
        files = Files(options.replay, options.detail, not options.no_records)
        if len(variants) == 1:
            planned, runs = self.planned[0], variants[names[0]]
            modes = natural_modes_of(planned.machine, planned.cases[0])
            return spin_answer(runs, modes, files)
        from wm_drake.studies.spin.comparison import comparison_answer  # most runs have one machine

        references = dict.fromkeys(names, names[0])
        if options.compare_gasket:  # each machine without gasket, then with it
            references = {name: names[place - place % 2] for place, name in enumerate(names)}
        parts = zip(names, file_parts(names), strict=True)
        of_variants = {name: replace(files, part=part) for name, part in parts}
        return comparison_answer(variants, references, of_variants)


def file_parts(names: Sequence[str]) -> list[str]:
    """Return parts of file names for variants: letters, digits and `_ . -` only, all different."""
    parts: list[str] = []
    for index, name in enumerate(names, start=1):
        part = re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("_.")[:LONGEST_FILE_PART]
        taken = {known.lower() for known in parts}  # some file systems ignore case
        parts.append(part if part and part.lower() not in taken else f"{part}_{index}".strip("_"))
    return parts


def _common_loads(machines: Sequence[MachineParameters]) -> list[str]:
    """Return the loads that all machines have."""
    common = [name for name in machines[0].loads if all(name in m.loads for m in machines)]
    if not common:
        loads = "; ".join(f"'{m.name}' has {', '.join(m.loads)}" for m in machines)
        raise input_error(
            f"the machines have no load of the same name: {loads}; name a load file with --load",
            where="--machine",
        )
    return common
