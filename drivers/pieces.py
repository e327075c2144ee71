"""What lies between two zero bytes of an incoming stream, whatever chunks it comes in."""


class Pieces:
    """Splits a stream at 00, which ends a frame and can stand nowhere else: the one sure place to fall back into step.

    Of a piece longer than `longest` the first `longest` + 1 bytes are kept, so that its length tells; a stream without
    zeros never fills the memory.
    """

    def __init__(self, longest: int) -> None:
        self._keep = longest + 1
        self._rest = b""

    def feed(self, chunk: bytes) -> list[bytes]:
        """Return the pieces that `chunk` ends, in order, without their zeros; empty ones too."""
        pieces = chunk.split(b"\0")
        pieces[0] = self._rest + pieces[0]
        self._rest = pieces.pop()[: self._keep]
        return [piece[: self._keep] for piece in pieces]
