"""docs/reference/harness.md: its examples load, its keys and defaults are the structs', its times are computed.

So are the times of chips in devices.md.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from thenar.drivers.i2c.chips import CHIPS, Conversion
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import (
    BoardMatrix,
    BoardWiring,
    BusWiring,
    ChipWiring,
    Debounce,
    GloveWiring,
    Harness,
    SpiWiring,
    StreamWiring,
)
from thenar.runtime.scanning.timing import port_us, select_us
from thenar.runtime.taxels import TaxelSettings

REFERENCE = Path(__file__).parents[1] / "docs" / "reference"
PAGE = (REFERENCE / "harness.md").read_text(encoding="utf-8")
DEVICES = (REFERENCE / "devices.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
TABLES: dict[str, type[msgspec.Struct]] = {
    "": Harness,
    "`[cyberglove]`": GloveWiring,
    "`[[bus]]`": BusWiring,
    "`[[bus.chip]]`": ChipWiring,
    "`[[spi]]`": SpiWiring,
    "`[[stream]]`": StreamWiring,
    "`[stream.board]`": BoardWiring,
    "`[stream.board.matrix]`": BoardMatrix,
    "`[debounce]`": Debounce,
    "`[taxels]`": TaxelSettings,
}


def rows(heading: str, page: str = PAGE) -> list[list[str]]:
    """Return the cells of the table whose heading begins with `heading`."""
    lines = page[page.index(f"\n| {heading}") + 1 :].split("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_every_example_is_a_sound_harness(number: int, tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    path.write_text(EXAMPLES[number], encoding="utf-8")
    assert load_harness(path).switches


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 5


def documented() -> Iterator[tuple[str, str, str]]:
    table = ""
    for heading, key, default, _ in rows("table | key"):
        table = heading or table
        yield table, key.strip("`"), default


def test_every_key_is_there_with_its_default() -> None:
    found = list(documented())
    nested = {"cyberglove", "board", "matrix", "bus", "chip", "spi", "stream", "debounce"}
    for table, kind in TABLES.items():
        tables = nested | ({"taxels"} if kind is Harness else set())
        keys = {field.encode_name: field for field in msgspec.structs.fields(kind) if field.encode_name not in tables}
        assert sorted(key for where, key, _ in found if where == table) == sorted(keys)
        for where, key, default in found:
            if where == table and keys[key].default not in (msgspec.NODEFAULT, None, ()):
                assert default == msgspec.json.encode(keys[key].default).decode().removesuffix(".0")


def test_every_kind_of_chip_is_named() -> None:
    kinds = [text for _, key, _, text in rows("table | key") if key == "`kind`"]
    assert [set(re.findall(r"`(\w+)`", text)) for text in kinds] == [set(CHIPS), set(SPI_CHIPS)]


def test_the_times_are_those_of_the_arithmetic() -> None:
    found: dict[str, tuple[str, str, str]] = {}
    for names, _, _, _, _, size, slow, fast in rows("chip | addresses", DEVICES):
        found |= dict.fromkeys(names.split(", "), (size, slow, fast))
    expanders = {name: chip for name, chip in CHIPS.items() if not isinstance(chip.readings[0], Conversion)}
    assert found.keys() == expanders.keys()
    for name, chip in expanders.items():
        whole = max(chip.readings, key=lambda reading: len(reading.pins))
        fast = f"{port_us(whole, 400_000):.1f}" if chip.clock_hz >= 400_000 else ""
        assert found[name] == (str(whole.wire_bytes), f"{port_us(whole, 100_000):.1f}", fast)
    one_port = {f"{port_us(CHIPS[name].readings[0], 400_000):.1f}" for name in ("mcp23017", "pca9555")}
    times = r"one port of an MCP23017 or PCA9555 takes (\S+) µs, a selection\son a TCA9548A (\S+) µs"
    (said,) = re.findall(times, PAGE)
    assert said == (*one_port, f"{select_us(400_000):.1f}")


def test_the_error_shown_is_the_error_raised(tmp_path: Path) -> None:
    (shown,) = re.findall(r"^    (glove\.toml, line .*) \.\.\.$", PAGE, re.MULTILINE)
    path = tmp_path / "glove.toml"
    path.write_text(
        "\n" * 7 + '[[bus]]\ndevice = "d"\n[[bus.chip]]\nkind = "mcp23017"\npins.GPA7 = "s"\naddress = 32\n'
    )
    with pytest.raises(HarnessError) as caught:
        load_harness(path)
    assert str(caught.value).startswith(shown)
