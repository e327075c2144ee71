from collections.abc import Sequence
from io import StringIO
from queue import Queue
from threading import Event
from typing import get_args

from msgspec.structs import replace

from thenar.cli.consoles import Console
from thenar.cli.live_view import LiveView, drawn
from thenar.runtime.published import DeviceHealth, Health, HealthReport, LiveGrasp, OutputTrouble, Quarantined

LONG_S = 10.0


def grasp(name: str) -> LiveGrasp:
    return LiveGrasp(0, 0, 0, name, name, 0.9, 12, "ok", 900, None, 310)


def nobody() -> tuple[DeviceHealth, ...]:
    return ()


class Terminal(StringIO):
    """Notes what it is given; is held while `held` is set; is gone once `gone` is."""

    def __init__(self) -> None:
        super().__init__()
        self.said: Queue[str] = Queue()
        self.going, self.waited = Event(), Event()
        self.going.set()
        self.gone = False

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if self.gone:
            raise OSError(5, "Input/output error")
        if not self.going.is_set():
            self.waited.set()
            assert self.going.wait(LONG_S)
        self.said.put(text)
        return len(text)

    def until(self, *texts: str) -> None:
        """Wait until all of `texts` were drawn from now on."""
        drawn = ""
        while not all(text in drawn for text in texts):
            drawn += self.said.get(timeout=LONG_S)


def view_on(terminal: Terminal) -> LiveView:
    return LiveView(Console(terminal, width=80))


def picture(grasp: LiveGrasp, devices: Sequence[DeviceHealth] = ()) -> list[str]:
    """Return the lines of what is drawn, with one blank between the words."""
    file = StringIO()
    Console(file, width=80).print(drawn(grasp, devices))
    return [" ".join(line.split()) for line in file.getvalue().splitlines()]


def test_the_picture_says_which_segment_it_is_and_since_when() -> None:
    held = replace(grasp("Tripod"), time_us=3_000_000, state="held", segment=7, segment_type="Tripod")
    assert "segment 7, Tripod: held, 1.5 s" in picture(replace(held, segment_us=1_500_000))


def test_the_view_shows_grasp_certainty_and_state_of_every_device() -> None:
    devices = DeviceHealth("glove", False, "no such port"), DeviceHealth("bus 1", True, "")
    assert picture(grasp("Tripod"), devices) == [
        "grasp Tripod",
        "█" * 27 + "░" * 3 + " 90.0%",
        "this frame Tripod, ahead by 12 steps",
        "segment none, 0 so far",
        "health ok",
        "age switches 0.9 ms, glove none yet",
        "frame 0",
        "glove no such port",
        "bus 1 connected",
    ]


def test_every_health_can_be_drawn() -> None:
    for health in get_args(Health):
        assert f"health {health}" in picture(replace(grasp("Tripod"), health=health))


def test_what_is_missing_is_named_six_of_it_at_most() -> None:
    for count, said in (
        (1, "missing s0"),
        (6, "missing s0, s1, s2, s3, s4, s5"),
        (8, "missing s0, s1, s2, s3, s4, s5 and 2 more"),
    ):
        lost = tuple(f"s{number}" for number in range(count))
        assert said in picture(replace(grasp("Tripod"), health="degraded", lost=lost))
    assert not any(line.startswith("missing") for line in picture(grasp("Tripod")))


def test_quarantined_switches_and_stalled_sinks_are_drawn_with_their_reason() -> None:
    wrong = (Quarantined("palm", "stuck closed"), Quarantined("tip", "chattering", used=True))
    terminal = Terminal()
    health = HealthReport(0, 100.0, 90.0, 120, 0, 0, 0, quarantined=wrong)
    health = replace(health, outputs=(OutputTrouble("recording", "the disk is full"),))
    with LiveView(Console(terminal, width=80)) as view:
        view.show(grasp("first"), nobody, health)
        terminal.until("palm", "stuck closed, treated as lost", "chattering, still used", "the disk is full")


def test_the_newest_grasp_is_drawn() -> None:
    terminal = Terminal()
    health = HealthReport(0, 100.0, 90.0, 120, 0, 0, 0)
    with LiveView(Console(terminal, width=80)) as view:
        view.show(grasp("first"), nobody)
        terminal.until("first")
        view.show(grasp("second"), lambda: (DeviceHealth("glove", False, "no such port"),), health)
        terminal.until("second", "no such port")


def test_a_stopped_terminal_delays_nobody_and_then_shows_the_present() -> None:
    terminal = Terminal()
    with view_on(terminal) as view:
        terminal.going.clear()
        view.show(grasp("old"), nobody)
        assert terminal.waited.wait(LONG_S)
        for number in range(1000):
            view.show(grasp(f"number {number}"), nobody)
        terminal.going.set()
        terminal.until("number 999")


def test_a_terminal_that_is_gone_is_no_error() -> None:
    terminal = Terminal()
    with view_on(terminal) as view:
        terminal.gone = True
        view.show(grasp("unseen"), nobody)
        view._thread.join(LONG_S)
        assert not view._thread.is_alive()
