import json
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.taxonomy import own
from thenar.simulator.body.layout import murakami160

from .conftest import refusal, works

NAMES = tuple(patch.name for patch in murakami160())


@pytest.fixture(scope="module")
def glove_set(small_set: GraspSet) -> GraspSet:
    """60 grasps of two subjects on all 160 switches, of which a few tell the types apart."""
    bits = np.random.default_rng(8).random((60, 160)) < 0.1
    bits[:, [3, 30, 31, 60, 90, 140]] = small_set.switches
    subjects = np.array(["A", "B"])[np.arange(60) // 30]
    s = small_set
    return GraspSet(bits, NAMES, s.codes, s.joints, s.grasps, own(s.taxonomy.types), subjects, s.objects, s.trials)


@pytest.fixture(scope="module")
def glove_file(glove_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glove") / "glove.grasps"
    glove_set.save(path)
    return path


def marks(svg: Path, hand: int = 0) -> list[str]:
    """Return the names of a hand's kept switches in their order, as hovering tells them."""
    lines = [line.split(">", 2)[2] for line in svg.read_text().splitlines() if f'id="dot-{hand}-' in line]
    kept = [line.removesuffix("</title>").split(": kept, number ") for line in lines if ": kept" in line]
    return [name for name, _ in sorted(kept, key=lambda words: int(words[1]))]


def test_the_glove_is_drawn_with_a_name_a_switch(tmp_path: Path) -> None:
    plain = tmp_path / "plain.SVG"
    assert works("draw", "-o", plain).stdout == f"{plain}: 1 hand\n"
    assert plain.read_text().count("<title>") == 160


def test_contacts_are_drawn_together_and_by_type(glove_file: Path, tmp_path: Path) -> None:
    together, by_type = tmp_path / "together.png", tmp_path / "by_type.svg"
    works("draw", glove_file, "-o", together)
    said = works("draw", glove_file, "--per-grasp", "-o", by_type).stdout
    assert together.read_bytes().startswith(b"\x89PNG")
    assert by_type.read_text().count("<title>") == 3 * 160
    assert f"{by_type}: 3 hands" in said


def test_a_placement_a_build_and_lists_are_drawn_side_by_side(
    glove_file: Path, glove_set: GraspSet, tmp_path: Path
) -> None:
    placement, listed, text = tmp_path / "a.json", tmp_path / "listed.json", tmp_path / "names.txt"
    assert run(["place", str(glove_file), "--method", "id3", "-o", str(placement)]) == 0
    build = compile_build(glove_set, tmp_path / "build", rounds=2, folds=0).folder
    listed.write_text(json.dumps([NAMES[7], NAMES[2]]))
    text.write_text(f"{NAMES[11]}\n\n  {NAMES[4]}\r\n")
    picture = tmp_path / "kept.svg"
    sources = [str(placement), str(build), str(listed), str(text)]
    assert run(["draw", *(word for source in sources for word in ("--kept", source)), "-o", str(picture)]) == 0
    chosen = [switch["name"] for switch in json.loads(placement.read_text())["switches"]]
    assert marks(picture, 0) == marks(picture, 1) == chosen
    assert (marks(picture, 2), marks(picture, 3)) == ([NAMES[7], NAMES[2]], [NAMES[11], NAMES[4]])
    drawn = picture.read_text()
    assert all(f"<!-- {title}" in drawn for title in ("a", "build", "listed", "names"))


def test_a_set_of_another_glove_is_refused_by_its_first_strange_switch(set_file: Path, tmp_path: Path) -> None:
    for options in ([], ["--per-grasp"]):
        said = refusal("draw", set_file, *options, "-o", tmp_path / "no.svg")
        assert "the position of switch 's0' is unknown: say it with --layout" in said
    assert not (tmp_path / "no.svg").exists()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "keeps no switches"),
        (b"[]", "keeps no switches"),
        (b'{"rates": []}', "is not a list of switches (Expected `array`, got `null`)"),
        (b'["a", "\\u001b[2J"]', r"switch '\x1b[2J' holds a control character (U+001B)"),
        (b"palm_heel_1\n\x1b[2J", r"switch '\x1b[2J' holds a control character (U+001B)"),
        (b"[1, 2]", "is not a list of switches (Expected `str`, got `int` - at `$[0]`)"),
        (b'["palm_heel_1", ', "is not a list of switches (Input data was truncated)"),
        (b"\xff\xfe\x00", "is not a text file"),
        (
            b"palm_heel_1\npalm_hel_2\nnonsense",
            "'palm_hel_2' is no switch of the glove murakami160 (did you mean 'palm_heel_2'",
        ),
        (b"palm_heel_1\npalm_heel_1", "switch 'palm_heel_1' is kept twice"),
    ],
)
def test_a_file_that_lists_no_switches_is_refused_with_the_reason(content: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_bytes(content)
    assert reason in refusal("draw", "--kept", tmp_path / "kept.txt", "-o", tmp_path / "no.svg")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--per-grasp"], "needs recordings"),
        (["--kept", "nowhere.json"], "'nowhere.json' does not exist"),
        (["GRASPS", "--kept", "GRASPS"], "leave GRASPS out"),
    ],
)
def test_a_mistake_is_one_sentence_and_code_two(
    glove_file: Path, options: list[str], reason: str, tmp_path: Path
) -> None:
    words = [str(glove_file) if word == "GRASPS" else word for word in options]
    assert reason in refusal("draw", *words, "-o", tmp_path / "no.svg")


def test_nothing_that_is_read_is_written_over(tmp_path: Path) -> None:
    listed = tmp_path / "kept.svg"
    listed.write_text(NAMES[0])
    assert "is named twice" in refusal("draw", "--kept", listed, "-o", listed, "--overwrite")
    assert listed.read_text() == NAMES[0]
