"""simulate_remembered: run the cases whose results are not in a ledger yet, and store them."""

import functools
import hashlib
import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import xarray as xr

from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of
from wm_drake.batch.many import SimulationInterrupted, run_cases
from wm_drake.batch.run_table import RunTable
from wm_drake.batch.runs import BatchOptions, RunResult
from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.model.bodies import sdf_path
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import versions
from wm_drake.simulation.steps import checked_step

_ROOMS_AFTER = ("cli", "batch/ledger.py", "report", "rigs", "studies")
"""Parts of the package that do not influence the result of a run."""

_EXCLUDED = {"name", "about", "measured", "published", "sources", "loads", "profile", "model"}
"""Fields of a machine that do not influence a run, or that have a part of the key of their own."""


@functools.cache
def sources_version() -> str:
    """Return a hash of the program that computes a run: the sources and the library versions."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(repr(sorted(versions().items())).encode())
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root)
        if not str(name.as_posix()).startswith(_ROOMS_AFTER):
            digest.update(f"{name}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def model_version(parameters: MachineParameters) -> str:
    """Return a hash of the SDF file of a machine."""
    return hashlib.sha256(sdf_path(parameters.model).read_bytes()).hexdigest()[:16]


def run_keys(
    parameters: MachineParameters,
    cases: Iterable[Case],
    *,
    measures: Iterable[str],
    step: float | None = None,
    engine: str = DEFAULT_ENGINE,
) -> Iterator[str]:
    """Yield the key of each case in a ledger: a hash of all that determines the result.

    This includes parameters, load, profile, gasket, SDF file, step size, engine, measures, sources
    and library versions. The name of the case is not included.

    Args:
        parameters: Machine of the cases that have no parameters of their own.
        cases: Cases.
        measures: Names of measures, keys of `wm_drake.simulation.measures.MEASURES`.
        step: Step size; None for that of the machine. [s]
        engine: Name of the engine.

    Raises:
        InputError: the step size does not divide the output period.
    """
    common: dict[str, object] = {
        "model": model_version(parameters),
        "sources": sources_version(),
        "engine": engine,
    }
    common |= {"step": checked_step(parameters, step), "integrator": parameters.integrator}
    common |= {"measures": sorted(set(measures))}
    last, numbers = None, ""
    for case in cases:
        changed = case.parameters or parameters
        if changed is not last:  # loads of one machine follow each other
            last, numbers = changed, changed.model_dump_json(exclude=_EXCLUDED)
            if changed.model != parameters.model:
                numbers += changed.model
        yield key_of(
            **common, numbers=numbers, load=case.load, profile=case.profile, gasket=case.gasket
        )


def simulate_remembered(
    machine: Machine,
    cases: Iterable[Case],
    ledger: Ledger,
    *,
    run: Callable[..., list[str] | None] = run_cases,
    progress: Callable[[int], None] = lambda done: None,
    **chosen: Any,
) -> xr.Dataset:
    """Run the cases whose results are not in a ledger and return the table of all cases.

    The table equals that of `simulate_many`. Results are stored in the ledger when a run is
    finished, so an interruption or an error loses none of them.

    Args:
        machine: A built machine.
        cases: Cases to run. They are taken one by one as needed.
        ledger: An open ledger.
        run: Function that runs cases, with the first arguments of `run_cases`.
        progress: Called with the number of cases that have a result.
        chosen: Fields of `BatchOptions`; the measures are by default "extremes".

    Raises:
        InputError: a case or an argument is wrong.
        SimulationInterrupted: Ctrl-C was pressed.
        LedgerError: the ledger cannot be written to, or it is damaged.
    """
    measures = tuple(dict.fromkeys(chosen.pop("measures", ("extremes",))))
    options = BatchOptions(measures, **chosen)
    table = RunTable(machine.parameters, options.measures)
    running: dict[int, tuple[int, str]] = {}  # number and key of each case that is run
    order, done = itertools.count(), 0

    def missing() -> Iterator[Case]:
        nonlocal done
        for number, (case, key) in enumerate(keyed(machine.parameters, cases, options)):
            if key in ledger:
                result = ledger.get(key)
                table.put(number, case.name, result.values, result.note)
                done += 1
                progress(done)
            else:
                running[next(order)] = number, key
                yield case

    def store(runs: list[RunResult]) -> None:
        nonlocal done
        places = [running.pop(ended.number) for ended in runs]
        # runs that end together are stored together
        ledger.put_all(
            {
                key: LedgerEntry(r.stored_values, r.diverged)
                for (_, key), r in zip(places, runs, strict=True)
            }
        )
        for (number, _), ended in zip(places, runs, strict=True):
            table.put(number, ended.case.name, ended.stored_values, ended.diverged)
            done += 1
            progress(done)

    try:
        pairs = run(machine, missing(), options, store)
    except KeyboardInterrupt:
        raise SimulationInterrupted(table.dataset()) from None
    return table.dataset(pairs)


def keyed(
    parameters: MachineParameters, cases: Iterable[Case], options: BatchOptions
) -> Iterator[tuple[Case, str]]:
    """Yield each case with its key, as `run_keys`; one case at a time is taken."""
    given, hashed = itertools.tee(cases)
    keys = run_keys(
        parameters, hashed, measures=options.measures, step=options.step, engine=options.engine
    )
    return zip(given, keys, strict=True)
