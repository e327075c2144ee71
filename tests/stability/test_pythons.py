import os
import subprocess
import sys
from pathlib import Path

import pytest

from thenar.stability import pythons

OTHERS = [version for version in pythons.SUPPORTED if version != f"{sys.version_info.major}.{sys.version_info.minor}"]


def program(file: Path, does: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"#!/bin/sh\n{does}\n")
    file.chmod(0o755)
    return file


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without any other Python: a PATH of one folder, `bin`, and a pyenv of no versions."""
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    return tmp_path


@pytest.mark.parametrize("version", OTHERS)
def test_a_python_on_the_path_is_found(machine: Path, version: str) -> None:
    python = program(machine / "bin" / f"python{version}", f"echo {version}.7")
    assert list(pythons.found()) == [(version, python)]


def test_the_python_that_asks_is_no_other(machine: Path) -> None:
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    program(machine / "bin" / f"python{own}", f"echo {own}.7")
    assert list(pythons.found()) == []


def test_where_a_shim_refuses_pyenvs_own_version_is_taken(machine: Path) -> None:
    version = OTHERS[-1]
    program(machine / "bin" / f"python{version}", "exit 127")
    python = program(machine / "pyenv" / "versions" / f"{version}.1" / "bin" / f"python{version}", f"echo {version}.1")
    assert list(pythons.found()) == [(version, python)]


def test_misnamed_python_versions_are_not_taken(machine: Path) -> None:
    program(machine / "bin" / f"python{OTHERS[0]}", "echo 3.1.5")
    assert list(pythons.found()) == []


def test_named_interpreters_stand_in_place_of_the_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(pythons.VARIABLE, os.pathsep.join(["/one/python", "", "/two/python"]))
    assert pythons.made() == [Path("/one/python"), Path("/two/python")]
    monkeypatch.setenv(pythons.VARIABLE, "")
    assert pythons.made() == []


def test_a_folder_counts_once_it_is_wholly_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(pythons.VARIABLE, raising=False)
    monkeypatch.setattr(pythons, "ROOT", tmp_path)
    (tmp_path / ".venv-3.13").mkdir()
    assert pythons.made() == []
    (tmp_path / ".venv-3.13" / "installed").touch()
    assert pythons.made() == [tmp_path / ".venv-3.13" / "bin" / "python"]


def test_asked_by_make_it_prints_what_it_finds(machine: Path) -> None:
    python = program(machine / "bin" / f"python{OTHERS[0]}", f"echo {OTHERS[0]}.0")
    command = [sys.executable, "-m", "thenar.stability.pythons"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout == f"{OTHERS[0]} {python}\n"


@pytest.mark.usefixtures("hostile_folder")
def test_no_module_of_the_current_folder_runs_when_a_python_is_tried() -> None:
    assert pythons._runs(Path(sys.executable), f"{sys.version_info.major}.{sys.version_info.minor}")
