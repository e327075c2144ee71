"""A guided collection while it runs: devices, terminal and recording around the CollectionGuide."""

import os
import re
import select
import sys
import termios
import tty
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from threading import Event

import click

from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.taxonomy import MOVEMENTS, Taxonomy
from thenar.drivers.closing import Closing
from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.calibration import load_calibration
from thenar.runtime.errors import HarnessError
from thenar.runtime.frames import SwitchFrame, now_us, old_after_us
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.sources import NOT_YET, Sources
from thenar.runtime.names import list_names
from thenar.runtime.published import NONE, DeviceHealth
from thenar.runtime.recording.guide import KEYS, CollectionGuide, Journal, Key, Trial
from thenar.runtime.recording.session import Collection, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.taxels import calibration_of
from thenar.runtime.toml_source import read_source

from . import ended_by_signals
from .consoles import Live, Printed, Text, bar, grid
from .printing import err, of_device

_WAIT_US = 50_000
# Time for a device that is just being plugged in.
_PATIENCE_US = 3_000_000
_REDRAW_US = 100_000
_LETTERS: dict[Key, str] = {"accept": "Enter", "redo": "r", "undo": "u", "skip": "s", "pause": "p", "quit": "q"}
_MEANT = {letter: key for key, letter in _LETTERS.items()} | dict.fromkeys(("", " ", "a"), KEYS[0])
# Escape sequences that a terminal sends for arrows, function keys and the like.
_ESCAPES = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|O.)?")


def collect(
    harness: Harness,
    file: Path,
    collection: Collection,
    trials: Sequence[Trial],
    recording: Path,
    journal: Journal | None,
    countdown_s: float,
    write: Callable[[int], None],
) -> None:
    """Lead through the `trials` that the journal lacks, then call `write` with the total number of accepted trials: it
    writes their set.

    Keys come from stdin. Raises SettingError or DeviceError if a device cannot serve, click.ClickException if the
    recording cannot go on.
    """
    if sys.stdin is None:
        raise click.UsageError("stdin is closed, but a collection is led by keys typed there: run it in a terminal")
    if any(stream.port == "-" for stream in harness.streams):
        raise click.UsageError("the keys that lead a collection come from stdin: send rows by udp: instead")
    switches, sensors = harness.switches, harness.sensor_names
    check_names("column", (*switches, *harness.taxel_names, *sensors))
    scan, recorder = whole_scan(harness, switches, every_taxel=True), None
    session = Session(
        thenar=version("thenar"),
        switches=switches,
        sensors=sensors,
        harness=read_source(file, HarnessError).text,
        calibration=None if harness.calibration is None else load_calibration(Path(harness.calibration)),
        collection=collection,
        taxels=harness.taxel_names,
        taxel_calibration=calibration_of(harness.taxel_settings),
    )
    if journal is not None:
        _check_same_glove(journal, session)
    accepted, tail = ((), None) if journal is None else (journal.accepted, journal.tail)
    taxonomy, done = Taxonomy(collection.taxonomy, collection.types), len(accepted)
    with ended_by_signals() as stop, Sources(harness, switches, scan) as sources, ExitStack() as entered:
        _meet(sources, len(switches), stop)
        if not stop.is_set():
            recorder = entered.enter_context(Recorder(recording, session, tail=tail))
            terminal = entered.enter_context(Terminal(taxonomy, sys.stdin.fileno()))
            old_us = old_after_us(sources.switch_period_us, sources.glove_period_us)
            guide = CollectionGuide(trials, recorder, round(countdown_s * 1e6), accepted, old_us)
            _lead(guide, sources, recorder, terminal, stop)
            done = guide.done
    if recorder is not None and (recorder.failure is not None or recorder.lost):
        why = recorder.failure or f"{recording}: {recorder.lost} messages were lost"
        raise click.ClickException(f"{why}; free some space, and the same command goes on")
    write(done)


def _meet(sources: Sources, switches: int, stop: Event) -> None:
    """Wait until every device is there and something is read, or `stop` is set.

    Raises DeviceError or SettingError for a missing device, DeviceError if all are silent: a port may open even when
    nothing is connected to its other end.
    """
    end = now_us() + _PATIENCE_US
    read = False
    while not stop.is_set():
        missing = [device for device in sources.devices() if not device.connected]
        if read and not missing:
            return
        sources.raise_settings()
        if now_us() > end and missing and all(device.error != NOT_YET for device in missing):
            raise DeviceError(f"{of_device(missing[0].name, missing[0].error)}; nothing is recorded")
        if now_us() > end and not missing:
            names = list_names([device.name for device in sources.devices()])
            raise DeviceError(f"{names}: nothing came in {_PATIENCE_US // 1_000_000} s; nothing is recorded")
        taken = sources.take(_WAIT_US)
        read = read or taken.glove is not None or (taken.switches is not None and _is_read(taken.switches, switches))


def _is_read(frame: SwitchFrame, switches: int) -> bool:
    """Return whether the frame holds a known switch, out of `switches`, or a readable taxel."""
    return bool((1 << switches) - 1 & ~frame.lost) or any(code is not None for code in frame.taxels or ())


class Terminal(Closing):
    """Keys from stdin and the view on stderr; a context manager.

    On a terminal single keys count, and the view is drawn in place, ten times a second and at every change; elsewhere
    each line is a key, and each change is a line. Enter, space and a accept, other keys are _LETTERS, and the end of
    the input leaves.
    """

    def __init__(self, taxonomy: Taxonomy, descriptor: int) -> None:
        self._names = dict(zip(taxonomy.types, taxonomy.full_names, strict=True))
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

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the typed keys to the guide."""
        for key in self.pressed():
            guide.press(now_us, key)

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

    def show(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> None:
        """Show the guide's state, if it changed or the next refresh is due."""
        if not self._console.is_terminal:
            self._say(guide, devices)
        elif now_us >= self._due_us or self._shown != guide.step:
            self._due_us, self._shown = now_us + _REDRAW_US, guide.step
            self._live.update(*self._drawn(now_us, guide, devices))

    def _say(self, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> None:
        errors = "; ".join(device.error for device in devices if not device.connected)
        why = f" ({errors})" if errors else ""
        problem = f"not captured: {guide.problem}{why}; " if guide.problem else ""
        waits = f"the countdown waits: {guide.lost}{why}; " if _waits(guide) else ""
        line = f"{self._task(guide)}: {problem}{waits}{_keys(guide)}"
        if line != self._said and guide.stage != "over":
            self._said = line
            self._console.print(line, soft_wrap=True)

    def _drawn(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> Sequence[Printed]:
        table = grid(3)
        skipped = f", {guide.skipped} skipped" if guide.skipped else ""
        share = guide.done / max(guide.total, 1)
        table.add_row("done", f"{guide.done} of {guide.total}{skipped}", bar(share, width=40))
        for device in devices:
            table.add_row(device.name, "connected" if device.connected else Text(device.error, "red"), "")
        stage = Text(self._standing(now_us, guide), "bold")
        return table, "", Text(self._task(guide), "bold cyan"), stage, _keys(guide)

    def _task(self, guide: CollectionGuide) -> str:
        trial = guide.trial
        if trial is None:
            return f"{guide.done} of {guide.total}: no trial is left"
        place = f"{guide.done + guide.skipped + 1} of {guide.total}"
        if trial.grasp == NONE and NONE not in self._names:
            return f"{place}: nothing held, {trial.object}: {MOVEMENTS.get(trial.object, 'touch nothing')}"
        full = self._names[trial.grasp]
        name = trial.grasp if full == trial.grasp else f"{full} ({trial.grasp})"
        return f"{place}: {name}, object {trial.object}"

    def _standing(self, now_us: int, guide: CollectionGuide) -> str:
        if _waits(guide):
            return f"the countdown waits: {guide.lost}"
        if guide.stage == "paused":
            return "paused; nothing is recorded meanwhile"
        if guide.problem:
            return f"not captured: {guide.problem}"
        if guide.stage == "countdown":
            doing = "move so" if guide.trial is not None and guide.trial.grasp == NONE else "hold it"
            return f"{doing} in {guide.seconds_left(now_us):.1f} s"
        if guide.stage == "moving":
            return f"move so for {guide.seconds_left(now_us):.1f} s more"
        if guide.stage != "review":
            return ""
        switches, glove = guide.captured
        closed = "" if switches is None else f"{switches.closed.bit_count()} switches closed"
        sensors = "" if glove is None else "glove " + " ".join(map(str, glove.sensors))
        return "captured: " + ", ".join(filter(None, (closed, sensors)))


def _waits(guide: CollectionGuide) -> bool:
    """Return whether no countdown can start, because something is not read."""
    return bool(guide.lost) and guide.stage in ("ready", "paused")


def _keys(guide: CollectionGuide) -> str:
    """Return the keys that are active now: "Enter: start the countdown   q: leave"."""
    return "   ".join(f"{_LETTERS[key]}: {what}" for key, what in guide.offered().items())


def _lead(guide: CollectionGuide, devices: Sources, recorder: Recorder, terminal: Terminal, stop: Event) -> None:
    """Lead through the guide's trials until all are done, the user leaves, `stop` is set, or the recording fails."""
    while guide.stage != "over" and not recorder.lost and recorder.failure is None and not stop.is_set():
        arrived = devices.take(_WAIT_US).arrived
        devices.raise_settings()
        guide.take(now_us(), arrived, [device.name for device in devices.devices() if not device.connected])
        terminal.press(now_us(), guide)
        terminal.show(now_us(), guide, devices.devices())


def _check_same_glove(journal: Journal, session: Session) -> None:
    for name in ("switches", "sensors", "calibration", "taxels", "taxel_calibration"):
        if getattr(journal.session, name) != getattr(session, name):
            what = name.replace("_", " ")
            raise SettingError(f"{journal.path} was begun with different {what}: name another --output for this glove")
