"""A calibration while it runs: the joints of a glove pose by pose, or its taxels at rest and pressed.

Like a collection, it is led by a view, the terminal or a page, and needs no trainer.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from time import monotonic
from typing import Literal

from msgspec.structs import replace

from thenar.drivers.cyberglove import CyberGlove
from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us, old_after_us
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness, StreamWiring
from thenar.runtime.live.sources import Sources
from thenar.runtime.posing import PoseGuide, PoseKey
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.taxels import TaxelCalibration, TaxelSettings, learnt_lines

from .collecting import WAIT_US, meet

Codes = tuple[int | None, ...]
# What is asked of the hand while taxels are calibrated.
PressStage = Literal["untouched", "resting", "pressing"]
PRESS_WORDS: dict[PressStage, str] = {
    "untouched": "Leave every taxel alone, the hand open: press nothing.",
    "resting": "Keep still.",
    "pressing": "Press every taxel once, firmly, for half a second each, in any order.",
}

_WAIT_S = 0.05
_ENDS = "nothing is calibrated"
# Nobody presses for an hour during a calibration.
_MOST_FRAMES = 1_000_000


def lead_poses(
    port: str,
    baud: int,
    hold_s: float,
    view: Callable[[PoseGuide], Iterable[PoseKey]],
    stop: Event,
    note: Callable[[str], None] = lambda _: None,
) -> PoseGuide | None:
    """Lead through the poses of a CyberGlove, or of the joints of a glove.toml.

    Parameters
    ----------
    port : str
        Its port, or the path of a glove.toml.
    baud : int
        The baud rate of a port.
    hold_s : float
        How long a pose is held, seconds.
    view : callable
        Gets the guide after every reading, and returns the keys pressed since.
    stop : Event
        Ends it.
    note : callable
        Gets what the glove says that is odd, in sentences.

    Returns
    -------
    PoseGuide or None
        With all poses taken; None if it was stopped.

    Raises
    ------
    DeviceError, SettingError
        If the glove is not there, or sends no joints.
    """
    with _rows(port, baud, stop, note) as (names, old_us, read):
        guide = PoseGuide(names, round(hold_s * 1e6), old_us)
        while guide.stage != "done" and not stop.is_set():
            raw = read()
            if raw is not None:
                guide.take(now_us(), raw)
            for key in view(guide):
                guide.press(now_us(), key)
        return guide if guide.stage == "done" else None


def lead_presses(
    glove: Path,
    hold_s: float,
    view: Callable[[PressStage, tuple[str, ...], Codes, Codes], bool],
    stop: Event,
    subject: str,
    newtons: float | None = None,
) -> tuple[tuple[str, ...], TaxelCalibration] | None:
    """Learn the counts of the taxels of a glove.toml at rest, for `hold_s`, and while each is pressed once.

    `view` gets the stage, the names of all taxels, their newest counts and those at rest, after every reading; it
    returns whether the person is ready. Return the names, and the calibration of the taxels that moved; None if `stop`
    was set.

    Raises DeviceError if no device sends taxels, SettingError if there are none.
    """
    harness = _uncalibrated(glove)
    if not harness.taxel_names:
        raise SettingError(f"{glove.name} names no taxels: add `taxels` to a [[stream]], or add a converter")
    harness = replace(harness, cyberglove=None, streams=tuple(one for one in harness.streams if one.taxels))
    with Sources(harness, (), whole_scan(harness, (), every_taxel=True)) as sources:
        codes, rested, names = list[Codes](), list[Codes](), harness.taxel_names
        nothing: Codes = (None,) * len(names)

        def take() -> list[Codes]:
            arrived = sources.take(WAIT_US).arrived
            codes.extend(one.taxels for one in arrived if isinstance(one, SwitchFrame) and one.taxels is not None)
            del codes[:-_MOST_FRAMES]
            return codes

        def ready(stage: PressStage) -> bool:
            take()
            newest = (found[-1] if found else nothing for found in (codes, rested))
            return view(stage, names, *newest) or stop.is_set()

        meet(sources, 0, stop, _ENDS)
        while not ready("untouched"):
            pass
        codes.clear()
        end = monotonic() + hold_s
        while (monotonic() < end or not codes) and not stop.is_set():
            ready("resting")
        rested.extend(codes)
        codes.clear()
        while not ready("pressing"):
            pass
        if stop.is_set():
            return None
        lines = learnt_lines(names, rested, codes, 1.0 if newtons is None else newtons)
        return names, TaxelCalibration(subject=subject, unit="press" if newtons is None else "N", sensors=lines)


def _uncalibrated(glove: Path) -> Harness:
    """Return the harness in a file, without the calibration of its taxels: it may be the file to be written."""
    return replace(load_harness(glove), taxel_settings=TaxelSettings())


@contextmanager
def _rows(
    port: str, baud: int, stop: Event, note: Callable[[str], None]
) -> Iterator[tuple[tuple[str, ...], int, Callable[[], bytes | None]]]:
    """Yield the names of the joints of a CyberGlove, or of the stream of a glove.toml.

    With them come the age from which a row of their bytes is old, and a function that waits for the next row. It
    returns None if none came yet.
    """
    names = tuple[str, ...]()
    if port.endswith(".toml"):
        harness = _uncalibrated(Path(port))
        wired, device = harness.cyberglove, harness.joint_device
        if wired is None:
            if not isinstance(device, StreamWiring):
                name = Path(port).name
                raise SettingError(f"{name} has no joints: add a [cyberglove], or `joints` to a [[stream]]")
            harness = replace(harness, buses=(), spi=(), streams=(device,))
            with Sources(harness, (), whole_scan(harness, ())) as sources:

                def newest() -> bytes | None:
                    """Return the newest row that measures every joint."""
                    arrived = sources.take(WAIT_US).arrived
                    rows = [frame.sensors for frame in arrived if isinstance(frame, GloveFrame)]
                    return next((row for row in reversed(rows) if 0 not in row), None)

                meet(sources, 0, stop, _ENDS)
                yield harness.sensor_names, old_after_us(sources.glove_period_us), newest
            return
        port, baud, names = wired.port, wired.baud, wired.joints
    glove = CyberGlove(port, baud=baud)

    def read() -> bytes | None:
        timed = glove.read(_WAIT_S)
        if timed is not None and timed[1].fault == "unplugged":
            raise DeviceError(f"{port}: the glove is not plugged into its box")
        return None if timed is None else timed[1].sensors

    try:
        info = glove.open()
        for sentence in info.notes:
            note(sentence)
        yield names or info.names, old_after_us(None), read
    finally:
        glove.close()
