"""Set-up of a chip, and what is there instead if it fails: a chip that only acknowledges is not believed."""

from .chip import Chip, Write
from .node import Node, Query
from .registry import CHIPS


class ImpostorError(Exception):
    """What answers at an address is not the chip that should be there."""


def set_up(node: Node, chip: Chip, used: frozenset[int]) -> None:
    """Write the chip's registers and read them back. Raises OSError of a transfer, ImpostorError of a wrong answer."""
    for write in chip.setup(used):
        node.write(chip.address, write.data)
        if write.expect and not write.holds(read_back(node, chip, write)):
            raise ImpostorError


def read_back(node: Node, chip: Chip, write: Write) -> bytes:
    """Return the bytes that stand where `write` put its own."""
    return node.query(Query(chip.address, write.data[:1] if chip.registers else b"", len(write.expect)))


def watched(chip: Chip, used: frozenset[int]) -> Write | None:
    """Return what a reset of the chip would lose, if it would lose anything."""
    last = chip.setup(used)[-1]
    return last if last.expect else None


def whats_there(node: Node, address: int) -> str:
    """Return, in words, what answers at an address: the first kind whose set-up holds, which leaves its pins inputs.

    Kinds without registers come last, for what is written to look for registers drives their pins.
    """
    for chip in sorted(CHIPS.values(), key=lambda chip: chip.registers, reverse=True):
        if address in chip.addresses and _behaves_like(node, chip(address)):
            return f"something that behaves like a {chip.kind}"
    return "something unknown"


def _behaves_like(node: Node, chip: Chip) -> bool:
    try:
        set_up(node, chip, frozenset())
    except (OSError, ImpostorError):
        return False
    return True
