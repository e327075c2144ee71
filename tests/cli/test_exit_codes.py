import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.cli.group import COMMANDS

Thenar = Callable[..., subprocess.CompletedProcess[str]]
HEAVY = ("sklearn", "scipy", "joblib", "matplotlib", "numpy")


def _one_sentence(done: "subprocess.CompletedProcess[str]") -> str:
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("thenar: ")
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(thenar: Thenar, command: str) -> None:
    done = thenar(command, "--help")
    assert done.returncode == 0, done.stderr
    assert f"thenar {command} " in done.stdout.split("Example:")[1]


def test_no_command_is_loaded_before_it_is_called() -> None:
    program = f"import sys, thenar.cli as c; c.run(['--version']); print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("arguments", [["run", "--help"], ["verify", "--help"], ["compile", "--help"]])
def test_help_loads_no_heavy_library(arguments: list[str]) -> None:
    program = f"import sys, thenar.cli as c; c.run({arguments}); print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_no_command_at_all_shows_the_help(thenar: Thenar) -> None:
    done = thenar()
    assert done.returncode == 2
    assert "Commands:" in done.stdout + done.stderr


def test_an_unknown_command_is_one_sentence(thenar: Thenar) -> None:
    assert "No such command 'fly'" in _one_sentence(thenar("fly"))


def test_an_unknown_option_is_one_sentence(thenar: Thenar, set_file: Path) -> None:
    assert "--wings" in _one_sentence(thenar("compile", set_file, "--wings", "2"))


def test_no_terminal_obeys_a_name_in_a_complaint(thenar: Thenar, tmp_path: Path) -> None:
    (tmp_path / "a\x1b[2J\u202e.grasps").write_bytes(b"")
    for name in ("a\x1b[2J\u202e.grasps", "none\x1b[2J\u202e"):
        said = thenar("info", tmp_path / name)
        assert said.returncode == 2
        assert r"\x1b[2J\u202e" in said.stderr
        assert said.stderr[:-1].isprintable()


def test_a_missing_file_is_one_sentence(thenar: Thenar, tmp_path: Path) -> None:
    assert "does not exist" in _one_sentence(thenar("compile", tmp_path / "no.grasps", "-o", tmp_path / "b"))


@pytest.mark.parametrize("command", ["compile", "verify", "run"])
def test_a_foreign_file_is_one_sentence(thenar: Thenar, tmp_path: Path, build_folder: Path, command: str) -> None:
    foreign = tmp_path / "foreign.grasps"
    foreign.write_text("not grasps")
    arguments = {
        "compile": (foreign, "-o", tmp_path / "b"),
        "verify": (build_folder, foreign),
        "run": (build_folder, "--replay", foreign),
    }
    assert "is not a thenar THNRGRSP file" in _one_sentence(thenar(command, *arguments[command]))


def test_a_damaged_build_is_one_sentence(thenar: Thenar, set_file: Path, build_folder: Path) -> None:
    data = (build_folder / "tables.bin").read_bytes()
    (build_folder / "tables.bin").write_bytes(data[:-1])
    assert "tables.bin is not the one" in _one_sentence(thenar("run", build_folder, "--replay", set_file))


def test_a_folder_of_the_users_is_one_sentence_and_untouched(thenar: Thenar, set_file: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep me")
    assert "not empty and not a build" in _one_sentence(thenar("compile", set_file, "-o", tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def _interrupt(command: list[str], ready: Path) -> "subprocess.CompletedProcess[str]":
    """Start `command`, wait until it has made the file `ready`, interrupt it as Ctrl-C does."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not ready.exists():
            assert process.poll() is None
            os.sched_yield()
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)


def test_ctrl_c_exits_with_130_and_leaves_the_old_build_alone(set_file: Path, build_folder: Path) -> None:
    before = {path: path.read_bytes() for path in build_folder.rglob("*") if path.is_file()}
    ready = build_folder.parent.parent / f"{build_folder.parent.name}.ready"
    program = (
        "import sys, pathlib\n"
        "from thenar.compiler.build import compile as module\n"
        "from thenar.cli import run\n"
        "train = module.train\n"
        f"def slow(*a): pathlib.Path({str(ready)!r}).touch(); return [train(*a) for _ in range(10**6)][0]\n"
        "module.train = slow\n"
        "sys.exit(run(sys.argv[1:]))"
    )
    done = _interrupt([sys.executable, "-c", program, "compile", str(set_file), "-o", str(build_folder)], ready)
    assert done.returncode == 130
    assert done.stderr.strip() == "thenar: interrupted"
    assert {path: path.read_bytes() for path in build_folder.rglob("*") if path.is_file()} == before
    assert [path.name for path in build_folder.parent.iterdir()] == ["build"]


def test_ctrl_c_while_the_libraries_load_is_one_like_any_other() -> None:
    program = (
        "import os, signal, sys\n"
        "from thenar.cli import run\n"
        "class Interrupts:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'click': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupts())\n"
        "sys.exit(run(['--help']))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "thenar: interrupted\n")
