"""Work in other processes: independent pieces on all cores, each answer handed over as soon as it is there; and one
piece aside, for whoever must not wait for it.
"""

import os
import select
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, Generic, TypeVar

from .cluster import on_cluster

Task = TypeVar("Task")
Answer = TypeVar("Answer")

# More processes than four a core are asked for by a slip only, and would take the machine with them.
MOST_JOBS = 4 * (os.cpu_count() or 1)

_SAFE_PATH = "PYTHONSAFEPATH"
# Rows times rounds of boosting: about a second's work.
_LITTLE = 200_000
# Where a process cannot be waited for by a stranger, it is looked for so often.
_LOOK_S = 0.5


def in_workers(
    work: Callable[[Task], Answer], tasks: Iterable[Task], jobs: int, cluster: str | None = None
) -> Iterator[Answer]:
    """Yield the answers in the order in which they come.

    jobs     worker processes, as joblib counts them: -1 for all cores, 1 for this process alone; no more than
             MOST_JOBS. A worker runs one thread.
    cluster  address of a Dask scheduler, such as tcp://10.0.0.5:8786: all of its workers do the work, and none here

    Workers end when this process does, however it ends.

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

    ending = {"initializer": _end_with_parent, "initargs": (os.getpid(),)}
    with _safe_paths(), parallel_config(backend="loky", inner_max_num_threads=1, **ending):
        workers = Parallel(n_jobs=min(jobs, MOST_JOBS), return_as="generator_unordered")
        try:
            with _cancelled_work_forgotten(), ExitStack() as ended:
                with _interrupts_held():
                    answers = workers(delayed(work)(task) for task in tasks)
                    ended.callback(_end_early, answers)
                # `yield from answers` would close them without a filter when this generator is closed.
                yield from (answer for answer in answers)
        except (BrokenExecutor, BrokenPipeError) as reason:
            raise BrokenExecutor(
                "a worker process ended before its work was done, perhaps for want of memory: --jobs 1 takes none"
            ) from reason


def little(work: int, jobs: int) -> int:
    """Return `jobs`, or 1 where so little work (rows times rounds of boosting) is done before processes are up."""
    return 1 if work < _LITTLE else jobs


def workers_of(jobs: int) -> int:
    """Return how many processes work when `jobs` are asked for."""
    if jobs == 1:
        return 1
    from joblib import effective_n_jobs

    return int(effective_n_jobs(min(jobs, MOST_JOBS)))


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let a Ctrl-C wait, and what ends a command like one. Processes started meanwhile never get these signals, so none
    complains of them: this one ends them.
    """
    from multiprocessing import resource_tracker

    # loky asks for this helper process of Python's, and its start would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
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


def _end_early(answers: Generator[object, None, None]) -> None:
    """End the work that is left, if any, and its workers, without joblib's warning of what is lost."""
    with warnings.catch_warnings():
        lost = r"\d+ tasks (have been successfully executed|which were still being processed)"
        warnings.filterwarnings("ignore", lost, UserWarning)
        answers.close()


@contextmanager
def _safe_paths() -> Iterator[None]:
    """Keep the current folder off the paths of the Pythons that are started: its modules are none of ours.

    loky and multiprocessing start them with -m and -c, and pass on no option of this one.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def _end_with_parent(parent: int) -> None:
    """Let this worker end as soon as process `parent`, which has started it, has ended.

    A thread waits for that. Linux could send a signal instead, but does so when the thread that started the worker
    ends, and loky starts some in threads that end before the work does.
    """
    threading.Thread(target=_end_after, args=(parent,), name="thenar parent", daemon=True).start()


def _end_after(parent: int) -> None:
    try:
        if sys.platform == "linux":
            ended = select.poll()
            ended.register(os.pidfd_open(parent), select.POLLIN)
            # By now the number may be another process's.
            if os.getppid() == parent:
                ended.poll()
    except OSError:  # no such process, or a kernel before 5.3
        pass
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)


class Aside(Generic[Answer]):
    """One piece of work at a time in a process of its own, which yields to everything else on the machine.

    It ends when this process does, however that ends.
    """

    def __init__(self) -> None:
        self._process: Any = None
        self._answers: Any = None

    @property
    def busy(self) -> bool:
        """Whether a piece of work is under way, or its answer has not been fetched."""
        return self._process is not None

    def start(self, work: Callable[[Task], Answer], task: Task) -> None:
        """Begin; must not be busy. `work` and `task` are pickled, and what `work` raises is told by its name."""
        from multiprocessing import get_context

        assert not self.busy
        context = get_context("spawn")
        self._answers, there = context.Pipe(duplex=False)
        # Its signals are held from before it is: a Ctrl-C is for this process.
        with _safe_paths(), _interrupts_held():
            self._process = context.Process(target=_aside, args=(os.getpid(), there, work, task), daemon=True)
            self._process.start()
        there.close()

    def fetch(self) -> Answer | None:
        """Return the answer, if it is there. Raises BrokenExecutor if the work has failed, with a sentence."""
        if self._process is None or not self._answers.poll():
            return None
        try:
            failure, answer = self._answers.recv()
        except EOFError:
            failure, answer = "its process ended, perhaps for want of memory", None
        self.close()
        if failure:
            raise BrokenExecutor(failure)
        found: Answer = answer
        return found

    def close(self) -> None:
        """End what is under way."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
            self._answers.close()
            self._process = None


def _aside(parent: int, there: Any, work: Callable[[Task], Answer], task: Task) -> None:
    _end_with_parent(parent)
    with suppress(OSError):
        os.nice(10)
    try:
        answer = "", work(task)
    except Exception as fault:
        answer = f"{type(fault).__name__}: {fault}", None  # type: ignore[assignment]
    there.send(answer)
