"""simulate_remembered: run the cases whose results are not in a ledger yet, and store them."""

import functools
import hashlib
import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import xarray as xr

from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of
from wm_drake.batch.many import as_table, simulate_many
from wm_drake.batch.runs import RunResult
from wm_drake.model.bodies import sdf_path
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.records import versions
from wm_drake.simulation.steps import checked_step

_ROOMS_AFTER = ("cli", "batch/ledger.py", "report", "rigs", "studies")
"""Parts of the package that do not influence the result of a run."""

_EXCLUDED = {"name", "about", "measured", "published", "sources", "loads", "profile"}
"""Fields of a machine that do not influence a run, or that the case replaces by its own."""


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
) -> Iterator[str]:
    """Yield the key of each case in a ledger: a hash of all that determines the result.

    This includes parameters, load, profile, gasket, SDF file, step size, engine, measures, sources
    and library versions. The name of the case is not included.

    Args:
        parameters: Machine of the cases that have no parameters of their own.
        cases: Cases.
        measures: Names of measures, keys of `wm_drake.simulation.measures.MEASURES`.
        step: Step size; None for that of the machine. [s]

    Raises:
        InputError: the step size does not divide the output period.
    """
    common: dict[str, object] = {
        "model": model_version(parameters),
        "sources": sources_version(),
        "engine": "compiled",
    }
    common |= {"step": checked_step(parameters, step), "integrator": parameters.integrator}
    common |= {"measures": sorted(set(measures))}
    last, numbers = None, ""
    for case in cases:
        changed = case.parameters or parameters
        if changed is not last:  # loads of one machine follow each other
            last, numbers = changed, changed.model_dump_json(exclude=_EXCLUDED)
        yield key_of(
            **common, numbers=numbers, load=case.load, profile=case.profile, gasket=case.gasket
        )


def simulate_remembered(
    machine: Machine,
    cases: Iterable[Case],
    ledger: Ledger,
    *,
    measures: Iterable[str] = ("extremes",),
    step: float | None = None,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> xr.Dataset:
    """Run the cases whose results are not in a ledger and return the table of all cases.

    The table equals that of `simulate_many`. Results are stored in the ledger when a run is
    finished, so an interruption or an error loses none of them.

    Args:
        machine: A built machine.
        cases: Cases to run. They are taken one by one as needed.
        ledger: An open ledger.
        measures: Names of measures, keys of `wm_drake.simulation.measures.MEASURES`.
        step: Step size; None for that of the machine. [s]
        workers: Number of threads; None for the number of cores.
        progress: Called with the number of cases that have a result.

    Raises:
        InputError: a case or an argument is wrong.
        SimulationInterrupted: Ctrl-C was pressed.
        LedgerError: the ledger cannot be written to, or it is damaged.
    """
    distinct = tuple(dict.fromkeys(measures))
    names: list[str] = []
    keys: list[str] = []
    to_run: list[int] = []  # numbers of the cases that are run, in the order of running
    done = 0

    def missing() -> Iterator[Case]:
        nonlocal done
        given, hashed = itertools.tee(cases)
        known = run_keys(machine.parameters, hashed, measures=distinct, step=step)
        for case, key in zip(given, known, strict=True):
            names.append(case.name)
            keys.append(key)
            if key in ledger:
                done += 1
                progress(done)
            else:
                to_run.append(len(keys) - 1)
                yield case

    ended: dict[str, LedgerEntry] = {}  # finished since the last call of `store`

    def keep(run: RunResult) -> None:
        ended[keys[to_run[run.number]]] = LedgerEntry(run.values, run.diverged)

    def store(_finished: int) -> None:
        nonlocal done
        together = dict(ended)  # runs that end together are stored together
        ended.clear()
        ledger.put_all(together)
        computed.update(together)
        for _ in together:
            done += 1
            progress(done)

    computed: dict[str, LedgerEntry] = {}
    table = simulate_many(
        machine,
        missing(),
        measures=distinct,
        step=step,
        workers=workers,
        progress=store,
        finished=keep,
    )
    rows = {}
    for number, (name, key) in enumerate(zip(names, keys, strict=True)):
        result = computed[key] if key in computed else ledger.get(key)
        rows[number] = (
            name,
            result.note,
            [result.values[n] for measure in distinct for n in MEASURES[measure].names],
        )
    pairs = table.pair.values.tolist() if "pair" in table.coords and computed else None
    return as_table(machine.parameters, distinct, rows, pairs)
