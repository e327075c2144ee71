"""Runs an I2cBus as JSON lines on stdin ask: umockdev shows its device nodes to other processes only.

The first line holds device, chips and how often they are checked; every further one [verb, arguments...]. The answer is
[result, error]: one of them is null.
"""

import json
import sys
from time import monotonic
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import ThenarError
from thenar.drivers.i2c.bus import I2cBus, PlacedPort
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.i2c.supervisor import PlacedChip, Route

if TYPE_CHECKING:
    from thenar.drivers.i2c.bus import Scan


class Client:
    def __init__(self, device: str, chips: list[dict[str, Any]], check_every_s: float) -> None:
        self._members = [_chip(**chip) for chip in chips]
        self._bus = I2cBus(device, self._members, check_every_s=check_every_s)
        self._scan: Scan | None = None

    def open(self) -> None:
        self._bus.open()

    def close(self) -> None:
        self._bus.close()

    def prepare(self, ports: list[tuple[int, str]]) -> None:
        self._scan = self._bus.prepare(
            [PlacedPort(self._members[chip], self._reading(chip, name)) for chip, name in ports]
        )

    def read(self) -> list[int | None]:
        assert self._scan is not None
        return self._scan.read()

    def read_until(self, wanted: list[int | None], timeout_s: float) -> list[list[int | None]]:
        """Return the different answers on the way, in order; the last one is what was wanted, or time ran out."""
        met: list[list[int | None]] = []
        end = monotonic() + timeout_s
        while monotonic() < end:
            answer = self.read()
            if not met or answer != met[-1]:
                met.append(answer)
            if answer == wanted:
                break
        return met

    def state(self) -> dict[str, Any]:
        return {
            "chips": [
                {name: getattr(chip, name) for name in ("present", "errors", "last_error")} for chip in self._bus.chips
            ],
            "way": self._bus.way,
            "fault_message": self._bus.fault_message,
            "transfers": self._bus.transfers,
        }

    def _reading(self, chip: int, name: str) -> Any:
        return next(reading for reading in self._members[chip].chip.readings if reading.name == name)


def _chip(kind: str, address: int, mux: int | None = None, channel: int | None = None) -> PlacedChip:
    chip = CHIPS[kind]
    used = frozenset(pin for pin, name in enumerate(chip.pins) if name not in chip.not_inputs)
    return PlacedChip(chip, address, used, None if mux is None or channel is None else Route(mux, channel))


def main() -> None:
    client = Client(*json.loads(sys.stdin.readline()))
    for line in sys.stdin:
        verb, *arguments = json.loads(line)
        try:
            answer = [getattr(client, verb)(*arguments), None]
        except ThenarError as error:
            answer = [None, f"{type(error).__name__}: {error}"]
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
