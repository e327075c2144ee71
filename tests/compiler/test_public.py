"""`from thenar.compiler import ...`: every name is there, is documented, and does what its example says."""

import doctest
import inspect
from importlib.metadata import version
from pathlib import Path

import pytest

import thenar.compiler
import thenar.runtime
from thenar.compiler import Build, GraspSet, compile_build, export_c
from thenar.runtime.errors import ThenarError

NAMES = [name for name in thenar.compiler.__all__ if callable(getattr(thenar.compiler, name))]
WITH_EXAMPLES = [name for name in NAMES if ">>>" in (getattr(thenar.compiler, name).__doc__ or "")]


def test_every_name_is_listed_once_and_loads() -> None:
    assert dir(thenar.compiler) == sorted(thenar.compiler.__all__)
    assert all(getattr(thenar.compiler, name) is not None for name in thenar.compiler.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = thenar.compiler.nothing


def test_rooms_say_which_thenar_they_are_of() -> None:
    assert thenar.compiler.__version__ == thenar.runtime.__version__ == version("thenar")


@pytest.mark.parametrize("name", NAMES)
def test_every_name_says_what_it_takes(name: str) -> None:
    public = getattr(thenar.compiler, name)
    words = inspect.getdoc(public) or ""
    assert words.split("\n")[0].endswith(".")
    if inspect.isfunction(public):
        assert "Parameters\n----------" in words
        assert "Raises\n------" in words


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_every_example_does_what_it_says(
    name: str, grasp_set: GraspSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    grasp_set.save(tmp_path / "set.grasps")
    failures: list[str] = []
    runner = doctest.DocTestRunner()
    (test,) = doctest.DocTestFinder(recurse=False).find(getattr(thenar.compiler, name), name, globs={})
    assert runner.run(test, out=failures.append).failed == 0, "".join(failures)


def test_a_build_is_written_as_c(grasp_set: GraspSet, tmp_path: Path) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=3, folds=0)
    build = Build.load(tmp_path / "build")
    written = export_c(build, tmp_path / "c", "avr328p")
    assert set(written) == {*(tmp_path / "c").iterdir()} - {tmp_path / "c" / "SHA256SUMS"}
    with pytest.raises(ThenarError):
        export_c(build, tmp_path / "c", "avr328p")
    assert export_c(build, tmp_path / "c", "avr328p", overwrite=True) == written
