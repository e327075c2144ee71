from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.drivers.errors import ThenarError
from thenar.drivers.i2c import chips
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.i2c.chips.pcf8574 import Pcf8574
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness import checks
from thenar.runtime.harness.loading import load_harness, parse_harness
from thenar.runtime.harness.wiring import Debounce, GloveWiring, Harness, MuxChannel
from thenar.runtime.taxels import TaxelSettings

Load = Callable[[str], Harness]
BUS = '[[bus]]\ndevice = "/dev/i2c-1"\n'
CHIP = '[[bus.chip]]\nkind = "mcp23017"\naddress = 0x20\n'


def complaint(load: Load, text: str) -> str:
    with pytest.raises(HarnessError) as caught:
        load(text)
    return str(caught.value)


def test_every_table_of_the_file_arrives(load: Load, full_text: str, tmp_path: Path) -> None:
    harness = load(full_text)
    calibration = str(tmp_path / "anna.toml")
    glove = GloveWiring(port="/dev/ttyUSB0", baud=38_400, rate_hz=100.0, sensors=18, calibration=calibration)
    assert (harness.name, harness.cyberglove) == ("bench", glove)
    (stream,) = harness.streams
    assert stream.board is not None
    assert (stream.port, sorted(stream.board.wired)) == ("/dev/ttyACM0", ["s100", "s102", "s103", "s104"])
    (bus,) = harness.buses
    assert (bus.device, bus.clock_hz, len(bus.chips)) == ("/dev/i2c-1", 400_000, 3)
    assert bus.chips[0].numbered_pins == {0: "s001", 11: "s014"}
    assert (bus.chips[1].mux, bus.chips[1].closed) == (MuxChannel(address=0x70, channel=2), "high")
    assert harness.debounce == Debounce(press_lockout_ms=4.0)
    assert harness.switches == ("s001", "s014", "s020", "s021", "s030", "s100", "s102")


def test_an_empty_file_is_an_empty_glove_of_its_name(load: Load) -> None:
    assert load("") == Harness(name="glove")


def test_stored_text_is_read_with_its_calibration_path_unchanged(full_text: str) -> None:
    glove = parse_harness(full_text, "a.mcap").cyberglove
    assert glove is not None
    assert glove.calibration == "anna.toml"
    assert parse_harness('[taxels]\ncalibration = "pads.toml"', "a").taxel_settings.calibration == "pads.toml"
    with pytest.raises(HarnessError, match=r"a\.mcap, line 1: nam: this key is unknown"):
        parse_harness("nam = 1", "a.mcap")


def test_the_calibration_of_taxels_counts_from_the_folder_too(load: Load, tmp_path: Path) -> None:
    settings = load('[taxels]\ncalibration = "pads.toml"').taxel_settings
    assert settings == TaxelSettings(calibration=str(tmp_path / "pads.toml"))
    with pytest.raises(HarnessError, match="drift"):
        load("[taxels]\ndrift = 0.2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[cyberglove]\n", "line 1: cyberglove: the key port is missing"),
        ("[cyberglove]\nport = ''", "line 2: cyberglove.port: must be text of length >= 1"),
        (
            "[cyberglove]\nport = 'spy:///dev/null?file=a'",
            "line 2: cyberglove.port: 'spy:///dev/null?file=a' is not a supported port: a port is a device such as",
        ),
        (
            "[[stream]]\nport = 'socket://a:1?x'\nswitches = ['a']",
            "port: 'socket://a:1?x' is not the address of a line",
        ),
        ("[[stream]]\nport = 'loop://'", "line 2: stream[0].port: 'loop://' is not a supported port"),
        ("[[bus]]\ndevice = 'spy://a'", "line 2: bus[0].device: 'spy://a' is not the path of a device, such as"),
        ("[[bus]]\ndevice = 'a\\u001bb'".replace("'", '"'), "bus[0].device: 'a\\x1bb' is not the path of a device"),
        ("[cyberglove]\nport = 'x'\nbaud = 0", "line 3: cyberglove.baud: must be at least 1, not 0"),
        ("[cyberglove]\nport = 'x'\nrate_hz = nan", "line 3: cyberglove.rate_hz: must be a finite number"),
        (
            "[cyberglove]\nport = 'x'\njoints = ['a']",
            "line 3: cyberglove.joints: 1 names for 18 or 22 sensors: name every one, in wire order",
        ),
        (
            f"[cyberglove]\nport = 'x'\nsensors = 22\njoints = {['', 'a'] * 9}",
            "cyberglove.joints: 18 names for 22 sensors",
        ),
        (
            f"[cyberglove]\nport = 'x'\njoints = {['', 'a'] * 9}",
            "line 3: cyberglove.joints[3]: sensor 'a' is already cyberglove.joints[1]",
        ),
        ("[cyberglove]\nport = 'x'\nsensors = 20", "line 3: cyberglove.sensors: 20 is not among its values"),
        ("[[steam]]", "line 1: steam: this key is unknown (did you mean 'stream'?)"),
        ("[[stream]]\nport = 'x'", "line 1: stream[0]: must have one of the keys switches, joints and taxels"),
        (
            "[[stream]]\nport = 'x'\nswitches = ['a', 'b', 'a']",
            "line 3: stream[0].switches[2]: switch 'a' is already stream[0].switches[0]: use the name in one place",
        ),
        (
            "[[stream]]\nport = 'x'\nswitches = [' a']",
            "stream[0].switches[0]: ' a' is not a valid name of a switch: it begins",
        ),
        (
            "[cyberglove]\nport = 'x'\n[[stream]]\nport = 'x'\nswitches = ['a']",
            "line 4: stream[0].port: x is already cyberglove.port: name each device in one entry only",
        ),
        (BUS + BUS, "line 4: bus[1].device: /dev/i2c-1 is already bus[0].device"),
        (BUS + "clock_hz = 5", "line 3: bus[0].clock_hz: must be at least 1000, not 5"),
    ],
)
def test_faults_of_lines_and_buses_name_their_place(load: Load, text: str, message: str) -> None:
    assert message in complaint(load, text)


@pytest.mark.parametrize(
    ("chip", "message"),
    [
        ("kind = 'mcp23018'", "line 4: bus[0].chip[0].kind: there is no chip 'mcp23018' (did you mean 'mcp23017'"),
        (
            "kind = 'mcp23017'\naddress = 0x28",
            "line 5: bus[0].chip[0].address: a mcp23017 is at 0x20 to 0x27, not",
        ),
        (
            "pins = { GPA8 = 's' }",
            "bus[0].chip[0].pins.GPA8: a mcp23017 has no pin 'GPA8' (did you mean 'GPA6' or 'GPA5' or 'GPA4'?)",
        ),
        ("pins = { GPA7 = 's' }", "bus[0].chip[0].pins.GPA7: must not be an input: since revision D of its data sheet"),
        ("kind = 'mcp23008'\npins = { GP7 = 's' }", "bus[0].chip[0].pins.GP7: must not be an input"),
        ("pins = { GPA0 = '' }", "bus[0].chip[0].pins.GPA0: '' is not a valid name of a switch: it is empty"),
        (
            "pins = { GPA0 = 'a', GPA1 = 'a' }",
            "bus[0].chip[0].pins.GPA1: switch 'a' is already bus[0].chip[0].pins.GPA0: use the name in one place",
        ),
        ("closed = 'lo'", "bus[0].chip[0].closed: 'lo' is not among its values (did you mean 'low'"),
        ("kind = 'pcf8574'\nclosed = 'high'", "bus[0].chip[0].closed: a pcf8574 pulls its inputs up"),
        ("mux = { address = 0x78, channel = 0 }", "bus[0].chip[0].mux.address: must be at most 119, not 120"),
        ("mux = { address = 0x70, channel = 8 }", "bus[0].chip[0].mux.channel: must be at most 7, not 8"),
    ],
)
def test_what_is_wrong_with_a_chip_is_told_with_its_place(load: Load, chip: str, message: str) -> None:
    given = "" if "kind" in chip else "kind = 'mcp23017'\n"
    placed = "" if "address = " in chip.partition("mux")[0] else "address = 0x20\n"
    assert message in complaint(load, f"{BUS}[[bus.chip]]\n{given}{chip}\n{placed}")


def place(address: int, channel: int | None, mux: int = 0x70) -> str:
    behind = "" if channel is None else f"mux = {{ address = {mux}, channel = {channel} }}\n"
    return f"[[bus.chip]]\nkind = 'pca9555'\naddress = {address}\n{behind}"


@pytest.mark.parametrize(
    ("places", "clash"),
    [
        (((0x20, None), (0x20, None)), True),
        (((0x20, None), (0x21, None)), False),
        (((0x20, 1), (0x20, 1)), True),
        (((0x20, 1), (0x20, 2)), False),
        (((0x20, None), (0x20, 2)), True),
        (((0x20, 2), (0x20, None)), True),
        (((0x20, 2), (0x21, None), (0x20, 3)), False),
    ],
)
def test_two_chips_that_would_answer_together_are_refused(
    load: Load, places: tuple[tuple[int, int | None], ...], clash: bool
) -> None:
    text = BUS + "".join(place(*each) for each in places)
    if clash:
        assert "bus[0].chip[1].address: 0x20 is the address of bus[0].chip[0] too: change one" in complaint(load, text)
    else:
        load(text)


def test_a_chip_at_the_address_of_a_mux_is_refused(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    class Odd(Pcf8574):
        name = "odd"
        addresses = range(0x70, 0x71)

    kinds = {**CHIPS, "odd": Odd()}
    for module in (checks, chips):
        monkeypatch.setattr(module, "CHIPS", kinds)
    text = BUS + "[[bus.chip]]\nkind = 'odd'\naddress = 0x70\n" + place(0x20, 0)
    assert "bus[0].chip[0].address: 0x70 is also the address of a mux on this bus" in complaint(load, text)


@pytest.mark.parametrize(
    ("kind", "mux", "clock_hz", "named"),
    [
        ("pcf8574", "", 100_001, "pcf8574: at most 100000"),
        ("pcf8574", "", 100_000, ""),
        ("pca9555", "", 400_001, "pca9555: at most 400000"),
        ("mcp23017", "", 1_700_000, ""),
        ("mcp23017", "mux = { address = 0x71, channel = 0 }", 1_000_000, "TCA9548A: at most 400000"),
    ],
)
def test_a_clock_beyond_what_a_chip_is_made_for_is_refused(
    load: Load, kind: str, mux: str, clock_hz: int, named: str
) -> None:
    text = f"{BUS}clock_hz = {clock_hz}\n[[bus.chip]]\nkind = '{kind}'\naddress = 0x20\n{mux}"
    if named:
        assert f"line 3: bus[0].clock_hz: {clock_hz} Hz is too fast for the {named}" in complaint(load, text)
    else:
        load(text)


def test_a_switch_on_a_board_and_on_a_chip_is_refused(load: Load) -> None:
    text = "[[stream]]\nport = 'x'\nswitches = ['s1']\n" + BUS + CHIP + "pins.GPA0 = 's1'"
    assert "bus[0].chip[0].pins.GPA0: switch 's1' is already stream[0].switches[0]" in complaint(load, text)


@pytest.mark.parametrize(
    ("instead", "of", "message"),
    [
        ('s103 = "10"', 's103 = "A0"', "pins.s103: 10 is already stream[0].board.matrix.columns[0]: use another one"),
        ('s103 = "A1"', 's103 = "A0"', "board.pins: A1 is already stream[0].board.pins.s103: use another one"),
        ('s103 = "A1.3"', 's103 = "A0"', "pins.s104: A1.3 is already stream[0].board.pins.s103: use another one"),
        ('s104 = "A1.16"', 's104 = "A1.3"', "pins.s104: 'A1.16' is no channel of a CD74HC4067: the channels of A0"),
        ('s100 = "A1.3"', 's104 = "A1.3"', "pins.s100: A1.3 is behind a multiplexer, which is for joints and taxels"),
        ('s103 = "A0;"', 's103 = "A0"', """pins.s103: 'A0;' is no pin of a sketch: write "2", "A0" or "PA3\""""),
        ('select = ["4"]', 'select = ["4", "5", "6", "7"]', "board.select: 1 pins: a CD74HC4067 has four, S0 to S3"),
        ("", 'select = ["4", "5", "6", "7"]', "board.select: is missing: the pins at S0 to S3 of the multiplexers"),
        ('[["s100"]]', '[["s100"], [""]]', 'matrix.keys: must be 2 lists of 1 names, "" where there is no key'),
        ('[["s102"], [""]]', '[["s100"], [""]]', "chip[0].pins.GPA0: input 's102' is already stream[0].board.matrix"),
        ('[["s103"], [""]]', '[["s100"], [""]]', "keys[0][0]: the stream has no such column 's103' (did you mean"),
        ('s999 = "A0"', 's103 = "A0"', "pins.s999: the stream has no such column 's999'"),
        ('kind = "pcf8574"', 'kind = "mcp23017"', "chip[0]: a board reads chips with registers that are on its bus"),
        ('closed = "low"\ntaxels', "taxels", "board: a board names its columns and sends its clock: leave out columns"),
    ],
)
def test_what_is_wrong_with_a_board_is_told_with_its_place(
    load: Load, full_text: str, instead: str, of: str, message: str
) -> None:
    assert of in full_text
    assert message in complaint(load, full_text.replace(of, instead, 1))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match=r"nowhere\.toml: cannot be read"):
        load_harness(tmp_path / "nowhere.toml")


def test_a_harness_error_is_one_of_ours_and_a_value_error() -> None:
    assert issubclass(HarnessError, ThenarError)
    assert issubclass(HarnessError, ValueError)
