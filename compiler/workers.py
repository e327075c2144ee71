"""Independent pieces of work on all cores, each answer handed over as soon as it is there."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import TypeVar

from .cluster import on_cluster

Task = TypeVar("Task")
Answer = TypeVar("Answer")

# More processes are asked for by a slip only, and would take the machine with them.
MOST_JOBS = 1024


def in_workers(
    work: Callable[[Task], Answer], tasks: Iterable[Task], jobs: int, cluster: str | None = None
) -> Iterator[Answer]:
    """Yield the answers in the order in which they come.

    jobs     worker processes, as joblib counts them: -1 for all cores, 1 for this process alone; no more than
             MOST_JOBS. A worker runs one thread.
    cluster  address of a Dask scheduler, such as tcp://10.0.0.5:8786: all of its workers do the work, and none here

    Raises BrokenExecutor if a worker is killed or cannot start, ClusterError (which is one) if the cluster cannot do
    the work, and whatever the work raises.
    """
    if cluster is not None:
        yield from on_cluster(work, tasks, cluster)
        return
    if jobs == 1:
        yield from map(work, tasks)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        workers = Parallel(n_jobs=min(jobs, MOST_JOBS), return_as="generator_unordered")
        try:
            with _cancelled_work_forgotten():
                with _interrupts_held():
                    answers = workers(delayed(work)(task) for task in tasks)
                yield from answers
        except (BrokenExecutor, BrokenPipeError) as reason:
            raise BrokenExecutor(
                "a worker process ended before its work was done, perhaps for want of memory: --jobs 1 takes none"
            ) from reason


def workers_of(jobs: int) -> int:
    """Return how many processes work when `jobs` are asked for."""
    if jobs == 1:
        return 1
    from joblib import effective_n_jobs

    return int(effective_n_jobs(min(jobs, MOST_JOBS)))


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let a Ctrl-C wait. Processes started meanwhile never get it, so none complains of it: this one ends them."""
    from multiprocessing import resource_tracker

    # loky asks for this helper process of Python's, and its start would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _cancelled_work_forgotten() -> Iterator[None]:
    """Keep loky's own thread quiet as it ends the workers early.

    It cancels what waits, and may then look for a piece of it that it was just about to hand out: a KeyError, which
    harms nobody and would be printed.
    """
    before = threading.excepthook

    def complain(what: threading.ExceptHookArgs) -> None:
        ending = getattr(getattr(what.thread, "executor_flags", None), "kill_workers", False)
        if not (ending and what.exc_type is KeyError):
            before(what)

    threading.excepthook = complain
    try:
        yield
    finally:
        threading.excepthook = before
