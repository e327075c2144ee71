import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.compiler.firmware import simavr
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import Layout, Ports, arrange
from thenar.compiler.firmware.probes import Lost, Probes, joined, lost_inputs, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.host import MEMBER as HOST
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Probed = Callable[[IntegerTables, int], Probes]
SameAsPython = Callable[..., None]
Tool = Callable[[str], str]


@dataclass(frozen=True)
class Case:
    """Sizes of tables, and the ports of their switches; all codes of joint `constant` take the same row."""

    tables: dict[str, int]
    constant: int | None = None
    ports: Ports | None = None


def _without_thresholds(tables: IntegerTables, joint: int) -> IntegerTables:
    thresholds, rows = list(tables.thresholds), list(tables.joint_rows)
    thresholds[joint], rows[joint] = thresholds[joint][:0], rows[joint][:1]
    kept = tables.bias, tables.switch_rows, tuple(thresholds), tuple(rows)
    return IntegerTables(*kept, tables.switch_means, tables.joint_means, tables.scale)


def _case(constant: int | None = None, ports: Ports | None = None, **sizes: int) -> Case:
    return Case(sizes, constant, ports)


WIRED = ((-1, 8, 0, -1, 1), (2, -1, -1, -1, -1, -1, 3, 4), (5, 7, -1, 6))
# Entries have 16 bits where `reach` is 300 or more, else 8; more than 7 bins of codes of a byte are looked up.
CASES = {
    "2 classes": _case(classes=2, reach=300),
    "2 classes, bytes": _case(classes=2, bins_=9),
    "3 classes": _case(classes=3, reach=300, bins_=9),
    "5 classes, bytes": _case(classes=5),
    "5 classes, sums of bytes": _case(classes=5, reach=3, bins_=9),
    "14 classes, 33 switches, 16 joints": _case(classes=14, switches=33, joints=16, bins_=20, reach=300),
    "14 classes, bytes": _case(classes=14, switches=33, joints=16, bins_=20),
    "codes beyond both ends of the bins": _case(joints=3, lowest=40, highest=150, bins_=9, reach=300),
    "codes beyond both ends of the bins, bytes": _case(joints=3, lowest=40, highest=150, bins_=9),
    "16 classes": _case(classes=16, reach=1000),
    "17 classes, one of them in two parts": _case(classes=17, reach=1000),
    "31 classes, two of them in two parts, bytes": _case(classes=31),
    "33 classes, bytes": _case(classes=33, bins_=9),
    "40 classes, sums of bytes": _case(classes=40, reach=3),
    "33 classes": _case(classes=33, reach=300),
    "no joints": _case(joints=0, reach=300),
    "no joints, bytes": _case(joints=0),
    "no switches": _case(switches=0, bins_=9, reach=300),
    "one switch": _case(switches=1, joints=0),
    "codes of 16 bits": _case(joints=4, switches=13, highest=65535, reach=300),
    "codes of 16 bits, searched, bytes": _case(joints=4, switches=3, lowest=600, highest=854, bins_=20),
    "a constant joint": _case(constant=1),
    "a constant joint, bins": _case(constant=0, bins_=9, reach=300),
    "a constant joint alone with switches": _case(joints=1, constant=0),
    "ports of a harness": _case(ports=WIRED, reach=300),
    "ports of a harness, bytes": _case(ports=WIRED),
    "keys of a matrix, a byte without a switch": _case(ports=((8, 7, -1, 6, 5, 4, 3, -1), (-1,) * 8, (2, 0, 1))),
    "254 thresholds": _case(joints=1, bins_=255),
    "56 look-ups": _case(switches=160, joints=16, classes=4, reach=150, bins_=9),
}
NAMED = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


@pytest.fixture
def arranged(make_tables: MakeTables) -> Callable[[Case], Layout]:
    """Return what makes a case's layout; `bins_` is the number of a joint's rows, `lowest` shifts its thresholds."""

    def make(case: Case) -> Layout:
        sizes = dict(case.tables)
        bins, lowest = sizes.pop("bins_", 6), sizes.pop("lowest", 0)
        highest = sizes.pop("highest", 254)
        tables = make_tables(bins=bins, highest=highest - lowest, **sizes)
        shifted = tuple((steps + lowest).astype(np.uint16) for steps in tables.thresholds)
        kept = tables.bias, tables.switch_rows, shifted, tables.joint_rows
        tables = IntegerTables(*kept, tables.switch_means, tables.joint_means, tables.scale)
        if case.constant is not None:
            tables = _without_thresholds(tables, case.constant)
        return arrange(tables, case.ports)

    return make


@pytest.mark.slow
@NAMED
def test_portable_c_by_clang_scores_as_python_does(
    tool: Tool,
    arranged: Callable[[Case], Layout],
    describe: Describe,
    probed: Probed,
    same_as_python: SameAsPython,
    case: Case,
) -> None:
    layout, name = arranged(case), Path(tool("clang")).name
    files = classifier_files("hand", describe(layout.tables), layout, avr=False)
    frames = probed(layout.tables, 200)
    held = layout.frame_bytes(frames.bits, frames.codes)
    answers = HOST.run(files, "hand", layout, held, incremental=True, compiler=name, sanitize=True)
    same_as_python(answers, layout.tables, frames)


@NAMED
@pytest.mark.parametrize("part", ["avr328p", "avr2560"])
def test_assembly_scores_as_python_does(
    avr: None,
    arranged: Callable[[Case], Layout],
    describe: Describe,
    probed: Probed,
    same_as_python: SameAsPython,
    case: Case,
    part: str,
) -> None:
    layout = arranged(case)
    files = classifier_files("hand", describe(layout.tables), layout, avr=True)
    frames = probed(layout.tables, 40)
    held = layout.frame_bytes(frames.bits, frames.codes)
    for incremental in (False, True):
        answers = TARGETS[part].run(files, "hand", layout, held, incremental=incremental)
        same_as_python(answers, layout.tables, frames)


def _without_each(layout: Layout, frames: Probes) -> tuple[Probes, Lost]:
    """Return every frame once with nothing missing, once without each of its inputs, and thrice without several."""
    inputs, several = layout.tables.n_switches + layout.tables.n_joints, len(frames) * 3
    alone = np.vstack([np.zeros((1, inputs), bool), np.eye(inputs, dtype=bool)])
    lost = np.vstack([np.tile(alone, (len(frames), 1)), lost_inputs(layout.tables, several, 1)])
    order = np.concatenate([np.repeat(np.arange(len(frames)), len(alone)), np.arange(several) % len(frames)])
    return Probes(frames.bits[order], frames.codes[order]), lost


def _and_whole(missing: tuple[Probes, Lost], whole: Probes) -> tuple[Probes, Lost]:
    """Return all frames, nothing of the second ones being missing."""
    frames, lost = missing
    return joined(frames, whole), np.vstack([lost, np.zeros((len(whole), lost.shape[1]), bool)])


# Each case on this machine and on one part.
ON_TARGETS = [
    pytest.param(case, target, id=f"{target}-{name}")
    for number, (name, case) in enumerate(CASES.items())
    for target in ("host", ("avr328p", "avr2560")[number % 2])
]


@pytest.mark.parametrize(("case", "target"), ON_TARGETS)
def test_the_mean_stands_in_for_every_input_that_is_missing_as_in_python(
    avr: None,
    arranged: Callable[[Case], Layout],
    describe: Describe,
    probed: Probed,
    same_as_python: SameAsPython,
    case: Case,
    target: str,
) -> None:
    layout, part = arranged(case), TARGETS[target]
    missing = _without_each(layout, random_frames(layout.tables, 12, seed=2))
    frames, lost = _and_whole(missing, probed(layout.tables, 40 if part.avr else 200))
    held = layout.frame_bytes(frames.bits, frames.codes)
    files = classifier_files("hand", describe(layout.tables), layout, avr=part.avr)
    for incremental in (False, True):
        answers = part.run(files, "hand", layout, held, incremental=incremental, lost=lost)
        same_as_python(answers, layout.tables, frames, lost)


@pytest.fixture
def avr(tool: Tool) -> None:
    tool("avr-gcc")
    if simavr.missing() is not None:
        tool("libsimavr-dev")


def test_many_classes_are_added_up_in_many_parts(
    tool: Tool, make_tables: MakeTables, describe: Describe, probed: Probed, same_as_python: SameAsPython
) -> None:
    tool("gcc")
    layout = arrange(make_tables(classes=300, switches=6, joints=1))
    frames = probed(layout.tables, 50)
    held = layout.frame_bytes(frames.bits, frames.codes)
    for avr in (False, True):
        files = classifier_files("hand", describe(layout.tables), layout, avr=avr)
        text = {name: text for name, text in files.items() if not name.endswith(".S")}
        answers = HOST.run(text, "hand", layout, held, sanitize=True)
        same_as_python(answers, layout.tables, frames)


def test_tables_at_the_limit_of_16_bits_borrow_and_carry_as_they_should(
    tool: Tool, describe: Describe, same_as_python: SameAsPython
) -> None:
    # Neighbouring classes at opposite ends: whatever leaks from one lane into the other shows.
    tool("gcc")
    row = np.array([16383, -16383, -16383, 16383, 16383], np.int16)
    rows = np.stack([row, -row, row, -row])
    zero = np.zeros((0, 5), np.int16)
    tables = IntegerTables(np.full(5, -1, np.int16), rows, (), (), 0 * rows, zero, 1.0)
    bits = np.array([[b >> i & 1 for i in range(4)] for b in range(16)], bool)
    frames = Probes(bits, np.zeros((16, 0), np.uint16))
    layout = arrange(tables)
    files = classifier_files("hand", describe(tables), layout, avr=False)
    for incremental in (False, True):
        held = layout.frame_bytes(frames.bits, frames.codes)
        answers = HOST.run(files, "hand", layout, held, incremental=incremental, sanitize=True)
        same_as_python(answers, tables, frames)


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.integers(0, 1000),
    st.integers(2, 40),
    st.integers(0, 40),
    st.integers(0, 6),
    st.sampled_from([3, 20, 300]),
    st.sampled_from([6, 9]),
    st.booleans(),
)
def test_any_tables_score_as_python_does(
    tool: Tool,
    make_tables: MakeTables,
    describe: Describe,
    same_as_python: SameAsPython,
    seed: int,
    classes: int,
    switches: int,
    joints: int,
    reach: int,
    bins: int,
    incremental: bool,
) -> None:
    tool("gcc")
    sizes = {"classes": classes, "switches": switches, "joints": max(joints, int(switches == 0))}
    tables = make_tables(seed, **sizes, reach=reach, bins=bins)
    layout = arrange(tables)
    frames = random_frames(tables, 60, seed=seed)
    files = classifier_files("hand", describe(tables), layout, avr=False)
    held = layout.frame_bytes(frames.bits, frames.codes)
    same_as_python(HOST.run(files, "hand", layout, held, incremental=incremental), tables, frames)


@pytest.mark.parametrize("reach", [20, 300])
@pytest.mark.parametrize(("bins", "shift", "codes"), [(9, 40, 256), (6, 40, 256), (6, 600, 1024), (20, 600, 1024)])
def test_every_code_finds_its_row_on_both(
    avr: None,
    make_tables: MakeTables,
    describe: Describe,
    same_as_python: SameAsPython,
    bins: int,
    shift: int,
    codes: int,
    reach: int,
) -> None:
    drawn = make_tables(seed=3, switches=2, joints=2, bins=bins, highest=100, reach=reach)
    shifted = tuple((steps + shift).astype(np.uint16) for steps in drawn.thresholds)
    kept = drawn.bias, drawn.switch_rows, shifted, drawn.joint_rows
    tables = IntegerTables(*kept, drawn.switch_means, drawn.joint_means, drawn.scale)
    layout = arrange(tables)
    every = np.arange(codes, dtype=np.uint16)
    frames = Probes(np.zeros((codes, 2), bool), np.stack([every, every[::-1]], axis=1))
    held = layout.frame_bytes(frames.bits, frames.codes)
    files = [classifier_files("hand", describe(tables), layout, avr=avr) for avr in (False, True)]
    same_as_python(HOST.run(files[0], "hand", layout, held, sanitize=True), tables, frames)
    for incremental in (False, True):
        part = TARGETS["avr328p"]
        answers = part.run(files[1], "hand", layout, held, incremental=incremental)
        same_as_python(answers, tables, frames)


def _watched(call: str) -> str:
    """Return assembly that makes `call` what it is, and answers 255 where it loses a register that C keeps, or r1."""
    kept = [*range(2, 18), 28, 29]
    saved = "".join(f"    push r{n}\n" for n in kept)
    marked = "".join(f"    ldi r26, {n}\n    mov r{n}, r26\n" for n in kept)
    held = "".join(f"    ldi r25, {n}\n    cpse r{n}, r25\n    ldi r24, 255\n" for n in kept)
    restored = "".join(f"    pop r{n}\n" for n in reversed(kept))
    zero = "    ldi r25, 0\n    cpse r1, r25\n    ldi r24, 255\n    clr r1\n"
    return f"    .global {call}\n{call}:\n{saved}{marked}    call unwatched_{call}\n{held}{zero}{restored}    ret\n"


@pytest.mark.parametrize("incremental", [False, True], ids=["classify", "update"])
@pytest.mark.parametrize("classes", [2, 6, 14, 20])
@pytest.mark.parametrize("reach", [3, 20, 1500])
def test_assembly_keeps_the_registers_that_c_keeps(
    avr: None,
    make_tables: MakeTables,
    describe: Describe,
    same_as_python: SameAsPython,
    reach: int,
    classes: int,
    incremental: bool,
) -> None:
    # Scores beyond a byte, where entries have room for them: the best is in r1:r0 in the end.
    layout = arrange(make_tables(classes=classes, reach=reach))
    files = classifier_files("hand", describe(layout.tables), layout, avr=True)
    call_name = "thenar_hand_update" if incremental else "thenar_hand_classify"
    # Only as a whole word: its section keeps its name.
    unwatched = re.sub(rf"(?<![\w.]){call_name}\b", f"unwatched_{call_name}", files["thenar_hand_avr.S"])
    watched = {**files, "thenar_hand_avr.S": unwatched, "watched.S": _watched(call_name)}
    frames = random_frames(layout.tables, 20, seed=1)
    held = layout.frame_bytes(frames.bits, frames.codes)
    answers = TARGETS["avr328p"].run(watched, "hand", layout, held, incremental=incremental)
    same_as_python(answers, layout.tables, frames)
