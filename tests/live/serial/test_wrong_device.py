"""A wrong device in a port, and then the right one."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Empty, Queue
from threading import Event, Thread
from time import monotonic
from typing import Protocol

import pytest

from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.readers import LineReader
from thenar.runtime.harness.wiring import GloveWiring, Harness, StreamWiring
from thenar.runtime.live.sources import DeviceThread
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.cyberglove import GloveDevice
from thenar.runtime.sources.rows import RowSource

pytestmark = pytest.mark.slow

NAMES = tuple(f"s{number}" for number in range(16))
LONG_S = 10.0


class Wrong(Protocol):
    """Something at the end of a line."""

    def close(self) -> None:
        """End."""


class Talker:
    """Says the same again and again, every so many seconds, to nobody."""

    def __init__(self, line: PtyLine, every_s: float) -> None:
        line.receive = lambda _data: None
        self._line, self._every_s, self._stop = line, every_s, Event()
        self._thread = Thread(target=self._talk)
        self._thread.start()

    def _talk(self) -> None:
        while not self._stop.wait(self._every_s):
            self._line.send(b"$GPGGA,123519,4807.038,N\r\n")

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._line.receive = None


class Listener:
    """Says what it is given to each message, or nothing."""

    def __init__(self, line: PtyLine, answer: bytes = b"") -> None:
        self._line = line
        line.receive = lambda _data: line.send(answer)

    def close(self) -> None:
        self._line.receive = None


def board(line: PtyLine, names: Sequence[str] = NAMES, rate_hz: float = 100.0) -> BoardSender:
    return BoardSender(line.send, names, (), rate_hz)


WRONG: dict[str, Callable[[PtyLine], Wrong]] = {
    "silence": Listener,
    "one that complains": lambda line: Listener(line, b"ERROR\r\n"),
    "one that talks": lambda line: Talker(line, 0.02),
    "one that talks slowly": lambda line: Talker(line, 0.12),
    "another board": lambda line: board(line, ("x", "y", "z")),
    "a faster board": lambda line: board(line, ("x", "y", "z"), 1000.0),
    "a glove of 22 sensors": lambda line: EmulatedCyberGlove(line, sensors=22),
}
RIGHT: dict[str, Callable[[PtyLine], Wrong]] = {"glove": EmulatedCyberGlove, "board": board}


def device(kind: str, port: Path) -> GloveDevice | RowSource:
    if kind == "glove":
        return GloveDevice(GloveWiring(port=str(port)))
    harness = Harness(name="wrong", streams=(StreamWiring(port=str(port), rate_hz=100.0, switches=NAMES),))
    wired = harness.streams[0]
    return RowSource(LineReader(wired.port, wired.baud), harness, 0, whole_scan(harness, NAMES))


def lead(link: Path, line: PtyLine) -> None:
    """Let the port's name lead to this line, as another cable in the same socket does."""
    fresh = link.with_name("fresh")
    fresh.symlink_to(line.link.readlink())
    fresh.replace(link)


@pytest.mark.parametrize("kind", RIGHT)
@pytest.mark.parametrize("same_line", [True, False], ids=["on the same line", "on another line"])
def test_the_right_device_is_read_again_when_it_returns(kind: str, same_line: bool, tmp_path: Path) -> None:
    """All of them at a time: each waits for most of its time."""
    with ThreadPoolExecutor(len(WRONG)) as pool:
        for took in [pool.submit(read_again, kind, wrong, same_line, tmp_path / wrong) for wrong in WRONG]:
            took.result()


def read_again(kind: str, wrong: str, same_line: bool, folder: Path) -> None:
    """Let a wrong device be in the place of the right one for 0.8 s, and wait until the right one is read again."""
    folder.mkdir()
    frames, link = Queue[float](), folder / "port"
    with PtyLine(folder / "right") as line, PtyLine(folder / "wrong") as elsewhere:
        lead(link, line)
        right = RIGHT[kind](line)
        keeper = DeviceThread("device", device(kind, link), lambda _frame: frames.put(monotonic()))
        keeper.start()
        try:
            frames.get(timeout=LONG_S)
            right.close()
            if not same_line:
                lead(link, elsewhere)
            at_its_place = WRONG[wrong](line if same_line else elsewhere)
            Event().wait(0.8)
            if same_line:
                at_its_place.close()
            right = RIGHT[kind](line)
            returned = monotonic()
            if not same_line:
                lead(link, line)
            print(f"{wrong}: read again {first_after(frames, returned) - returned:.2f} s after")
            if not same_line:
                at_its_place.close()
        finally:
            keeper.close()
            right.close()


def first_after(frames: "Queue[float]", since: float) -> float:
    """Wait for the first frame that came after a moment."""
    try:
        while (came := frames.get(timeout=LONG_S)) < since:
            pass
    except Empty:
        raise AssertionError("it never came back") from None
    return came
