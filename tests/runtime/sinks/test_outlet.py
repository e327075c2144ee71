"""Whatever a slow reader takes, and whenever: it sees whole lines, in order, and no more than one waits for it."""

import contextlib
import os

import pytest

from thenar.runtime.sinks.jsonl import Outlet, patient_writer


class Reader:
    """Takes so many bytes at each try: 0 is not now."""

    def __init__(self, takes: list[int]) -> None:
        self.takes = takes
        self.got = b""

    def write(self, data: bytes) -> int:
        took = self.takes.pop(0) if self.takes else 0
        if not took:
            raise BlockingIOError
        self.got += data[:took]
        return min(took, len(data))


def test_a_line_that_nothing_was_taken_of_is_lost_rather_than_late() -> None:
    reader = Reader([0, 100])
    outlet = Outlet(reader.write)
    assert not outlet.send(b"old\n")
    assert outlet.send(b"new\n")
    assert reader.got == b"new\n"


def test_a_full_pipe_that_blocks_is_never_written_to() -> None:
    ours, theirs = os.pipe()
    write = patient_writer(theirs)
    assert os.get_blocking(theirs)
    with contextlib.suppress(BlockingIOError):
        for _ in range(10_000):
            write(b"x" * 5000)
    with pytest.raises(BlockingIOError):
        write(b"x")
    assert len(os.read(ours, 4096)) == 4096
    assert write(b"y" * 5000) == 4096
    os.close(ours)
    with pytest.raises(BrokenPipeError):
        write(b"z")
    os.close(theirs)
