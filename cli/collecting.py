"""The terminal that leads a collection: keys from stdin, and the view on stderr."""

import os
import re
import select
import termios
import tty
from collections.abc import Sequence
from contextlib import ExitStack

from thenar.compiler.recordings.taxonomy import Taxonomy
from thenar.drivers.closing import Closing
from thenar.runtime.frames import now_us
from thenar.runtime.published import DeviceHealth
from thenar.runtime.recording.guide import KEYS, CollectionGuide, Key
from thenar.studio.collecting import standing, task

from .consoles import Live, Printed, Text, bar, grid
from .printing import err

_REDRAW_US = 100_000
_LETTERS: dict[Key, str] = {"accept": "Enter", "redo": "r", "undo": "u", "skip": "s", "pause": "p", "quit": "q"}
_MEANT = {letter: key for key, letter in _LETTERS.items()} | dict.fromkeys(("", " ", "a"), KEYS[0])
# Escape sequences that a terminal sends for arrows, function keys and the like.
_ESCAPES = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|O.)?")


class Terminal(Closing):
    """Keys from stdin and the view on stderr; a context manager.

    On a terminal single keys count, and the view is drawn in place, ten times a second and at every change; elsewhere
    each line is a key, and each change is a line. Enter, space and a accept, other keys are _LETTERS, and the end of
    the input leaves.
    """

    def __init__(self, taxonomy: Taxonomy, descriptor: int) -> None:
        self._taxonomy = taxonomy
        self._descriptor, self._raw = descriptor, os.isatty(descriptor)
        self._rest, self._ended = "", False
        self._due_us, self._shown, self._said = 0, -1, ""
        self._console = err()
        self._opened = ExitStack()
        if self._raw:
            self._opened.callback(termios.tcsetattr, descriptor, termios.TCSADRAIN, termios.tcgetattr(descriptor))
            # Ctrl-C keeps its meaning, and keys pressed a moment too early count as well.
            tty.setcbreak(descriptor, termios.TCSADRAIN)
        self._live = self._opened.enter_context(Live(self._console))

    def close(self) -> None:
        """Leave the terminal as it was."""
        self._opened.close()

    def __call__(self, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> list[Key]:
        """Show the guide's state, if it changed or the next refresh is due, and return the typed keys."""
        now = now_us()
        if not self._console.is_terminal:
            self._say(guide, devices)
        elif now >= self._due_us or self._shown != guide.step:
            self._due_us, self._shown = now + _REDRAW_US, guide.step
            self._live.update(*self._drawn(guide, devices))
        return self.pressed()

    def pressed(self) -> list[Key]:
        """Return the keys pressed since the last call."""
        if self._ended or not select.select([self._descriptor], [], [], 0.0)[0]:
            return []
        try:
            typed = os.read(self._descriptor, 4096).decode("utf-8", "replace")
        except OSError:  # the terminal was closed
            typed = ""
        self._ended = not typed
        if self._ended:
            return ["quit"]
        self._rest += typed
        return [_MEANT[word] for word in self._words() if word in _MEANT]

    def _words(self) -> list[str]:
        if self._raw:
            keys, self._rest = _ESCAPES.sub("", self._rest), ""
            return [key.strip("\r\n").lower() for key in keys]
        *lines, self._rest = self._rest.split("\n")
        return [line.strip().lower() for line in lines]

    def _say(self, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> None:
        errors = "; ".join(device.error for device in devices if not device.connected)
        why = f" ({errors})" if errors else ""
        problem = f"not captured: {guide.problem}{why}; " if guide.problem else ""
        waits = f"the countdown waits: {guide.lost}{why}; " if guide.waits else ""
        line = f"{self._task(guide)}: {problem}{waits}{_keys(guide)}"
        if line != self._said and guide.stage != "over":
            self._said = line
            self._console.print(line, soft_wrap=True)

    def _drawn(self, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> Sequence[Printed]:
        table = grid(3)
        skipped = f", {guide.skipped} skipped" if guide.skipped else ""
        share = guide.done / max(guide.total, 1)
        table.add_row("done", f"{guide.done} of {guide.total}{skipped}", bar(share, width=40))
        for device in devices:
            table.add_row(device.name, "connected" if device.connected else Text(device.error, "red"), "")
        stage = Text(standing(guide), "bold")
        return table, "", Text(self._task(guide), "bold cyan"), stage, _keys(guide)

    def _task(self, guide: CollectionGuide) -> str:
        place = guide.done + (0 if guide.trial is None else guide.skipped + 1)
        return f"{place} of {guide.total}: {', '.join(filter(None, task(guide, self._taxonomy)))}"


def _keys(guide: CollectionGuide) -> str:
    """Return the keys that are active now: "Enter: start the countdown   q: leave"."""
    return "   ".join(f"{_LETTERS[key]}: {what}" for key, what in guide.offered().items())
