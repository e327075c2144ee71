"""A scanner board on an emulated serial line."""

from collections import deque
from threading import Condition, Thread
from time import monotonic_ns
from types import TracebackType
from typing import Self

from .pty_line import PtyLine
from .scanner_board import ScannerBoard

Mask = int


class EmulatedScanner:
    """A board of so many directly wired keys at the far end of `line`; or any other, as `board`.

    It runs from here to close(), as if the line gave it no power. Keys are read at the board's scans: a change that is
    undone before the next one is not seen.
    """

    def __init__(self, line: PtyLine, switches: int, *, board: ScannerBoard | None = None) -> None:
        self.line = line
        self.board = board or ScannerBoard(1, switches)
        self._closed: Mask = 0
        self._lost: Mask = 0
        self._closing = False
        self._heard: deque[bytes] = deque()
        self._booted_us = monotonic_ns() // 1000
        self._condition = Condition()
        self._send(self.board.boot(0))
        line.receive = self._receive
        self._thread = Thread(target=self._run, name=f"scanner {line.link}", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def set(self, closed: Mask) -> None:
        """Close exactly these keys: bit k is key k."""
        with self._condition:
            self._closed = closed
            self.board.touch(self._now())
            self._condition.notify()

    def lose(self, lost: Mask) -> None:
        """Read all keys but these from now on: they keep their state, and the board says so."""
        with self._condition:
            self._lost = lost
            self.board.touch(self._now())
            self._condition.notify()

    def recognise(self, grasp: int, margin: int, flags: int = 0) -> None:
        """Say that the board recognised grasp type number `grasp`, with the values of GRASP's fields."""
        with self._condition:
            self._send(self.board.recognised(grasp, margin, flags, self._now()))

    def reboot(self, board: ScannerBoard | None = None) -> None:
        """Start again as after a power cut, as `board` if given: numbers and clock from their beginnings."""
        with self._condition:
            old = self.board
            self.board = board or ScannerBoard(old.rows, old.columns, diodes=old.diodes, board=old.board)
            self._booted_us = monotonic_ns() // 1000
            self._send(self.board.boot(0))
            self._condition.notify()

    def close(self) -> None:
        """Stop. The line stays as it is, silent."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join()
        self.line.receive = None

    def _receive(self, data: bytes) -> None:
        with self._condition:
            self._heard.append(data)
            self._condition.notify()

    def _run(self) -> None:
        with self._condition:
            while not self._closing:
                while self._heard:
                    self._send(self.board.receive(self._heard.popleft(), self._now()))
                now, due = self._now(), self.board.next_us()
                if due is not None and due <= now:
                    self._send(self.board.scan(self._closed, now, unread=self._lost))
                else:
                    self._condition.wait(None if due is None else (due - now) / 1e6)

    def _now(self) -> int:
        return monotonic_ns() // 1000 - self._booted_us

    def _send(self, frames: list[bytes]) -> None:
        for frame in frames:
            self.line.send(frame)
