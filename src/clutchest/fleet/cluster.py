"""The cluster that a fleet is processed by: one at an address, or one on this machine."""

from __future__ import annotations

import atexit
import gc
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import current_process
from queue import Empty, SimpleQueue
from time import sleep
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    from distributed import Client, Future

NO_WORKER = "no worker is left; started again, what is done is kept"
UNGUARDED = (
    'a script of your own calls it under `if __name__ == "__main__":`, as its workers import the '
    "script"
)
START_S = 60.0  # for a worker to start in
PATIENCE_S = 10.0  # without a log that is done, until it is asked whether there is a worker
SETTLED_S = 1.0  # after its first task, until it counts as started
_ENVIRONMENT = "distributed.nanny.pre-spawn-environ"
_FAILURES = "distributed.scheduler.allowed-failures"


@contextmanager
def client_of(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """A client of the cluster at an address, or of one on this machine that ends with it."""
    if getattr(current_process(), "_inheriting", False):  # it imports the script that called
        raise ClutchestError(UNGUARDED)
    if workers is not None and workers < 1:
        raise ClutchestError(f"workers {workers}: expected 1 or more, or None for one a core")
    import dask
    from distributed import Client

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, ValueError) as problem:
            raise ClutchestError(
                f"--scheduler {scheduler}: cannot be reached ({problem})"
            ) from None
        with client:
            yield client
        return
    environment = {**dask.config.get(_ENVIRONMENT), "MALLOC_ARENA_MAX": "1"}
    # Dask has the C library return memory that the next array takes again: a fifth of the time
    environment.pop("MALLOC_TRIM_THRESHOLD_", None)
    with (
        # what has lost its worker is not given to the next one while that starts: see ``settle``
        dask.config.set({_ENVIRONMENT: environment, _FAILURES: 0}),
        _local_cluster(workers or os.cpu_count() or 1) as cluster,
        Client(cluster) as client,
    ):
        client.run(atexit.register, gc.freeze)  # what ends need not search for circles
        yield client


@contextmanager
def _local_cluster(workers: int) -> Iterator[Any]:
    """So many workers on this machine."""
    from distributed import LocalCluster

    try:
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=logging.ERROR,  # such as of a worker that ends slowly on a busy machine
        )
    except RuntimeError as problem:
        raise ClutchestError(f"no worker could be started ({problem}); {UNGUARDED}") from None
    try:
        yield cluster
    finally:
        with suppress(KeyError):  # of Dask's list, as a worker that was lost is replaced meanwhile
            cluster.close()


def survived(future: Future, otherwise: Callable[[], Any]) -> Any:
    """The result; something else where every worker that had the task was lost."""
    from distributed.scheduler import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return otherwise()


def in_turn(client: Client, futures: Sequence[Future]) -> Iterator[Future]:
    """The same futures, each when it is done or lost.  Raises ClutchestError where no worker is
    left that could do it, nor comes."""
    finished: SimpleQueue[Future] = SimpleQueue()
    for future in futures:
        future.add_done_callback(finished.put)
    left = len(futures)
    while left:
        try:
            future = finished.get(timeout=PATIENCE_S)
        except Empty:
            _require_worker(client)
        else:
            left -= 1
            yield future


def _require_worker(client: Client) -> None:
    """Wait for a worker to be up, unless there is one, which may be short of memory for a while; on
    this machine another one is started in place of those that do not come.  Raises ClutchestError
    where there is none any more."""
    if client.nthreads() or _comes(client):
        return
    if (own := client.cluster) is not None:
        own.scale(len(own.worker_spec) + 1)
        if _comes(client):
            return
    raise ClutchestError(NO_WORKER)


def _comes(client: Client) -> bool:
    """Whether a worker starts in time."""
    try:
        client.wait_for_workers(1, timeout=START_S)
    except TimeoutError:
        return False
    return True


def settle(client: Client) -> None:
    """Wait until a worker is up and has started: one that ends while it starts, such as by a task
    that waited for it, is not started again.  Raises ClutchestError where none is left."""
    _require_worker(client)
    for _ in in_turn(client, [client.submit(int, pure=False)]):
        sleep(SETTLED_S)


def alone(client: Client, function: Callable[..., Any], *given: Any) -> Any:
    """The result of a task while no other one is there: it may have been lost only because it
    waited behind one that ends its worker.  None where it is lost again.  Raises ClutchestError
    where no worker is left.
    """
    settle(client)
    future = client.submit(function, *given, pure=False)
    for _ in in_turn(client, [future]):
        pass
    return survived(future, lambda: None)
