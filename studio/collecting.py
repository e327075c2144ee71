"""A guided collection while it runs: the devices of a glove, the recording, and the CollectionGuide between them.

It needs no trainer: `thenar record` works without the compiler's libraries. A view shows the guide's state and returns
the keys that were pressed; it is the terminal or a page.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from threading import Event

from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.taxonomy import MOVEMENTS, Taxonomy
from thenar.drivers.errors import DeviceError, SettingError, ThenarError
from thenar.runtime.calibration import load_calibration
from thenar.runtime.errors import HarnessError
from thenar.runtime.frames import now_us, old_after_us
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live.sources import NOT_YET, Sources
from thenar.runtime.names import list_names, of_device
from thenar.runtime.published import NONE, DeviceHealth
from thenar.runtime.recording.guide import CollectionGuide, Journal, Key, planned
from thenar.runtime.recording.session import Collection, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.taxels import calibration_of
from thenar.runtime.toml_source import read_source

from .edits import EDITS_NAME, restore

View = Callable[[CollectionGuide, Sequence[DeviceHealth]], Iterable[Key]]

WAIT_US = 50_000
# Time for a device that is just being plugged in.
_PATIENCE_US = 3_000_000


def collect(
    glove: Path,
    collection: Collection,
    recording: Path,
    journal: Journal | None,
    view: View,
    stop: Event,
    countdown_s: float = 3.0,
) -> int:
    """Lead through the trials of a collection until all are done or the user leaves.

    What became of a trial in the log of edits next to the recording is taken back if the trial is undone.

    Parameters
    ----------
    glove : Path
        The glove.toml.
    collection, journal
        What is collected, and what of it the recording already has; None: nothing.
    recording : Path
        The .mcap file to write, or to continue.
    view : callable
        Gets the guide and the state of the devices after every reading, and returns the keys pressed since.
    stop : Event
        Ends it.
    countdown_s : float
        Before a grasp is captured, seconds.

    Returns
    -------
    int
        The number of accepted trials, those of earlier sittings included.

    Raises
    ------
    SettingError, DeviceError
        If a device cannot serve; if the recording was begun with another glove.
    ThenarError
        If the recording cannot go on.
    """
    trials, accepted = planned(collection), () if journal is None else journal.accepted
    if len(accepted) == len(trials):
        return len(accepted)
    harness = load_harness(glove)
    switches, sensors = harness.switches, harness.sensor_names
    check_names("column", (*switches, *harness.taxel_names, *sensors))
    session = Session(
        thenar=version("thenar"),
        switches=switches,
        sensors=sensors,
        harness=read_source(glove, HarnessError).text,
        calibration=None if harness.calibration is None else load_calibration(Path(harness.calibration)),
        collection=collection,
        taxels=harness.taxel_names,
        taxel_calibration=calibration_of(harness.taxel_settings),
    )
    for name in ("switches", "sensors", "calibration", "taxels", "taxel_calibration"):
        if journal is not None and getattr(journal.session, name) != getattr(session, name):
            what = name.replace("_", " ")
            raise SettingError(f"{journal.path} was begun with different {what}: begin another recording")
    with Sources(harness, switches, whole_scan(harness, switches, every_taxel=True)) as sources:
        meet(sources, len(switches), stop, "nothing is recorded")
        if stop.is_set():
            return len(accepted)
        with Recorder(recording, session, tail=None if journal is None else journal.tail) as recorder:
            old_us = old_after_us(sources.switch_period_us, sources.glove_period_us)
            guide = CollectionGuide(trials, recorder, round(countdown_s * 1e6), accepted, old_us)
            # None at first: edits of an earlier recording of the same name are taken back, too.
            known: Sequence[int] | None = None
            while guide.stage != "over" and not recorder.lost and recorder.failure is None and not stop.is_set():
                arrived = sources.take(WAIT_US).arrived
                sources.raise_settings()
                devices = sources.devices()
                guide.take(now_us(), arrived, [device.name for device in devices if not device.connected])
                if guide.accepted != known:
                    known = guide.accepted
                    # What is wrong with the log is said by the page Choose, and ends no recording.
                    with suppress(ThenarError, OSError):
                        restore(recording.with_name(EDITS_NAME), recording.with_suffix(".grasps").name, {*known})
                for key in view(guide, devices):
                    guide.press(now_us(), key)
    if recorder.failure is not None or recorder.lost:
        why = recorder.failure or f"{recording}: {recorder.lost} messages were lost"
        raise ThenarError(f"{why}; free some space, and the same command goes on")
    return guide.done


def task(guide: CollectionGuide, taxonomy: Taxonomy) -> tuple[str, str]:
    """Return the grasp type to take now, in words, and its object, or how the empty hand moves; "" if none is left."""
    trial, names = guide.trial, dict(zip(taxonomy.types, taxonomy.full_names, strict=True))
    if trial is None:
        return "no trial is left", ""
    if trial.grasp == NONE and NONE not in names:
        return "nothing held", f"{trial.object}: {MOVEMENTS.get(trial.object, 'touch nothing')}"
    full = names[trial.grasp]
    return trial.grasp if full == trial.grasp else f"{full} ({trial.grasp})", f"object {trial.object}"


def standing(guide: CollectionGuide) -> str:
    """Return the state of the trial now, as a sentence: the time left, what is missing, or what was captured."""
    if guide.waits:
        return f"the countdown waits: {guide.lost}"
    if guide.stage == "paused":
        return "paused; nothing is recorded meanwhile"
    if guide.problem:
        return f"not captured: {guide.problem}"
    if guide.stage == "countdown":
        doing = "move so" if guide.trial is not None and guide.trial.grasp == NONE else "hold it"
        return f"{doing} in {guide.seconds_left(now_us()):.1f} s"
    if guide.stage == "moving":
        return f"move so for {guide.seconds_left(now_us()):.1f} s more"
    if guide.stage != "review":
        return ""
    switches, glove = guide.captured
    closed = "" if switches is None else f"{switches.closed.bit_count()} switches closed"
    sensors = "" if glove is None else "glove " + " ".join(map(str, glove.sensors))
    return "captured: " + ", ".join(filter(None, (closed, sensors)))


def meet(sources: Sources, switches: int, stop: Event, ends: str) -> None:
    """Wait until every device is connected and a switch, a taxel or the joints were read, or until `stop` is set.

    There are `switches` switches. Raises DeviceError or SettingError for a missing device, DeviceError if all are
    silent: a port may open even when nothing is connected to its other end. The error ends with `ends`.
    """
    end = now_us() + _PATIENCE_US
    read = False
    while not stop.is_set():
        missing = [device for device in sources.devices() if not device.connected]
        if read and not missing:
            return
        sources.raise_settings()
        if now_us() > end and missing and all(device.error != NOT_YET for device in missing):
            raise DeviceError(f"{of_device(missing[0].name, missing[0].error)}; {ends}")
        if now_us() > end and not missing:
            names = list_names([device.name for device in sources.devices()])
            raise DeviceError(f"{names}: nothing came in {_PATIENCE_US // 1_000_000} s; {ends}")
        taken = sources.take(WAIT_US)
        frame, read = taken.switches, read or taken.glove is not None
        if frame is not None:
            # A known switch, or a taxel that can be read.
            read |= bool((1 << switches) - 1 & ~frame.lost) or any(code is not None for code in frame.taxels or ())
