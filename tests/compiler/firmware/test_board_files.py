import re
from collections.abc import Callable, Mapping

import pytest
from msgspec.structs import replace

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.board import check_switches, parse_board
from thenar.compiler.firmware.board_files import (
    board_files,
    config_of,
    readings,
    shortest_scan_us,
    whole_folder,
)
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.targets.base import Mode
from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22
from thenar.drivers.i2c.chips import CHIPS
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Generate = Callable[..., dict[str, str]]

UNO, MEGA = 'part = "atmega328p"\n', 'part = "atmega2560"\n'
PINS = '[pins]\ns1 = "PD7"\ns0 = "PB0"\ns2 = "PC3"\n'
MATRIX = (
    '[matrix]\nrows = ["PD2", "PD3"]\ncolumns = ["PB0", "PB1", "PC2"]\ndiodes = {}\nsettle_us = 7\n'
    'switches = [["s2", "", "s0"], ["other", "s1", ""]]\n'
)
CHIPS_TOML = (
    '[[chip]]\nkind = "mcp23017"\naddress = 0x20\npins = { GPA0 = "s0", GPB6 = "s1", GPB5 = "unused" }\n'
    '[[chip]]\nkind = "tca6424a"\naddress = 0x22\nclosed = "high"\npins = { P21 = "s2" }\n'
    '[[chip]]\nkind = "pca9555"\naddress = 0x21\npins = { P00 = "unused too" }\n'
)
ANALOG = '[analog]\nj1 = "ADC1"\nj0 = "ADC7"\n'
RAW = {"code_a": 1, "code_b": 255, "unit": "raw"}


@pytest.fixture
def generate(make_tables: MakeTables, describe: Describe) -> Generate:
    """Return what makes the files of a board for a build of three switches, s0 to s2, and some joints."""

    def made(
        text: str,
        mode: Mode = "scan",
        joints: tuple[str, ...] = (),
        highest: int = 254,
        classes: int = 5,
        **coded: object,
    ) -> dict[str, str]:
        tables = make_tables(switches=3, joints=len(joints), highest=highest, classes=classes)
        manifest = describe(tables)
        named = tuple(
            replace(joint, name=name, **(RAW | coded)) for joint, name in zip(manifest.joints, joints, strict=True)
        )
        layout = arrange(tables)
        board = parse_board(text)
        files = board_files("my_hand", replace(manifest, joints=named), layout, board, mode)
        return whole_folder("my_hand", board, mode, files)

    return made


def keys_of_pins(source: str) -> dict[str, int]:
    """Return pin -> key as thenar_pins.c reads them."""
    found = re.findall(r"_BV\((P\w\d)\)\) != 0u\) \{ /\*.*?\*/\s+closed\[(\d+)\] \|= 0x(\w+)u;", source)
    return {pin: 8 * int(byte) + int(mask, 16).bit_length() - 1 for pin, byte, mask in found}


def test_a_pin_is_pulled_up_and_read_into_the_key_that_is_its_switch(generate: Generate) -> None:
    source = generate(UNO + PINS)["thenar_pins.c"]
    assert keys_of_pins(source) == {"PB0": 0, "PD7": 1, "PC3": 2}
    for port, mask in (("B", "0x01"), ("C", "0x08"), ("D", "0x80")):
        assert f"    DDR{port} &= (uint8_t)~{mask}u;\n    PORT{port} |= {mask}u;\n" in source


def test_pins_of_jtag_are_freed_and_only_for_those_who_use_them(generate: Generate) -> None:
    assert "JTD" not in generate(MEGA + PINS)["thenar_pins.c"]
    assert "    switch_jtag_off();\n" in generate(MEGA + PINS.replace("PC3", "PF4"))["thenar_pins.c"]
    assert "JTD" in generate(MEGA + PINS + '[analog]\nj0 = "ADC5"', "glove", ("j0",))["thenar_adc.c"]


@pytest.mark.parametrize("diodes", [True, False])
def test_a_matrix_lists_rows_and_columns_and_finds_ghosts_only_without_diodes(generate: Generate, diodes: bool) -> None:
    files = generate(UNO + MATRIX.format(str(diodes).lower()), "glove")
    source = files["thenar_matrix.c"]
    assert re.findall(r"\{&PORT(\w), &DDR(\w), _BV\((\w+)\)\}", source) == [("D", "D", "PD2"), ("D", "D", "PD3")]
    assert "DDRD &= (uint8_t)~0x0Cu; /* rows */\n    PORTD |= 0x0Cu;\n" in source, "pulled up while they are not read"
    columns = re.findall(r"_BV\((\w+)\)\) != 0u\) \{\s+low \|= 0x(\w+)u;", source)
    assert columns == [("PB0", "01"), ("PB1", "02"), ("PC2", "04")]
    assert "#define SETTLE_CYCLES 112u" in source
    assert ("has_ghosts" in source) is not diodes
    assert "keys_of_switches[THENAR_MY_HAND_SWITCHES] PROGMEM = {\n    2u, 4u, 0u,\n" in files["thenar_turn.c"]


@pytest.mark.parametrize(("columns", "kind"), [(8, "uint8_t"), (9, "uint16_t"), (16, "uint16_t"), (17, "uint32_t")])
def test_a_row_is_held_in_the_narrowest_type(generate: Generate, columns: int, kind: str) -> None:
    pins = [f"P{port}{bit}" for port in "ABCL" for bit in range(8)][:columns]
    names = [f"s{n}" for n in range(columns)]
    text = f'{MEGA}[matrix]\nrows = ["PF0"]\ncolumns = {pins}\ndiodes = true\nswitches = [{names}]\n'
    assert f"static {kind} read_columns(void)" in generate(text)["thenar_matrix.c"]


def test_more_columns_than_a_row_has_bits_are_refused(generate: Generate) -> None:
    pins = [f"P{port}{bit}" for port in "ABCLK" for bit in range(8)][:33]
    names = [f"s{n}" for n in range(33)]
    text = f'{MEGA}[matrix]\nrows = ["PF0"]\ncolumns = {pins}\ndiodes = true\nswitches = [{names}]\n'
    with pytest.raises(FirmwareError, match="33 columns: the firmware reads at most 32; swap rows and columns"):
        generate(text)


def expander_rows(source: str, table: str) -> list[str]:
    """Return the rows of a table of thenar_expanders.c, one line each."""
    body = source.partition(f"{table}[")[2].partition("= {\n")[2].partition("\n};")[0]
    return " ".join(re.sub(r"/\*.*?\*/", "", body, flags=re.DOTALL).split()).split("}}, {")


def test_chips_without_a_kept_switch_are_not_touched_and_the_others_set_up_as_the_driver_does(
    generate: Generate,
) -> None:
    source = generate(UNO + CHIPS_TOML)["thenar_expanders.c"]
    assert "0x21" not in source
    writes = [*CHIPS["mcp23017"].setup(frozenset({0, 13, 14})), *CHIPS["tca6424a"].setup(frozenset({17}))]
    rows = [[int(n, 16) for n in re.findall(r"0x(\w+)u", row)] for row in expander_rows(source, "writes")]
    assert rows == [[*write.data, *(write.expect or b"\0")] for write in writes]
    assert re.findall(r"\{0x(\w+)u, (\d+)u, (\d+)u\}", source) == [("20", "0", "3"), ("22", "4", "6")]


def test_each_reading_says_which_key_every_bit_is_and_at_what_level_it_is_closed(generate: Generate) -> None:
    rows = expander_rows(generate(UNO + CHIPS_TOML)["thenar_expanders.c"], "ports")
    found = {}
    for row in rows:
        numbers = [int(n, 0) for n in re.findall(r"(0x\w+|\d+)u", row)]
        (chip, command, length), rest = numbers[:3], numbers[3:]
        keys = rest[length + 1 :]
        found[chip, command] = rest[:length], rest[length], {bit: key for bit, key in enumerate(keys) if key != 0xFF}
    assert found == {(0, 0x12): ([0x80, 0x80], 0xFF, {0: 0, 14: 1}), (1, 0x02): ([0], 0, {1: 2})}


def test_a_board_without_chips_has_no_readings() -> None:
    names = ("s0", "s1", "s2")
    assert [list(port.elements) for port in readings(parse_board(UNO + CHIPS_TOML), names)] == [[0, 1], [2]]
    assert readings(parse_board(UNO + PINS), names) == ()


def test_the_clock_of_the_bus_is_never_faster_than_the_board_says(generate: Generate) -> None:
    for hz, clock, twbr in ((400_000, 16_000_000, 12), (100_000, 16_000_000, 72), (390_000, 16_000_000, 13)):
        text = f"{UNO}clock_hz = {clock}\n[bus]\nclock_hz = {hz}\n{CHIPS_TOML}"
        assert f"TWBR = {twbr}u;" in generate(text)["thenar_twi.c"]
        assert clock // (16 + 2 * twbr) <= hz


@pytest.mark.parametrize(
    ("clock_hz", "counts", "us"),
    [(16_000_000, 40_000, 32_768), (20_000_000, 50_000, 26_214), (1_000_000, 2500, 524_288)],
)
def test_the_timer_counts_20_ms_in_whole_counts(generate: Generate, clock_hz: int, counts: int, us: int) -> None:
    baud = {20_000_000: 250_000, 1_000_000: 62_500}.get(clock_hz, 1_000_000)
    source = generate(f"{UNO}clock_hz = {clock_hz}\nbaud = {baud}\n{PINS}")["thenar_clock.c"]
    assert f"#define COUNTS {counts}u " in source
    assert f"UINT32_C({us})" in source
    assert ((counts - 1) * us) >> 16 < 20_000, "the time within a period is less than the period"


@pytest.mark.parametrize(("sensors", "names"), [(18, SENSORS_18), (22, SENSORS_22)])
def test_a_joint_is_taken_from_its_sensors_place_in_the_record(
    generate: Generate, sensors: int, names: tuple[str, ...]
) -> None:
    chosen = (names[-1], names[0], names[7])
    source = generate(f"{MEGA}[pins]\ns0='PC0'\ns1='PC1'\ns2='PC2'\n[cyberglove]\nsensors={sensors}", "glove", chosen)
    places = re.search(r"places\[JOINTS\] PROGMEM = \{ (.*?)u \}", source["thenar_cyberglove.c"])
    assert places is not None
    assert [int(place) for place in places[1].split("u, ")] == [sensors, 1, 8]
    assert f"#define SENSORS {sensors}u" in source["thenar_cyberglove.c"]
    assert "{'T', 0x00u, 0x00u, 0x00u, 0x00u}" in source["thenar_cyberglove.c"]


def test_the_box_is_told_its_rate_and_records_count_for_two_periods(generate: Generate) -> None:
    text = f"{MEGA}[pins]\ns0='PC0'\ns1='PC1'\ns2='PC2'\n[cyberglove]\nrate_hz = 50.0\n"
    source = generate(text, "glove", ("palm_arch",))["thenar_cyberglove.c"]
    assert "{'T', 0x09u, 0x00u, 0x00u, 0x01u}" in source, "2304 / 115200 s"
    assert "#define LOST_US UINT32_C(40000)" in source


def test_analog_joints_are_converted_in_the_builds_order(generate: Generate) -> None:
    source = generate(UNO + PINS.replace("PC3", "PC4") + ANALOG, "glove", ("j0", "j1"))["thenar_adc.c"]
    assert "channels[JOINTS] = { 7u, 1u };" in source
    assert "DIDR0 = 0x02u;" in source, "ADC7 of an ATmega328P has no digital input"
    assert "_BV(ADIE) | 7u;" in source, "16 MHz / 2^7 = 125 kHz"
    wide = generate(MEGA + PINS + '[analog]\nj0 = "ADC15"\nj1 = "ADC0"', "glove", ("j0", "j1"))["thenar_adc.c"]
    assert "DIDR0 = 0x01u;" in wide
    assert "DIDR2 = 0x80u;" in wide
    assert "MUX5" in wide


@pytest.mark.parametrize(
    ("text", "joints", "more", "message"),
    [
        (UNO + PINS, ("j0",), {}, "needs 1 joints, but the board measures none: add"),
        (UNO + PINS + ANALOG, ("j0", "j7"), {}, "no channel for j7, which the build needs"),
        (UNO + PINS + ANALOG, ("j0",), {"highest": 300}, "codes above 254"),
        (UNO + PINS, (), {"classes": 256}, "256 grasp types: a board can report 255"),
        (MEGA + PINS + "[cyberglove]", ("palm",), {}, "no sensor of that name (did you mean 'palm_arch'"),
        (MEGA + PINS + "[cyberglove]", ("palm_arch",), {"code_a": 0, "unit": "deg"}, "coded in 'deg', not in a Cyber"),
    ],
)
def test_a_glove_that_cannot_be_is_refused(
    generate: Generate, text: str, joints: tuple[str, ...], more: Mapping[str, object], message: str
) -> None:
    with pytest.raises(FirmwareError, match=re.escape(message)):
        generate(text, "glove", joints, **more)


def test_a_board_that_only_scans_needs_no_joints(generate: Generate) -> None:
    files = generate(UNO + PINS, "scan", ("j0", "j1"))
    assert not {"thenar_joints.h", "thenar_adc.c", "thenar_cyberglove.c"} & set(files)
    assert "my_hand" not in files["thenar_turn.c"]


def test_a_board_that_lacks_a_kept_switch_is_refused(generate: Generate) -> None:
    with pytest.raises(FirmwareError, match="no pin or column for s2, which the build keeps"):
        generate(UNO + PINS.replace("s2", "s5"))


def test_nobody_can_ask_for_more_scans_than_the_board_makes(make_tables: MakeTables) -> None:
    """The wire alone sets a bound from below: 48 and 39 SCL periods at 400 kHz."""
    names, tables = ("s0", "s1", "s2"), make_tables(switches=3, joints=3, classes=14)
    board = parse_board(UNO + CHIPS_TOML)
    config = config_of(board, names, tables)
    assert (48 + 39) / 0.4 < config.fastest_us < 3 * (48 + 39) / 0.4
    assert config.fastest_us < shortest_scan_us(board, names, tables, recognises=True)
    assert (config.rows, config.columns, config.diodes) == (1, 3, True)
    matrix = config_of(parse_board(UNO + MATRIX.format("false")), names, tables)
    assert (matrix.rows, matrix.columns, matrix.diodes) == (2, 3, False)
    with pytest.raises(FirmwareError, match="scan_us of the board is 200"):
        config_of(parse_board(UNO + "scan_us = 200\n" + CHIPS_TOML), names, tables)


def test_the_same_board_gives_the_same_files_and_no_line_is_too_long(generate: Generate) -> None:
    for text in (PINS, MATRIX.format("true"), CHIPS_TOML):
        files = generate(UNO + "scan_us = 3000\n" + text, "glove")
        assert files == generate(UNO + "scan_us = 3000\n" + text, "glove")
        for name, content in files.items():
            assert max(map(len, content.splitlines())) <= 120, name
            assert content.endswith("\n"), name
            assert not content.endswith("\n\n"), name
            assert "\n\n\n" not in content, name


def test_names_that_are_long_or_end_comments_do_no_harm(make_tables: MakeTables, describe: Describe) -> None:
    names = ("*/ int main(void) /*", "x" * 200, "\u00fcber")
    tables = make_tables(switches=3, joints=0)
    described = describe(tables)
    switches = tuple(replace(switch, name=name) for switch, name in zip(described.switches, names, strict=True))
    a, b, c = (f'"{name}"' for name in names)
    for wired, file in (
        (f'[pins]\n{a} = "PD2"\n{b} = "PD3"\n{c} = "PD4"\n', "thenar_pins.c"),
        (CHIPS_TOML.replace('"s0"', a).replace('"s1"', b).replace('"s2"', c), "thenar_expanders.c"),
        (MATRIX.format("true").replace('"s0"', a).replace('"s1"', b).replace('"s2"', c), "thenar_matrix.c"),
    ):
        manifest = replace(described, switches=switches)
        source = board_files("b", manifest, arrange(tables), parse_board(UNO + wired), "scan")[file]
        assert "int main" in source
        assert "*/ int main" not in source
        assert source.isascii()
        assert max(map(len, source.splitlines())) <= 120


@pytest.mark.parametrize(
    ("part", "programmer"), [("atmega328p", "-p m328p -c arduino"), ("atmega2560", "-p m2560 -c wiring")]
)
def test_the_makefile_flashes_by_the_boot_loader_of_the_part(generate: Generate, part: str, programmer: str) -> None:
    makefile = generate(f'part = "{part}"\n{PINS}')["Makefile"]
    assert f"avrdude {programmer} -P $(PORT) -b $(FLASH_BAUD) -D -U flash:w:$<:i" in makefile
    assert "\nFLASH_BAUD = 115200\n" in makefile
    assert f"MCU = {part}\n" in makefile
    assert "thenar_my_hand_scan.hex: thenar_my_hand_scan.elf" in makefile


@pytest.mark.parametrize(("uart", "pin"), [(0, "PE0"), (1, "PD2"), (2, "PH0"), (3, "PJ0")])
def test_a_line_that_nobody_drives_rests_high(generate: Generate, uart: int, pin: str) -> None:
    glove = f"{MEGA}[pins]\ns0='PC0'\ns1='PC1'\ns2='PC2'\n[cyberglove]\nuart={max(uart, 1)}"
    begin = generate(glove, "glove", ("palm_arch",))[f"thenar_uart{uart}.c"].partition("_begin(void)\n{\n")[2]
    assert begin.startswith(f"    PORT{pin[1]} |= _BV({pin});")


@pytest.mark.parametrize("main", ["thenar_cyberglove.c", "thenar_turn.c"])
def test_bytes_that_never_end_are_taken_some_at_a_time(generate: Generate, main: str) -> None:
    glove = f"{MEGA}[pins]\ns0='PC0'\ns1='PC1'\ns2='PC2'\n[cyberglove]\n"
    source = generate(glove, "glove", ("palm_arch",))[main]
    assert re.search(r"\(taken < BYTES_A_TURN\) && thenar_\w+_receive", source)
    assert not re.search(r"while \(thenar_\w+_receive", source)


def test_the_makefile_compiles_what_thenar_wrote_and_nothing_else_that_lies_there(generate: Generate) -> None:
    files = generate(UNO + PINS)
    text = files["Makefile"].replace("\\\n", " ")
    objects, headers = (
        re.findall(rf"^{what} = (.*)$", text, re.MULTILINE)[0].split() for what in ("OBJECTS", "HEADERS")
    )
    assert objects == sorted(f"{name[:-2]}.o" for name in files if name.endswith(".c"))
    assert headers == sorted(name for name in files if name.endswith(".h"))
    assert "wildcard" not in text


def test_a_new_compilers_warning_does_not_stop_the_makefile(generate: Generate) -> None:
    makefile = generate(UNO + PINS)["Makefile"]
    assert "Werror" not in makefile
    assert "\nCFLAGS ?= " in makefile
    assert "\nSTRICT = -std=c99 -Wall -Wextra -Wconversion -pedantic\n" in makefile


def test_a_build_without_switches_is_told_how_to_get_some() -> None:
    with pytest.raises(FirmwareError, match=r"nothing to scan: compile it with --inputs both or --inputs switches$"):
        check_switches(parse_board(UNO + PINS), ())
