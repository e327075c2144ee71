"""What an SPI source makes of the codes of its converter; that they are read is shown on real device nodes."""

from collections.abc import Callable, Sequence

import pytest

from thenar.drivers.spi.device import SpiDevice
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Debounce, Harness, SpiWiring
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources import i2c
from thenar.runtime.sources.base import slowest_us, sources_of
from thenar.runtime.sources.spi import SpiConverter
from thenar.runtime.taxels import TaxelCalibration

from ...gloves import pad_line

HARNESS = Harness(
    name="x",
    buses=(BusWiring(device="/dev/i2c-1", chips=(ChipWiring(kind="mcp23008", address=0x20, pins={"GP0": "s0"}),)),),
    spi=(
        SpiWiring(device="/dev/spidev0.0", kind="mcp3208", pins={"CH1": "t0"}),
        SpiWiring(device="/dev/spidev0.1", kind="mcp3008", pins={"CH7": "t2", "CH2": "t1"}),
    ),
    debounce=Debounce(enabled=False),
)
NAMES = ["t2>100", "s0", "t1>40", "t0>7", "t1>500"]


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> list[list[int | None]]:
    """What the converters will answer; the time stands still."""
    given: list[list[int | None]] = []

    def prepare(_self: object, _transfers: Sequence[object]) -> Callable[[], list[int | None]]:
        return lambda: given.pop(0)

    monkeypatch.setattr(SpiDevice, "prepare", prepare)
    monkeypatch.setattr(i2c, "now_us", lambda: 5)
    monkeypatch.setattr("time.sleep", lambda _: None)
    return given


def test_levels_are_closed_above_their_codes_and_the_codes_go_along(answers: list[list[int | None]]) -> None:
    device = SpiConverter(HARNESS, 1, whole_scan(HARNESS, NAMES))
    assert device.owned == 0b10101
    answers += [[41, 100], [40, 101], [501, 0]]
    found = [device.read(0.1) for _ in range(3)]
    assert found == [
        SwitchFrame(5, 0b00100, taxels=(None, 41, 100)),
        SwitchFrame(5, 0b00001, taxels=(None, 40, 101)),
        SwitchFrame(5, 0b10100, taxels=(None, 501, 0)),
    ]
    assert device.fault_message() == ""


def test_where_no_converter_answers_levels_are_lost_and_it_says_so(answers: list[list[int | None]]) -> None:
    device = SpiConverter(HARNESS, 1, whole_scan(HARNESS, NAMES))
    answers.append([None, None])
    assert device.read(0.1) == SwitchFrame(5, 0, lost=0b10101)
    assert "mcp3008 does not reply" in device.fault_message()


def test_a_saturated_taxel_is_lost_and_named(answers: list[list[int | None]]) -> None:
    lines = tuple(pad_line(name, rest=50, press=600) for name in ("t1", "t2"))
    device = SpiConverter(HARNESS, 1, whole_scan(HARNESS, NAMES), TaxelCalibration(sensors=lines))
    answers.append([1023, 400])
    found = device.read(0.1)
    assert found is not None
    assert (found.closed, found.lost) == (0b00001, 0b10100)
    assert device.fault_message() == "taxels with faults: t1: saturated"


def test_only_devices_with_levels_are_sources_of_a_build() -> None:
    scan = whole_scan(HARNESS, ["t1>40", "s0"])
    sources = [source.name for source in sources_of(HARNESS, ["t1>40", "s0"], scan)]
    assert sources == ["i2c at /dev/i2c-1", "spi at /dev/spidev0.1"]
    assert slowest_us(sources_of(HARNESS, ["t1>40", "s0"], scan)) == 10_000
    everything = whole_scan(HARNESS, [], every_taxel=True)
    assert [source.name for source in sources_of(HARNESS, [], everything)] == [
        "spi at /dev/spidev0.0",
        "spi at /dev/spidev0.1",
    ]
