"""Keys of a guided collection: single keys if stdin is a terminal, else one per line."""

import os
import re
import select
import termios
import tty
from typing import Self

from thenar.runtime.recording.guide import Key

LETTERS = {Key.ACCEPT: "Enter", Key.REDO: "r", Key.UNDO: "u", Key.SKIP: "s", Key.PAUSE: "p", Key.QUIT: "q"}
_MEANT = {letter: key for key, letter in LETTERS.items()} | dict.fromkeys(("", " ", "a"), Key.ACCEPT)
# Escape sequences that a terminal sends for arrows, function keys and the like.
_ESCAPES = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|O.)?")


class GuideKeys:
    """Reads `descriptor` without blocking: Enter, space and a accept, other keys are LETTERS, end of input leaves."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._raw = os.isatty(descriptor)
        self._before: list[int | list[bytes | int]] | None = None
        self._rest = ""
        self._ended = False

    def __enter__(self) -> Self:
        if self._raw:
            self._before = termios.tcgetattr(self._descriptor)
            # Ctrl-C keeps its meaning.
            # Keys pressed a moment too early count as well.
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

    def pressed(self) -> list[Key]:
        """Return the keys pressed since the last call."""
        if self._ended or not select.select([self._descriptor], [], [], 0.0)[0]:
            return []
        typed = self._typed()
        self._ended = not typed
        if self._ended:
            return [Key.QUIT]
        self._rest += typed
        return [_MEANT[word] for word in self._words() if word in _MEANT]

    def _typed(self) -> str:
        try:
            return os.read(self._descriptor, 4096).decode("utf-8", "replace")
        except OSError:  # the terminal was closed
            return ""

    def _words(self) -> list[str]:
        if self._raw:
            keys, self._rest = _ESCAPES.sub("", self._rest), ""
            return [key.strip("\r\n").lower() for key in keys]
        *lines, self._rest = self._rest.split("\n")
        return [line.strip().lower() for line in lines]
