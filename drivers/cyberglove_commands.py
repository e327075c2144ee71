"""Commands of the CyberGlove's box and their answers, as bytes. (The vendor's manual, as public drivers quote it.)

Upper-case letters are binary: what follows them, and what comes back, are bytes. A query is '?' and a letter. An answer
is an echo of the command's letters, the values, and a NUL; as values may be 0, it is told by its exact length. Only the
information text ends by itself, with CR LF NUL. An answer may also be an error: 'e' and what was wrong, with the echo
before it or not (the sources disagree: both are understood).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from .errors import SettingError

STOP = b"\x03"  # Ctrl-C
RESTART = b"\x12"  # Ctrl-R
POLL, STREAM = b"G", b"S"

# What ?G says when all is well: bit 0 initialised, bit 1 glove connected (two of seven sources swap the bits).
READY = 3

_TEXT_END = b"\r\n\0"
_ERRORS = {
    b"?": "unknown command",
    b"n": "wrong number of values, or a wrong value",
    b"y": "the external synchronisation comes too fast",
    b"g": "no glove is plugged in",
    b"s": "sampling too fast",
}

# Bytes in the answer to ?X, by X; after X as a setting. docs/cyberglove.md says what each letter means.
ANSWERED: Mapping[str, int] = (
    dict.fromkeys("BDFGJLNQRSUWY", 1) | dict.fromkeys("KMP", 3) | dict.fromkeys("TV", 4) | {"A": 6}
)
SET: Mapping[str, int] = dict.fromkeys("BDFJLNQUWY", 1) | {"M": 3, "T": 4}


@dataclass(frozen=True, slots=True)
class Command:
    """What is sent, what the answer begins with, and how many bytes of values it then has; None: text."""

    request: bytes
    echo: bytes
    values: int | None

    @property
    def name(self) -> str:
        """The command as a message names it."""
        return self.echo.decode("ascii")


@dataclass(frozen=True, slots=True)
class Answer:
    """What the box answered: values (or text), or else what it complains of."""

    values: bytes
    error: str | None = None


INFORMATION = Command(b"?i", b"?i", None)


def query(letter: str) -> Command:
    """Return the query ?X of a letter X. Raises SettingError if the box has none."""
    if letter not in ANSWERED:
        raise SettingError(f"a CyberGlove has no query ?{letter}: it has ?{', ?'.join(sorted(ANSWERED))}")
    echo = b"?" + letter.encode("ascii")
    return Command(echo, echo, ANSWERED[letter])


def setting(letter: str, values: bytes) -> Command:
    """Return the command that sets X to `values`. Raises SettingError if it takes other values."""
    if len(values) != SET.get(letter):
        raise SettingError(
            f"a CyberGlove's {letter} cannot be set to {len(values)} bytes: settings are "
            + ", ".join(f"{letter} ({length})" for letter, length in sorted(SET.items()))
        )
    echo = letter.encode("ascii")
    return Command(echo + values, echo, 0)


def find_answer(command: Command, received: bytes, *, last: bool = False) -> Answer | None:
    """Return the answer in what was received since the command, or None while there is none yet.

    What comes before it is skipped, NUL by NUL: rests of a stream, the echo of a Ctrl-C. `last` says that nothing more
    will come: then what could have become a longer answer is taken for what it is.
    """
    while received:
        answer = _at_start(command, received, last)
        if answer is not None:
            return answer
        if not last and received.startswith(command.echo):
            return None
        received = received.partition(b"\0")[2]
    return None


def _at_start(command: Command, received: bytes, last: bool) -> Answer | None:
    values = _text(command, received) if command.values is None else _values(command, received)
    return Answer(values) if values is not None else _error(command, received, last)


def _values(command: Command, received: bytes) -> bytes | None:
    begin = len(command.echo)
    end = begin + (command.values or 0)
    if not received.startswith(command.echo) or received[end : end + 1] != b"\0":
        return None
    return received[begin:end]


def _text(command: Command, received: bytes) -> bytes | None:
    end = received.find(_TEXT_END)
    return received[len(command.echo) : end] if received.startswith(command.echo) and end >= 0 else None


def _error(command: Command, received: bytes, last: bool) -> Answer | None:
    found = re.match(rb"(%b)?e([?nygs])(\r\n)?\0" % re.escape(command.echo), received)
    if found is None or (found[1] and not last and _may_grow(command, found.end())):
        return None
    return Answer(b"", _ERRORS[found[2]])


def _may_grow(command: Command, size: int) -> bool:
    """Return whether `size` bytes that read as an error may be the beginning of values."""
    return command.values is not None and size <= len(command.echo) + command.values
