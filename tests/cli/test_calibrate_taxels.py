import os
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Event

import click
import pytest

from thenar.cli.calibrate_command import TypedLines
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.calibration import load_lines
from thenar.runtime.taxels import TaxelCalibration

from ..gloves import pad_line

HANGING_S = 60.0
PADS = ("p0", "p1", "p2")
REST = (40, 900, 500)


class Pressed(BoardSender):
    """A board whose rows hold the codes of `script` one after the other, and then the last."""

    def __init__(self, line: PtyLine) -> None:
        self.script = deque[Sequence[int]]([REST])
        self.done = Event()
        super().__init__(line.send, (), PADS, 200)

    def line(self, now_s: float) -> bytes:
        """Return the row with the next codes."""
        if self.script:
            self.show(dict(zip(PADS, self.script.popleft(), strict=True)))
            if not self.script:
                self.done.set()
        return super().line(now_s)


def calibrated(folder: Path, presses: Sequence[Sequence[int]], *options: str) -> tuple[int, str]:
    """Hold each press for twenty rows when asked to; return exit code and what was said on stderr."""
    glove, ranges = folder / "glove.toml", ", ".join(f"{name} = [0, 1023]" for name in PADS)
    glove.write_text(
        f'[[stream]]\nport = "{folder}/port"\nrate_hz = 200\ntaxels = {{ {ranges} }}\n'
        '[taxels]\ncalibration = "pads.toml"\n'
    )
    command = [sys.executable, "-m", "thenar.cli", "calibrate", str(glove), "--taxels", "-o", str(folder / "pads.toml")]
    with PtyLine(folder / "port") as line, Pressed(line) as board:
        pipe = subprocess.PIPE
        with subprocess.Popen(
            [*command, "--hold", "0.05", *options], stdin=pipe, stdout=subprocess.DEVNULL, stderr=pipe, text=True
        ) as process:
            assert process.stdin is not None
            assert process.stderr is not None
            said = ""
            for text in process.stderr:
                said += text
                if text.startswith("Press every"):
                    board.done.clear()
                    board.script.extend(codes for codes in (*presses, REST) for _ in range(20))
                elif text.startswith("Enter"):
                    assert not board.script or board.done.wait(HANGING_S)
                    process.stdin.write("\n")
                    process.stdin.flush()
            return process.wait(HANGING_S), said


def test_rest_and_press_are_learnt_except_of_taxels_never_pressed(tmp_path: Path) -> None:
    code, said = calibrated(tmp_path, [(800, 900, 503), (40, 120, 500)], "--newtons", "2.5", "--subject", "anna")
    assert code == 0, said
    assert "Not calibrated, because they did not move: p2" in said
    lines = (pad_line("p0", 40, 800, 2.5), pad_line("p1", 900, 120, 2.5))
    found = load_lines(tmp_path / "pads.toml", TaxelCalibration)
    assert found == TaxelCalibration(subject="anna", unit="N", sensors=lines)


def test_where_nothing_moves_nothing_is_written(tmp_path: Path) -> None:
    code, said = calibrated(tmp_path, [REST])
    assert code == 2
    assert "no taxel moved" in said
    assert not (tmp_path / "pads.toml").exists()


@pytest.fixture
def keyboard() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    os.close(ends[0])


def test_a_whole_line_is_taken_without_waiting(keyboard: tuple[int, int]) -> None:
    reading, writing = keyboard
    typed = TypedLines(reading)
    assert typed.take() is None
    os.write(writing, b"ye")
    assert typed.take() is None
    os.write(writing, b"s \r\n\nq\n")
    assert [typed.take() for _ in range(4)] == ["yes", "", "q", None]
    os.write(writing, b"\xff\n")
    os.close(writing)
    assert typed.take() == "\N{REPLACEMENT CHARACTER}"
    with pytest.raises(click.ClickException, match="nothing is written"):
        typed.take()
