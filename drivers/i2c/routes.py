"""Which mux channel is connected, and how to connect another: by a transfer of its own, for it takes effect at STOP."""

from collections.abc import Iterable
from dataclasses import dataclass

from . import words
from .node import Node, Query
from .tca9548a import control

# So often a mux must leave its address unacknowledged before it counts as gone: a glitch may swallow one.
_NAKS = 3


@dataclass(frozen=True, slots=True)
class Route:
    """A channel of the mux at address `mux`."""

    mux: int
    channel: int


def place(device: str, what: str, address: int, route: Route | None) -> str:
    """Name a chip by where it is."""
    behind = f" (channel {route.channel} of the tca9548a at 0x{route.mux:02X})" if route else ""
    return f"{device}: the {what} at 0x{address:02X}{behind}"


class Routes:
    """The muxes of a bus. Only one channel of them all is connected at a time; chips off the muxes are always reached.

    What was selected is remembered, and forgotten at any failure behind a mux: a mux that was reset acknowledges
    nothing for the chips behind it, and the next try selects again.

    mux  the address of the mux that was spoken to last
    """

    def __init__(self, node: Node, muxes: Iterable[int]) -> None:
        self._node = node
        self._connected = set(muxes)  # those that may have a channel on: all, until they were seen to
        self.selected: Route | None = None
        self.mux: int | None = None

    def select(self, route: Route | None) -> None:
        """Connect `route`, and nothing else, unless it is connected. Raises OSError, with nothing selected, if not."""
        if route is None or route == self.selected:
            return
        self.selected = None
        for other in sorted(self._connected - {route.mux}):
            self._release(other)
        self._connected.add(route.mux)
        self._tell(route.mux, route.channel)
        self.selected = route

    def holds(self) -> bool:
        """Read the mux's register back: is what was selected still connected? Raises OSError."""
        selected = self.selected
        if selected is None:
            return True
        return self._node.query(Query(selected.mux, b"", 1)) == control(selected.channel)

    def forget(self) -> None:
        """Select again next time."""
        self.selected = None

    def _release(self, mux: int) -> None:
        """Disconnect all channels of a mux. One that is gone takes with it what is behind it.

        Raises OSError where it may still be connected: its chips would answer together with those of the other mux.
        """
        for left in reversed(range(_NAKS)):
            try:
                self._tell(mux, None)
            except OSError as error:
                if error.errno not in words.NOBODY_THERE:
                    raise
                if not left:
                    return
            else:
                self._connected.discard(mux)
                return

    def _tell(self, mux: int, channel: int | None) -> None:
        self.mux = mux
        self._node.write(mux, control(channel))
