"""A collection from end to end: the real command on a terminal of its own, real drivers, emulated devices on ptys."""

import os
import pty
import re
import resource
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet
from thenar.compiler.recordings.graspset import Joint
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.recording.guide import planned, read_journal
from thenar.runtime.taxels import TaxelCalibration
from thenar.studio.edits import change, load_edits

from ..gloves import pad_line
from .conftest import refusal

# Collections over ptys, in real time.
pytestmark = pytest.mark.slow

GLOVE = """name = "bench"
[cyberglove]
port = "{folder}/glove"
[[stream]]
port = "{folder}/board"
rate_hz = 200
switches = ["s1", "s2", "s3"]
"""
OBJECTS = 'cup = ["mug", "jar"]\npen = ["biro"]\n'


class Terminal:
    """`thenar record` on a pty."""

    def __init__(self, folder: Path, *more: str, most_bytes: int = resource.RLIM_INFINITY) -> None:
        self.master, slave = pty.openpty()
        options = ["--glove", folder / "glove.toml", "--taxonomy", "own", "--objects", folder / "objects.toml"]
        options += ["--subject", "A", "--repetitions", "2", "--countdown", "0.05", "-o", folder / "set.grasps"]
        options += more or ["--no-none"]
        command = [sys.executable, "-m", "thenar.cli", "record", *map(str, options)]
        environment = os.environ | {"TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
        self.process = subprocess.Popen(
            command,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env=environment,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY)),
        )
        os.close(slave)
        self.said = b""

    def until(self, pattern: bytes, seconds: float = 30.0) -> bytes:
        """Return what was said up to and with `pattern`, and forget it."""
        end = monotonic() + seconds
        while (found := re.search(pattern, self.said, re.DOTALL)) is None:
            assert monotonic() < end, self.said[-3000:]
            if select.select([self.master], [], [], 0.1)[0]:
                self.said += self._read()
        before, self.said = self.said[: found.end()], self.said[found.end() :]
        return before

    def press(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def finish(self) -> tuple[int, str]:
        """Return the exit code and the rest of what was said."""
        end = monotonic() + 60.0
        while True:
            assert monotonic() < end, self.said[-3000:]
            if select.select([self.master], [], [], 1.0)[0]:
                if not (chunk := self._read()):
                    break
                self.said += chunk
        return self.process.wait(30), self.said.decode("utf-8", "replace")

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)

    def _read(self) -> bytes:
        try:
            return os.read(self.master, 65536)
        except OSError:  # the other end is closed
            return b""


Start = Callable[..., Terminal]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "glove.toml").write_text(GLOVE.format(folder=tmp_path))
    (tmp_path / "objects.toml").write_text(OBJECTS)
    return tmp_path


@pytest.fixture
def board(folder: Path) -> Iterator[BoardSender]:
    with (
        PtyLine(folder / "board") as line,
        BoardSender(line.send, ("s1", "s2", "s3"), ("p0", "p1"), 200) as board,
    ):
        yield board


@pytest.fixture
def glove(folder: Path) -> Iterator[EmulatedCyberGlove]:
    with PtyLine(folder / "glove") as line, EmulatedCyberGlove(line) as glove:
        glove.set(bytes(range(101, 119)))
        yield glove


@pytest.fixture
def start(folder: Path) -> Iterator[Start]:
    terminals: list[Terminal] = []

    def begin(*more: str, most_bytes: int = resource.RLIM_INFINITY) -> Terminal:
        terminals.append(Terminal(folder, *more, most_bytes=most_bytes))
        return terminals[-1]

    yield begin
    for terminal in terminals:
        terminal.close()


@pytest.fixture(autouse=True)
def hands(board: BoardSender, glove: EmulatedCyberGlove) -> None:
    board.show({"s1": 1, "s2": 1})


def finished(terminal: Terminal) -> tuple[int, str]:
    """Finish a collection of which no trial is left."""
    terminal.until(rb"no trial is left.*?Enter: finish")
    terminal.press(b"\r")
    return terminal.finish()


def reviewed(terminal: Terminal, number: int) -> None:
    """Wait until this trial's grasp is there to judge; the countdown begins again while devices are on their way."""
    screen = rb"%d of 4: (?:(?!of 4: ).)*?(not captured: |the countdown waits: |: keep it)" % number
    while not terminal.until(screen).endswith(b": keep it"):
        terminal.until(rb"%d of 4: (?:(?!of 4: ).)*?Enter: start" % number)
        terminal.press(b"\r")


def at_the_second_trial(start: Start) -> Terminal:
    """Begin a collection whose first trial is accepted and whose second one is there to judge."""
    terminal = start("--seed", "5", "--no-none")
    terminal.until(rb"Enter: start the countdown")
    terminal.press(b"\r")
    reviewed(terminal, 1)
    terminal.press(b"\r")
    reviewed(terminal, 2)
    return terminal


def command_of(folder: Path, *more: object) -> list[str]:
    """Return the command that records in a folder without a terminal."""
    options = ["--glove", folder / "glove.toml", "--subject", "A", "-o", folder / "set.grasps", *more]
    return [sys.executable, "-m", "thenar.cli", "record", *map(str, options)]


def refused(command: list[str]) -> str:
    """Return the sentence in which a command is refused that has written nothing."""
    done = subprocess.run(command, stdin=subprocess.PIPE, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert not list(Path(command[command.index("-o") + 1]).parent.glob("set.*"))
    return done.stderr


def test_a_whole_collection_becomes_a_set(folder: Path, start: Start, board: BoardSender) -> None:
    terminal = start("--seed", "5", "--no-none")
    terminal.until(rb"Enter: start the countdown")
    terminal.press(b"\r")
    for number in (1, 2, 3, 4):
        reviewed(terminal, number)
        terminal.press(b"\r")
    code, said = finished(terminal)
    assert code == 0, said
    assert "set.grasps: 4 trials of 4 frames; 4 of 4 trials are done" in said
    grasp_set = GraspSet.load(folder / "set.grasps")
    assert sorted(zip(grasp_set.grasps.tolist(), grasp_set.objects.tolist(), strict=True)) == [
        ("cup", "jar"),
        ("cup", "mug"),
        ("pen", "biro"),
        ("pen", "biro"),
    ]
    assert grasp_set.switch_names == ("s1", "s2", "s3")
    assert grasp_set.switches.tolist() == [[True, True, False]] * 4
    assert grasp_set.codes.tolist() == [list(range(101, 117))] * 4
    assert grasp_set.joint_names[:2] == ("thumb_rotation", "thumb_mpj")
    assert grasp_set.subjects.tolist() == ["A"] * 4
    assert run(["import", str(folder / "set.mcap"), "-o", str(folder / "again.grasps")]) == 0
    assert (folder / "again.grasps").read_bytes() == (folder / "set.grasps").read_bytes()


def test_after_a_kill_the_same_command_goes_on_where_it_was(folder: Path, start: Start) -> None:
    first = at_the_second_trial(start)
    os.killpg(first.process.pid, signal.SIGKILL)
    first.process.wait()
    assert read_journal(folder / "set.mcap").accepted == (1,)
    assert not (folder / "set.grasps").exists()

    second = start()
    said = second.until(rb"Enter: start the countdown")
    assert b"2 of 4: " in said
    second.press(b"\r")
    for number in (2, 3, 4):
        reviewed(second, number)
        second.press(b"\r")
    code, text = finished(second)
    assert code == 0, text
    assert "set.grasps: 4 trials of 4 frames; 4 of 4 trials are done" in text
    assert GraspSet.load(folder / "set.grasps").trials.tolist() == [1, 2, 3, 4]

    third = start()
    code, text = third.finish()
    assert code == 0, text
    assert "4 of 4 trials are done" in text


def test_a_trial_that_is_undone_loses_its_edit(folder: Path, start: Start) -> None:
    """As on the page Record: the next trial of its number is another one."""
    terminal = at_the_second_trial(start)
    journal, log = read_journal(folder / "set.mcap"), folder / "edits.jsonl"
    assert journal.session.collection is not None
    first = planned(journal.session.collection)[0]
    change(log, [("set.grasps", "A", "1", first.grasp, first.object, 1)], "")
    terminal.press(b"u")
    terminal.until(rb"1 of 4: ")
    terminal.press(b"q")
    terminal.finish()
    assert [edit.new for edit in load_edits(log)[0]] == ["", first.grasp]


def test_pads_are_recorded_with_the_rest(
    folder: Path, start: Start, board: BoardSender, glove: EmulatedCyberGlove
) -> None:
    taxels = 'taxels = { p0 = [0, 1023], p1 = [0, 1023] }\n[taxels]\ncalibration = "pads.toml"\n'
    (folder / "glove.toml").write_text(GLOVE.format(folder=folder) + taxels)
    (folder / "pads.toml").write_text(TaxelCalibration(unit="N", sensors=(pad_line("p0", 100, 900, 2.0),)).to_toml())
    board.show({"p0": 500, "p1": 40})
    terminal = start("--seed", "5", "--no-none")
    terminal.until(rb"Enter: start the countdown")
    terminal.press(b"\r")
    for number in (1, 2):
        reviewed(terminal, number)
        terminal.press(b"\r")
    reviewed(terminal, 3)
    terminal.press(b"q")
    code, said = terminal.finish()
    assert code == 0, said
    grasp_set = GraspSet.load(folder / "set.grasps")
    assert grasp_set.taxels.tolist() == [[500, 40]] * 2
    assert grasp_set.taxel_columns == (Joint("p0", "N", 100, 0.0, 900, 2.0), Joint("p1", "counts", 0, 0.0, 1, 1.0))
    assert run(["import", str(folder / "set.mcap"), "-o", str(folder / "again.grasps")]) == 0
    assert (folder / "again.grasps").read_bytes() == (folder / "set.grasps").read_bytes()


def test_a_port_without_anybody_at_its_other_end_is_no_device(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        (folder / "glove.toml").write_text(f'name = "bench"\n[[stream]]\nport = "{port}"\nswitches = ["a", "b"]\n')
        said = refused(command_of(folder, "--taxonomy", "own", "--objects", folder / "objects.toml"))
    assert "nothing came in 3 s; nothing is recorded" in said


def test_a_full_disk_ends_recording_and_room_lets_it_resume(folder: Path, start: Start) -> None:
    code, said = start(most_bytes=16_384).finish()
    assert code == 2
    words = " ".join(said.split())
    assert "File too large: nothing more is written after" in words
    assert "free some space, and the same command goes on" in words
    again = start()
    again.until(rb"Enter: start the countdown")
    again.press(b"q")
    assert again.finish()[0] == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_cleanly(folder: Path, start: Start, number: signal.Signals) -> None:
    terminal = start()
    terminal.until(rb"Enter: start the countdown")
    terminal.process.send_signal(number)
    code, said = terminal.finish()
    assert code == 0, said
    assert "no trial was accepted" in said
    assert not (folder / "set.grasps").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["--subject", "B"], "was begun with a different value of subject (A, not B)"),
        (["--repetitions", "3"], "was begun with a different value of repetitions"),
        (["--seed", "6"], "was begun with a different value of seed"),
        (["--none"], "was begun with a different value of tasks"),
    ],
)
def test_another_collection_does_not_go_into_the_same_file(
    folder: Path, start: Start, change: list[str], said: str
) -> None:
    first = start("--seed", "5", "--no-none")
    first.until(rb"Enter: start the countdown")
    first.press(b"q")
    assert first.finish()[0] == 0
    before = (folder / "set.mcap").read_bytes()
    code, text = start(*change).finish()
    assert code == 2
    assert said in " ".join(text.split())
    assert (folder / "set.mcap").read_bytes() == before


def test_a_set_that_was_not_collected_here_is_not_replaced(folder: Path, start: Start) -> None:
    (folder / "set.grasps").write_bytes(b"imported")
    code, said = start().finish()
    assert code == 2
    assert "name another --output" in " ".join(said.split())
    assert (folder / "set.grasps").read_bytes() == b"imported"
    assert not (folder / "set.mcap").exists()


def test_ones_own_grasp_types_come_from_a_file(folder: Path) -> None:
    assert "name it with --objects" in refusal(*command_of(folder, "--taxonomy", "own")[3:])


def test_a_glove_without_devices_collects_nothing(folder: Path) -> None:
    (folder / "glove.toml").write_text('name = "bare"\n')
    assert "glove.toml names no device" in refusal(*command_of(folder)[3:])


def test_without_its_devices_nothing_is_recorded(folder: Path) -> None:
    (folder / "glove.toml").write_text(GLOVE.format(folder=folder / "none"))
    assert "there is no such port" in refused(command_of(folder))


def test_without_a_terminal_lines_are_keys(folder: Path, board: BoardSender) -> None:
    board.show({"s1": 0, "s2": 0})
    taxonomy = ("--taxonomy", "own", "--objects", folder / "objects.toml")
    command = command_of(folder, *taxonomy, "--repetitions", "1", "--countdown", "0")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        accepted, moving = 0, False
        for line in process.stderr:
            accepted += b"keep it" in line
            moving = b"nothing held, open hand: hold the hand open" in line or moving
            if b"Enter" in line:
                process.stdin.write(b"\n")
                process.stdin.flush()
        assert (accepted, moving) == (3, True)
        assert process.wait(30) == 0
        assert process.stdout is not None
        said = re.search(rb"3 trials \(2 grasps, 1 rest\) of (\d+) frames; 3 of 3", process.stdout.read())
    grasp_set = GraspSet.load(folder / "set.grasps")
    # Ten, but for those that a busy machine read too late.
    assert 1 <= len(grasp_set) - 2 <= 10
    assert said is not None
    assert int(said[1]) == len(grasp_set)
    assert len(grasp_set.without_none()) == 2
    assert set(grasp_set.rows(grasp_set.is_none).objects.tolist()) == {"open hand"}
    assert run(["import", str(folder / "set.mcap"), "-o", str(folder / "stream.grasps"), "--stream"]) == 0
    stream = GraspSet.load(folder / "stream.grasps")
    # Two hundred on a machine that is not busy.
    assert len(stream.rows(stream.is_none)) > 10
    assert set(np.diff(stream.times_us).tolist()) >= {10_000}


def test_without_stdin_it_says_where_keys_would_come_from(folder: Path) -> None:
    done = subprocess.run(
        ["sh", "-c", '"$@" <&-', "sh", *command_of(folder)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "stdin is closed" in done.stderr
    assert not (folder / "set.mcap").exists()
