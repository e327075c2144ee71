"""The folder for this machine, made and checked by its own Makefile."""

import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.probes import CHECKS, check_header, self_test_frames, turns
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest

from ...conftest import tool
from ...tables import describe
from .conftest import make_tables

Make = Callable[..., "subprocess.CompletedProcess[str]"]

AGREED = f"{CHECKS} frames, predicted as by Python\n"
SHAPES = {
    "switches_and_joints": {"classes": 14, "switches": 33, "joints": 16},
    "switches_only": {"joints": 0},
    "joints_only_wide_codes": {"switches": 0, "highest": 4095},
    "wide_codes_after_an_odd_byte": {"switches": 3, "highest": 4095},
    "more_than_256_classes": {"classes": 260, "reach": 3},
}


def files_for(layout: Layout, manifest: Manifest) -> dict[str, str]:
    library = Library("hand", manifest, layout)
    files = TARGETS["host"].files(library)
    assert {path: files[path] for path in library.files} == library.files
    return files


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Return what writes files into a folder and runs make there."""

    def make(files: Mapping[str, str], *arguments: str) -> "subprocess.CompletedProcess[str]":
        tool("gcc")
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        command = [tool("make"), "-s", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)

    return make


@pytest.mark.slow
@pytest.mark.parametrize("shape", list(SHAPES))
def test_a_folder_checks_itself_without_a_warning(make: Make, shape: str) -> None:
    tables = make_tables(**SHAPES[shape])
    files = files_for(Layout(tables), describe(tables))
    assert [line for text in files.values() for line in text.splitlines() if len(line) > 120] == []
    done = make(files, "CFLAGS=-O2 -Werror", "check")
    assert (done.returncode, done.stdout + done.stderr) == (0, AGREED)


def test_a_classifier_with_a_wrong_entry_fails_its_check(make: Make) -> None:
    tables = make_tables()
    files = files_for(Layout(tables), describe(tables))
    wrong = re.sub(r" START\((-?\d+), ", lambda found: f" START({int(found[1]) + 1}, ", files["thenar_hand.c"], count=1)
    assert wrong != files["thenar_hand.c"]
    done = make(files | {"thenar_hand.c": wrong}, "check")
    assert done.returncode != 0
    assert "predictions differ from Python's\n" in done.stdout + done.stderr


def test_a_wrong_switch_bit_fails_the_check(make: Make) -> None:
    tables = make_tables()
    files = files_for(Layout(tables), describe(tables))
    assert "number / 8u]" in files["thenar.c"]
    done = make(files | {"thenar.c": files["thenar.c"].replace("number / 8u]", "0u]")}, "check")
    assert done.returncode != 0
    assert "predictions differ from Python's" in done.stdout + done.stderr


@pytest.mark.parametrize("changed", ["thenar_hand.c", "thenar_hand.h", "thenar_hand_check.h"])
def test_what_a_changed_file_is_part_of_is_made_again(make: Make, changed: str) -> None:
    tables = make_tables()
    assert make(files_for(Layout(tables), describe(tables)), "check").returncode == 0
    again = make({}, "-n", "-W", changed, "check").stdout
    assert ("-c -o thenar_hand.o thenar_hand.c" in again) == (changed != "thenar_hand_check.h")
    assert "check.c" in again


def test_the_frames_are_the_extreme_ones_and_others_at_the_thresholds() -> None:
    tables = make_tables(switches=9, joints=4)
    frames = self_test_frames(Layout(tables))
    assert frames.bits.shape == (CHECKS, 9)
    assert frames.codes.shape == (CHECKS, 4)
    assert (frames.bits[0].any(), frames.bits[1].all()) == (False, True)
    assert frames.codes[:2].tolist() == [[0] * 4, [255] * 4]
    for joint in range(4):
        assert set(frames.codes[:, joint].tolist()) <= set(turns(tables, joint).tolist())
    assert len(np.unique(frames.bits, axis=0)) == CHECKS


def test_the_answers_in_the_check_are_those_of_the_build() -> None:
    tables = make_tables()
    layout = Layout(tables)
    frames, build = self_test_frames(layout), Build(describe(tables), tables)
    scores = [build.scores(bits, codes) for bits, codes in zip(frames.bits, frames.codes, strict=True)]
    text = "".join(check_header("hand", layout).split())
    for each in scores:
        assert f"}},{each.argmax()},{{{','.join(str(score) for score in each)}}}," in text
