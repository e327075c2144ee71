from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.serial_line import Pieces

# Zeros often enough that there are pieces of every length.
STREAMS = st.lists(st.sampled_from([0, 0, 1, 2, 255])).map(bytes)


def fed(pieces: Pieces, chunks: list[bytes]) -> list[bytes]:
    return [piece for chunk in chunks for piece in pieces.feed(chunk)]


@given(st.lists(STREAMS), st.integers(1, 5))
def test_chunks_do_not_matter(chunks: list[bytes], longest: int) -> None:
    assert fed(Pieces(longest), chunks) == Pieces(longest).feed(b"".join(chunks))


@given(STREAMS)
def test_pieces_are_what_lies_between_zeros(stream: bytes) -> None:
    assert Pieces(1000).feed(stream + b"\0") == stream.split(b"\0")


@given(STREAMS, st.integers(1, 5))
def test_a_piece_that_is_too_long_is_cut_to_one_more_than_the_longest(stream: bytes, longest: int) -> None:
    whole = stream.split(b"\0")
    assert Pieces(longest).feed(stream + b"\0") == [piece[: longest + 1] for piece in whole]


def test_a_stream_without_zeros_does_not_fill_the_memory() -> None:
    pieces = Pieces(20)
    for _ in range(1000):
        pieces.feed(b"\xff" * 100)
        assert len(pieces._rest) <= 21
