"""What was typed wrongly is answered with what comes nearest to it; what is half typed, a shell completes."""

from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete

from thenar.cli.group import COMMANDS, thenar
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.trainers.base import TRAINERS

from .conftest import refusal, works


@pytest.mark.parametrize(
    ("line", "nearest"),
    [
        ("evalute", "evaluate"),
        ("imprt", "import"),
        ("teech", "teach"),
        ("compile {set} -o new --trainer logitbost", "logitboost"),
        ("compile {set} -o new --metod id3", "--method"),
        ("compile {set} -o new --roundz 3", "--rounds"),
        ("place {set} --method eliminaton", "elimination"),
        ("frontier {set} -o new --methods id3,cmin", "cmim"),
        ("frontier {set} -o new --target avr382p", "avr328p"),
        ("firmware . --target esp23 -o new", "esp32"),
        ("evaluate {set} --tables composition", "compositions"),
        ("verify . {set} --firmware hots", "host"),
        ("simulate quik -o new.grasps", "quick"),
        ("stability weigths", "weights"),
    ],
)
def test_a_typo_is_answered_with_the_nearest_name(
    line: str,
    nearest: str,
    set_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refusal(*line.format(set=set_file).split())
    assert "id you mean " in said
    assert f"'{nearest}'" in said.partition("id you mean ")[2]
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_is_near_all_names_are_listed(set_file: Path) -> None:
    said = refusal("place", set_file, "--method", "foo")
    assert f"there is no method 'foo': choose one of {', '.join(METHODS)}." in said


def test_an_unknown_target_is_answered_with_the_general_one() -> None:
    for wrong, said in (("rp2400", "(did you mean 'rp2040'"), ("z80", ": choose one of host, avr328p")):
        line = refusal("firmware", ".", "--target", wrong, "-o", "new")
        assert f"there is no target '{wrong}'" in line
        assert said in line
        assert "Use `generic` for any other part with a C99 compiler" in line


def test_help_is_a_command_too() -> None:
    for words, command in ((["help"], []), (["help", "place"], ["place"])):
        asked = works(*words).stdout
        assert works(*command, "--help").stdout == asked


def completed(*words: str) -> list[str]:
    """Return what completes the last of `words`."""
    shell = ShellComplete(thenar, {}, "thenar", "_THENAR_COMPLETE")
    return [item.value for item in shell.get_completions(list(words[:-1]), words[-1]) if item.type == "plain"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("",), [*COMMANDS]),
        (("ev",), ["evaluate"]),
        (("place", "set.grasps", "--method", ""), [*METHODS]),
        (("compile", "--trainer", ""), ["auto", *TRAINERS]),
        (("compile", "--meth"), ["--method"]),
        (("firmware", "--target", "cortex"), ["cortex-m0plus", "cortex-m4"]),
        (("stability", "weig"), ["weights"]),
        (("segm",), ["segment"]),
        (("segment", "--la"), ["--lag-ms"]),
    ],
)
def test_a_shell_completes_what_is_half_typed(words: tuple[str, ...], expected: list[str]) -> None:
    assert completed(*words) == expected


def test_every_command_completes_its_options() -> None:
    for command in COMMANDS:
        context = click.Context(thenar)
        found = thenar.get_command(context, command)
        assert found is not None
        # A flag and its opposite are both there; a parameter that is given once is not offered twice.
        options = {each.opts[-1] for each in found.get_params(click.Context(found)) if isinstance(each, click.Option)}
        assert options <= {*completed(command, "--")}
