"""Which keys of a scanner board are closed, and of which that can be trusted: lost frames, lost keys, ghosts."""

from .ghosting import ambiguous
from .scanner_messages import WITHOUT_DIODES, Event, FromBoard, Heartbeat, Lost, State

Mask = int


class BoardKeys:
    """The keys of a board, as its HELLO gives them, which was the frame numbered `sequence`.

    They are unknown until a HEARTBEAT comes, with the frame before it: that is a LOST if there are keys that the board
    cannot read.
    """

    def __init__(self, rows: int = 0, columns: int = 0, flags: int = 0, sequence: int = 0) -> None:
        self._rows, self._columns, self._flags, self._sequence = rows, columns, flags, sequence
        self.keys = rows * columns
        self._all = (1 << self.keys) - 1
        self.closed: Mask = 0
        self.lost: Mask = 0
        self.gaps = 0
        self._follows = True  # the frame before the last one was read, too
        self._unread = False  # the last one was sound, but could not be read
        self._is_lost = self._after_lost = False  # the last one, and the one before it, were LOSTs
        self.restarted()

    @property
    def trusted(self) -> bool:
        """Whether nothing is missing of what the board told of its keys."""
        return self._has_bitmap and self._has_lost

    @property
    def known(self) -> Mask:
        """The keys of which it can be said whether they are closed."""
        if not self.trusted:
            return 0
        readable = self._all & ~self.lost
        if not self._flags & WITHOUT_DIODES:
            return readable
        return readable & ~ambiguous(self.closed, self._rows, self._columns)

    def restarted(self) -> None:
        """Note that the board begins anew: nothing of what it told before holds."""
        self._has_bitmap = self._has_lost = False

    def damaged(self) -> None:
        """Note that something came in which was no frame: it may have been an EVENT. A LOST would leave a gap."""
        self._has_bitmap = False

    def misread(self) -> None:
        """Note that the last frame could not be read: it may have been anything."""
        self._unread = True
        self.restarted()

    def numbered(self, sequence: int) -> None:
        """Note the number of a frame; a gap before it means that frames were lost, or that the board restarted."""
        gap = sequence != (self._sequence + 1) & 0xFF
        self._follows, self._unread, self._sequence = not (gap or self._unread), False, sequence
        self._after_lost, self._is_lost = self._is_lost, False
        if gap:
            self.gaps += 1
            self.restarted()

    def heard(self, message: FromBoard) -> None:
        """Take what the frame numbered last says of keys. An EVENT changes nothing before there is a bitmap."""
        match message:
            case State():
                self.closed, self._has_bitmap = message.closed, True
            case Heartbeat():
                self.closed, self._has_bitmap = message.closed, True
                self._not_lost()
            case Lost():
                self.lost, self._has_lost, self._is_lost = message.lost, True, True
            case Event() if self._has_bitmap:
                bit = 1 << message.key
                self.closed = self.closed | bit if message.edge else self.closed & ~bit

    def _not_lost(self) -> None:
        """Take a HEARTBEAT that follows another frame than a LOST to say that all keys can be read."""
        if self._follows and not self._after_lost:
            self.lost, self._has_lost = 0, True
