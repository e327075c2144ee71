"""What `thenar frontier` prints of what it found, and what it refuses."""

from pathlib import Path
from typing import Any

import pytest

from thenar.cli.frontier_command import print_frontier

from .conftest import refusal


def _printed(frontier: Any, capsys: pytest.CaptureFixture[str]) -> list[str]:
    print_frontier(frontier)
    return capsys.readouterr().out.splitlines()


def test_a_point_is_a_line_of_the_table(examples: Any, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [line for line in _printed(examples.example_frontier(), capsys) if line.startswith("│")]
    assert [line.strip("│").split("│")[0].strip() for line in lines] == [str(number) for number in range(1, 12)]
    assert [cell.strip() for cell in lines[4].strip("│").split("│")] == [
        *("5", "33", "switches", "elimination 33", "100, 8", "mcp23017 1 MHz"),
        *("92.9 [92.1, 93.7]", "94.7 [94.0, 95.4]", "440 µs model", "8,844", "114"),
    ]


def test_what_was_skipped_and_the_sentence_follow(examples: Any, capsys: pytest.CaptureFixture[str]) -> None:
    told = "\n".join(_printed(examples.example_frontier(), capsys))
    assert "qemu-system-arm is missing" in told
    assert "Point 5: 33 of 160 switches" in told


def test_rates_say_what_they_are_of_and_that_points_are_corrected(
    examples: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    told = " ".join("\n".join(_printed(examples.example_frontier(), capsys)).split())
    assert "New subject, trials: the 3 subjects left out in turn. Accuracy in % with 95 % intervals." in told
    assert "A point is the best of many, so its rate is corrected for luck" in told
    assert "Cross-validation gave 93.3 %; 0.4 points are subtracted" in told
    pooled = examples.example_frontier(by="pooled")
    assert "Pooled, trials: 4 folds of whole trials, 3 repeats." in " ".join(
        "\n".join(_printed(pooled, capsys)).split()
    )


def test_no_points_and_one_subject_print_too(examples: Any, capsys: pytest.CaptureFixture[str]) -> None:
    told = "\n".join(_printed(examples.example_frontier(points=(), picked=None), capsys))
    assert "none is a point of the frontier" in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--budget-us", "5", "--rate", "0.5"), "give one of them"),
        (("--rate", "1.5"), "1.5 is not in the range"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(
    set_file: Path, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    complaint = " ".join(refusal("frontier", set_file, "-o", tmp_path / "found", *arguments).split())
    assert said in complaint


def test_a_folder_that_holds_other_things_is_left_alone(set_file: Path, tmp_path: Path) -> None:
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "notes.txt").write_text("mine")
    assert "is not empty and holds no frontier: name another folder" in " ".join(
        refusal("frontier", set_file, "-o", tmp_path / "found").split()
    )
    assert [path.name for path in (tmp_path / "found").iterdir()] == ["notes.txt"]
