"""Open Sound Control over UDP as rows (extra `osc`): `port = "osc:HOST:PORT/ADDRESS"` of a [[stream]].

HOST is this computer's own address: 127.0.0.1, or 0.0.0.0 for all. Two forms are read:

    ADDRESS       one message a row, with its arguments as columns in the order of glove.toml
    ADDRESS/NAME  one datagram (a bundle) a row, with a number for each column by its name

Messages at other addresses are left out, and so is a second sender.
"""

import re
from typing import Any

from thenar.drivers.errors import SettingError
from thenar.drivers.extras import optional
from thenar.drivers.lines import LineParser, Row, finite
from thenar.drivers.names import shortened
from thenar.drivers.readers import LineReader

from .rows import row_kind

_PORT = re.compile(r"osc:([^/]+:[0-9]{1,5})(/[^ #*,?\[\]{}]*[^ #*,?\[\]{}/])")


class OscParser(LineParser):
    """Parses rows from datagrams; the messages at `address` and below it count."""

    def __init__(self, address: str) -> None:
        super().__init__()
        self._address = address

    def feed(self, chunk: bytes) -> list[Row]:
        """Return the rows of a datagram, to which `LineReader` adds the end of a line."""
        from pythonosc.osc_packet import OscPacket

        try:
            messages = [(each.message.address, each.message.params) for each in OscPacket(chunk[:-1]).messages]
        except Exception:  # the parser raises many kinds for what is not OSC
            return self._misfit("a datagram that is not OSC")
        rows, named = list[Row](), dict[str, float | None]()
        for address, values in messages:
            if address == self._address:
                rows.append(Row(None, tuple(map(_number, values))))
            elif address.startswith(f"{self._address}/") and values:
                named[address.removeprefix(f"{self._address}/")] = _number(values[0])
        rows += [Row(tuple(named), tuple(named.values()))] if named else []
        return rows or self._misfit(f"a message at {shortened(messages[0][0])}" if messages else "an empty bundle")

    def _misfit(self, odd: str) -> list[Row]:
        self.counts.misfits += 1
        self.odd = odd
        return []


def _is_not_of_osc(record: Any) -> bool:
    """Return whether a record of the log is not by python-osc, which writes one for each unusual datagram."""
    return "pythonosc" not in record.pathname


def _number(value: Any) -> float | None:
    return finite(float(value)) if isinstance(value, int | float) else None  # a bool is an int


class OscReader(LineReader):
    """Rows of the messages that come to a port of this computer. The constructor opens nothing."""

    def __init__(self, port: str) -> None:
        found = _PORT.fullmatch(port)
        super().__init__(f"udp://{found[1]}" if found else port)
        self._place, self._address = port, found[2] if found else ""
        self._parser = OscParser(self._address)

    def open(self) -> None:
        """Open the port."""
        if not self._address:
            raise SettingError(f"{shortened(repr(self._place))} names no address: write osc:HOST:PORT/ADDRESS")
        with optional(SettingError, self._place):
            import pythonosc.osc_packet  # noqa: F401
        from logging import getLogger

        getLogger().addFilter(_is_not_of_osc)
        super().open()


MEMBER = row_kind("osc", lambda wiring: OscReader(wiring.port), 7)
