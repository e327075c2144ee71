from io import StringIO
from queue import Queue
from threading import Event

from rich.console import Console

from thenar.cli.live_view import LiveView
from thenar.runtime.live.health import DeviceHealth
from thenar.runtime.live.published import LiveGrasp

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

    def until(self, text: str) -> None:
        while text not in self.said.get(timeout=LONG_S):
            pass


def view_on(terminal: Terminal) -> LiveView:
    return LiveView(Console(file=terminal, force_terminal=True, width=80))


def test_the_newest_grasp_is_drawn() -> None:
    terminal = Terminal()
    with view_on(terminal) as view:
        view.show(grasp("first"), nobody)
        terminal.until("first")
        view.show(grasp("second"), lambda: (DeviceHealth("glove", False, "no such port"),), ("120 frames",))
        terminal.until("second")


def test_a_terminal_that_is_held_holds_nobody_up_and_then_shows_the_present() -> None:
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
