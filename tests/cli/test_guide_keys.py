import os
import pty
import termios
from collections.abc import Iterator

import pytest

from thenar.cli.collecting import Terminal
from thenar.compiler.recordings.taxonomy import Taxonomy
from thenar.runtime.recording.guide import Key

TAXONOMY = Taxonomy("own", ("A",))
A, R, Q = "accept", "redo", "quit"


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    yield master, slave
    for descriptor in (master, slave):
        try:
            os.close(descriptor)
        except OSError:
            continue


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        (b"\n", [A]),
        (b"\r", [A]),
        (b" a", [A, A]),
        (b"rR", [R, R]),
        (b"q", [Q]),
        (b"usp", ["undo", "skip", "pause"]),
        (b"xyz1", []),
        (b"\x1b[A\x1b[1;5C\x1bOP", []),
        (b"\x1b[Ar", [R]),
        (b"\xff\xfe", []),
    ],
)
def test_on_a_terminal_every_key_counts_by_itself(terminal: tuple[int, int], typed: bytes, keys: list[Key]) -> None:
    master, slave = terminal
    with Terminal(TAXONOMY, slave) as reader:
        assert reader.pressed() == []
        os.write(master, typed)
        assert reader.pressed() == keys
        assert reader.pressed() == []


def test_the_terminal_is_left_as_it_was(terminal: tuple[int, int]) -> None:
    _, slave = terminal
    before = termios.tcgetattr(slave)
    with Terminal(TAXONOMY, slave):
        assert termios.tcgetattr(slave) != before
    assert termios.tcgetattr(slave) == before


def test_ctrl_c_stays_what_it_is(terminal: tuple[int, int]) -> None:
    _, slave = terminal
    with Terminal(TAXONOMY, slave):
        assert termios.tcgetattr(slave)[3] & termios.ISIG


def test_a_terminal_that_is_closed_leaves(terminal: tuple[int, int]) -> None:
    master, slave = terminal
    reader = Terminal(TAXONOMY, slave)
    os.close(master)
    assert reader.pressed() == [Q]
    assert reader.pressed() == []


def test_elsewhere_a_line_is_a_key() -> None:
    here, there = os.pipe()
    with Terminal(TAXONOMY, here) as reader:
        assert reader.pressed() == []
        os.write(there, b"\na\nR")
        assert reader.pressed() == [A, A]
        os.write(there, b"\nwhat\n q \n")
        assert reader.pressed() == [R, Q]
        os.close(there)
        assert reader.pressed() == [Q]
        assert reader.pressed() == []
    os.close(here)
