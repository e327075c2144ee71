from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import Layout, arrange
from thenar.compiler.firmware.probes import Predictions, Probes
from thenar.compiler.firmware.targets.host import MEMBER as HOST
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Probed = Callable[[IntegerTables, int], Probes]
SameAsPython = Callable[[Predictions, IntegerTables, Probes], None]


@pytest.fixture
def files(describe: Describe) -> Callable[[Layout], dict[str, str]]:
    """Return what writes the classifier "hand" of a layout."""
    return lambda layout: classifier_files("hand", describe(layout.tables), layout, avr=False)


Files = Callable[[Layout], dict[str, str]]


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("incremental", [False, True], ids=["classify", "update"])
@pytest.mark.parametrize("entry_bits", [16, 8])
def test_every_score_and_class_is_python_s_without_a_warning_or_a_finding(
    tool: Callable[[str], str],
    make_tables: MakeTables,
    files: Files,
    probed: Probed,
    same_as_python: SameAsPython,
    entry_bits: int,
    incremental: bool,
    compiler: str,
) -> None:
    tables = make_tables(classes=14, switches=33, joints=16, reach=20 if entry_bits == 8 else 300)
    layout, frames = arrange(tables), probed(tables, 10_000)
    answers = HOST.run(
        files(layout),
        "hand",
        layout,
        layout.frame_bytes(frames.bits, frames.codes),
        incremental=incremental,
        compiler=Path(tool(compiler)).name,
        sanitize=True,
    )
    same_as_python(answers, tables, frames)
    assert (answers.cost, answers.unit, answers.stack) == (None, "", None)


SHAPES = {
    "one_switch": {"switches": 1, "joints": 0},
    "one_joint": {"switches": 0, "joints": 1},
    "two_classes": {"classes": 2},
    "more_than_256_classes": {"classes": 260, "reach": 3},
    "many_switches": {"switches": 300, "joints": 0, "reach": 5},
    "wide_codes": {"highest": 65535},
    "wide_codes_after_an_odd_byte": {"switches": 11, "highest": 4095},
    "codes_up_to_255": {"highest": 255},
}


@pytest.mark.parametrize("incremental", [False, True], ids=["classify", "update"])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_so_it_is_for_builds_of_any_shape(
    make_tables: MakeTables,
    files: Files,
    probed: Probed,
    same_as_python: SameAsPython,
    shape: str,
    incremental: bool,
) -> None:
    tables = make_tables(**SHAPES[shape])
    layout = arrange(tables)
    frames = probed(tables, 300)
    sent = layout.frame_bytes(frames.bits, frames.codes)
    same_as_python(HOST.run(files(layout), "hand", layout, sent, incremental=incremental), tables, frames)


STAND_IN = {
    "thenar_hand.h": """
#include <stdbool.h>
#include <stdint.h>
typedef uint8_t thenar_hand_class;
typedef uint8_t thenar_hand_switch;
typedef struct { uint8_t switches[2]; uint8_t codes[3]; } thenar_hand_frame;
typedef struct { int16_t scores[5]; thenar_hand_frame input; } thenar_hand;
void thenar_hand_init(thenar_hand *glove);
uint8_t thenar_hand_classify(thenar_hand *glove);
uint8_t thenar_hand_update(thenar_hand *glove);
void thenar_hand_set_switch(thenar_hand *glove, thenar_hand_switch number, bool closed);
uint16_t thenar_hand_margin(const thenar_hand *glove);
uint16_t thenar_hand_probability(const thenar_hand *glove, thenar_hand_class grasp);
const char *thenar_hand_grasp(thenar_hand_class grasp);
""",
    "thenar_hand.c": """
#include "thenar_hand.h"
void thenar_hand_init(thenar_hand *glove) { glove->scores[0] = 0; }
uint8_t thenar_hand_classify(thenar_hand *glove) { glove->scores[0]++; return 3; }
uint8_t thenar_hand_update(thenar_hand *glove) { glove->scores[1]--; return 4; }
void thenar_hand_set_switch(thenar_hand *glove, thenar_hand_switch number, bool closed)
{
    if (number == 1 && closed) glove->scores[2]++;
}
uint16_t thenar_hand_margin(const thenar_hand *glove) { return (uint16_t)(glove->scores[0] + 7); }
uint16_t thenar_hand_probability(const thenar_hand *glove, thenar_hand_class grasp)
{
    return (uint16_t)(100 * grasp - glove->scores[1]);
}
const char *thenar_hand_grasp(thenar_hand_class grasp) { return grasp == 4 ? "last" : ""; }
""",
}


def test_update_is_called_for_every_frame_and_then_switches_are_set_one_by_one(make_tables: MakeTables) -> None:
    layout, frames = arrange(make_tables()), np.full((3, 5), 2, np.uint8)
    full = HOST.run(STAND_IN, "hand", layout, frames)
    assert full.classes.tolist() == [3, 3, 3]
    assert full.scores[:, :3].tolist() == [[1, 0, 0], [2, 0, 0], [3, 0, 0]]
    assert full.names == ("", "", "", "", "last")
    assert full.margins is not None
    assert full.margins.tolist() == [8, 9, 10]
    assert full.shares is not None
    assert full.shares.tolist() == [0, 100, 200]
    updated = HOST.run(STAND_IN, "hand", layout, frames, incremental=True)
    assert updated.classes.tolist() == [4, 4, 4]
    assert updated.scores[:, :3].tolist() == [[0, -1, 1], [0, -2, 2], [0, -3, 3]]


def test_no_frames_have_no_answers(make_tables: MakeTables, files: Files) -> None:
    layout = arrange(make_tables())
    answers = HOST.run(files(layout), "hand", layout, np.zeros((0, 5), np.uint8))
    assert answers.scores.shape == (0, 5)
    assert answers.classes.shape == (0,)


OTHERS: dict[str, np.ndarray] = {
    "size": np.zeros((3, 4), np.uint8),
    "type": np.zeros((3, 5), np.int16),
    "one_frame": np.zeros(5, np.uint8),
}


@pytest.mark.parametrize("other", list(OTHERS))
def test_frames_of_another_layout_are_refused(make_tables: MakeTables, other: str) -> None:
    layout = arrange(make_tables())
    with pytest.raises(FirmwareError, match=r"this layout takes uint8 \(n, 5\)"):
        HOST.run({}, "hand", layout, OTHERS[other])


def test_a_warning_is_an_error_that_shows_it(make_tables: MakeTables, files: Files) -> None:
    layout = arrange(make_tables())
    untidy = files(layout) | {"untidy.c": "int twice(int x); int twice(int x) { int idle; return 2 * x; }\n"}
    with pytest.raises(FirmwareError, match=r"(?s)ended with 1: .*untidy\.c.*unused variable .*idle"):
        HOST.run(untidy, "hand", layout, np.zeros((1, 5), np.uint8))


def test_a_sanitizer_s_finding_is_an_error_that_shows_it(make_tables: MakeTables, files: Files) -> None:
    layout = arrange(make_tables())
    made = files(layout)
    head = "_classify(thenar_hand *glove)\n{\n"
    broken = made | {"thenar_hand.c": made["thenar_hand.c"].replace(head, head + OVERFLOW)}
    assert broken != made
    HOST.run(broken, "hand", layout, np.zeros((1, 5), np.uint8), sanitize=False)
    with pytest.raises(FirmwareError, match="signed integer overflow"):
        HOST.run(broken, "hand", layout, np.zeros((1, 5), np.uint8), sanitize=True)


OVERFLOW = "    volatile int most = 2147483647;\n    most = most + 1;\n"


def test_a_program_that_answers_too_few_frames_is_an_error(make_tables: MakeTables, files: Files) -> None:
    layout = arrange(make_tables())
    made = files(layout)
    early = {"early.c": "#include <stdlib.h>\n__attribute__((constructor)) static void leave(void) { exit(0); }\n"}
    with pytest.raises(FirmwareError, match="printed 0 names for 5 grasp types"):
        HOST.run(made | early, "hand", layout, np.zeros((2, 5), np.uint8))


def test_a_missing_compiler_is_named_with_its_package(
    make_tables: MakeTables, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    layout = arrange(make_tables())
    with pytest.raises(FirmwareError, match="gcc or clang not found; Debian: apt-get install gcc"):
        HOST.run({}, "hand", layout, np.zeros((1, 5), np.uint8))
    with pytest.raises(FirmwareError, match="clang not found; Debian: apt-get install clang"):
        HOST.run({}, "hand", layout, np.zeros((1, 5), np.uint8), compiler="clang")
