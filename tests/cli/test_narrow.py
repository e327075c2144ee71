"""On a terminal of 80 columns nothing is cut: what does not fit goes below, under the first column again."""

import re
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.cli.printing import out, table
from thenar.compiler import GraspSet

GLOVE = '[[bus]]\ndevice = "/dev/i2c-1"\n[[bus.chip]]\nkind = "mcp23017"\naddress = 0x20\n[bus.chip.pins]\n'


@pytest.fixture
def place(small_set: GraspSet, build_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "80")
    small_set.save("set.grasps")
    pins = "".join(f'GPA{pin} = "{name}"\n' for pin, name in enumerate(small_set.switch_names))
    Path("glove.toml").write_text(GLOVE + pins)
    return tmp_path


@pytest.mark.usefixtures("one_way_to_train")
@pytest.mark.parametrize(
    "line",
    [
        "info set.grasps",
        "place set.grasps",
        "place set.grasps --method cmim --keep 3",
        "evaluate set.grasps --repeats 1 --folds 2 --rounds 3 --jobs 1",
        "compile set.grasps -o new --rounds 3 --folds 2 --no-report --glove glove.toml",
        "spec build",
        "doctor glove.toml",
        "simulate --list",
        pytest.param("stability elementary --jobs 1", marks=pytest.mark.slow),
        pytest.param(
            "frontier set.grasps -o new --methods elimination --rounds 3 --repeats 1 --finalists 1",
            marks=pytest.mark.slow,
        ),
        pytest.param("simulate quick -o new.grasps --repetitions 1 --jobs 1", marks=pytest.mark.slow),
    ],
)
def test_nothing_is_cut_at_80_columns(line: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(line.split()) in (0, 1)
    printed = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert printed
    assert "…" not in printed
    framed = [row for row in printed.splitlines() if set(row) & set("┃│┏┡└")]
    assert max(map(len, framed), default=0) <= 80


@pytest.mark.parametrize("width", [40, 57, 80, 200])
def test_each_number_is_whole_in_a_line_of_any_length(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(width))
    columns = [f"column {number}" for number in range(12)]
    grid = table(("name", *columns, "remark"), columns, "A title")
    cells = [f"{number}{number}.4 [82.1, 86.2]" for number in range(12)]
    grid.add_row("first", *cells, "and a remark of many words that may be wrapped wherever a word ends")
    out().print(grid)
    printed = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    for cell in cells:
        assert f" {cell} " in printed
    assert printed.count("A title") == 1
    assert printed.count("first") == printed.count("┏")
    assert max(map(len, printed.splitlines())) <= width
