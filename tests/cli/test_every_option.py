"""Every option and argument of every command, taken from click's own tree, with values that make no sense."""

import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType

import click
import numpy as np
import pytest

from thenar.cli import run
from thenar.cli.group import COMMANDS, thenar
from thenar.cli.parameters import OutputFile, OutputFolder
from thenar.compiler import GraspSet
from thenar.studio import collecting

# Arguments and options of a small run of each command. Its devices are not there.
LINES: dict[str, tuple[str, str]] = {
    "simulate": ("quick", "-o new.grasps --repetitions 1 --subject S1 --jobs 1"),
    "import": ("table.csv", "-o new.grasps --columns columns.toml"),
    "export": ("set.grasps", "-o new.csv"),
    "merge": ("set.grasps other.grasps", "-o new.grasps"),
    "split": ("set.grasps", "--by subject -o new"),
    "info": ("set.grasps", ""),
    "place": ("set.grasps", ""),
    "draw": ("", "-o new.svg"),
    "evaluate": ("set.grasps", "--repeats 1 --folds 2 --rounds 2 --tables compositions --jobs 1"),
    "segment": ("movements.grasps", "-b build -o new.csv"),
    "frontier": (
        "set.grasps",
        "-o new --methods elimination --rounds 2 --repeats 1 --finalists 1 --jobs 1"
        # Nothing is left to choose, which takes long and says nothing.
        " --trainer logitboost --shrinkage 1 --max-bins 256 --ties first",
    ),
    "compile": ("set.grasps", "-o new --rounds 2 --folds 0 --no-report"),
    "adapt": ("build set.grasps", "-o new"),
    "compare": ("build build set.grasps", ""),
    "verify": ("build set.grasps", ""),
    "firmware": ("build", "--target host -o new"),
    "spec": ("build", "-o new"),
    "run": ("build", "--replay set.grasps"),
    "studio": ("missing", "--web 127.0.0.1:0"),
    "monitor": ("missing.mcap", "-b build --web 127.0.0.1:0"),
    "teach": ("movements.grasps", "-b build -o new.json"),
    "calibrate": ("missing/port", "-o new.toml"),
    "record": ("", "--glove glove.toml --subject A --objects objects.toml --taxonomy own -o new.grasps"),
    "wear": ("build", "--glove glove.toml -o new"),
    "emulate": ("set.grasps", "--glove glove.toml --dir new --period-ms 1"),
    "doctor": ("glove.toml", ""),
    "service": ("install build", "--glove glove.toml --root new"),
    "stability": ("elementary", "--jobs 1"),
}
NUMBERS = ("nan", "inf", "-inf", "-1", "0", "1" + 30 * "0")
PATHS = ("folder", "missing/new", "junk", "junk/new", "/dev/full", "/proc/new")
VALUES = (*NUMBERS, *PATHS, "", "x\x1b[2J\udcff")
# Most of what click lets through is found with these.
QUICK = ("nan", "")
# Longer than any refusal takes: what goes on then is at work, and is interrupted.
AT_WORK_S = 1.0


@pytest.fixture(scope="module")
def material(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("material")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        small_set.save("set.grasps")
        small_set.rows(np.repeat(np.arange(len(small_set)), 3)).save("movements.grasps")
        shutil.copy("set.grasps", "other.grasps")
        assert run(["export", "set.grasps", "-o", "table.csv", "--columns", "columns.toml"]) == 0
        assert run(["compile", "set.grasps", "-o", "build", "--rounds", "2", "--folds", "0", "--no-report"]) == 0
        names = ", ".join(f'"{name}"' for name in small_set.switch_names)
        Path("glove.toml").write_text(f'[[stream]]\nport = "{folder}/none"\nswitches = [{names}]\n')
        Path("objects.toml").write_text('cup = ["mug"]\n')
        # Libraries are loaded whole before any work is interrupted.
        assert run(["place", "set.grasps", "--draw", "set.png"]) == 0
        for library in ("sklearn", "scipy.stats", "scipy.optimize", "joblib", "threadpoolctl", "jinja2"):
            import_module(library)
        Path("folder").mkdir()
        Path("junk").write_bytes(bytes(range(256)))
    return folder


@pytest.fixture
def place(material: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shutil.copytree(material, tmp_path / "place"))
    monkeypatch.setattr(collecting, "_PATIENCE_US", 0)
    return Path.cwd()


def _parameters(command: str) -> list[click.Parameter]:
    context = click.Context(thenar)
    found = thenar.get_command(context, command)
    assert found is not None
    return [
        each
        for each in found.get_params(click.Context(found))
        if not (isinstance(each, click.Option) and (each.is_flag or each.name == "help"))
    ]


def _line(command: str, parameter: click.Parameter, value: str) -> list[str]:
    arguments, options = (text.split() for text in LINES[command])
    if isinstance(parameter, click.Option):
        return [command, *options, parameter.opts[0], value, "--", *arguments]
    places = [each.name for each in _parameters(command) if isinstance(each, click.Argument)]
    place = places.index(parameter.name)
    return [command, *options, "--", *arguments[:place], value, *arguments[place + 1 :]]


@contextmanager
def _interrupted_at_work() -> Iterator[None]:
    def interrupt(_number: int, _frame: FrameType | None) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, AT_WORK_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _holds(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


def _tried(
    line: list[str], place: Path, before: dict[str, bytes], capfd: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """Return exit code and what was said, once all that was there `before` is the same; what was written is removed."""
    with _interrupted_at_work():
        code = run(line)
    printed, said = capfd.readouterr()
    after = _holds(place)
    assert "Traceback" not in printed + said
    assert "bug in thenar" not in said, said
    assert {name: after.get(name) for name in before} == before, "a file that was there has changed"
    new = sorted(after.keys() - before.keys(), key=len)
    if code == 2:
        assert new == []
        assert (said[:8], said.count("\n")) == ("thenar: ", 1), said
    assert not [name for name in new if name.endswith(".part")]
    for name in new:
        if Path(name).is_dir():
            shutil.rmtree(name)
        else:
            Path(name).unlink(missing_ok=True)
    return code, said


def test_there_is_a_line_for_every_command() -> None:
    assert set(LINES) == set(COMMANDS)


# An interrupt may fall into a callback of a library, out of which nothing can be raised.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("values", [QUICK, pytest.param(VALUES, marks=pytest.mark.slow)], ids=["quick", "all"])
def test_a_value_that_makes_no_sense_is_one_sentence(
    command: str, values: tuple[str, ...], place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = _holds(place)
    for parameter in _parameters(command):
        number = isinstance(parameter.type, click.types.FloatParamType | click.types.IntParamType)
        for value in values:
            code, said = _tried(_line(command, parameter, value), place, before, capfd)
            where = (parameter.name, value, said)
            assert code in (0, 1, 2, 130), where
            if number and value in ("nan", "inf", "-inf", ""):
                assert code == 2, where
            if isinstance(parameter.type, OutputFile) and value == "nan":
                assert "nan: the name of the output file must end in " in said, where
                assert all(ending in said for ending in parameter.type.endings), where
            if isinstance(parameter.type, click.Path) and value in ("missing/new", "junk/new", ""):
                makes = isinstance(parameter.type, OutputFolder) and value == "missing/new"
                assert code == 2 or makes, where


def test_every_command_that_writes_a_file_can_be_asked_to_replace_it() -> None:
    for command in COMMANDS:
        parameters = {each.name: each for each in thenar.get_command(click.Context(thenar), command).params}  # type: ignore[union-attr]
        written = [each.type for each in parameters.values() if isinstance(each.type, OutputFile)]
        if any(not each.goes_on for each in written):
            assert "overwrite" in parameters, command
        for each in written:
            assert each.endings, command
        for name in parameters.keys() & {"output", "draw"}:
            assert isinstance(parameters[name].type, OutputFile | OutputFolder), (command, name)
