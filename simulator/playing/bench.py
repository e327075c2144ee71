"""The emulated devices of a harness: their wiring, their ports for clients, and the faults of their wires."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np

from thenar.drivers.calibration import SensorCalibration
from thenar.drivers.closing import Closing
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.i2c import AdapterKind, EmulatedBus, EmulatedChip, EmulatedI2c
from thenar.drivers.emulated.lines import BoardSender, LineSender, lines_like
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.transports import is_serial
from thenar.runtime.calibration import load_calibration, numbers_of
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, SpiWiring, StreamWiring
from thenar.runtime.sources.rows import steps_of

from ..effects import wire_damaged_bytes, wire_lost_bytes
from ..scenes.scene import Scene

_ALL_HIGH = (1 << 24) - 1
_CODE_BITS = 16


def levels_of(chip: ChipWiring, closed: Sequence[bool], numbers: Mapping[str, int]) -> int:
    """Return the levels of a chip's pins, bit p for pin p: open pins are pulled to the level of an open switch.

    numbers  the index in `closed` of each switch by name; other switches are open
    """
    shut = sum(1 << pin for pin, name in chip.numbered_pins.items() if name in numbers and closed[numbers[name]])
    return shut if chip.closed == "high" else _ALL_HIGH & ~shut


def codes_of(chip: ChipWiring | SpiWiring, taxels: Sequence[int], numbers: Mapping[str, int]) -> int:
    """Return the counts at a converter's channels, 16 bits each; a taxel not among `numbers` is at 0."""
    pins = chip.numbered_pins.items()
    return sum(taxels[numbers[name]] << _CODE_BITS * channel for channel, name in pins if name in numbers)


Cable = Callable[[bytes], bytes]


def cable_of(scene: Scene, line: int) -> Cable | None:
    """Return the effect of the cable of line number `line` on an outgoing message; None if the scene lists none.

    Each line has its own draws, reproducible by the seed.
    """
    listed = dict(scene.effects)
    lost, damaged = (
        dict(listed[effect.name])["rate"] if effect.name in listed else None
        for effect in (wire_lost_bytes.MEMBER, wire_damaged_bytes.MEMBER)
    )
    if lost is None and damaged is None:
        return None
    random = np.random.Generator(np.random.Philox(key=[scene.seed, line]))

    def cable(message: bytes) -> bytes:
        data = np.frombuffer(message, dtype=np.uint8)
        if damaged is not None:
            data = wire_damaged_bytes.damaged(data, random.random(len(data)), damaged)
        if lost is not None:
            data = data[wire_lost_bytes.arrives(random.random(len(data)), lost)]
        return data.tobytes()

    return cable


class Bench(Closing):
    """Emulated devices for every device of `harness`, their serial ports linked in `folder`.

    harness      the same harness with the ports of the emulated devices
    environment  variables that a process needs to see the emulated I2C buses and SPI devices
    lines        the serial lines, the CyberGlove's first, then the streams'
    """

    def __init__(
        self,
        harness: Harness,
        switch_names: Sequence[str],
        folder: Path,
        cable: Callable[[int], Cable | None] = lambda _line: None,
        adapter: AdapterKind = "any",
        taxel_names: Sequence[str] = (),
        joints: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Start the devices. cable(n) is applied to the messages of serial line n; joints are the names and units of
        those that streams send.

        Raises DeviceError if a package for the emulation is not installed.
        """
        self._numbers = {name: number for number, name in enumerate(switch_names)}
        self._taxels = {name: number for number, name in enumerate(taxel_names)}
        self._folder, self._cable = folder, cable
        self.lines: list[PtyLine] = []
        with ExitStack() as stack:
            self.glove: EmulatedCyberGlove | None = None
            if harness.cyberglove is not None:
                line = self._line("cyberglove", harness.cyberglove.baud, stack)
                self.glove = stack.enter_context(EmulatedCyberGlove(line, sensors=harness.cyberglove.all_sensors))
            self.i2c: EmulatedI2c | None = None
            if harness.buses or harness.spi:
                spi = {wiring.device: wiring.kind for wiring in harness.spi}
                self.i2c = stack.enter_context(EmulatedI2c([_emulated(bus, adapter) for bus in harness.buses], spi))
            self._joints = {name: (number, unit) for number, (name, unit) in enumerate(joints)}
            self.streams, ports = list[LineSender](), list[str]()
            for number, wiring in enumerate(harness.streams):
                sender, port = self._stream(number, wiring, stack)
                self.streams.append(sender)
                ports.append(port)
            self._stack = stack.pop_all()
        self.harness = _moved(harness, folder, ports)
        self._lines = [_lines_of(wiring) for wiring in harness.streams]
        self.environment = {} if self.i2c is None else self.i2c.environment

    def _line(self, name: str, baud: int, stack: ExitStack) -> PtyLine:
        line = stack.enter_context(PtyLine(self._folder / name, baud))
        line.damage = self._cable(len(self.lines))
        self.lines.append(line)
        return line

    def _stream(self, number: int, wiring: StreamWiring, stack: ExitStack) -> tuple[LineSender, str]:
        """Return the sender of a stream's rows, and its port; those of other readers are also sent as lines."""
        if not is_serial(wiring.port):
            way = lines_like(wiring.port)
            stack.callback(way.close)
            send, port = way.send, way.port
        else:
            line = self._line(f"stream{number}", wiring.baud, stack)
            send, port = line.send, str(line.link)
        if wiring.board is not None:
            readings = (*wiring.joints, *wiring.taxels)
            return stack.enter_context(BoardSender(send, wiring.switches, readings, wiring.rate_hz)), port
        time = () if wiring.time is None else (wiring.time,)
        columns = wiring.columns or (*time, *wiring.used)
        unit, named = wiring.time_unit, not wiring.columns
        sender = LineSender(send, columns, wiring.rate_hz, wiring.time, unit, named=named)
        return stack.enter_context(sender), port

    def _numbers_of(
        self, number: int, closed: Sequence[bool], taxels: Sequence[int], joints: Sequence[float]
    ) -> dict[str, float]:
        """Return the values of a stream's columns, in the sender's units."""
        wiring, found = self.harness.streams[number], dict[str, float]()
        for name in wiring.switches:
            shut = name in self._numbers and closed[self._numbers[name]]
            threshold = wiring.thresholds.get(name, wiring.threshold)
            found[name] = threshold + (0.5 if shut == (wiring.closed == "high") else -0.5)
        for name, (low, high) in wiring.taxels.items():
            code = taxels[self._taxels[name]] if name in self._taxels else 0
            found[name] = low + code * (high - low) / steps_of((low, high))
        for line in numbers_of(wiring.joints):
            name, (place, unit) = line.name, self._joints.get(line.name, (-1, ""))
            if place >= 0:
                found[name] = joints[place]
                if unit == "raw":
                    found[name] = line.value(round(joints[place]))
                elif name in self._lines[number]:
                    found[name] = line.value(self._lines[number][name](joints[place]))
        return found

    def show(
        self, closed: Sequence[bool], sensors: bytes, taxels: Sequence[int] = (), joints: Sequence[float] = ()
    ) -> None:
        """Set one frame on all devices: the mask of closed switches (s,), the glove's sensors, the taxels' counts (t,),
        and the joints (j,) of streams.
        """
        for number, sender in enumerate(self.streams):
            sender.show(self._numbers_of(number, closed, taxels, joints))
        if self.glove is not None:
            self.glove.set(sensors)
        if self.i2c is not None:
            spi = [[codes_of(chip, taxels, self._taxels)] for chip in self.harness.spi]
            self.i2c.set_all(
                [*([self._levels(chip, closed, taxels) for chip in bus.chips] for bus in self.harness.buses), *spi]
            )

    def _levels(self, chip: ChipWiring, closed: Sequence[bool], taxels: Sequence[int]) -> int:
        return codes_of(chip, taxels, self._taxels) if chip.measures else levels_of(chip, closed, self._numbers)

    def close(self) -> None:
        """Stop all devices and remove their ports."""
        self._stack.close()


def _emulated(wiring: BusWiring, adapter: AdapterKind) -> EmulatedBus:
    chips = (
        EmulatedChip(chip.kind, chip.address, *((chip.mux.address, chip.mux.channel) if chip.mux else ()))
        for chip in wiring.chips
    )
    return EmulatedBus(wiring.device, wiring.clock_hz, adapter, tuple(chips))


def _lines_of(wiring: StreamWiring) -> dict[str, Callable[[float], int]]:
    """Return functions from angle to byte, for the calibrated joints."""
    if wiring.calibration is None:
        return {}

    def byte_of(line: SensorCalibration) -> Callable[[float], int]:
        return lambda value: min(range(1, 256), key=lambda raw: abs(line.value(raw) - value))

    return {line.name: byte_of(line) for line in load_calibration(Path(wiring.calibration)).sensors}


def _moved(harness: Harness, folder: Path, ports: Sequence[str]) -> Harness:
    """Return `harness` with its serial ports in `folder`, and its streams at these ports."""
    glove = harness.cyberglove
    return msgspec.structs.replace(
        harness,
        cyberglove=None if glove is None else msgspec.structs.replace(glove, port=str(folder / "cyberglove")),
        streams=tuple(
            msgspec.structs.replace(wiring, port=port, frame=None)
            for wiring, port in zip(harness.streams, ports, strict=True)
        ),
    )
