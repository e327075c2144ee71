import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact import verify_firmware as verify_firmware_module
from thenar.compiler.artifact.verify import verify
from thenar.compiler.artifact.verify_firmware import FirmwareTrial, verify_firmware
from thenar.compiler.firmware import FirmwareError, classifier
from thenar.compiler.firmware.classifier import Library, segment_files
from thenar.compiler.firmware.costs import fit_for
from thenar.compiler.firmware.probes import Probes, extreme_frames, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.words import string
from thenar.runtime.build import Build
from thenar.runtime.segmenting.model import SegmentModel

from ...conftest import tool

TOOLS: dict[str, tuple[str, ...]] = {
    "host": ("gcc",),
    "avr": ("avr-gcc", "make", "gcc"),
}
PARTS = {"host": ["host"], "avr": ["atmega328p"]}
EACH = pytest.mark.parametrize("kind", ["host", pytest.param("avr", marks=pytest.mark.slow)])


@pytest.fixture(scope="module")
def build(grasp_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(grasp_set, tmp_path_factory.mktemp("builds") / "build", rounds=10, folds=0).folder


@pytest.mark.parametrize("kind", ["host", "avr"])
def test_every_score_and_type_of_every_frame_is_pythons(build: Path, grasp_set: GraspSet, kind: str) -> None:
    for name in TOOLS[kind]:
        tool(name)
    found = verify_firmware(build, grasp_set, (kind,))
    assert found.holds
    assert [check.part for check in found.checks[::2]] == PARTS[kind]
    assert [check.missing for check in found.checks[:2]] == [False, True]
    assert (found.rows, found.random) == (96, 10_000)
    for check in found.checks:
        assert (check.frames, check.differing, check.first) == (96 + found.extreme + 10_000, 0, None)
        assert (check.worst is None) == (kind == "host" or (kind == "avr" and check.missing))
        assert check.misnamed == (None if kind == "avr" else 0)
        assert check.shares == (kind != "avr" or check.missing)
    assert found.outdated == ()


@pytest.fixture
def few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows, extreme frames and 400 random ones, each missing inputs too, show all that is wrong below."""
    monkeypatch.setattr(verify_firmware_module, "RANDOM_FRAMES", 400)


def changed(monkeypatch: pytest.MonkeyPatch, path: str, change: Callable[[str], str]) -> None:
    """Let every library have a changed file."""
    files: Callable[[Library], dict[str, str]] = vars(Library)["files"].func

    def made(library: Library) -> dict[str, str]:
        right = files(library)
        wrong = change(right[path])
        assert wrong != right[path]
        return right | {path: wrong}

    monkeypatch.setattr(Library, "files", property(made))


@pytest.mark.usefixtures("few_frames")
def test_one_wrong_entry_is_found_with_the_first_frame_that_shows_it(
    build: Path, grasp_set: GraspSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool("gcc")

    def one_off(text: str) -> str:
        last = list(re.finditer(r"PAIR\((-?[1-9]\d*), ", text))[-1]
        return f"{text[: last.start()]}PAIR({int(last[1]) + 1}, {text[last.end() :]}"

    changed(monkeypatch, "thenar_glove.c", one_off)
    some = grasp_set.rows(np.flatnonzero(grasp_set.codes[:, -1] <= 100)[:2])
    found = verify_firmware(build, some, ("host",))
    assert not found.holds
    check = found.checks[0]
    assert 0 < check.differing < check.frames
    assert check.first is not None
    kind, number = check.first.frame.rsplit(" ", 1)
    assert kind == "extreme frame"
    assert tuple(extreme_frames(Build.load(build).tables).codes[int(number)].tolist()) == check.first.codes
    off = [there - here for here, there in zip(check.first.scores, check.first.compiled_scores, strict=True)]
    assert sorted(off) == [0] * (len(off) - 1) + [1]
    loaded = Build.load(build)
    bits = [switch.name in check.first.closed for switch in loaded.manifest.switches]
    assert loaded.scores(bits, check.first.codes).tolist() == list(check.first.scores)
    assert loaded.grasps[int(loaded.scores(bits, check.first.codes).argmax())] == check.first.grasp


@pytest.mark.usefixtures("few_frames")
@EACH
def test_a_frame_that_the_compiled_code_does_not_refuse_is_found(
    build: Path, grasp_set: GraspSet, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """On an AVR where inputs are missing: there the answers are those of decide()."""
    for name in TOOLS[kind]:
        tool(name)
    assert Build.load(build).scorer.rejector is not None
    changed(monkeypatch, "thenar.c", lambda text: text.replace("return outside > ", "return outside > 999u + "))
    found = verify_firmware(build, grasp_set, (kind,))
    wrong = [check.missing for check in found.checks if check.differing]
    assert wrong
    assert all(wrong) or kind == "host"


@pytest.mark.usefixtures("few_frames")
@EACH
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("(uint16_t)best - (uint16_t)second)", "(uint16_t)best - (uint16_t)second + 1u)"),
        ("one * 65535u", "one * 65534u"),
    ],
    ids=["margin", "probability"],
)
def test_a_margin_or_a_probability_that_is_off_is_found(
    build: Path, grasp_set: GraspSet, monkeypatch: pytest.MonkeyPatch, kind: str, right: str, wrong: str
) -> None:
    for name in TOOLS[kind]:
        tool(name)
    changed(monkeypatch, "thenar.c", lambda text: text.replace(right, wrong))
    found = verify_firmware(build, grasp_set, (kind,))
    assert [bool(check.differing) for check in found.checks] == [check.shares for check in found.checks]
    first = found.checks[-1].first
    assert first is not None
    assert (first.scores, first.grasp) == (first.compiled_scores, first.compiled_grasp)
    assert [*first.said] != [*first.compiled_said]


@pytest.mark.parametrize("wrong", [False, True], ids=["right", "wrong"])
def test_a_state_of_a_segment_that_is_off_is_found(build: Path, monkeypatch: pytest.MonkeyPatch, wrong: bool) -> None:
    tool("gcc")
    loaded = Build.load(build)
    tables = loaded.tables
    usual = SegmentModel.usual(tables.n_classes, False, tables.scale)
    costs = structs.replace(usual, least=(2,) * (tables.n_classes + 1), enter=(20,) * tables.n_classes)
    named = Build(structs.replace(loaded.manifest, segments=costs), tables)

    def off(*arguments: Any, **options: Any) -> dict[str, str]:
        files = segment_files(*arguments, **options)
        text = files["thenar_segments.c"]
        assert text.count("ahead < gap") == 1
        return files | {"thenar_segments.c": text.replace("ahead < gap", "ahead >= gap")}

    if wrong:
        monkeypatch.setattr(classifier, "segment_files", off)
    held = random_frames(tables, 120, 3)
    rows = Probes(held.bits.repeat(9, axis=0), held.codes.repeat(9, axis=0))
    trial = FirmwareTrial(named, rows, extreme_frames(tables), random_frames(tables, 50, 1))
    for missing in (False, True):
        found = trial.check(fit_for(TARGETS["host"], tables), missing=missing)
        assert found.states
        assert bool(found.differing) == wrong
        if found.first is not None:
            assert found.first.said[:2] == found.first.compiled_said[:2]
            assert found.first.said[2] != found.first.compiled_said[2]


@pytest.mark.usefixtures("few_frames")
def test_names_that_are_mixed_up_are_found(build: Path, grasp_set: GraspSet, monkeypatch: pytest.MonkeyPatch) -> None:
    tool("gcc")
    one, two = (string(f"{grasp}\0") for grasp in Build.load(build).grasps[:2])
    changed(monkeypatch, "thenar_glove.c", lambda text: text.replace(one, "?").replace(two, one).replace("?", two))
    found = verify_firmware(build, grasp_set.rows(np.arange(2)), ("host",))
    assert not found.holds
    assert [(check.differing, check.misnamed) for check in found.checks[:2]] == [(0, 2), (0, 2)]


@pytest.mark.usefixtures("few_frames")
def test_what_does_not_hold_of_firmware_does_not_hold_of_the_build(
    build: Path, grasp_set: GraspSet, tmp_path: Path
) -> None:
    tool("gcc")
    folder = compile_build(grasp_set, tmp_path / "build", rounds=10, folds=0).folder
    assert verify(folder, grasp_set).firmware is None
    assert verify(folder, grasp_set, ("host",)).holds
    (folder / "firmware" / "thenar_glove.c").write_text("/* mine */\n")
    (folder / "firmware" / "thenar.h").unlink()
    whole = verify(folder, grasp_set, ("host",))
    changed = whole.firmware
    assert changed is not None
    assert changed.outdated == ("firmware/thenar.h", "firmware/thenar_glove.c")
    assert not changed.holds
    assert not whole.holds


@pytest.mark.usefixtures("few_frames")
def test_a_build_of_before_carries_no_firmware_and_holds(grasp_set: GraspSet, tmp_path: Path) -> None:
    tool("gcc")
    folder = compile_build(grasp_set, tmp_path / "build", rounds=5, folds=0).folder
    for path in (folder / "firmware").iterdir():
        path.unlink()
    (folder / "firmware").rmdir()
    found = verify_firmware(folder, grasp_set, ("host",))
    assert (found.outdated, found.holds) == (None, True)


@pytest.mark.parametrize("kind", ["host", "avr"])
def test_without_the_tools_it_says_what_to_install(
    build: Path, grasp_set: GraspSet, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(FirmwareError, match=f"firmware for {PARTS[kind][0]} cannot be run here: .*apt-get install"):
        verify_firmware(build, grasp_set, (kind,))
