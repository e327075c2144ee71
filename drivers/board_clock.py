"""A board's microsecond clock on the host's time scale."""

_MODULUS = 1 << 32
# A ceramic resonator is wrong by up to 0.5 %: so much the offset may grow between two frames, 1/128 of what has passed.
_DRIFT_SHIFT = 7


class BoardClock:
    """Finds the offset between the clocks as the smallest delay seen, forgotten no faster than clocks drift apart.

    Delays only ever add to it, so the smallest is the nearest to the truth. A host that falls behind, and reads what
    has long stood in a buffer, thus gets the times at which it was sent, not those at which it was read. The board's
    clock wraps after 71.6 minutes; it may restart at any time.

    A delay that all frames share does not show in that offset. Frames that the host asked for bound it from the other
    side: they were not sent before they were asked for. `trip_us` is what lies between the two bounds.
    """

    def __init__(self) -> None:
        self._board: int | None = None
        self._offset = 0
        self._least: int | None = None
        self._guessed = False

    @property
    def trip_us(self) -> int:
        """By how much a frame may have been sent before the time that `host_us` gave it; 0 before one was asked for."""
        return 0 if self._least is None else self._offset - self._least

    def host_us(self, board_us: int, came_us: int, asked_us: int | None = None) -> int:
        """Return the host's time of `board_us` (0 to 2**32 - 1), sent in a frame that came in at `came_us`: not later.

        asked_us  when the host asked for this very frame, if it did: the board cannot have sent it before
        """
        if self._board is None:
            self._board, self._offset = board_us, came_us - board_us
        passed, trip_us = (board_us - self._board) % _MODULUS, self.trip_us
        drift_us = passed >> _DRIFT_SHIFT
        self._board += passed
        self._offset = min(came_us - self._board, self._offset + drift_us)
        if self._least is not None:
            self._least -= drift_us
            # Where the bounds cross, the board has started again: on the same line, until it is asked anew.
            self._guessed |= self._least > self._offset
            if self._guessed:
                self._least = min(self._least, self._offset - trip_us)
        if asked_us is not None:
            asked = asked_us - self._board
            self._offset = max(self._offset, asked)
            self._least = asked if self._least is None or self._guessed else max(self._least, asked)
            self._guessed = False
        return self._board + self._offset
