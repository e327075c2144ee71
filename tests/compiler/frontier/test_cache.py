"""What a store keeps through kills, damage and full disks; and that what it keeps is not found again."""

import math
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.compiler.frontier.cache import Cache, Store, StoreError, question, stored


def key(number: int) -> bytes:
    return b"question %d" % number


class Answer(msgspec.Struct, frozen=True):
    rates: tuple[float, ...]
    name: str = ""


def filled(path: Path, count: int = 3) -> Path:
    with Store(path, "set") as store:
        for number in range(count):
            store.put(key(number), Answer((number / 3,)))
    return path


def kept(path: Path, count: int = 3) -> list[int]:
    """Return which of the questions of `filled` the store at `path` still answers, all of them rightly."""
    with Store(path, "set") as store:
        answers = {number: store.get(key(number), Answer) for number in range(count)}
    assert all(answer in (None, Answer((number / 3,))) for number, answer in answers.items())
    return [number for number, answer in answers.items() if answer is not None]


def test_another_scope_of_question_is_another_question(tmp_path: Path) -> None:
    filled(tmp_path / "store", 1)
    with Store(tmp_path / "store", "other set") as store:
        assert store.get(key(0), Answer) is None
        store.put(key(0), Answer((9.0,)))
    assert kept(tmp_path / "store", 1) == [0]


def test_a_stored_answer_of_another_type_is_computed_again(tmp_path: Path) -> None:
    filled(tmp_path / "store", 1)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(key(0), int) is None
        store.put(key(5), Answer((math.nan,)))
        assert store.get(key(5), Answer) is None


def foreign_database() -> bytes:
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute("CREATE TABLE mine (value)")
        return database.serialize()


@pytest.mark.parametrize(
    "content", [b"a,b\n1,2\n", b'{"key": 1}\n', b"\n", bytes(100), b"\xff\xfe", foreign_database()]
)
def test_a_foreign_file_is_refused_and_not_touched(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "mine.csv"
    path.write_bytes(content)
    with pytest.raises(StoreError, match=r"mine\.csv is no store of results"):
        Store(path, "set")
    assert path.read_bytes() == content
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]


def test_a_damaged_file_is_an_error_of_the_store(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    path.write_bytes(path.read_bytes()[:100] + bytes(5000))
    with pytest.raises(StoreError, match="store is no store of results"):
        Store(path, "set")


def test_what_is_no_file_or_in_no_folder_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, Path("/dev/null"), tmp_path / "no" / "store"):
        with pytest.raises(StoreError, match=str(path)):
            Store(path, "set")


def test_two_runs_do_not_have_it_at_once(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    with Store(path, "set"), pytest.raises(StoreError, match="in use by another run"):
        Store(path, "set")
    assert kept(path) == [0, 1, 2]


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from tests.compiler.frontier.test_cache import Answer, key
from thenar.compiler.frontier.cache import Store, StoreError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
with Store(Path(sys.argv[1]), "set") as store:
    try:
        for number in range(10_000):
            store.put(key(number), Answer((number / 3,)))
    except StoreError as reason:
        print(number, reason)
"""


def test_a_full_disk_is_told_and_what_was_put_stays(tmp_path: Path) -> None:
    path = tmp_path / "store"
    command = [sys.executable, "-c", FULL_DISK, str(path)]
    number, said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split(maxsplit=1)
    assert "cannot be written" in said
    assert f"its {number} results are kept" in said
    assert kept(path, int(number) + 100) == list(range(int(number)))


class Found(msgspec.Struct, frozen=True):
    square: float
    parts: tuple[int, ...]


class Notes:
    """A file that a result does not depend on."""

    identity = ""

    def __init__(self, path: Path) -> None:
        self.path = path


@stored(1)
def squared(number: int, notes: Notes) -> Found:
    """Leave a line in `notes` whenever it is done."""
    if number < 0:
        raise ValueError(f"{number} is negative")
    with notes.path.open("a") as file:
        file.write(f"{number}\n")
    return Found(number**2 / 7, (number,))


@stored(1)
def told_wrongly(number: int) -> str:
    return number  # type: ignore[return-value]


def calls_in(folder: Path, numbers: list[int] | range) -> list[tuple[int, Notes]]:
    return [(number, Notes(folder / "notes")) for number in numbers]


def done_in(folder: Path) -> list[int]:
    notes = folder / "notes"
    return sorted(map(int, notes.read_text().split())) if notes.exists() else []


def silent(_done: int, _total: int) -> None:
    pass


def asked(path: Path, calls: list[tuple[int, Notes]], jobs: int = 1) -> list[Found]:
    with Store(path, "set") as store:
        return Cache(store, silent, jobs=jobs).ask(squared, calls)


def found_of(numbers: list[int] | range) -> list[Found]:
    return [Found(number**2 / 7, (number,)) for number in numbers]


@pytest.mark.parametrize("jobs", [1, 2])
def test_answers_are_computed_once_and_come_in_call_order(tmp_path: Path, jobs: int) -> None:
    assert asked(tmp_path / "store", calls_in(tmp_path, [3, 1, 3, 2]), jobs) == found_of([3, 1, 3, 2])
    assert done_in(tmp_path) == [1, 2, 3]


def test_stored_answers_are_reused_and_read_back_equal(tmp_path: Path) -> None:
    first = asked(tmp_path / "store", calls_in(tmp_path, range(5)))
    again = asked(tmp_path / "store", calls_in(tmp_path, range(7)))
    assert done_in(tmp_path) == list(range(7))
    assert again[:5] == first


def test_what_was_found_before_an_error_is_kept(tmp_path: Path) -> None:
    calls = calls_in(tmp_path, [1, -1])
    with pytest.raises(ValueError, match="-1 is negative"):
        asked(tmp_path / "store", calls)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(question(squared, calls[0], {}), Found) is not None


def test_an_answer_that_json_would_change_is_refused_when_it_is_found(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store, pytest.raises(TypeError, match="the result of told_wrongly is no"):
        Cache(store, silent, jobs=1).ask(told_wrongly, [(1,)])


def test_every_round_has_the_same_weight(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    asked(tmp_path / "store", calls_in(tmp_path, [2]))
    with Store(tmp_path / "store", "set") as store:
        cache = Cache(store, lambda done, total: told.append((done, total)), 3, jobs=1)
        cache.ask(squared, calls_in(tmp_path, range(4)))
        cache.ask(squared, [])
        cache.ask(squared, calls_in(tmp_path, [9]))
    assert told == [(25, 300), (50, 300), (75, 300), (100, 300), (200, 300), (200, 300), (300, 300)]


@stored(1)
def lengths(array: np.ndarray[Any, Any], name: str = "") -> int:
    return len(array) + len(name)


@stored(2)
def other_lengths(array: np.ndarray[Any, Any], name: str = "") -> int:
    return len(array) + len(name)


def test_a_question_is_its_function_version_and_arguments_and_no_other() -> None:
    array = np.arange(6)
    here = question(lengths, (array,), {})
    assert here == question(lengths, (array.copy(), ""), {})
    others = (array[::-1], array.astype(np.int32), array.reshape(2, 3), array[:5], array + (array == 5))
    different = [question(lengths, (other,), {}) for other in others]
    different += [question(lengths, (array, "x"), {}), question(other_lengths, (array,), {})]
    assert here not in different
    assert len(set(different)) == len(different)
    first, second = calls_in(Path("a"), [1]), calls_in(Path("b"), [1])
    assert question(squared, first[0], {}) == question(squared, second[0], {})


def run(folder: Path, numbers: range) -> None:
    """Do what the killed process below does; it says when ten answers are stored."""

    def told(done: int, _total: int) -> None:
        if done >= 1:  # of 100, of 1000 calls
            print("ten", flush=True)
            signal.sigtimedwait([signal.SIGUSR1], 60)

    with Store(folder / "store", "set") as store:
        Cache(store, told, jobs=2).ask(squared, [(number, Notes(folder / "notes")) for number in numbers])


RUN = """
import sys
from pathlib import Path
from tests.compiler.frontier.test_cache import run
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
    calls = calls_in(again, range(1000))
    with Store(tmp_path / "store", "set") as store:
        known = {
            number for number, call in enumerate(calls) if store.get(question(squared, call, {}), Found) is not None
        }
    assert len(known) == 10
    assert asked(tmp_path / "store", calls) == found_of(range(1000))
    assert set(done_in(again)) == set(range(1000)) - known
