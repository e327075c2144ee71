import random
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest
from distributed import LocalCluster

from thenar.compiler.cluster import ClusterError
from thenar.compiler.frontier.storing.resuming import Effort, resumed
from thenar.compiler.frontier.storing.store import Store


class Square(msgspec.Struct, frozen=True):
    number: int


class Found(msgspec.Struct, frozen=True):
    square: float
    parts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Task:
    """A piece of work that leaves a line in `notes` whenever it is done."""

    number: int
    notes: Path
    cost: float = 1.0

    @property
    def key(self) -> Square:
        return Square(self.number)


def squared(task: Task) -> Found:
    if task.number < 0:
        raise ValueError(f"{task.number} is negative")
    with task.notes.open("a") as notes:
        notes.write(f"{task.number}\n")
    return Found(task.number**2 / 7, (task.number,))


def tasks_in(folder: Path, numbers: list[int] | range) -> list[Task]:
    return [Task(number, folder / "notes", cost=1.0 + number % 3) for number in numbers]


def done_in(folder: Path) -> list[int]:
    notes = folder / "notes"
    return sorted(map(int, notes.read_text().split())) if notes.exists() else []


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_answer_comes_once_in_the_order_of_the_tasks_on_any_number_of_jobs(tmp_path: Path, jobs: int) -> None:
    with Store(tmp_path / "store", "set") as store:
        answers = resumed(store, tasks_in(tmp_path, [3, 1, 3, 2]), squared, Found, jobs=jobs)
    assert list(answers.items()) == [(Square(n), Found(n**2 / 7, (n,))) for n in (3, 1, 2)]
    assert done_in(tmp_path) == [1, 2, 3]


def test_a_cluster_finds_the_same_answers(tmp_path: Path) -> None:
    tasks = tasks_in(tmp_path, range(9))
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0") as cluster,
        Store(tmp_path / "cluster", "set") as store,
    ):
        there = resumed(store, tasks, squared, Found, cluster=cluster.scheduler_address)
    with Store(tmp_path / "here", "set") as store:
        assert resumed(store, tasks, squared, Found, jobs=1) == there
    assert done_in(tmp_path) == sorted(2 * [*range(9)])


def test_work_for_a_cluster_is_not_done_here(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store, pytest.raises(ClusterError, match="no Dask scheduler answers"):
        resumed(store, tasks_in(tmp_path, [1]), squared, Found, jobs=1, cluster="")


def test_what_is_stored_is_not_done_again_and_reads_as_what_was_found(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store:
        first = resumed(store, tasks_in(tmp_path, range(5)), squared, Found, jobs=1)
    with Store(tmp_path / "store", "set") as store:
        again = resumed(store, tasks_in(tmp_path, range(7)), squared, Found, jobs=1)
    assert done_in(tmp_path) == list(range(7))
    assert {key: again[key] for key in first} == first


def test_the_order_of_tasks_and_of_interruptions_changes_no_answer(tmp_path: Path) -> None:
    numbers = list(range(12))
    with Store(tmp_path / "whole", "set") as store:
        whole = resumed(store, tasks_in(tmp_path, numbers), squared, Found, jobs=1)
    shuffled = random.Random(7)
    with Store(tmp_path / "parts", "set") as store:
        for _ in range(4):
            resumed(store, tasks_in(tmp_path, shuffled.sample(numbers, 5)), squared, Found, jobs=1)
        shuffled.shuffle(numbers)
        assert resumed(store, tasks_in(tmp_path, numbers), squared, Found, jobs=1) == whole


def test_what_was_found_before_an_error_is_kept(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store, pytest.raises(ValueError, match="-1 is negative"):
        resumed(store, [Task(1, tmp_path / "notes", 9.0), Task(-1, tmp_path / "notes")], squared, Found, jobs=1)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(Square(1), Found) is not None


def test_an_answer_that_json_would_change_is_refused_when_it_is_found(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store, pytest.raises(TypeError, match="does not read as Square"):
        resumed(store, tasks_in(tmp_path, [1]), squared, Square, jobs=1)  # type: ignore[arg-type]


def test_the_dearest_tasks_begin_first(tmp_path: Path) -> None:
    costs = {1: 2.0, 2: 30.0, 3: 4.0}
    with Store(tmp_path / "store", "set") as store:
        tasks = [Task(number, tmp_path / "notes", cost) for number, cost in costs.items()]
        resumed(store, tasks, squared, Found, jobs=1)
    assert (tmp_path / "notes").read_text().split() == ["2", "3", "1"]


def test_one_progress_goes_over_all_stages_and_counts_nothing_that_was_stored(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    effort = Effort(lambda done, total: told.append((done, total)), {"first": 10.0, "second": 20.0})
    with Store(tmp_path / "store", "set") as store:
        resumed(store, tasks_in(tmp_path, [2]), squared, Found, jobs=1)
        resumed(store, tasks_in(tmp_path, range(3)), squared, Found, jobs=1, effort=effort, stage="first")
        resumed(store, [Task(9, tmp_path / "notes", 40.0)], squared, Found, jobs=1, effort=effort, stage="second")
    assert told == [(0, 23), (2, 23), (3, 23), (3, 43), (43, 43)]


def run(folder: Path, numbers: range) -> None:
    """Do what the killed process below does; it says when ten answers are stored."""

    def told(done: int, _total: int) -> None:
        if done >= 10:
            print("ten", flush=True)
            signal.sigtimedwait([signal.SIGUSR1], 60)

    tasks = [Task(number, folder / "notes") for number in numbers]
    with Store(folder / "store", "set") as store:
        resumed(store, tasks, squared, Found, jobs=2, effort=Effort(told))


RUN = """
import sys
from pathlib import Path
from tests.compiler.frontier.storing.test_resuming import run
run(Path(sys.argv[1]), range(1000))
"""


def test_a_run_that_is_killed_goes_on_where_it_was(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", RUN, str(tmp_path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ten\n"
        process.kill()
        process.wait()
    # What its workers, which outlive it for a moment, still note belongs to the killed run.
    (tmp_path / "notes").rename(tmp_path / "notes.killed")
    again = tmp_path / "again"
    again.mkdir()
    with Store(tmp_path / "store", "set") as store:
        stored = {number for number in range(1000) if store.get(Square(number), Found) is not None}
        answers = resumed(store, tasks_in(again, range(1000)), squared, Found, jobs=1)
    assert len(stored) == 10
    assert set(done_in(again)) == set(range(1000)) - stored
    assert answers == {Square(n): Found(n**2 / 7, (n,)) for n in range(1000)}
