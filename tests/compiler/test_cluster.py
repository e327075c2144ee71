import asyncio
import builtins
import gc
import operator
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distributed import Client, LocalCluster
from numpy.typing import NDArray

from thenar.compiler import cluster as under_test
from thenar.compiler.cluster import ClusterError, dask_cluster
from thenar.compiler.workers import in_workers

pytestmark = pytest.mark.slow

# As large as the rows of a large set: Dask warns of such tasks, unless told otherwise.
X = np.arange(1 << 23, dtype=np.uint16).reshape(-1, 8)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Serve a cluster of two worker processes; yields its address."""
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0") as cluster:
        yield cluster.scheduler_address


def in_cluster(work: Callable[[Any], Any], tasks: Iterable[Any], address: str) -> Iterator[Any]:
    with dask_cluster(address):
        yield from in_workers(work, tasks, 1)


def column_sum(column: int, rows: NDArray[np.uint16]) -> tuple[int, int]:
    return column, int(rows[:, column].sum())


def test_the_answers_are_those_of_one_job_here(scheduler: str) -> None:
    work = partial(column_sum, rows=X)
    there = sorted(in_cluster(work, range(8), scheduler))
    assert there == sorted(in_workers(work, range(8), 1)) == [(n, int(X[:, n].sum())) for n in range(8)]


def test_more_tasks_than_are_handed_out_ahead_are_all_answered(scheduler: str) -> None:
    assert sorted(in_cluster(operator.neg, iter(range(150)), scheduler)) == sorted(-n for n in range(150))


def test_what_is_wrong_in_a_worker_is_raised_here(scheduler: str) -> None:
    with pytest.raises(ZeroDivisionError):
        list(in_cluster((1).__truediv__, [1, 0], scheduler))


def times_out(number: int) -> None:
    raise TimeoutError(f"piece {number}")


def test_a_timeout_in_the_work_is_not_the_clusters(scheduler: str) -> None:
    with pytest.raises(TimeoutError, match="piece 3"):
        list(in_cluster(times_out, [3], scheduler))


def threads(_number: int) -> set[int]:
    from threadpoolctl import threadpool_info

    assert np.ones((2, 2)).dot(np.ones((2, 2))).sum() == 8
    return {library["num_threads"] for library in threadpool_info()}


def test_a_worker_runs_one_thread(scheduler: str) -> None:
    assert list(in_cluster(threads, range(2), scheduler)) == [{1}, {1}]


def unread(_task: object) -> None:
    pass


class Unreadable:
    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return builtins.__import__, ("no_such_module_there",)


def test_work_that_a_worker_cannot_read_is_told_with_what_to_install(scheduler: str) -> None:
    with pytest.raises(
        ClusterError, match=r"cannot read its task \(No module named 'no_such.*needs the packages installed"
    ):
        list(in_cluster(unread, [Unreadable()], scheduler))


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:1", "127.0.0.1:1", "nonsense", "foo://127.0.0.1:1", "tls://127.0.0.1:1", ""]
)
def test_an_address_where_no_scheduler_answers_is_told_within_seconds(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(under_test, "CONNECT_S", 0.5)
    with pytest.raises(ClusterError, match=f"no Dask scheduler replies at '{address}'"):
        list(in_cluster(operator.neg, [1], address))


def test_where_nobody_answers_no_client_is_left_to_hold_up_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_test, "CONNECT_S", 0.5)
    for address in ("nonsense", "foo://127.0.0.1:1"):
        with pytest.raises(ClusterError, match="no Dask scheduler replies"):
            list(in_cluster(operator.neg, [1], address))
    assert not [thing for thing in gc.get_objects() if type(thing) is Client and thing.status == "connecting"]


def test_a_cluster_works_for_who_runs_a_loop_of_their_own(scheduler: str) -> None:
    async def asked() -> list[int]:
        return sorted(in_cluster(operator.neg, range(3), scheduler))

    assert asyncio.run(asked()) == [-2, -1, 0]


def test_without_dask_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r'pip install "thenar\[cluster\]"'):
        list(in_cluster(operator.neg, [1], "tcp://127.0.0.1:1"))


def killed_at_first(number: int, folder: Path) -> int:
    try:
        (folder / str(number)).touch(exist_ok=False)
    except FileExistsError:
        return -number
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def test_a_worker_that_is_killed_loses_nothing(scheduler: str, tmp_path: Path) -> None:
    (tmp_path / "0").touch()
    (tmp_path / "1").touch()
    assert sorted(in_cluster(partial(killed_at_first, folder=tmp_path), range(3), scheduler)) == [-2, -1, 0]


def killed(_number: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_work_that_kills_workers_fails_without_ending_the_cluster(scheduler: str) -> None:
    with pytest.raises(ClusterError, match="one task ended 4 workers"):
        list(in_cluster(killed, [0], scheduler))
    assert list(in_cluster(operator.neg, [1], scheduler)) == [-1]


class Served:
    """A scheduler and workers of it, each a process of its own, without nannies that would start them again."""

    def __init__(self) -> None:
        self.processes: list[subprocess.Popen[str]] = []
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        self.address = self._until(self.scheduler, "Scheduler at:").split()[-1]

    def worker(self, **variables: str) -> "subprocess.Popen[str]":
        process = self._start("worker", self.address, "--nthreads", "1", "--no-nanny", **variables)
        self._until(process, "Registered to:")
        return process

    def _start(self, what: str, *arguments: str, **variables: str) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard", *arguments]
        environment = os.environ | variables
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)
        self.processes.append(process)
        return process

    def _until(self, process: "subprocess.Popen[str]", words: str) -> str:
        assert process.stderr is not None
        return next(line for line in process.stderr if words in line)

    def end(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.communicate()


@pytest.fixture
def served() -> Iterator[Served]:
    processes = Served()
    yield processes
    processes.end()


def test_a_worker_without_thenar_is_named(served: Served, tmp_path: Path) -> None:
    (tmp_path / "thenar.py").write_text("raise ModuleNotFoundError(\"No module named 'thenar'\", name='thenar')")
    served.worker(PYTHONPATH=str(tmp_path))
    with pytest.raises(ClusterError, match=r"worker tcp://127.0.0.1:\d+ lacks thenar .*No module named 'thenar'"):
        list(in_cluster(operator.neg, [1], served.address))


def test_a_scheduler_without_workers_is_told(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_test, "WORKERS_S", 0.5)
    with pytest.raises(ClusterError, match="has no workers: start some"):
        list(in_cluster(operator.neg, [1], served.address))


@pytest.mark.parametrize(("who", "said"), [("worker", "has no workers"), ("scheduler", "are lost")])
def test_a_cluster_that_is_lost_on_the_way_is_an_error(
    served: Served, who: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for limit in ("PATIENCE_S", "WORKERS_S"):
        monkeypatch.setattr(under_test, limit, 0.5)
    worker = served.worker()
    answers = in_cluster(slow_after_the_first, range(2), served.address)
    assert next(answers) == 0
    (worker if who == "worker" else served.scheduler).kill()
    with pytest.raises(ClusterError, match=said):
        next(answers)


def slow_after_the_first(number: int) -> int:
    if number:
        signal.sigtimedwait([signal.SIGUSR1], 60)
    return number


INTERRUPTED = """
import sys
from tests.compiler.test_cluster import in_cluster, slow_after_the_first
for number in in_cluster(slow_after_the_first, range(2), sys.argv[1]):
    print(number, flush=True)
"""


def test_an_interrupt_ends_the_waiting_at_once(served: Served) -> None:
    served.worker()
    command = [sys.executable, "-c", INTERRUPTED, served.address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "0\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert said.rstrip().endswith("KeyboardInterrupt")
