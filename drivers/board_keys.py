"""Which keys of a scanner board are closed, and whether that can be trusted: lost frames, lost events, ghosts."""

from .ghosting import ambiguous
from .scanner_messages import WITHOUT_DIODES, Event, FromBoard, Heartbeat, State

Mask = int


class BoardKeys:
    """The keys of a board, as its HELLO gives them, which was the frame numbered `sequence`.

    They are unknown until a bitmap comes.
    """

    def __init__(self, rows: int = 0, columns: int = 0, flags: int = 0, sequence: int = 0) -> None:
        self._rows, self._columns, self._flags, self._sequence = rows, columns, flags, sequence
        self.keys = rows * columns
        self._all = (1 << self.keys) - 1
        self.closed: Mask = 0
        self.trusted = False
        self.gaps = 0

    @property
    def known(self) -> Mask:
        """The keys of which it can be said whether they are closed."""
        if not self.trusted:
            return 0
        if not self._flags & WITHOUT_DIODES:
            return self._all
        return self._all & ~ambiguous(self.closed, self._rows, self._columns)

    def lost(self) -> None:
        """Note that something came in which could not be read: it may have been an EVENT."""
        self.trusted = False

    def numbered(self, sequence: int) -> None:
        """Note the number of a frame; a gap before it means that frames were lost, or that the board restarted."""
        if sequence != (self._sequence + 1) & 0xFF:
            self.gaps += 1
            self.trusted = False
        self._sequence = sequence

    def heard(self, message: FromBoard) -> None:
        """Take what a frame says of keys. An event changes nothing before there is a bitmap to change."""
        match message:
            case State() | Heartbeat():
                self.closed, self.trusted = message.closed, True
            case Event() if self.trusted:
                bit = 1 << message.key
                self.closed = self.closed | bit if message.edge else self.closed & ~bit
