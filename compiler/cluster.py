"""Independent tasks on the workers of a Dask cluster: same results as locally, each as soon as it is available.

A task is pickled for its worker; large arrays are sent separately.
"""

import asyncio
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import version
from io import BytesIO
from itertools import islice
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.drivers.extras import optional

if TYPE_CHECKING:
    from distributed import Client, Future, Security


# Arrays of at least this size are sent to the workers once, not with every task that holds them.
SHARED_BYTES = 1 << 16


class UnreadableError(ThenarError):
    """A worker cannot unpickle its task."""


class SharedArrays:
    """Large arrays, each sent to all workers with the first task that holds it, and freed there when freed here."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._sent: dict[int, tuple[ref[NDArray[Any]], Future[Any]]] = {}

    def packed(self, piece: object) -> "list[bytes | Future[Any]]":
        """Return the arguments of `run_packed` for a task."""
        file = BytesIO()
        packer = _Packer(file, pickle.HIGHEST_PROTOCOL)
        packer.dump(piece)
        return [file.getvalue(), *map(self._future, packer.arrays)]

    def _future(self, array: NDArray[Any]) -> "Future[Any]":
        number = id(array)
        if number not in self._sent:
            gone = ref(array, lambda _: self._sent.pop(number, None))
            self._sent[number] = gone, self._client.scatter(array, broadcast=True, hash=False)
        return self._sent[number][1]


class _Packer(pickle.Pickler):
    """Pickles all but large arrays, which it collects."""

    def __init__(self, file: BytesIO, protocol: int) -> None:
        super().__init__(file, protocol)
        self.arrays: list[NDArray[Any]] = []

    def persistent_id(self, part: Any) -> int | None:
        if type(part) is not np.ndarray or part.nbytes < SHARED_BYTES or part.dtype.hasobject:
            return None
        self.arrays.append(part)
        return len(self.arrays) - 1


class _Unpacker(pickle.Unpickler):
    """Reverses _Packer, given the arrays."""

    def __init__(self, data: bytes, arrays: Sequence[NDArray[Any]]) -> None:
        super().__init__(BytesIO(data))
        self._arrays = arrays

    def persistent_load(self, number: int) -> NDArray[Any]:
        array = self._arrays[number]
        array.flags.writeable = False  # other tasks share it
        return array


def run_packed(data: bytes, *arrays: NDArray[Any]) -> Any:
    """Run a task in a worker."""
    try:
        work, task = _Unpacker(data, arrays).load()
    except Exception as reason:
        raise UnreadableError(
            f"a worker with thenar {installed()} and Python {sys.version.split()[0]} cannot read its task ({reason})"
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


Task = TypeVar("Task")
Result = TypeVar("Result")

CONNECT_S = 5.0
WORKERS_S = 10.0
# Time without a result after which the workers are checked.
PATIENCE_S = 10.0
# Tasks that are submitted ahead, so that no worker waits for this process: for each of its threads, and at least.
AHEAD_EACH, AHEAD = 4, 64


class ClusterError(ThenarError, BrokenExecutor):
    """A cluster is missing, lost its workers, or cannot run this program's tasks."""


def on_cluster(work: Callable[[Task], Result], tasks: Iterable[Task], address: str) -> Iterator[Result]:
    """Yield the results in the order of completion.

    work     and tasks are pickled, `work` by the name of its module: this version of thenar must be installed on the
             cluster. An array of SHARED_BYTES or more that several tasks hold is sent to each worker once.
    address  of the scheduler, such as tcp://10.0.0.5:8786

    If a worker dies, the others redo its tasks. Work runs in threads of the workers (`dask worker --nthreads 1` keeps
    them from competing), with one BLAS thread as long as the worker lives.

    Raises ClusterError if there is no such cluster, if it has no workers (any more), if a task killed several workers,
    or if they cannot read it; and any exception of `work`.
    """
    with _connected(address) as client:
        _check_workers(client, address)
        yield from _results(client, address, work, tasks)


@contextmanager
def _connected(address: str) -> "Iterator[Client]":
    with optional(ClusterError, "work on a cluster"):
        from distributed import Client
    try:
        security = _security(address)
        # A separate event loop: the caller's thread may run one.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, _greet(address, security)).result()
        client = Client(address, timeout=CONNECT_S, set_as_default=False, security=security)
    except (OSError, ValueError, TypeError, RuntimeError) as reason:
        raise ClusterError(
            f"no Dask scheduler replies at {address!r}: start one there (dask scheduler), or fix the address, "
            "which is like tcp://10.0.0.5:8786"
        ) from reason
    try:
        yield client
    finally:
        client.close(timeout=CONNECT_S)


def _security(address: str) -> "Security":
    """Return the TLS settings of the user's Dask configuration."""
    import dask
    from distributed import Security
    from distributed.utils import import_term

    loader = dask.config.get("distributed.client.security-loader")
    return import_term(loader)({"address": address}) if loader else Security()


async def _greet(address: str, security: "Security") -> None:
    """Connect to the scheduler and disconnect.

    A Client that cannot connect stays half initialised. When it is collected it can take the lock under which the next
    one starts, so none is made until a scheduler replies. (Without an address Dask would start a local cluster.)
    """
    from distributed.comm.core import connect

    greeting = await connect(address, timeout=CONNECT_S, **security.get_connection_args("client"))
    await greeting.close()


def _check_workers(client: "Client", address: str) -> None:
    """Raise ClusterError unless there are workers, each with this version of thenar."""
    _wait_for_workers(client, address)
    ours = installed()
    for worker, theirs in client.run(installed, on_error="return").items():
        if theirs != ours:
            raise ClusterError(
                f"worker {worker} lacks thenar {ours} ({theirs}): install it on all workers and on the scheduler"
            )


def _wait_for_workers(client: "Client", address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError:
        raise ClusterError(f"the scheduler at {address} has no workers: start some (dask worker {address})") from None


def _results(client: "Client", address: str, work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
    arrays = SharedArrays(client)
    finished: SimpleQueue[Future[Any]] = SimpleQueue()
    begun: set[Future[Any]] = set()
    waiting = iter(tasks)

    def begin(number: int) -> None:
        for task in islice(waiting, number):
            try:
                arguments = arrays.packed((work, task))
            except TimeoutError as reason:  # no worker accepts an array
                raise _lost(address) from reason
            future = client.submit(run_packed, *arguments, pure=False)
            begun.add(future)
            future.add_done_callback(finished.put)

    begin(max(AHEAD, AHEAD_EACH * sum(client.ncores().values())))
    while begun:
        future = _next(finished, client, address)
        result = _result(future, client, address)
        begun.discard(future)
        begin(1)
        yield result


def _next(finished: "SimpleQueue[Future[Any]]", client: "Client", address: str) -> "Future[Any]":
    while True:
        try:
            return finished.get(timeout=PATIENCE_S)
        except Empty:
            _check_alive(client, address)


def _check_alive(client: "Client", address: str) -> None:
    if client.status != "running":
        raise _lost(address)
    _wait_for_workers(client, address)


def _lost(address: str) -> ClusterError:
    return ClusterError(
        f"the scheduler at {address}, or its tasks, are lost: check how it or its workers ended, and run this again"
    )


def _result(future: "Future[Any]", client: "Client", address: str) -> Any:
    """Return the result of a finished `future`, or raise the exception of its work."""
    from distributed import CancelledError, KilledWorker

    patience = PATIENCE_S
    while True:
        try:
            return future.result(timeout=patience)
        except KilledWorker as reason:
            raise ClusterError(
                f"one task ended {reason.allowed_failures + 1} workers of the cluster at {address}, perhaps for lack "
                "of memory: give each worker more"
            ) from reason
        except UnreadableError as reason:
            raise ClusterError(f"{reason}: the cluster at {address} needs the packages installed here") from reason
        except CancelledError as reason:
            raise _lost(address) from reason
        except TimeoutError:
            if future.status == "error":
                raise  # from the work itself
        # The worker with the result may be gone: another repeats the task.
        _check_alive(client, address)
        patience *= 2
