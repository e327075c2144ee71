"""A board in simavr, as a process of its own."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from types import TracebackType
from typing import Self

ANSWER_S = 20.0


@dataclass(frozen=True, slots=True)
class Done:
    """When the board did what it was told: by the monotonic clock, and by its cycles.

    board_us  when that was for the program, which is behind while its simulation waits for a processor
    starts    how many START conditions there have been on its bus
    """

    time_us: int
    board_us: int
    cycle: int
    starts: int


class SimulatedBoard:
    """`elf` on a board that is wired as `wiring` says; both in the words of simavr_board.c."""

    def __init__(self, program: Path, wiring: Sequence[str], elf: Path) -> None:
        file = elf.with_suffix(".wiring")
        file.write_text("\n".join(wiring) + "\n")
        self._errors = elf.with_suffix(".stderr")
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [str(program), str(file), str(elf)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
            )
        self._lines: Queue[bytes] = Queue()
        self._reader = Thread(target=self._read, name="reader of the board")
        self._reader.start()
        try:
            self.ports = {name: Path(link) for name, link in json.loads(self._line()).items()}
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def said(self) -> str:
        """What it has said of errors."""
        return self._errors.read_text()

    def do(self, *commands: str) -> Done:
        """Tell the board to do these things, one after another; return when the last one is done."""
        for command in commands:
            self.tell(command)
        return [self.done(command) for command in commands][-1]

    def tell(self, command: str) -> None:
        """Tell it, and do not wait until it is done."""
        assert self.process.stdin is not None
        self.process.stdin.write(command.encode() + b"\n")
        self.process.stdin.flush()

    def done(self, command: str = "it") -> Done:
        """Wait until what it was told is done."""
        answer = json.loads(self._line())
        assert answer.pop("done"), f"{command}: the board cannot do that"
        return Done(**answer)

    def set_keys(self, closed: Sequence[bool]) -> Done:
        """Close the keys that are true, open the others."""
        mask = sum(1 << key for key, one in enumerate(closed) if one)
        return self.do(f"set {mask.to_bytes((len(closed) + 7) // 8, 'little').hex()}")

    def close(self) -> None:
        """End it. Does no harm twice."""
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(ANSWER_S)
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(b"")

    def _line(self) -> bytes:
        try:
            line = self._lines.get(timeout=ANSWER_S)
        except Empty:
            line = b""
        if not line:
            raise AssertionError(f"the board does not answer: {self.said}")
        return line
