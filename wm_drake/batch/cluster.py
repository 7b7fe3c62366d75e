"""Runs of many cases on a dask.distributed cluster.

The cases are sent as plain parameters, grouped into work items. The results come back as numbers
and are stored in the ledger. If a worker dies, the cluster sends its work item to another worker.
This module needs the extra `cluster`.
"""

import functools
import itertools
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import Any

import xarray as xr

from wm_drake.batch.ledger import Ledger, LedgerEntry
from wm_drake.batch.many import simulate_many
from wm_drake.batch.remembered import keyed, sources_version
from wm_drake.batch.run_table import RunTable
from wm_drake.batch.runs import BatchOptions
from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.errors import WmDrakeError, input_error, shortened
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case, notice_jumping_friction
from wm_drake.simulation.steps import checked_step

CASES_PER_WORK_ITEM = 32
"""Number of cases that are sent together.

They take about 0.2 s to run and a few milliseconds to send.
"""

WORK_ITEMS_PER_THREAD = 4
"""Number of work items in flight for each thread of the cluster."""

WAIT_FOR_WORKERS = 60.0
"""Time for which a study waits for a worker when all are gone. [s]"""

POLL = 0.05
"""Time between two looks for finished work items. [s]"""

ANSWER_TIME = 10.0
"""Time in which a scheduler must answer. [s]"""

KEPT_MESSAGES = 8
"""Number of messages that the client keeps after it has sent them; each has a work item."""

CLOSING_TIME = 5.0
"""Longest time for which the end of a command waits for the scheduler. [s]"""

_CONNECTION_LOST = (
    "--cluster: the connection to the scheduler is lost; finished runs are kept: start it again "
    "and go on with --resume"
)

_log = logging.getLogger(__name__)

RETRY_LIMIT = 10
"""Number of times that a work item is sent again after it failed, for example with its worker."""


@contextmanager
def cluster_client(address: str) -> Iterator[Any]:
    """Open a client of the scheduler at an address and close it at the end.

    Args:
        address: Address of the scheduler, for example tcp://host:8786.

    Raises:
        InputError: the extra `cluster` is not installed, no scheduler answers, there are no
            workers, or a worker has other sources or library versions.
    """
    try:
        import dask.config
        from distributed import Client
    except ImportError:
        raise input_error(
            "needs the extra 'cluster': pip install 'wm-drake[cluster]'", where="--cluster"
        ) from None
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("distributed"):  # its tracebacks would bury our message
            logging.getLogger(name).setLevel(logging.CRITICAL)
    kept = {"distributed.admin.low-level-log-length": KEPT_MESSAGES}
    try:
        with dask.config.set(kept):
            client = Client(address, timeout=ANSWER_TIME, set_as_default=False)
    except (OSError, ValueError) as error:
        raise input_error(
            f"no scheduler answers at '{address}' ({type(error).__name__}); "
            "give the address of a running dask scheduler, such as tcp://host:8786",
            where="--cluster",
        ) from None
    try:
        check_workers(client)
        yield client
    finally:
        with suppress(Exception):  # the scheduler is gone: there is nothing left to close
            client.close(timeout=CLOSING_TIME)


def check_workers(client: Any) -> None:
    """Check that a cluster has workers and that all have the sources and versions of this computer.

    Raises:
        InputError: there are no workers, or one has other sources or library versions.
    """
    try:
        versions = client.run(sources_version)
    except OSError:
        message = "the scheduler or a worker has gone; start it again, then repeat the command"
        raise input_error(message, where="--cluster") from None
    if not versions:
        raise input_error("the cluster has no workers; start at least one", where="--cluster")
    for worker, version in versions.items():
        if version != sources_version():
            raise input_error(
                f"worker {worker} has other sources or versions ({version}) than this computer "
                f"({sources_version()}); install the same wm-drake and libraries on both",
                where="--cluster",
            )


@contextmanager
def _cluster_errors() -> Iterator[None]:
    """Convert the errors of workers and of the connection into one with a message for the user."""
    try:
        yield
    except WmDrakeError:
        raise
    except CancelledError:  # what is left of a work item when the connection is lost
        raise WmDrakeError(_CONNECTION_LOST) from None
    except Exception as error:  # workers and the connection raise many types of errors
        reason = shortened(f"{type(error).__name__}: {error}", 300)
        raise WmDrakeError(
            f"--cluster: {reason}; finished runs are kept: go on with --resume"
        ) from None


def simulate_on_cluster(
    machine: Machine,
    cases: Iterable[Case],
    ledger: Ledger,
    client: Any,
    *,
    measures: Iterable[str] = ("extremes",),
    step: float | None = None,
    engine: str = DEFAULT_ENGINE,
    progress: Callable[[int], None] = lambda done: None,
) -> xr.Dataset:
    """Run the cases whose results are not in a ledger on a cluster, and return the table of all.

    The table equals that of `simulate_many`. Results are stored in the ledger as they come back.

    Args:
        machine: A built machine.
        cases: Cases to run. They are taken one by one as needed.
        ledger: An open ledger.
        client: Client of the cluster, from `cluster_client`.
        measures: Names of measures, keys of `wm_drake.simulation.measures.MEASURES`.
        step: Step size; None for that of the machine. [s]
        engine: Name of the engine.
        progress: Called with the number of cases that have a result.

    Raises:
        WmDrakeError: a work item failed more often than the retry limit allows, or the connection
            to the cluster broke. Results that came back before are in the ledger.
    """
    from distributed import as_completed

    notice_jumping_friction(machine.parameters)
    step = checked_step(machine.parameters, step)
    options = BatchOptions(tuple(dict.fromkeys(measures)), step, engine=engine)
    table = RunTable(machine.parameters, options.measures)
    running: dict[str, list[tuple[int, str]]] = {}  # numbers and names of the cases by their keys
    done = 0

    def missing() -> Iterator[tuple[str, Case]]:
        nonlocal done
        for number, (case, key) in enumerate(keyed(machine.parameters, cases, options)):
            if key in ledger:
                put(ledger.get(key), number, case.name)
                done += 1
            else:
                running.setdefault(key, []).append((number, case.name))
                yield key, case

    def put(result: LedgerEntry, number: int, name: str) -> None:
        table.put(number, name, result.values, result.note)

    queue = missing()
    work_items: Iterator[tuple[tuple[str, Case], ...]] = iter(
        lambda: tuple(itertools.islice(queue, CASES_PER_WORK_ITEM)), ()
    )

    def send(work_item: tuple[tuple[str, Case], ...]) -> Any:
        return client.submit(
            run_work_item,
            machine.parameters,
            work_item,
            options,
            pure=False,
            retries=RETRY_LIMIT,
        )

    in_flight = WORK_ITEMS_PER_THREAD * max(1, sum(client.nthreads().values()))
    with _cluster_errors():
        ended = as_completed(
            [send(work_item) for work_item in itertools.islice(work_items, in_flight)],
            loop=client.loop,
        )
        for future in _as_they_end(ended, client):
            results = future.result()
            ledger.put_all(results)
            for key, result in results.items():
                for number, name in running.pop(key, ()):
                    put(result, number, name)
            done += len(results)
            progress(done)
            for work_item in itertools.islice(work_items, 1):
                ended.add(send(work_item))
    data = table.dataset()
    progress(data.sizes["run"])
    return data


def map_on_cluster(
    function: Callable[[Any], Any], items: Iterable[Any], client: Any
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of a function for each item, as they end on a cluster.

    Args:
        function: Function at the level of a module.
        items: Its arguments.
        client: Client of the cluster, from `cluster_client`.

    Raises:
        WmDrakeError: as for `simulate_on_cluster`, or raised by the function.
    """
    from distributed import as_completed

    with _cluster_errors():
        sent = client.map(function, list(items), pure=False, retries=RETRY_LIMIT)
        numbers = {future.key: number for number, future in enumerate(sent)}
        try:
            for future in _as_they_end(as_completed(sent, loop=client.loop), client):
                yield numbers[future.key], future.result()
        finally:
            client.cancel(sent)


def _as_they_end(running: Any, client: Any) -> Iterator[Any]:
    """Yield the work items of a cluster as they end, as long as the cluster has workers.

    Args:
        running: Work items, as `distributed.as_completed`; others may be added.
        client: Client of the cluster.

    Raises:
        WmDrakeError: the connection to the scheduler is lost, or there has been no worker for
            `WAIT_FOR_WORKERS`.
    """
    since: float | None = None
    while not running.is_empty():
        if running.has_ready():
            since = None
            yield next(running)
            continue
        if client.status != "running":
            raise WmDrakeError(_CONNECTION_LOST)
        if client.scheduler_info()["workers"]:
            since = None
        elif since is None:
            since = time.monotonic()
            _log.warning(
                "--cluster: the cluster has no workers; waiting %g s for one", WAIT_FOR_WORKERS
            )
        elif time.monotonic() - since > WAIT_FOR_WORKERS:
            raise WmDrakeError(
                f"--cluster: the cluster has had no workers for {WAIT_FOR_WORKERS:g} s; finished "
                "runs are kept: start a worker and go on with --resume"
            )
        time.sleep(POLL)


def run_work_item(
    parameters: MachineParameters,
    work_item: tuple[tuple[str, Case], ...],
    options: BatchOptions,
) -> dict[str, LedgerEntry]:
    """Run the cases of a work item in the process of a worker and return their results by key.

    Args:
        parameters: The machine.
        work_item: Pairs of the key of a run and its case.
        options: How they are run.
    """
    cases = [case for _, case in work_item]
    results: dict[str, LedgerEntry] = {}
    simulate_many(
        _built_machine(
            _HashableParameters(parameters.model_dump_json(exclude={"sources"}), parameters)
        ),
        cases,
        measures=options.measures,
        step=options.step,
        workers=1,
        engine=options.engine,
        finished=lambda run: results.update(
            {work_item[run.number][0]: LedgerEntry(run.stored_values, run.diverged)}
        ),
    )
    return results


class _HashableParameters:
    """Machine parameters that are hashed and compared by their JSON text, as a key of a cache."""

    def __init__(self, text: str, parameters: MachineParameters) -> None:
        self.text, self.parameters = text, parameters

    def __hash__(self) -> int:
        return hash(self.text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _HashableParameters) and self.text == other.text


@functools.lru_cache(maxsize=2)
def _built_machine(hashable: _HashableParameters) -> Machine:
    """Return the built machine, from the cache if it was built before.

    Building takes long beside a run, so a worker builds each machine only once.
    """
    return build_machine(hashable.parameters)
