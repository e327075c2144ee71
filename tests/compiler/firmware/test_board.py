import re
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import fields

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.board import (
    Board,
    GloveUart,
    TaxelInputs,
    check_switches,
    glove_toml,
    key_names,
    keys_of,
    load_board,
    parse_board,
    rows_and_columns,
)
from thenar.compiler.firmware.targets.avr import AVRS, best_setting
from thenar.drivers.errors import ThenarError
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Manifest, Switch, Threshold
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]

UNO = 'part = "atmega328p"\n'
MEGA = 'part = "atmega2560"\n'
PINS = '[pins]\na = "PD2"\nb = "PD3"\n'
MATRIX = (
    '[matrix]\nrows = ["PD2", "PD3"]\ncolumns = ["PB0", "PB1"]\ndiodes = true\nswitches = [["a", "b"], ["", "c"]]\n'
)
CHIP = '[[chip]]\nkind = "mcp23017"\naddress = 0x20\npins = { GPA0 = "a" }\n'


PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "wire-a-board.md"


def complaint(text: str) -> str:
    with pytest.raises(FirmwareError) as caught:
        parse_board(text)
    return str(caught.value)


def test_every_table_of_the_file_arrives(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    file.write_text(
        f"{MEGA}clock_hz = 8_000_000\nbaud = 500_000\nboard = 7\nscan_us = 2000\nstate_us = 4000\nheartbeat_us = 0\n"
        "[debounce]\npress_us = 5000\nrelease_us = 10_000\n[bus]\nclock_hz = 100_000\n"
        f"{CHIP}[cyberglove]\nuart = 2\nbaud = 38_400\nsensors = 22\nrate_hz = 50.0\njoints = {['j'] + [''] * 21}\n"
    )
    board = load_board(file)
    assert (board.part, board.clock_hz, board.baud, board.board) == ("atmega2560", 8_000_000, 500_000, 7)
    assert (board.scan_us, board.state_us, board.heartbeat_us) == (2000, 4000, 0)
    assert (board.debounce.press_us, board.debounce.release_us, board.bus.clock_hz) == (5000, 10_000, 100_000)
    assert [(chip.kind, chip.address, chip.pins) for chip in board.chips] == [("mcp23017", 0x20, {"GPA0": "a"})]
    assert board.cyberglove is not None
    assert (board.cyberglove.uart, board.cyberglove.baud, board.cyberglove.sensors) == (2, 38_400, 22)


def test_what_is_left_out_has_its_default_and_debouncing_is_off() -> None:
    board = parse_board(UNO + PINS)
    assert board == Board(part="atmega328p", pins={"a": "PD2", "b": "PD3"})
    assert (board.clock_hz, board.baud, board.scan_us, board.heartbeat_us) == (16_000_000, 1_000_000, 1000, 50_000)
    assert (board.debounce.press_us, board.debounce.release_us, board.state_us) == (0, 0, 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PINS, "line 1: the key part is missing"),
        ('part = "atmega32"\n' + PINS, "line 1: part: 'atmega32' is not one of its values"),
        (UNO, "line 1: no switch is wired: add [pins], [matrix] or [[chip]] tables"),
        (UNO + "scan_ms = 1\n" + PINS, "line 2: scan_ms: times are in microseconds: scan_us"),
        (UNO + PINS + CHIP, "line 5: chip: pins is given too"),
        (UNO + '[pins]\na = "PD2"\nb = "PD2"', "line 4: pins.b: PD2 is already the pin of pins.a: use another pin"),
        (UNO + '[pins]\na = "PE2"', "line 3: pins.a: an atmega328p has no usable pin 'PE2'"),
        (UNO + '[pins]\na = "PB6"', "an atmega328p has no usable pin 'PB6'"),
        (UNO + '[pins]\na = "PC6"', "an atmega328p has no usable pin 'PC6'"),
        (UNO + '[pins]\na = "PD1"', "pins.a: PD1 is already a pin of UART 0 (the host's)"),
        (MEGA + '[pins]\na = "PD3"\n[cyberglove]', "pins.a: PD3 is already a pin of UART 1 (the glove's)"),
        (UNO + '[pins]\n" a" = "PD3"', "' a' is not a valid switch name: it begins or ends with a blank"),
        (UNO + PINS + '[analog]\n"j\\u202e" = "ADC0"', "not a valid joint name: it holds a control character (U+202E)"),
        (MEGA + '[pins]\na = "PC2"\n[cyberglove]\njoints = ["\\u001b"]', "1 names for 18 sensors"),
        (UNO + '[pins]\na = "PC0"\n[analog]\nj = "ADC0"', "analog.j: PC0 is already the pin of pins.a"),
        (UNO + PINS + '[analog]\nj = "ADC8"', "an atmega328p has no channel 'ADC8'"),
        (UNO + PINS + '[analog]\nj = "ADC0"\nk = "ADC0"', "line 7: analog.k: ADC0 is already used by j"),
        (UNO + PINS + "[cyberglove]", "cyberglove: an atmega328p has one UART, which the host uses"),
        (MEGA + '[pins]\na = "PC2"\n[cyberglove]\nuart = 0', "cyberglove.uart: UART 0 is the host's: use 1, 2 or 3"),
        (MEGA + '[pins]\na = "PC2"\n[cyberglove]\njoints = ["j"]', "1 names for 18 sensors"),
        (MEGA + '[pins]\na = "PC2"\n[analog]\nj = "ADC0"\n[cyberglove]', "[cyberglove] is given too"),
        (UNO + MATRIX.replace(', ["", "c"]', ""), "matrix.switches: 1 lists for 2 rows"),
        (UNO + MATRIX.replace('"", "c"', '"c"'), 'matrix.switches[1]: 1 names for 2 columns: write ""'),
        (UNO + MATRIX.replace('"c"', '"a"'), "switch 'a' is already at matrix.switches[0][0]"),
        (UNO + MATRIX.replace("PB1", "PD2"), "matrix.columns[1]: PD2 is already the pin of matrix.rows[0]"),
        (UNO + MATRIX.replace("diodes = true\n", ""), "matrix: the key diodes is missing"),
        (UNO + CHIP.replace("GPA0", "GPA7"), "chip[0].pins.GPA7: must not be an input"),
        (UNO + CHIP.replace("0x20", "0x30"), "chip[0].address: a mcp23017 is at 0x20 to 0x27"),
        (UNO + CHIP + CHIP.replace('"a"', '"b"'), "chip[1].address: 0x20 is the address of chip[0] too"),
        (UNO + CHIP + CHIP.replace("0x20", "0x21"), "switch 'a' is already chip[0].pins.GPA0"),
        (UNO + CHIP.replace("mcp23017", "pcf8574"), "the firmware cannot read a pcf8574: it reads mcp23017"),
        (UNO + CHIP + "mux = { address = 0x70, channel = 0 }", "chip[0].mux: the firmware cannot select multiplexer"),
        (UNO + "clock_hz = 1_000_000\nbaud = 62_500\n" + CHIP, "bus.clock_hz: must be at most a 16th"),
        (UNO + "baud = 921_600\n" + PINS, "baud: a UART at 16000000 Hz cannot make 921600 baud within 2.5%"),
        (UNO + "clock_hz = 16_000_001\n" + PINS, "clock_hz: must be a multiple of 400"),
        (MEGA + "clock_hz = 20_000_000\n" + PINS, "an atmega2560 runs at 16000000 Hz at most"),
        (UNO + "state_us = 500\n" + PINS, "state_us: must be 0 (none) or at least scan_us, 1000"),
    ],
)
def test_what_is_wrong_is_told_with_its_place_and_what_to_do(text: str, message: str) -> None:
    assert message in complaint(text)


@pytest.mark.parametrize("name", AVRS)
def test_no_pin_of_a_part_is_wasted_or_there_twice(name: str) -> None:
    part = AVRS[name]
    assert len(set(part.pins)) == len(part.pins)
    special = {pin for pins in (*part.uarts, part.twi, part.jtag) for pin in pins} | set(part.analog.values()) - {""}
    assert special <= set(part.pins)


@pytest.mark.parametrize(
    ("baud", "clock_hz", "ubrr", "double", "error"),
    [
        (9600, 16_000_000, 103, False, 0.002),
        (57_600, 16_000_000, 34, True, -0.008),
        (115_200, 16_000_000, 16, True, 0.021),
        (1_000_000, 16_000_000, 0, False, 0.0),
        (115_200, 14_745_600, 7, False, 0.0),
        (38_400, 8_000_000, 12, False, 0.002),
    ],
)
def test_baud_settings_are_those_of_the_data_sheet(
    baud: int, clock_hz: int, ubrr: int, double: bool, error: float
) -> None:
    """ATmega328P data sheet, "Examples of Baud Rate Setting"."""
    setting = best_setting(baud, clock_hz)
    assert setting is not None
    assert (setting.ubrr, setting.double, round(setting.error, 3)) == (ubrr, double, error)


def test_with_pins_and_chips_key_k_is_the_builds_switch_k() -> None:
    for text in (UNO + PINS, UNO + CHIP.replace('GPA0 = "a"', 'GPA0 = "a", GPA1 = "b"')):
        board = parse_board(text)
        assert key_names(board, ["b", "a"]) == ("b", "a")
        assert rows_and_columns(board, ["b", "a"]) == (1, 2)


def test_in_a_matrix_keys_count_row_by_row_whatever_the_build_keeps() -> None:
    board = parse_board(UNO + MATRIX)
    assert key_names(board, ["c"]) == ("a", "b", "", "c")
    assert rows_and_columns(board, ["c"]) == (2, 2)


def test_a_switch_that_the_build_keeps_must_be_wired() -> None:
    board = parse_board(UNO + PINS)
    check_switches(board, ["a"])
    with pytest.raises(FirmwareError, match=r"no pin or column for x, y, which the build keeps: add what is missing"):
        check_switches(board, ["a", "x", "y"])
    with pytest.raises(FirmwareError, match="keeps no switch"):
        check_switches(board, [])


@pytest.mark.parametrize("debounced", [False, True])
def test_the_hosts_file_names_the_keys_and_debounces_what_the_board_does_not(
    debounced: bool, make_tables: MakeTables, describe: Describe
) -> None:
    text = UNO + "baud = 500_000\n" + ("[debounce]\npress_us = 5000\n" * debounced) + MATRIX
    manifest = describe(make_tables(switches=0))
    with pytest.raises(ThenarError, match="keeps no switch"):
        glove_toml("hand", parse_board(text), manifest)
    manifest = describe(make_tables(switches=3))
    board = parse_board(text.replace('"a"', '"s0"').replace('"b"', '"s1"').replace('"c"', '"s2"'))
    harness = parse_harness(glove_toml("hand", board, manifest, "/dev/ttyUSB3"), "glove.toml")
    (line,) = harness.scanners
    assert (harness.name, line.port, line.baud) == ("hand", "/dev/ttyUSB3", 500_000)
    assert line.switches == ("s0", "s1", "", "s2")
    assert harness.debounce.enabled is not debounced


def test_every_example_of_the_page_is_a_sound_board() -> None:
    blocks = re.findall(r"^```toml\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) == 7
    assert all(parse_board(block).wired for block in blocks)


def test_the_error_on_the_page_is_what_is_said() -> None:
    page = PAGE.read_text()
    example = re.search(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert example is not None
    assert f"    {complaint(example[1].replace('PD3', 'PD2'))}\n" in page


@pytest.mark.parametrize(
    ("struct", "heading"), [(Board, "## The board"), (GloveUart, "### CyberGlove"), (TaxelInputs, "## Taxels")]
)
def test_every_key_is_on_the_page_with_its_default(struct: type[Board | GloveUart | TaxelInputs], heading: str) -> None:
    page = PAGE.read_text()
    table = page.partition(heading)[2].partition("\n#")[0]
    for key in fields(struct):
        row = re.search(rf"^\| `{key.encode_name}` \| (\w*) ?\|", table, re.MULTILINE)
        assert row is not None or f"[{key.encode_name}]" in page, key.encode_name
        if row is not None and isinstance(key.default, int):
            assert row[1] == str(key.default).lower()


TAXELS = '[taxels]\ninputs = ["ADC0", "ADC6"]\nselect = ["PB0", "PB1", "PB2", "PB3"]\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TAXELS.replace(', "PB3"', "") + 'names = ["p"]', "3 pins: a CD74HC4067 has 4 select pins, S0 to S3"),
        (TAXELS + f"names = {['p'] + [''] * 32}", "33 names for 32 channels"),
        ('[taxels]\ninputs = ["ADC0"]\nnames = ["p", "q"]', "2 names for 1 channels"),
        (TAXELS.replace("ADC6", "ADC9") + 'names = ["p"]', "has no channel 'ADC9'"),
        (TAXELS.replace("ADC6", "ADC0") + 'names = ["p"]', "already taxels.inputs[0]: give each input its own channel"),
        ('[analog]\nj = "ADC6"\n' + TAXELS + 'names = ["p"]', "ADC6 is already analog.j"),
        (PINS + TAXELS + 'names = ["a"]', "switch 'a' is already at pins.a"),
        ('[pins]\na = "PB0"\n' + TAXELS + 'names = ["p"]', "PB0 is"),
        ('[pins]\na = "PC0"\n' + TAXELS + 'names = ["p"]', "PC0 is"),
        (MATRIX.replace("PD2", "PB4") + TAXELS.replace("PB0", "PC1") + 'names = ["p"]', "port B drives a row"),
    ],
)
def test_taxels_that_cannot_be_wired_so_are_refused(text: str, said: str) -> None:
    assert said in complaint(UNO + text)


def test_levels_of_taxels_are_no_keys_and_the_host_is_told_of_the_channels(
    describe: Describe, make_tables: MakeTables
) -> None:
    taxel = Calibration(9, "p", "counts", 0, 0.0, 1, 1.0)
    manifest = describe(make_tables(switches=3))
    switches = (
        Switch(0, "a", 0.0),
        Switch(9, "p>5", 0.0, Threshold(5, 5.5, taxel)),
        Switch(1, "b", 0.0),
    )
    manifest = msgspec.structs.replace(manifest, switches=switches)
    board = parse_board(UNO + PINS + TAXELS + 'names = ["", "p"]\n')
    assert keys_of(board, switches) == ("a", "b")
    (scanner,) = parse_harness(glove_toml("hand", board, manifest), "glove.toml").scanners
    assert (scanner.switches, scanner.taxels, scanner.mux) == (("a", "b"), ("", "p"), "cd74hc4067")
    # A comparator's pin may stand for a level: then the board knows nothing of the taxel.
    assert keys_of(parse_board(UNO + PINS), switches) == ("a", "p>5", "b")
