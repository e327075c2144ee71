"""What this machine can do: independent tasks on all cores, with each result as soon as it is available; and
trainings that fit into its memory.
"""

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager
from typing import TypeVar

from thenar.drivers.errors import ThenarError

Task = TypeVar("Task")
Result = TypeVar("Result")

# More processes than four per core are certainly a mistake, and would slow the machine to a halt.
MOST_JOBS = 4 * (os.cpu_count() or 1)

# Numbers of (types, rows) arrays in a round of boosting, and of a training's columns with two values and with more.
_BYTES_A_TYPE_AND_ROW, _BYTES_A_SWITCH_AND_ROW, _BYTES_A_JOINT_AND_ROW = 120, 10, 60
_SAFE_PATH = "PYTHONSAFEPATH"
# Rows times rounds of boosting: about a second's work.
_LITTLE = 200_000
# How often a worker checks whether its parent is still there.
_LOOK_S = 0.5


def in_workers(work: Callable[[Task], Result], tasks: Iterable[Task], jobs: int) -> Iterator[Result]:
    """Yield the results in the order of completion.

    jobs     worker processes, as joblib counts them: -1 for all cores, 1 for this process alone; no more than
             MOST_JOBS. A worker runs one thread.

    Workers end when this process does, however it ends.

    Raises BrokenExecutor if a worker is killed or cannot start, and any exception of the work.
    """
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
                    results = workers(delayed(work)(task) for task in tasks)
                    ended.callback(_end_early, results)
                # `yield from results` would close them without a filter when this generator is closed.
                yield from (result for result in results)
        except (BrokenExecutor, BrokenPipeError) as reason:
            raise BrokenExecutor(
                "a worker process ended before its work was done, perhaps for lack of memory: ``jobs`` 1 needs none"
            ) from reason


def little(work: int, jobs: int) -> int:
    """Return `jobs`, or 1 if the work (rows times rounds of boosting) is shorter than starting processes."""
    return 1 if work < _LITTLE else jobs


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Defer Ctrl-C and other signals that end a command. Processes started meanwhile never get these signals, so they
    print no traceback: this process ends them.
    """
    from multiprocessing import resource_tracker

    # loky needs this helper process of Python, whose start would unblock the signals.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _cancelled_work_forgotten() -> Iterator[None]:
    """Silence loky's thread when the workers end early.

    It cancels waiting tasks, and may then look for one that it was about to hand out: a harmless KeyError, which would
    be printed.
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


def _end_early(results: Generator[object, None, None]) -> None:
    """Cancel the remaining work, if any, and end its workers, without joblib's warning about lost tasks."""
    with warnings.catch_warnings():
        lost = r"\d+ tasks (have been successfully executed|which were still being processed)"
        warnings.filterwarnings("ignore", lost, UserWarning)
        results.close()


@contextmanager
def _safe_paths() -> Iterator[None]:
    """Keep the current folder off the import paths of started Pythons: its modules are not ours.

    loky and multiprocessing start them with -m and -c, and pass on no option of this process.
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
    """Let this worker end soon after process `parent`, which started it, has ended.

    Linux could send a signal instead, but does so when the thread that started the worker ends, and loky starts some in
    threads that end before the work does.
    """

    def wait() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(1)

    threading.Thread(target=wait, name="thenar parent", daemon=True).start()


def check_memory(rows: int, n_classes: int, raises: type[ThenarError], switches: int = 0, joints: int = 0) -> None:
    """Raise `raises` if training on `rows` rows needs more memory than this machine has."""
    a_row = _BYTES_A_TYPE_AND_ROW * n_classes + _BYTES_A_SWITCH_AND_ROW * switches + _BYTES_A_JOINT_AND_ROW * joints
    needed, there = rows * a_row, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > there:
        raise raises(
            f"training on {rows} rows of {n_classes} grasp types needs some {needed / 1e9:.1f} GB of memory, this "
            f"machine has {there / 1e9:.1f}: take fewer rows or columns"
        )
