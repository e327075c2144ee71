import math
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.storing.store import HEADER, Store, StoreError


class Question(msgspec.Struct, frozen=True):
    number: int
    way: str = "id3"


class OtherQuestion(msgspec.Struct, frozen=True):
    number: int
    way: str = "id3"


class Answer(msgspec.Struct, frozen=True):
    rates: tuple[float, ...]
    name: str = ""


def filled(path: Path, count: int = 3) -> Path:
    with Store(path, "set") as store:
        for number in range(count):
            store.put(Question(number), Answer((number / 3,)))
    return path


def kept(path: Path, count: int = 3) -> list[int]:
    """Return which of the questions of `filled` the store at `path` still answers, all of them rightly."""
    with Store(path, "set") as store:
        answers = {number: store.get(Question(number), Answer) for number in range(count)}
    assert all(answer in (None, Answer((number / 3,))) for number, answer in answers.items())
    return [number for number, answer in answers.items() if answer is not None]


def test_what_was_put_is_there_at_once_and_after_opening_again(tmp_path: Path) -> None:
    with Store(tmp_path / "store", "set") as store:
        store.put(Question(1), Answer((0.1, 1 / 3), "Zylinder\n\u2028"))
        at_once = store.get(Question(1), Answer)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(Question(1), Answer) == at_once == Answer((0.1, 1 / 3), "Zylinder\n\u2028")
        assert len(store) == 1


def test_another_value_kind_or_scope_of_question_is_another_question(tmp_path: Path) -> None:
    filled(tmp_path / "store", 1)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(Question(0, "rfe"), Answer) is None
        assert store.get(OtherQuestion(0), Answer) is None
    with Store(tmp_path / "store", "other set") as store:
        assert store.get(Question(0), Answer) is None
        store.put(Question(0), Answer((9.0,)))
    assert kept(tmp_path / "store", 1) == [0]


def test_the_newest_answer_to_a_question_counts(tmp_path: Path) -> None:
    filled(tmp_path / "store", 1)
    with Store(tmp_path / "store", "set") as store:
        store.put(Question(0), Answer((7.0,)))
    with Store(tmp_path / "store", "set") as store:
        assert store.get(Question(0), Answer) == Answer((7.0,))


def test_an_answer_that_no_longer_reads_as_asked_is_to_be_found_again(tmp_path: Path) -> None:
    filled(tmp_path / "store", 1)
    with Store(tmp_path / "store", "set") as store:
        assert store.get(Question(0), Question) is None
        store.put(Question(5), Answer((math.nan,)))
        assert store.get(Question(5), Answer) is None


@given(lost=st.integers(min_value=1, max_value=400))
def test_a_torn_end_loses_the_lines_it_tore_and_no_other(tmp_path_factory: pytest.TempPathFactory, lost: int) -> None:
    path = filled(tmp_path_factory.mktemp("store") / "store")
    whole = path.read_bytes()
    torn = whole[: max(0, len(whole) - lost)]
    path.write_bytes(torn)
    lines = max(0, torn.count(b"\n") - 1)
    assert kept(path) == list(range(lines))
    assert path.read_bytes() == (torn[: torn.rindex(b"\n") + 1] if b"\n" in torn else HEADER)
    filled(path)
    assert kept(path) == [0, 1, 2]


@given(at=st.integers(min_value=0), bit=st.integers(min_value=0, max_value=7))
def test_a_damaged_line_is_taken_for_none_and_the_others_stay(
    tmp_path_factory: pytest.TempPathFactory, at: int, bit: int
) -> None:
    path = filled(tmp_path_factory.mktemp("store") / "store")
    data = bytearray(path.read_bytes())
    at = len(HEADER) + at % (len(data) - len(HEADER))
    data[at] ^= 1 << bit
    line = data[:at].count(b"\n") - 1
    path.write_bytes(data)
    # A damaged end of line joins two lines.
    assert set(range(3)) - {line, line + 1} <= set(kept(path))
    left = kept(path)
    assert line not in left
    with Store(path, "set") as store:
        assert len(store) == len(left)


def test_zeros_that_a_loss_of_power_left_at_the_end_are_cut_off(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    whole = path.read_bytes()
    path.write_bytes(whole + bytes(4096))
    assert kept(path) == [0, 1, 2]
    assert path.read_bytes() == whole


@pytest.mark.parametrize(
    "content", [b"a,b\n1,2\n", b'{"key": 1}\n', HEADER.replace(b"1}", b"2}"), b"\n", bytes(100), b"\xff\xfe"]
)
def test_a_foreign_file_is_refused_and_not_touched(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "mine.csv"
    path.write_bytes(content)
    with pytest.raises(StoreError, match=r"mine\.csv is no store of answers"):
        Store(path, "set")
    assert path.read_bytes() == content


def test_what_is_no_file_or_in_no_folder_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, Path("/dev/null"), tmp_path / "no" / "store"):
        with pytest.raises(StoreError, match=str(path)):
            Store(path, "set")


def test_two_runs_do_not_have_it_at_once(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    with Store(path, "set"), pytest.raises(StoreError, match="in use by another run"):
        Store(path, "set")
    assert kept(path) == [0, 1, 2]


OTHER_RUN = """
import sys
from pathlib import Path
from thenar.compiler.frontier.storing.store import Store
store = Store(Path(sys.argv[1]), "set")
print("open", flush=True)
sys.stdin.read()
"""


def test_another_process_that_is_killed_lets_it_go(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    command = [sys.executable, "-c", OTHER_RUN, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"open\n"
        with pytest.raises(StoreError, match="in use by another run"):
            Store(path, "set")
        process.kill()
        process.wait()
    assert kept(path) == [0, 1, 2]


def test_closing_twice_is_closing_and_nothing_is_put_after_it(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", "set")
    store.close()
    store.close()
    with pytest.raises(StoreError, match="closed"):
        store.put(Question(1), Answer(()))


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from tests.compiler.frontier.storing.test_store import Answer, Question
from thenar.compiler.frontier.storing.store import Store, StoreError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with Store(Path(sys.argv[1]), "set") as store:
    try:
        for number in range(100):
            store.put(Question(number), Answer((number / 3,)))
    except StoreError as reason:
        print(number, reason)
"""


def test_a_full_disk_is_told_and_what_was_put_stays(tmp_path: Path) -> None:
    path = tmp_path / "store"
    command = [sys.executable, "-c", FULL_DISK, str(path)]
    number, said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split(maxsplit=1)
    assert "File too large" in said
    assert f"its {number} answers are kept" in said
    assert kept(path, 100) == list(range(int(number)))
