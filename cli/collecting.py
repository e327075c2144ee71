"""A guided collection while it runs: devices, terminal and recording around the guide."""

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, Protocol, Self

import click

from thenar.compiler.recordings.errors import check_names
from thenar.compiler.recordings.taxonomy import Taxonomy
from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.calibration import load_calibration
from thenar.runtime.errors import HarnessError
from thenar.runtime.frames import SwitchFrame, now_us, old_after_us
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.sources import NOT_YET, DeviceState, Snapshot, Sources
from thenar.runtime.names import list_names
from thenar.runtime.recording.guide import CollectionGuide, Journal, Key, Stage, Trial
from thenar.runtime.recording.session import Collection, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.taxels import calibration_of
from thenar.runtime.toml_source import read_source

from .common import err, of_device
from .ending import ended_by_signals
from .guide_keys import GuideKeys
from .guide_view import GuideView

if TYPE_CHECKING:
    from .guided_web import PageAt

_WAIT_US = 50_000
# Time for a device that is just being plugged in.
_PATIENCE_US = 3_000_000


class Devices(Protocol):
    """The part of `Sources` that a collection uses."""

    def take(self, at_most_us: int) -> Snapshot:
        """Wait for new readings and return them."""

    def devices(self) -> tuple[DeviceState, ...]:
        """Return the state of each device."""

    def raise_settings(self) -> None:
        """Raise the SettingError of a device that can never work."""


def collect(
    harness: Harness,
    file: Path,
    collection: Collection,
    trials: Sequence[Trial],
    recording: Path,
    journal: Journal | None,
    countdown_s: float,
    write: Callable[[int], Sequence[str]],
    page: "PageAt | None" = None,
) -> None:
    """Lead through the `trials` that the journal lacks, then call `write` with the total number of accepted trials: it
    writes their set and returns warnings, which the page shows.

    Keys come from stdin, or from the `page` alone if stdin is not a terminal. Raises SettingError or DeviceError if a
    device cannot serve, SinkError if the page cannot be served, click.ClickException if the recording cannot go on.
    """
    typed = page is None or (sys.stdin is not None and sys.stdin.isatty())
    if sys.stdin is None and typed:
        raise click.UsageError("stdin is closed, but a collection is led by keys typed there: run it in a terminal")
    if typed and any(stream.port == "-" for stream in harness.streams):
        raise click.UsageError("the keys that lead a collection come from stdin: send rows by udp: instead")
    switches, sensors = harness.switches, harness.sensor_names
    check_names("column", (*switches, *harness.taxel_names, *sensors))
    scan, shown, recorder = whole_scan(harness, switches, every_taxel=True), None, None
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
    with ExitStack() as served:
        with ended_by_signals() as stop, Sources(harness, switches, scan) as sources, ExitStack() as entered:
            _meet(sources, len(switches), stop)
            if not stop.is_set():
                if page is not None:
                    # Before the recording begins: an address that cannot be served leaves no file.
                    shown = served.enter_context(page.serve(session, taxonomy, recording))
                recorder = entered.enter_context(Recorder(recording, session, tail=tail))
                faces: list[Face] = [] if shown is None else [shown]
                if typed:
                    faces.append(entered.enter_context(Terminal(taxonomy)))
                old_us = old_after_us(sources.switch_period_us, sources.glove_period_us)
                guide = CollectionGuide(trials, recorder, round(countdown_s * 1e6), accepted, old_us)
                lead(guide, sources, recorder, faces, stop)
                done = guide.done
        if recorder is not None and (recorder.failure is not None or recorder.lost):
            why = recorder.failure or f"{recording}: {recorder.lost} messages were lost"
            raise click.ClickException(f"{why}; free some space, and the same command goes on")
        if (warnings := write(done)) and shown is not None:
            shown.warn(warnings)


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


class Face(Protocol):
    """Where a collection is shown and keys are pressed: the terminal, or a page."""

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the keys pressed since the last call to the guide."""

    def show(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceState]) -> None:
        """Show the guide's state."""


class Terminal:
    """Keys from stdin and the view on stderr; a context manager."""

    def __init__(self, taxonomy: Taxonomy) -> None:
        self._view = GuideView(err(), taxonomy)
        self._keys = GuideKeys(sys.stdin.fileno())
        self.show = self._view.show
        self._entered = ExitStack()

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the typed keys to the guide."""
        for key in self._keys.pressed():
            guide.press(now_us, key)

    def __enter__(self) -> Self:
        self._entered.enter_context(self._keys)
        self._entered.enter_context(self._view)
        return self

    def __exit__(self, *of_error: Any) -> None:
        self._entered.__exit__(*of_error)


def lead(guide: CollectionGuide, devices: Devices, recorder: Recorder, faces: Sequence[Face], stop: Event) -> None:
    """Lead through the guide's trials until all are done, the user leaves, `stop` is set, or the recording fails."""
    while guide.stage is not Stage.OVER and not recorder.lost and recorder.failure is None and not stop.is_set():
        arrived = devices.take(_WAIT_US).arrived
        devices.raise_settings()
        guide.take(now_us(), arrived, [device.name for device in devices.devices() if not device.connected])
        for face in faces:
            face.press(now_us(), guide)
            face.show(now_us(), guide, devices.devices())
    # However it ended, the page shows that it has.
    guide.press(now_us(), Key.QUIT)
    for face in faces:
        face.show(now_us(), guide, devices.devices())


def _check_same_glove(journal: Journal, session: Session) -> None:
    begun = journal.session
    for what, before, now in (
        ("switches", begun.switches, session.switches),
        ("sensors", begun.sensors, session.sensors),
        ("calibration", begun.calibration, session.calibration),
        ("taxels", begun.taxels, session.taxels),
        ("calibration of taxels", begun.taxel_calibration, session.taxel_calibration),
    ):
        if before != now:
            raise SettingError(f"{journal.path} was begun with different {what}: name another --output for this glove")
