import re
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.probes import Predictions, Probes
from thenar.compiler.firmware.tools import STRICT, call, workshop
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Probed = Callable[[IntegerTables, int], Probes]
SameAsPython = Callable[[Predictions, IntegerTables, Probes], None]
Tool = Callable[[str], str]


PLACES = r"""
#include <stdio.h>
#include "thenar_hand.h"

int main(void)
{
    static thenar_hand glove;

    thenar_hand_init(&glove);
    for (unsigned number = 0; number < 40; number++) {
        thenar_hand_set_switch(&glove, (thenar_hand_switch)number, true);
        for (unsigned port = 0; port < THENAR_HAND_PORTS; port++) {
            printf("%d ", glove.input.switches[port]);
        }
        puts(thenar_hand_grasp((thenar_hand_class)number));
        if (number % 2 == 1) {
            thenar_hand_set_switch(&glove, (thenar_hand_switch)number, false);
        }
    }
    puts(thenar_hand_grasp((thenar_hand_class)255));
    return 0;
}
"""


def test_switches_are_set_by_number_and_grasps_named(tool: Tool, make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables(switches=33, classes=14)
    layout = arrange(tables)
    manifest = replace(describe(tables), grasps=('say "Ü"\\n??/', *(f"grasp {k}" for k in range(1, 14))))
    files = classifier_files("hand", manifest, layout, avr=False)
    with workshop({**files, "main.c": PLACES}) as folder:
        call([tool("gcc"), *STRICT, "main.c", "thenar_hand.c", "thenar_hand_tables.c", "-o", "places"], folder)
        said = call([str(folder / "places")], folder).decode().split("\n")
    bits = np.zeros(33, bool)
    for number in range(40):
        if number < 33:
            bits[number] = True
        grasp = manifest.grasps[number] if number < 14 else ""
        assert said[number] == " ".join(map(str, layout.port_bytes(bits[np.newaxis])[0].tolist())) + " " + grasp
        if number < 33:
            bits[number] = number % 2 == 0
    assert said[40] == ""


@pytest.fixture(params=[False, True], ids=["portable", "avr"])
def texts(request: pytest.FixtureRequest, make_tables: MakeTables, describe: Describe) -> dict[str, str]:
    tables = make_tables(classes=14, switches=33, joints=2)
    odd = replace(describe(tables), grasps=("*/ #error", *(f"grasp {k} of many words" for k in range(13))))
    notes = ("3260 cycles */", "Grünes Licht")
    return classifier_files("hand", odd, arrange(tables), avr=request.param, notes=notes)


def test_lines_are_ascii_of_120_columns_without_trailing_blanks_or_runs_of_empty_lines(texts: dict[str, str]) -> None:
    for text in texts.values():
        assert text.isascii()
        assert text.endswith("\n")
        assert "\n\n\n" not in text
        assert all(len(line) <= 120 and line == line.rstrip() and "\t" not in line for line in text.split("\n"))


def test_every_row_says_what_it_is_the_row_of(texts: dict[str, str]) -> None:
    table = texts["thenar_hand_tables.c"].split("/* columns: ")[1].split("};")[0]
    for bit, name in enumerate(("s0", "s1", "s2")):
        assert f"/* {name} */\n    {{" in table, bit
    assert "/* s0 + s1 + s2 + s3 */" in table
    assert "/* all open */" in table
    assert "/* j1 above 254 */" in table
    assert table.startswith("* / #error, grasp 0 of many words")


def test_openings_name_tables_version_and_notes_and_no_word_ends_a_comment(texts: dict[str, str]) -> None:
    for name, text in texts.items():
        opening = text.split("*/")[0]
        assert opening.startswith(f"/**\n * @file {name}\n" if name == "thenar_hand.h" else f"/* {name}: ")
        if name.endswith("hand.h"):
            assert "3260 cycles * /" in opening
            assert "Gr\\xfcnes Licht" in opening
        assert re.search(r"From the tables [0-9a-f]{16}; thenar [0-9.]+, template classifier/", opening)


def test_a_build_for_avr_has_assembly_and_one_for_others_does_not_know_of_it(
    make_tables: MakeTables, describe: Describe
) -> None:
    tables = make_tables()
    plain, both = (classifier_files("a", describe(tables), arrange(tables), avr=avr) for avr in (False, True))
    names = ["thenar_a.h", "thenar_a.c", "thenar_a_tables.h", "thenar_a_tables.c"]
    assert list(plain) == names
    assert list(both) == [*names, "thenar_a_avr.S"]
    assert not any("AVR" in text or "PROGMEM" in text for text in plain.values())


def test_the_same_layout_gives_the_same_texts(make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables()
    one, two = (classifier_files("a", describe(tables), arrange(tables), avr=True) for _ in range(2))
    assert one == two


def test_tables_beyond_what_an_avr_reads_are_refused_for_it_alone(make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables(classes=300, switches=64)
    layout = arrange(tables)
    assert classifier_files("a", describe(tables), layout, avr=False)
    with pytest.raises(FirmwareError, match="an AVR reads constants from the first 65536 bytes"):
        classifier_files("a", describe(tables), layout, avr=True)
