import os
import pty
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

import pytest

from thenar.drivers.calibration import FLAT, POSES
from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.calibration import load_calibration

from .conftest import refusal, thenar

# Dialogues over a pty, in real time.
pytestmark = pytest.mark.slow

Answer = Callable[[str], str | None]
HANGING_S = 60.0
ALL = (FLAT, *POSES)


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "glove") as line:
        yield line


class Wearer:
    """Someone who wears the emulated glove and does as asked, but for what `odd` says of the number of a question.

    A hand that holds pose n has the byte 60 + 20 n on every sensor; the third time someone is asked is question 2.
    """

    def __init__(self, glove: EmulatedCyberGlove, sensors: int, odd: dict[int, str | int | None]) -> None:
        self.glove, self.sensors, self.odd = glove, sensors, odd
        self.questions = 0

    def __call__(self, text: str) -> str | None:
        """Answer a line on stderr: None where it asks nothing."""
        if named := re.match(r"Pose \d+ of \d+, ([^:]+):", text):
            pose = [pose.name for pose in ALL].index(named[1])
            raw = self.odd.get(self.questions)
            self.glove.set(bytes([raw if isinstance(raw, int) else 60 + 20 * pose] * self.sensors))
        if not text.startswith("Enter"):
            return None
        typed = self.odd.get(self.questions, "")
        self.questions += 1
        return typed if isinstance(typed, str) else ""


@contextmanager
def calibrating(line: PtyLine, output: Path, *options: str) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-m", "thenar.cli", "calibrate", str(line.link), "-o", str(output), *options]
    pipe = subprocess.PIPE
    with subprocess.Popen([*command, "--hold", "0.05"], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        hanging = Timer(HANGING_S, process.kill)
        hanging.start()
        try:
            yield process
        finally:
            hanging.cancel()
            process.kill()


def converse(process: "subprocess.Popen[str]", answer: Answer) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of a calibration that is answered to the end."""
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    said = ""
    for text in process.stderr:
        said += text
        typed = answer(text)
        if typed is not None:
            process.stdin.write(typed + "\n")
            process.stdin.flush()
    return process.wait(HANGING_S), process.stdout.read(), said


@pytest.mark.parametrize(("sensors", "names"), [(18, SENSORS_18), (22, SENSORS_22)])
def test_pose_by_pose_every_sensor_gets_its_two_points(
    line: PtyLine, tmp_path: Path, sensors: int, names: tuple[str, ...]
) -> None:
    output = tmp_path / "anna.toml"
    with EmulatedCyberGlove(line, sensors=sensors) as glove, calibrating(line, output) as process:
        code, out, said = converse(process, Wearer(glove, sensors, {}))
    assert (code, out) == (0, f"{output}: {sensors} sensors of anna\n"), said
    assert all(f"Pose {number} of 7, {pose.name}: {pose.instruction}" in said for number, pose in enumerate(ALL, 1))
    calibration = load_calibration(output)
    assert calibration.subject == "anna"
    assert tuple(sensor.name for sensor in calibration.sensors) == names
    for sensor in calibration.sensors:
        (number,) = [number for number, pose in enumerate(ALL) if sensor.name in pose.degrees]
        assert (sensor.raw_a, sensor.value_a) == (60, 0.0)
        assert (sensor.raw_b, sensor.value_b) == (60 + 20 * number, ALL[number].degrees[sensor.name])


def test_a_pose_that_was_not_taken_up_is_asked_for_again(line: PtyLine, tmp_path: Path) -> None:
    output = tmp_path / "anna.toml"
    with EmulatedCyberGlove(line) as glove, calibrating(line, output) as process:
        # Question 1 is the fist, held like the flat hand; question 2 whether to hold it again.
        code, _, said = converse(process, Wearer(glove, 18, {1: 60, 2: ""}))
    assert code == 0, said
    assert "index_mpj went from 60 to 60 only: was the joint moved?" in said
    assert said.count("Pose 2 of 7") == 2
    assert {sensor.raw_b for sensor in load_calibration(output).sensors if "mpj" in sensor.name} == {80, 100}


def test_a_doubtful_pose_may_be_kept_without_its_unmoved_sensors(line: PtyLine, tmp_path: Path) -> None:
    output = tmp_path / "a.toml"
    with EmulatedCyberGlove(line) as glove, calibrating(line, output, "--subject", "Anna B") as process:
        code, out, said = converse(process, Wearer(glove, 18, {6: 60, 7: "k"}))
    assert (code, out) == (0, f"{output}: 17 sensors of Anna B\n"), said
    assert "Not calibrated, because they did not move: wrist_yaw" in said
    assert "wrist_yaw" not in [sensor.name for sensor in load_calibration(output).sensors]


def test_an_answer_that_was_not_offered_takes_no_pose(line: PtyLine, tmp_path: Path) -> None:
    with EmulatedCyberGlove(line) as glove, calibrating(line, tmp_path / "a.toml") as process:
        code, _, said = converse(process, Wearer(glove, 18, {0: "back", 3: "k"}))
    assert code == 0, said
    assert "'back' is not one of the keys: type one that the question names" in said
    assert "'k' is not one of the keys: type one that the question names" in said
    assert [said.count(f"Pose {number} of 7") for number in range(1, 8)] == [1] * 7


def test_a_hand_that_never_moved_leaves_the_old_file(line: PtyLine, tmp_path: Path) -> None:
    output = tmp_path / "a.toml"
    output.write_text("old")
    still: dict[int, str | int | None] = dict.fromkeys(range(0, 13), 60)
    still |= dict.fromkeys(range(2, 13, 2), "k")
    with EmulatedCyberGlove(line) as glove, calibrating(line, output, "--overwrite") as process:
        code, _, said = converse(process, Wearer(glove, 18, still))
    assert code == 2, said
    assert "no sensor moved" in said.splitlines()[-1]
    assert output.read_text() == "old"


def test_one_may_go_back_to_the_pose_before(line: PtyLine, tmp_path: Path) -> None:
    output = tmp_path / "anna.toml"
    with EmulatedCyberGlove(line) as glove, calibrating(line, output) as process:
        code, _, said = converse(process, Wearer(glove, 18, {2: "b"}))
    assert code == 0, said
    assert [said.count(f"Pose {number} of 7") for number in range(1, 8)] == [1, 2, 2, 1, 1, 1, 1]
    assert len(load_calibration(output).sensors) == 18


@pytest.mark.parametrize(
    ("end", "code", "message"),
    [("q", 130, "interrupted"), ("ctrl-c", 130, "interrupted"), ("eof", 2, "the input ended"), ("pull", 2, "is gone")],
)
def test_whatever_ends_it_early_leaves_the_old_file(
    line: PtyLine, tmp_path: Path, end: str, code: int, message: str
) -> None:
    output = tmp_path / "anna.toml"
    output.write_text("old")

    with EmulatedCyberGlove(line) as glove, calibrating(line, output, "--overwrite") as process:
        wearer = Wearer(glove, 18, {})

        def answer(text: str) -> str | None:
            if wearer.questions < 3 or not text.startswith("Enter"):
                return wearer(text)
            finish()
            return "q" if end == "q" else None

        def finish() -> None:
            assert process.stdin is not None
            if end == "ctrl-c":
                process.send_signal(signal.SIGINT)
            elif end == "eof":
                process.stdin.close()
            elif end == "pull":
                line.unplug()

        ended, out, said = converse(process, answer)
    assert (ended, out) == (code, ""), said
    assert message in said.splitlines()[-1]
    assert "Traceback" not in said
    assert output.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != "glove") == ["anna.toml"]


def test_an_unplugged_glove_is_not_calibrated(line: PtyLine, tmp_path: Path) -> None:
    with EmulatedCyberGlove(line) as glove, calibrating(line, tmp_path / "anna.toml") as process:
        glove.box.plugged = False
        code, _, said = converse(process, lambda _: None)
    assert code == 2
    assert "?G returns 1, not 3" in said
    assert "the glove is not plugged into its box" in said.splitlines()[-1]


def test_on_a_terminal_the_bytes_are_shown_live(line: PtyLine, tmp_path: Path) -> None:
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "thenar.cli", "calibrate", str(line.link), "-o", str(tmp_path / "a.toml")]
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "100", "LINES": "50"}
    with EmulatedCyberGlove(line) as glove:
        glove.set(bytes(range(201, 219)))
        with subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=environment) as process:
            hanging = Timer(HANGING_S, process.kill)
            hanging.start()
            os.close(slave)
            shown = b""
            while b"wrist_yaw" not in shown or b"218" not in shown:
                shown += os.read(master, 4096)
            os.write(master, b"q\n")
            while True:
                try:
                    shown += os.read(master, 4096)
                except OSError:  # the other side is closed
                    break
            assert process.wait(HANGING_S) == 130
            hanging.cancel()
    os.close(master)
    assert b"interrupted" in shown


def test_missing_port_and_wrong_baud_rate_are_reported_in_a_sentence(tmp_path: Path) -> None:
    done = thenar("calibrate", tmp_path / "none", "-o", tmp_path / "a.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"thenar: .*/none: there is no such port: .*\n", done.stderr)
    for baud in ("fast", "0", "-3", "99999999999"):
        assert "--baud" in refusal("calibrate", "x", "-o", tmp_path / "a.toml", "--baud", baud)
