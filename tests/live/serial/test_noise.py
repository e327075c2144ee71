"""What a bad cable does to the bytes of a run."""

from collections.abc import Callable
from random import Random
from threading import Event
from typing import Any

import pytest

MakeRun = Callable[..., Any]

pytestmark = pytest.mark.slow

GLOVE, BOARD = 0, 1


class Noise:
    """Damages one message in `every`, by its own generator, and tells when it has damaged `enough`."""

    def __init__(self, damage: Callable[[Random, bytes], bytes], every: int, enough: int) -> None:
        self._damage, self._every, self._left = damage, every, enough
        self._random = Random(1)
        self.enough = Event()

    def __call__(self, message: bytes) -> bytes:
        if self._random.randrange(self._every):
            return message
        self._left -= 1
        if self._left <= 0:
            self.enough.set()
        return self._damage(self._random, message)


def cut(random: Random, message: bytes) -> bytes:
    at = random.randrange(len(message))
    return message[:at] if random.random() < 0.5 else message[at + 1 :]


def insert(random: Random, message: bytes) -> bytes:
    at = random.randrange(len(message) + 1)
    return message[:at] + random.randbytes(random.randint(1, 3)) + message[at:]


def flip(random: Random, message: bytes) -> bytes:
    at = random.randrange(len(message))
    return message[:at] + bytes([message[at] ^ 1 << random.randrange(8)]) + message[at + 1 :]


def flood(random: Random, message: bytes) -> bytes:
    """No more than the line has room for: what waits longer is late, whoever reads it."""
    return bytes(random.randint(1, 100)) + message + bytes(20)


def drop(_random: Random, message: bytes) -> bytes:
    return b""


@pytest.mark.parametrize("line", [GLOVE, BOARD], ids=["glove", "board"])
@pytest.mark.parametrize("damage", [cut, insert, flip, flood, drop])
def test_damaged_bytes_give_no_wrong_answer_and_cease_with_repair(
    run: MakeRun, line: int, damage: Callable[[Random, bytes], bytes]
) -> None:
    """One message in three is damaged, while rows change; a flipped byte of the glove alone may go unnoticed, for its
    records have no checksum, and hold only while it is the newest.
    """
    running = run("both", "glove", "board")
    scene, cable = running.scene, running.bench.lines[line]
    noise = Noise(damage, 3, 60)
    cable.damage = noise
    row = 0
    while not noise.enough.wait(0.4):
        row += 1
        scene.show(row % 20)
    cable.damage = None
    mended_us = running.now_us()
    scene.well(mended_us)
    scene.show(25)
    scene.settled(25)
    if (line, damage) != (GLOVE, flip):
        assert scene.check() > 0
    assert set(running.opened()) == {1}
    assert running.damaged(line) > 0 or damage in (drop, flood)
