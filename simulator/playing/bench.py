"""The devices of a harness, emulated: what they are connected to, and where a client finds them."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.i2c import AdapterKind, EmulatedBus, EmulatedChip, EmulatedI2c
from thenar.drivers.emulated.scanner import EmulatedScanner
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.harness.wiring import BusWiring, Harness
from thenar.runtime.sources.cyberglove import sensors_of

from .cable import Cable
from .levels import levels_of

_USUAL_BAUD = 115_200


class Bench:
    """Emulated devices for every device of `harness`, their serial ports linked in `folder`.

    harness      the same harness with the ports where the emulated devices are
    environment  what a process needs besides its own environment to see the emulated I2C buses
    lines        the serial lines, the CyberGlove's first, then the scanners'
    """

    def __init__(
        self,
        harness: Harness,
        switch_names: Sequence[str],
        folder: Path,
        cable: Callable[[int], Cable | None] = lambda _line: None,
        adapter: AdapterKind = "any",
    ) -> None:
        """Start the devices. cable(n) is what happens to the messages of serial line n.

        Raises DeviceError if something that emulates is not installed.
        """
        self._numbers = {name: number for number, name in enumerate(switch_names)}
        self._folder, self._cable = folder, cable
        self.lines: list[PtyLine] = []
        with ExitStack() as stack:
            self.glove: EmulatedCyberGlove | None = None
            if harness.cyberglove is not None:
                baud = harness.cyberglove.baud
                line = self._line("cyberglove", _USUAL_BAUD if baud == "auto" else baud, stack)
                self.glove = stack.enter_context(EmulatedCyberGlove(line, sensors=sensors_of(harness.cyberglove)))
            self.scanners = tuple(
                stack.enter_context(
                    EmulatedScanner(self._line(f"scanner{number}", wiring.baud, stack), len(wiring.switches))
                )
                for number, wiring in enumerate(harness.scanners)
            )
            self.i2c: EmulatedI2c | None = None
            if harness.buses:
                self.i2c = stack.enter_context(EmulatedI2c([_emulated(bus, adapter) for bus in harness.buses]))
            self._stack = stack.pop_all()
        self.harness = _moved(harness, folder)
        self.environment = {} if self.i2c is None else self.i2c.environment

    def _line(self, name: str, baud: int, stack: ExitStack) -> PtyLine:
        line = stack.enter_context(PtyLine(self._folder / name, baud))
        line.damage = self._cable(len(self.lines))
        self.lines.append(line)
        return line

    def show(self, closed: Sequence[bool], sensors: bytes) -> None:
        """Put one frame on all devices: which switches (s,) are closed, and the glove's sensors."""
        if self.glove is not None:
            self.glove.set(sensors)
        for scanner, wiring in zip(self.scanners, self.harness.scanners, strict=True):
            keys = [self._numbers.get(name) for name in wiring.switches]
            scanner.set(sum(1 << key for key, number in enumerate(keys) if number is not None and closed[number]))
        if self.i2c is not None:
            buses = self.harness.buses
            self.i2c.set_all([[levels_of(chip, closed, self._numbers) for chip in bus.chips] for bus in buses])

    def close(self) -> None:
        """Stop all devices and take their ports away."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _emulated(wiring: BusWiring, adapter: AdapterKind) -> EmulatedBus:
    chips = (
        EmulatedChip(chip.kind, chip.address, *((chip.mux.address, chip.mux.channel) if chip.mux else ()))
        for chip in wiring.chips
    )
    return EmulatedBus(wiring.device, wiring.clock_hz, adapter, tuple(chips))


def _moved(harness: Harness, folder: Path) -> Harness:
    """Return `harness` with its serial ports in `folder`."""
    glove = harness.cyberglove
    return msgspec.structs.replace(
        harness,
        cyberglove=None if glove is None else msgspec.structs.replace(glove, port=str(folder / "cyberglove")),
        scanners=tuple(
            msgspec.structs.replace(wiring, port=str(folder / f"scanner{number}"))
            for number, wiring in enumerate(harness.scanners)
        ),
    )
