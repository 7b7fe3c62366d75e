"""simulate_many with a memory: runs that a ledger holds are not run again, others enter it the moment they end."""

import functools
import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import xarray as xr

from wm_drake.batch.ledger import Ledger, key_of
from wm_drake.batch.many import as_table, simulate_many
from wm_drake.batch.runs import MEASURES, RunResult
from wm_drake.model.bodies import sdf_path
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import versions
from wm_drake.simulation.runs import checked_step

_ROOMS_AFTER = ("cli", "batch/ledger.py", "report", "rigs", "studies")
"""What of the package does not determine a run."""

_NO_NUMBERS = {"name", "about", "measured", "sources", "loads", "profile"}
"""Parts of a machine that do not determine a run, or that the case has as its own."""


@functools.cache
def sources_version() -> str:
    """A hash of all that computes a run, apart from its numbers: our sources and the versions of the libraries."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(repr(sorted(versions().items())).encode())
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root)
        if not str(name.as_posix()).startswith(_ROOMS_AFTER):
            digest.update(f"{name}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def model_version(parameters: MachineParameters) -> str:
    """A hash of the SDF of a machine."""
    return hashlib.sha256(sdf_path(parameters.model).read_bytes()).hexdigest()[:16]


def run_keys(
    parameters: MachineParameters,
    cases: Iterable[Case],
    *,
    measures: Iterable[str],
    step: float | None = None,
) -> Iterator[str]:
    """The key of each case: of its numbers, its load and profile, SDF, step, engine, measures, sources, versions."""
    common: dict[str, object] = {
        "model": model_version(parameters),
        "sources": sources_version(),
        "engine": "compiled",
    }
    common |= {"step": checked_step(parameters, step)}
    common |= {"measures": sorted(set(measures))}
    for case in cases:
        numbers = (case.parameters or parameters).model_dump_json(exclude=_NO_NUMBERS)
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
    """As `simulate_many`, and gives the same table, but takes runs from the ledger where it can.

    Args:
        machine, cases, measures, step, workers: As there.
        ledger: Open; what had ended before an interruption or a fault is in it.
        progress: Called with the number of runs that there are results of.

    Raises:
        InputError, SimulationInterrupted: As there.
        LedgerError: the ledger cannot be written to, or is damaged.
    """
    wanted = tuple(dict.fromkeys(measures))
    names: list[str] = []
    keys: list[str] = []
    to_run: list[int] = []  # numbers of the cases that are run, in the order they are taken
    kept = 0

    def missing() -> Iterator[Case]:
        nonlocal kept
        for case in cases:
            (key,) = run_keys(machine.parameters, [case], measures=wanted, step=step)
            names.append(case.name)
            keys.append(key)
            if key in ledger:
                kept += 1
                progress(kept)
            else:
                to_run.append(len(keys) - 1)
                yield case

    def keep(run: RunResult) -> None:
        nonlocal kept
        ledger.put(keys[to_run[run.number]], run.values, run.diverged)
        kept += 1
        progress(kept)

    simulate_many(machine, missing(), measures=wanted, step=step, workers=workers, finished=keep)
    rows = {}
    for number, (name, key) in enumerate(zip(names, keys, strict=True)):
        result = ledger.get(key)
        rows[number] = (
            name,
            result.note,
            [result.values[n] for measure in wanted for n in MEASURES[measure]],
        )
    return as_table(machine.parameters, wanted, rows)
