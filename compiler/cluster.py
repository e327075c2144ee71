"""Independent tasks on the workers of a Dask cluster: same results as locally, each as soon as it is available.

joblib's backend for Dask does not do: where a task kills workers, it waits forever.
"""

import asyncio
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from importlib.metadata import version
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from thenar.drivers.errors import ThenarError
from thenar.drivers.extras import optional

if TYPE_CHECKING:
    from distributed import Client, Future, Security

Task = TypeVar("Task")
Result = TypeVar("Result")

CONNECT_S = 5.0
WORKERS_S = 10.0
# Time without a result after which the workers are checked.
PATIENCE_S = 10.0
# Tasks that are submitted ahead for each thread of a worker, so that none waits for this process.
AHEAD = 3
# Dask warns of tasks of more than 10 MB, whose data it would rather load itself.
_LARGE_TASKS = {"distributed.admin.large-graph-warning-threshold": "1TB"}


class ClusterError(ThenarError, BrokenExecutor):
    """A cluster is missing, lost its workers, or cannot run this program's tasks."""


# The address of the scheduler whose cluster does the work.
_address: ContextVar[str | None] = ContextVar("thenar cluster", default=None)


@contextmanager
def dask_cluster(address: str | None) -> Iterator[None]:
    """Let the cluster of a Dask scheduler do the work of this block: of `evaluate`, `compile_build`, `find_frontier`.

    Parameters
    ----------
    address : str or None
        Of the scheduler, such as tcp://10.0.0.5:8786. None: this machine does the work. The results are the same.

    Raises
    ------
    ClusterError
        From the work, if there is no such cluster, or if it loses its workers.
    """
    before = _address.set(address)
    try:
        yield
    finally:
        _address.reset(before)


def cluster_address() -> str | None:
    """Return the address of the scheduler whose cluster does the work here; None if this machine does."""
    return _address.get()


def on_cluster(work: Callable[[Task], Result], tasks: Iterable[Task], address: str) -> Iterator[Result]:
    """Yield the results in the order of completion.

    work     and tasks are pickled, `work` by the name of its module: this version of thenar must be installed on the
             cluster
    address  of the scheduler, such as tcp://10.0.0.5:8786

    If a worker dies, the others redo its tasks. Work runs in threads of the workers (`dask worker --nthreads 1` keeps
    them from competing), with one BLAS thread as long as the worker lives.

    Raises ClusterError if there is no such cluster, if it has no workers (any more), if a task killed several workers,
    or if they cannot read it; and any exception of `work`.
    """
    with _connected(address) as client:
        ours = installed()
        for worker, theirs in client.run(installed, on_error="return").items():
            if theirs != ours:
                raise ClusterError(
                    f"worker {worker} lacks thenar {ours} ({theirs}): install it on all workers and on the scheduler"
                )
        yield from _results(client, address, work, tasks)


@contextmanager
def _connected(address: str) -> "Iterator[Client]":
    """Connect to a scheduler that has workers."""
    with optional(ClusterError, "work on a cluster"):
        from distributed import Client
    try:
        # A separate event loop: the caller's thread may run one.
        with ThreadPoolExecutor(1) as thread:
            security = thread.submit(asyncio.run, _greet(address)).result()
        client = Client(address, timeout=CONNECT_S, set_as_default=False, security=security)
    except (OSError, ValueError, TypeError, RuntimeError) as reason:
        raise ClusterError(
            f"no Dask scheduler replies at {address!r}: start one there (dask scheduler), or fix the address, "
            "which is like tcp://10.0.0.5:8786"
        ) from reason
    try:
        _wait_for_workers(client, address)
        yield client
    finally:
        client.close(timeout=CONNECT_S)


async def _greet(address: str) -> "Security":
    """Connect to the scheduler and disconnect; return the TLS settings of the user's Dask configuration.

    A Client that cannot connect stays half initialised. When it is collected it can take the lock under which the next
    one starts, so none is made until a scheduler replies. (Without an address Dask would start a local cluster.)
    """
    import dask
    from distributed import Security
    from distributed.comm.core import connect
    from distributed.utils import import_term

    loader = dask.config.get("distributed.client.security-loader")
    security: Security = import_term(loader)({"address": address}) if loader else Security()
    greeting = await connect(address, timeout=CONNECT_S, **security.get_connection_args("client"))
    await greeting.close()
    return security


def _wait_for_workers(client: "Client", address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError:
        raise ClusterError(f"the scheduler at {address} has no workers: start some (dask worker {address})") from None


def _results(client: "Client", address: str, work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
    import dask
    from distributed import CancelledError, KilledWorker, wait

    waiting = iter(tasks)

    def begun(number: int) -> "set[Future[Any]]":
        with dask.config.set(_LARGE_TASKS):
            pickled = (pickle.dumps((work, task), pickle.HIGHEST_PROTOCOL) for task in islice(waiting, number))
            return {client.submit(_run, task, pure=False) for task in pickled}

    running = begun(AHEAD * max(sum(client.ncores().values()), 1))
    try:
        while running:
            try:
                with client.as_current():
                    done, running = wait(running, timeout=PATIENCE_S, return_when="FIRST_COMPLETED")
            except TimeoutError:
                _wait_for_workers(client, address)
                continue
            for future in done:
                running |= begun(1)
                yield future.result()
    except KilledWorker as reason:
        raise ClusterError(
            f"one task ended {reason.allowed_failures + 1} workers of the cluster at {address}, perhaps for lack of "
            "memory: give each worker more"
        ) from reason
    except CancelledError as reason:
        raise ClusterError(
            f"the scheduler at {address}, or its tasks, are lost: check how it or its workers ended, and run this again"
        ) from reason


def _run(pickled: bytes) -> Any:
    """Run a task in a worker."""
    try:
        work, task = pickle.loads(pickled)  # noqa: S301 - of the program that this cluster works for
    except Exception as reason:
        raise ClusterError(
            f"a worker with thenar {installed()} and Python {sys.version.split()[0]} cannot read its task ({reason}): "
            "the cluster needs the packages installed here"
        ) from reason
    _take_one_thread(len(sys.modules))
    return work(task)


@lru_cache(maxsize=1)
def _take_one_thread(_modules: int) -> None:
    """Limit BLAS and OpenMP to one thread; again after modules, and with them libraries, have been loaded."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1)


def installed() -> str:
    """Return the version of thenar in this process."""
    return version("thenar")
