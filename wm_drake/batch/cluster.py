"""Runs of many cases on a dask.distributed cluster.

The cases are sent as plain parameters, grouped into work items. The results come back as numbers.
If a worker dies, the cluster sends its work item to another worker.
This module needs the extra `cluster`.
"""

import functools
import itertools
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

from wm_drake.batch.ledger import LedgerEntry
from wm_drake.batch.many import run_cases
from wm_drake.batch.remembered import sources_version
from wm_drake.batch.runs import BatchOptions, RunResult
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


def run_on_cluster(
    machine: Machine,
    cases: Iterable[Case],
    options: BatchOptions,
    collect: Callable[[list[RunResult]], None],
    *,
    client: Any,
) -> None:
    """Run cases on a cluster and pass finished runs on, as `run_cases` does on this computer.

    Args:
        machine: A built machine.
        cases: Cases to run. They are taken one by one as needed.
        options: How they are run; without records.
        collect: Called with the runs of a work item when they have come back.
        client: Client of the cluster, from `cluster_client`.

    Raises:
        WmDrakeError: a work item failed more often than the retry limit allows, or the connection
            to the cluster broke. `collect` has got the results that came back before.
    """
    from distributed import as_completed

    notice_jumping_friction(machine.parameters)
    numbered, running = enumerate(cases), dict[int, Case]()
    worker_options = replace(
        options, step=checked_step(machine.parameters, options.step), workers=1
    )

    def sent(count: int) -> list[Any]:
        futures = []
        for work_item in itertools.islice(work_items, count):
            running.update(work_item)
            sending = functools.partial(client.submit, pure=False, retries=RETRY_LIMIT)
            futures.append(sending(run_work_item, machine.parameters, work_item, worker_options))
        return futures

    work_items: Iterator[tuple[tuple[int, Case], ...]] = iter(
        lambda: tuple(itertools.islice(numbered, CASES_PER_WORK_ITEM)), ()
    )
    in_flight = WORK_ITEMS_PER_THREAD * max(1, sum(client.nthreads().values()))
    with _cluster_errors():
        ended = as_completed(sent(in_flight), loop=client.loop)
        for future in _as_they_end(ended, client):
            results = future.result().items()
            collect([RunResult(n, running.pop(n), r.values, r.note, None) for n, r in results])
            for following in sent(1):
                ended.add(following)


def map_on_cluster(
    function: Callable[[Any], Any], items: Iterable[Any], client: Any
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of a function for each item, as they end on a cluster.

    Args:
        function: Function at the level of a module.
        items: Its arguments.
        client: Client of the cluster, from `cluster_client`.

    Raises:
        WmDrakeError: as for `run_on_cluster`, or raised by the function.
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
    parameters: MachineParameters, work_item: tuple[tuple[int, Case], ...], options: BatchOptions
) -> dict[int, LedgerEntry]:
    """Run the cases of a work item in the process of a worker and return their results by number.

    Args:
        parameters: The machine.
        work_item: Pairs of the number of a case and the case.
        options: How they are run.
    """
    numbers, cases = zip(*work_item, strict=True)
    results = dict[int, LedgerEntry]()

    def collect(runs: list[RunResult]) -> None:
        results.update({numbers[r.number]: LedgerEntry(r.stored_values, r.diverged) for r in runs})

    text = parameters.model_dump_json(exclude={"sources"})
    run_cases(_built_machine(_HashableParameters(text, parameters)), cases, options, collect)
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
