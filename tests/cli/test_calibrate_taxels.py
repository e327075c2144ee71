import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from threading import Event, Thread

import pytest

from thenar.cli import run
from thenar.drivers.closing import Closing
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.taxels import TaxelCalibration, TaxelLine, load_taxel_calibration

HANGING_S = 60.0
REST = (40, 0, 900, 500)


class Pressed(Closing):
    """A sender of four columns whose rows hold the codes of `script` one after the other, and then the last."""

    def __init__(self, line: PtyLine) -> None:
        self.script: deque[Sequence[int]] = deque()
        self.done = Event()
        self._line, self._codes, self._stop = line, REST, Event()
        self._thread = Thread(target=self._send, daemon=True)
        self._thread.start()

    def _send(self) -> None:
        while not self._stop.wait(0.002):
            if self.script:
                self._codes = tuple(self.script.popleft())
                if not self.script:
                    self.done.set()
            self._line.send(",".join(map(str, self._codes)).encode() + b"\n")

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


def calibrated(folder: Path, presses: Sequence[Sequence[int]], *options: str) -> tuple[int, str]:
    """Hold each press for ten rows when asked to; return exit code and what was said on stderr."""
    glove = folder / "glove.toml"
    glove.write_text(
        f'[[stream]]\nport = "{folder}/port"\nrate_hz = 500\ncolumns = ["p0", "", "p1", "p2"]\n'
        "taxels = { p0 = [0, 1023], p1 = [0, 1023], p2 = [0, 1023] }\n"
        '[taxels]\ncalibration = "pads.toml"\n'
    )
    command = [sys.executable, "-m", "thenar.cli", "calibrate", str(glove), "--taxels", "-o", str(folder / "pads.toml")]
    with PtyLine(folder / "port", 115_200) as line, Pressed(line) as board:
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
                    board.script.extend(codes for codes in (*presses, REST) for _ in range(10))
                elif text.startswith("Enter"):
                    assert not board.script or board.done.wait(HANGING_S)
                    process.stdin.write("\n")
                    process.stdin.flush()
            return process.wait(HANGING_S), said


def test_rest_and_press_are_learnt_and_what_was_not_pressed_is_left_out(tmp_path: Path) -> None:
    code, said = calibrated(tmp_path, [(800, 0, 900, 503), (40, 7, 120, 500)], "--newtons", "2.5", "--subject", "anna")
    assert code == 0, said
    assert "Not calibrated, because their counts did not move: p2" in said
    lines = (TaxelLine("p0", 40, 800, 2.5), TaxelLine("p1", 900, 120, 2.5))
    assert load_taxel_calibration(tmp_path / "pads.toml") == TaxelCalibration(subject="anna", unit="N", taxels=lines)


def test_where_nothing_moves_nothing_is_written(tmp_path: Path) -> None:
    code, said = calibrated(tmp_path, [REST])
    assert code == 2
    assert "no taxel moved" in said
    assert not (tmp_path / "pads.toml").exists()


def test_presses_have_no_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "glove.toml").write_text('[[stream]]\nport = "nowhere"\ntaxels = { p0 = [0, 1023] }\n')
    asked = ["calibrate", str(tmp_path / "glove.toml"), "--taxels", "-o", str(tmp_path / "pads.toml"), "--web"]
    assert run([*asked, "127.0.0.1:0"]) == 2
    assert "leave out --web or --taxels" in capsys.readouterr().err
    assert not (tmp_path / "pads.toml").exists()
