import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Generator
from concurrent.futures import BrokenExecutor
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from thenar.compiler.workers import in_workers


def squared_where(number: int) -> tuple[int, int]:
    return number * number, os.getpid()


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_piece_of_work_is_answered_once(jobs: int) -> None:
    answers = in_workers(squared_where, iter(range(20)), jobs)
    assert sorted(answer for answer, _ in answers) == [number * number for number in range(20)]


def test_one_job_is_done_in_this_process_and_several_in_others() -> None:
    assert {process for _, process in in_workers(squared_where, range(3), 1)} == {os.getpid()}
    assert os.getpid() not in {process for _, process in in_workers(squared_where, range(3), 2)}


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_wrong_in_a_worker_is_raised_here(jobs: int) -> None:
    with pytest.raises(ZeroDivisionError):
        list(in_workers((1).__truediv__, [1, 0], jobs))


def killed(_number: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_worker_is_an_error_and_is_replaced() -> None:
    with pytest.raises(BrokenExecutor, match="ended before its work was done"):
        list(in_workers(killed, range(3), 2))
    assert len(list(in_workers(squared_where, range(3), 2))) == 3


def test_an_end_before_the_last_answer_warns_of_nothing() -> None:
    answers = in_workers(squared_where, count(), 2)
    assert isinstance(answers, Generator)
    next(answers)
    with warnings.catch_warnings(record=True) as complaints:
        warnings.simplefilter("always")
        answers.close()
    assert complaints == []


def test_a_slip_of_the_finger_does_not_start_a_million_processes() -> None:
    assert list(in_workers(squared_where, [], 10**30)) == []


BUSY = """
import os, signal, sys
from pathlib import Path
from thenar.compiler.workers import in_workers

def work(number):
    (Path(sys.argv[1]) / str(os.getpid())).touch()
    while True:
        {step}

if __name__ == "__main__":
    list(in_workers(work, range(2), 2))
"""


def runs(process: int) -> bool:
    """Return whether a process is there, and is no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(limit_s: float, condition: Any) -> bool:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)
    return bool(condition())


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("step", ["signal.pause()", "pass"])
def test_workers_end_when_their_parent_is_killed(tmp_path: Path, step: str) -> None:
    script, folder = tmp_path / "busy.py", tmp_path / "workers"
    script.write_text(BUSY.format(step=step))
    folder.mkdir()
    parent = subprocess.Popen([sys.executable, script, folder])
    try:
        assert wait_until(60, lambda: len(list(folder.iterdir())) == 2)
        workers = [int(path.name) for path in folder.iterdir()]
        assert all(map(runs, workers))
    finally:
        parent.kill()
        parent.wait()
    try:
        assert wait_until(5, lambda: not any(map(runs, workers)))
    finally:
        for worker in filter(runs, workers):
            os.kill(worker, signal.SIGKILL)


@pytest.mark.usefixtures("hostile_folder")
def test_no_module_of_the_current_folder_runs_in_a_worker() -> None:
    work = "from math import sqrt; from thenar.compiler.workers import in_workers; print(*in_workers(sqrt, [4, 4], 2))"
    done = subprocess.run([sys.executable, "-P", "-c", work], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("2.0 2.0\n", "")


def test_the_environment_is_as_it_was_after_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in (None, "", "1"):
        monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
        if before is not None:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        list(in_workers(squared_where, range(3), 2))
        assert os.environ.get("PYTHONSAFEPATH") == before
