"""Runs on a dask.distributed cluster: plain parameters go out in parcels, rows of numbers come back into the ledger.

Needs the extra `cluster`. A worker that dies loses the parcel it was at, which another one runs again.
"""

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import xarray as xr

from wm_drake.batch.ledger import Ledger, Result
from wm_drake.batch.many import as_table, simulate_many
from wm_drake.batch.remembered import run_keys, sources_version
from wm_drake.batch.runs import MEASURES
from wm_drake.errors import WmDrakeError, input_error
from wm_drake.model.machine import Machine, build_machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.machine import DEFAULT_STEP
from wm_drake.simulation.cases import Case

PARCEL = 32
"""Runs a parcel: a fifth of a second of work, against some milliseconds to send it."""

AHEAD = 4
"""Parcels for each thread of the cluster that are sent before the first comes back."""

DEATHS = 10
"""Workers that may die over one parcel before it is given up."""


@contextmanager
def cluster_client(address: str) -> Iterator[Any]:
    """A client of the scheduler at an address, e.g. tcp://host:8786.

    Raises:
        InputError: the extra is not installed, nobody answers, or workers have other sources.
    """
    try:
        from distributed import Client
    except ImportError:
        raise input_error(
            "needs the extra 'cluster': pip install 'wm-drake[cluster]'", where="--cluster"
        ) from None
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise input_error(
            f"no scheduler answers at '{address}' ({type(error).__name__})", where="--cluster"
        ) from None
    try:
        check_workers(client)
        yield client
    finally:
        client.close()


def check_workers(client: Any) -> None:
    """Refuses a cluster without workers, or whose workers would compute with other sources or libraries."""
    found = client.run(sources_version)
    if not found:
        raise input_error("the cluster has no workers", where="--cluster")
    for worker, version in found.items():
        if version != sources_version():
            message = f"worker {worker} has other sources or versions ({version}) than this computer ({sources_version()})"
            raise input_error(message, where="--cluster")


def simulate_on_cluster(
    machine: Machine,
    cases: Iterable[Case],
    ledger: Ledger,
    client: Any,
    *,
    measures: Iterable[str] = ("extremes",),
    step: float = DEFAULT_STEP,
    progress: Callable[[int], None] = lambda done: None,
) -> xr.Dataset:
    """As `simulate_remembered`, with the runs on a cluster.

    Args:
        machine, cases, ledger, measures, step, progress: As there.
        client: From `cluster_client`.

    Raises:
        WmDrakeError: a parcel was given up; what came back before is in the ledger.
    """
    from distributed import as_completed

    wanted = tuple(dict.fromkeys(measures))
    names: list[str] = []
    keys: list[str] = []

    def missing() -> Iterator[tuple[str, Case]]:
        for case in cases:
            (key,) = run_keys(machine.parameters, [case], measures=wanted, step=step)
            names.append(case.name)
            keys.append(key)
            if key not in ledger:
                yield key, case

    queue = missing()
    parcels: Iterator[tuple[tuple[str, Case], ...]] = iter(
        lambda: tuple(itertools.islice(queue, PARCEL)), ()
    )

    def send(parcel: tuple[tuple[str, Case], ...]) -> Any:
        return client.submit(
            run_parcel, machine.parameters, parcel, wanted, step, pure=False, retries=DEATHS
        )

    ahead = AHEAD * max(1, sum(client.nthreads().values()))
    running = as_completed(
        [send(parcel) for parcel in itertools.islice(parcels, ahead)], loop=client.loop
    )
    held = len(ledger)
    progress(held)
    try:
        for future in running:
            ledger.put_all(future.result())
            progress(len(ledger))
            for parcel in itertools.islice(parcels, 1):
                running.add(send(parcel))
    except WmDrakeError:
        raise
    except Exception as error:  # of a worker or of the way to it; the cluster has many kinds
        raise WmDrakeError(
            f"--cluster: {type(error).__name__}: {error}; finished runs are kept, go on with --resume"
        ) from None
    rows = {}
    for number, (name, key) in enumerate(zip(names, keys, strict=True)):
        result = ledger.get(key)
        rows[number] = (
            name,
            result.note,
            [result.values[n] for measure in wanted for n in MEASURES[measure]],
        )
    return as_table(machine.parameters, wanted, rows)


def run_parcel(
    parameters: MachineParameters,
    parcel: tuple[tuple[str, Case], ...],
    measures: tuple[str, ...],
    step: float,
) -> dict[str, Result]:
    """What a worker does: runs a parcel of cases in its own process, and gives the results by key."""
    cases = [case for _, case in parcel]
    results: dict[str, Result] = {}
    simulate_many(
        _built(parameters.model_dump_json(exclude={"sources"}), parameters),
        cases,
        measures=measures,
        step=step,
        workers=1,
        finished=lambda run: results.update(
            {parcel[run.number][0]: Result(run.values, run.diverged)}
        ),
    )
    return results


class _Keyed:
    """Parameters under a text that tells them apart: they do not hash."""

    def __init__(self, text: str, parameters: MachineParameters) -> None:
        self.text, self.parameters = text, parameters

    def __hash__(self) -> int:
        return hash(self.text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Keyed) and self.text == other.text


def _built(text: str, parameters: MachineParameters) -> Machine:
    return _built_once(_Keyed(text, parameters))


@functools.lru_cache(maxsize=2)
def _built_once(keyed: _Keyed) -> Machine:
    """A Drake diagram is never freed: a worker builds each machine once."""
    return build_machine(keyed.parameters)
