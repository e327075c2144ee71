import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from thenar.cli.group import COMMANDS
from thenar.drivers.extras import EXTRAS

from .conftest import refusal, thenar, works

HEAVY = ("sklearn", "scipy", "joblib", "matplotlib", "numpy")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command: str) -> None:
    done = works(command, "--help")
    assert re.search(rf"^ +thenar {command} ", done.stdout.split("Example:")[1], re.MULTILINE)


@pytest.mark.parametrize(
    ("lines", "allowed"),
    [
        ([["--version"], ["--help"], ["run", "--help"], ["verify", "--help"]], ""),
        ([[command, "--help"] for command in ("compile", "place", "frontier", "evaluate")], "numpy"),
    ],
    ids=["nothing", "numpy where methods are listed"],
)
def test_help_loads_no_heavy_library(lines: list[list[str]], allowed: str) -> None:
    program = (
        f"import sys, thenar.cli as c\nfor line in {lines}:\n c.run(line)\n"
        f" print(line, [m for m in {HEAVY} if m in sys.modules and m != {allowed!r}], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == [f"{line} []" for line in lines]


def test_no_command_at_all_shows_the_help() -> None:
    done = thenar()
    assert done.returncode == 2
    assert "Choose and measure:" in done.stdout + done.stderr


def _interrupt(command: list[str], ready: Path) -> "subprocess.CompletedProcess[str]":
    """Start `command`, wait until it has made the file `ready`, interrupt it as Ctrl-C does."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not ready.exists():
            assert process.poll() is None
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)


def test_ctrl_c_exits_with_130_and_leaves_the_old_build_alone(set_file: Path, build_folder: Path) -> None:
    before = {path: path.read_bytes() for path in build_folder.rglob("*") if path.is_file()}
    ready = build_folder.parent.parent / f"{build_folder.parent.name}.ready"
    program = (
        "import sys, pathlib\n"
        "from thenar.compiler.artifact import compile as module\n"
        "from thenar.cli import run\n"
        "fit = module.Recogniser.fit\n"
        f"def slow(*a, **k): pathlib.Path({str(ready)!r}).touch(); return [fit(*a, **k) for _ in range(10**6)][0]\n"
        "module.Recogniser.fit = slow\n"
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


# A base install: of the packages of all extras, none can be imported.
BASE = """
import sys
from thenar.drivers.extras import EXTRAS
lacking = {package for packages in EXTRAS.values() for package in packages}
class Lacking:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in lacking:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Lacking())
"""
RUN = "from thenar.cli import main; main()"
# Every module, by its name; what its import says on a base install is printed.
IMPORT_ALL = """
import importlib, pkgutil, thenar
for module in pkgutil.walk_packages(thenar.__path__, "thenar.", onerror=lambda _: None):
    if module.name.rpartition(".")[2] in ("__main__", "i2c_server"):  # one runs, the other needs a system's package
        continue
    try:
        importlib.import_module(module.name)
    except ImportError as lack:
        print(f"{module.name}: {lack}")
"""


def _on_a_base_install(program: str, *arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", BASE + program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_extras_in_hints_are_those_of_the_project() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    called = {
        "scikit-learn": "sklearn",
        "python-calamine": "python_calamine",
        "foxglove-sdk": "foxglove",
        "paho-mqtt": "paho",
        "python-osc": "pythonosc",
    }
    needed = {
        extra: {called.get(name, name) for name in (re.split("[>=<]", package)[0] for package in packages)}
        for extra, packages in project["optional-dependencies"].items()
    }
    assert {extra: set(packages) for extra, packages in EXTRAS.items()} == needed


def test_an_import_without_its_extra_says_which_one_it_needs() -> None:
    done = _on_a_base_install(IMPORT_ALL)
    assert (done.returncode, done.stderr) == (0, "")
    said = dict(line.split(": ", 1) for line in done.stdout.splitlines())
    hint = re.compile(r'\S+ is not installed: pip install "thenar\[(\w+)\]"')
    extras = {name: found[1] if (found := hint.fullmatch(text)) else text for name, text in said.items()}
    assert set(extras.values()) <= EXTRAS.keys(), extras
    for name, extra in (
        ("compiler.classifiers", "compiler"),
        ("runtime.web", "web"),
        ("stability", "stability"),
    ):
        assert extras[f"thenar.{name}"] == extra


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "extra"),
    [
        ("compile {set} -o {new}", "compiler"),
        ("compile {set} -o {new} --no-report", "compiler"),
        ("verify {build} {set} --firmware host", "compiler"),
        ("firmware {build} --target host -o {new}", "compiler"),
        ("frontier {set} -o {new}", "compiler"),
        ("evaluate {set}", "compiler"),
        ("place {set} --draw {new}.svg", "compiler"),
        ("simulate quick -o {new}.grasps", "compiler"),
        ("stability", "stability"),
    ],
)
def test_what_is_not_installed_is_named_with_the_extra_that_brings_it(
    set_file: Path, build_folder: Path, tmp_path: Path, line: str, extra: str
) -> None:
    words = line.format(set=set_file, build=build_folder, new=tmp_path / "new").split()
    done = _on_a_base_install(RUN, *words)
    assert done.returncode == 2
    assert done.stderr.endswith(f': pip install "thenar[{extra}]"\n')


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "info {set}",
        "place {set} --method id3",
        "place {set} --method elimination --keep 2",
        "run {build} --replay {set}",
        "export {set} -o {new}.csv",
        "simulate quick -o {new}.grasps --jobs 1 --repetitions 2",
    ],
)
def test_a_base_install_does_what_needs_no_extra(set_file: Path, build_folder: Path, tmp_path: Path, line: str) -> None:
    done = _on_a_base_install(RUN, *line.format(set=set_file, build=build_folder, new=tmp_path / "new").split())
    assert done.returncode == 0, done.stderr


def test_ports_on_the_command_line_obey_the_rules_of_files(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("kept")
    said = refusal("calibrate", f"spy:///dev/null?file={victim}", "-o", tmp_path / "anna.toml")
    assert (said[:8], said.count("\n")) == ("thenar: ", 1)
    assert "is not a supported port: a port is a device such as /dev/ttyUSB0" in said
    assert victim.read_text() == "kept"


@pytest.mark.parametrize("line", ["simulate --list", "simulate --list --json", "--help", "run {build} --replay {set}"])
def test_a_command_ends_silently_when_the_reader_of_its_output_has_gone(
    line: str, build_folder: Path, set_file: Path
) -> None:
    words = line.format(build=build_folder, set=set_file).split()
    command = [sys.executable, "-m", "thenar.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert process.returncode == 1
