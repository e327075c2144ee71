"""A board's microsecond clock on the host's time scale."""

_MODULUS = 1 << 32
# A ceramic resonator is wrong by up to 0.5 %: so much the offset may grow between two frames, 1/128 of what has passed.
_DRIFT_SHIFT = 7


class BoardClock:
    """Finds the offset between the clocks as the smallest delay seen, forgotten no faster than clocks drift apart.

    Delays only ever add to it, so the smallest is the nearest to the truth. A host that falls behind, and reads what
    has long stood in a buffer, thus gets the times at which it was sent, not those at which it was read. The board's
    clock wraps after 71.6 minutes; it may restart at any time.
    """

    def __init__(self) -> None:
        self._board: int | None = None
        self._offset = 0

    def host_us(self, board_us: int, came_us: int, asked_us: int | None = None) -> int:
        """Return the host's time of `board_us` (0 to 2**32 - 1), sent in a frame that came in at `came_us`: not later.

        asked_us  when the host asked for this very frame, if it did: the board cannot have sent it before
        """
        if self._board is None:
            self._board, self._offset = board_us, came_us - board_us
        passed = (board_us - self._board) % _MODULUS
        self._board += passed
        self._offset = min(came_us - self._board, self._offset + (passed >> _DRIFT_SHIFT))
        if asked_us is not None:
            self._offset = max(self._offset, asked_us - self._board)
        return self._board + self._offset
