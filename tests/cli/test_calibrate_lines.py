import os
from collections.abc import Iterator

import click
import pytest

from thenar.cli.calibrate_command import TypedLines


@pytest.fixture
def keyboard() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    os.close(ends[0])


def test_a_whole_line_is_taken_without_waiting(keyboard: tuple[int, int]) -> None:
    reading, writing = keyboard
    typed = TypedLines(reading)
    assert typed.take() is None
    os.write(writing, b"ye")
    assert typed.take() is None
    os.write(writing, b"s \r\n\nq\n")
    assert [typed.take() for _ in range(4)] == ["yes", "", "q", None]
    os.write(writing, b"\xff\n")
    os.close(writing)
    assert typed.take() == "\N{REPLACEMENT CHARACTER}"
    with pytest.raises(click.ClickException, match="nothing is written"):
        typed.take()
