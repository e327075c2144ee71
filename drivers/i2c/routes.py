"""Which mux channel is connected, and how to connect another: by a transfer of its own, for it takes effect at STOP."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

from .node import Node, Query
from .tca9548a import control


@dataclass(frozen=True, slots=True)
class Route:
    """A channel of the mux at address `mux`."""

    mux: int
    channel: int


class Routes:
    """The muxes of a bus. Only one channel of them all is connected at a time; chips off the muxes are always reached.

    What was selected is remembered, and forgotten at any failure behind a mux: a mux that was reset acknowledges
    nothing for the chips behind it, and the next try selects again.
    """

    def __init__(self, node: Node, muxes: Iterable[int]) -> None:
        self._node = node
        self._connected = set(muxes)  # those that may have a channel on: all, until they were seen to
        self.selected: Route | None = None

    def select(self, route: Route | None) -> None:
        """Connect `route` unless it is connected. Raises OSError, with nothing selected, if its mux fails."""
        if route is None or route == self.selected:
            return
        self.selected = None
        for other in sorted(self._connected - {route.mux}):
            with suppress(OSError):  # it is gone, and takes with it what is behind it
                self._node.write(other, control(None))
                self._connected.discard(other)
        self._connected.add(route.mux)
        self._node.write(route.mux, control(route.channel))
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
