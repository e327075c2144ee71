"""Ctrl-C, SIGTERM and SIGHUP, sent to real processes at work: all of it ends, and nothing is left."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

from thenar.cli import run

# Touches the file "ready" when the work of a command has made its first step, or has handed out its first piece.
PROGRAM = """
import pathlib, sys
import thenar.cli.printing as printing
from contextlib import contextmanager
ready = pathlib.Path("ready")
@contextmanager
def telling(what):
    yield lambda done, total: done and ready.touch()
printing.progress = telling
import thenar.compiler.workers as workers
held = workers._interrupts_held
@contextmanager
def handing_out():
    with held(): yield
    ready.touch()
workers._interrupts_held = handing_out
from thenar.cli import main
main()
"""
# Linux, include/linux/sched.h: in the flags of /proc/*/stat.
PF_EXITING = 4
COMMANDS = {
    "simulate": "simulate crowd -o old.grasps --overwrite --jobs 2",
    "evaluate": "evaluate set.grasps --repeats 50 --tables compositions --protocol paper -o new.json --jobs 2",
    "compile": "compile set.grasps -o new --rounds 100000 --folds 10",
    "verify": "verify build set.grasps --firmware host",
    "frontier": "frontier set.grasps -o new --jobs 2",
    "stability": "stability --jobs 2",
}
CTRL_C = (signal.SIGINT, "thenar: interrupted", 130)
SIGTERM = (signal.SIGTERM, "thenar: terminated", 143)
SENT = {"ctrl-c": (*CTRL_C, True), "kill -INT": (*CTRL_C, False)}
SENT |= {"sigterm": (*SIGTERM, False), "sigterm to all": (*SIGTERM, True)}
# Of all commands with all signals, the quick half takes these.
QUICK = {("simulate", "ctrl-c"), ("stability", "ctrl-c"), ("evaluate", "ctrl-c"), ("evaluate", "kill -INT")}


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("material")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run(["simulate", "quick", "-o", "set.grasps", "--repetitions", "3", "--jobs", "1"]) == 0
        assert run(["compile", "set.grasps", "-o", "build", "--rounds", "3", "--folds", "0", "--no-report"]) == 0
    return folder


@pytest.fixture
def folder(tmp_path: Path, material: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "work").mkdir()
    (tmp_path / "temporary").mkdir()
    for path in material.iterdir():
        (tmp_path / "work" / path.name).symlink_to(path)
    (tmp_path / "work" / "old.grasps").write_text("old")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setenv("JOBLIB_TEMP_FOLDER", str(tmp_path / "temporary"))
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


def _of_group(group: int) -> Iterator[str]:
    """Yield the processes of a group that have not ended: neither zombies, nor those that the kernel is removing. These
    run nothing any more and have closed their files already, which is what this test waits for.
    """
    for process in Path("/proc").glob("[0-9]*"):
        try:
            fields = (process / "stat").read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z" and not int(fields[6]) & PF_EXITING:
            yield process.name


@pytest.mark.parametrize(
    ("command", "sent"),
    [
        pytest.param(command, sent, id=f"{sent}-{command}", marks=[pytest.mark.slow] * ((command, sent) not in QUICK))
        for sent in SENT
        for command in COMMANDS
    ],
)
def test_a_signal_ends_all_of_it_and_leaves_nothing(command: str, sent: str, folder: Path) -> None:
    number, said, code, to_all = SENT[sent]
    before = {path.name for path in Path().iterdir()}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *COMMANDS[command].split()],
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        late = monotonic() + 60
        while not Path("ready").exists():
            assert process.poll() is None, process.communicate()
            assert monotonic() < late
            sleep(0.002)
        (os.killpg if to_all else os.kill)(process.pid, number)
        printed, complaints = process.communicate(timeout=60)
        left = list(_of_group(process.pid))
    finally:
        for one in list(_of_group(process.pid)):
            os.kill(int(one), signal.SIGKILL)
    if command == "evaluate":  # warns, and prints each table as it is finished
        printed, complaints = "", "\n".join(one for one in complaints.splitlines() if not one.startswith("warning: "))
    assert (process.returncode, printed, complaints.strip()) == (code, "", said)
    # Its store, from which the same command goes on, is all that a frontier leaves.
    kept = {"ready", "new"} if command == "frontier" else {"ready"}
    assert {path.name for path in Path().iterdir()} - before <= kept
    assert Path("old.grasps").read_text() == "old"
    assert left == []
    assert list((folder / "temporary").iterdir()) == []
    marks = (f"-{process.pid}-", f"_{process.pid}_")
    assert [path for path in Path("/dev/shm").iterdir() if any(mark in path.name for mark in marks)] == []


def test_a_hangup_that_nohup_ignores_stays_ignored() -> None:
    program = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "from thenar.cli import run\n"
        "import thenar.cli.group as group\n"
        "group.run_group = lambda arguments: os.kill(os.getpid(), signal.SIGHUP) or 0\n"
        "sys.exit(run([]))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_handlers_are_put_back() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    assert run(["--version"]) == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before
