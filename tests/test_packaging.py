"""What is installed: every package, under one name, and a runtime that needs the base dependencies only."""

import importlib.metadata as metadata
import json
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import compile_build

from .sending import datagrams, free_port
from .sets import grasp_set_of

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LINKS = ROOT / "src" / "thenar"
# No package by itself: a namespace, so that every room is found wherever it is installed.
ROOMS = sorted(path.name for path in LINKS.iterdir() if path.is_dir() and path.name != "__pycache__")


def test_every_room_is_linked_under_its_import_name() -> None:
    assert sorted(path.parent.name for path in ROOT.glob("*/__init__.py")) == ROOMS
    assert all((LINKS / room).is_symlink() and (LINKS / room).resolve() == ROOT / room for room in ROOMS)


def test_every_folder_with_python_in_it_is_a_package() -> None:
    folders = {path.parent for room in ROOMS for path in (ROOT / room).rglob("*.py")}
    assert len(folders) > 30
    assert not [folder for folder in folders if not (folder / "__init__.py").exists()]


def test_every_room_is_marked_as_typed() -> None:
    assert all((ROOT / room / "py.typed").exists() for room in ROOMS)


def needed(extra: str = "") -> set[str]:
    """Return the names of the dependencies of thenar and of an extra, and of theirs."""
    names: set[str] = set()
    listed = PROJECT["project"]["dependencies"] + PROJECT["project"]["optional-dependencies"].get(extra, [])
    left = [re.split(r"[ <>=!~;\[]", requirement, maxsplit=1)[0] for requirement in listed]
    while left:
        name = left.pop()
        try:
            requirements = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # a dependency of another platform
        if name not in names:
            names.add(name)
            left += [re.split(r"[ <>=!~;\[(]", r, maxsplit=1)[0] for r in requirements if "extra ==" not in r]
    return names


def checkout(source: Path) -> None:
    """Copy what the distributions are built from."""
    for name in (*ROOMS, "src"):
        leave_out = shutil.ignore_patterns("__pycache__", "*.egg-info")
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=leave_out)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE", "MANIFEST.in"):
        shutil.copy(ROOT / name, source / name)


def built(source: Path, into: Path) -> subprocess.CompletedProcess[str]:
    """Build as `make dist` does, but without isolation, which would fetch setuptools."""
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(into), str(source)]
    return subprocess.run(build, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the sdist and of the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("distributions")
    checkout(folder / "source")
    done = built(folder / "source", folder / "dist")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "dist"


@pytest.mark.slow
def test_the_sdist_has_no_links_and_builds_where_there_are_none(distributions: Path) -> None:
    (sdist,) = distributions.glob("*.tar.gz")
    with tarfile.open(sdist) as content:
        members = content.getmembers()
    assert not [member.name for member in members if member.issym() or member.islnk()]
    names = {member.name.split("/", 1)[-1] for member in members}
    assert {f"src/thenar/{room}/__init__.py" for room in ROOMS} <= names


@pytest.mark.slow
def test_an_installation_leaves_no_build_folder_in_the_checkout(tmp_path: Path) -> None:
    checkout(tmp_path / "source")
    wheel = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path)]
    subprocess.run([*wheel, str(tmp_path / "source")], capture_output=True, check=True)
    assert list(tmp_path.glob("thenar-*.whl"))
    assert not (tmp_path / "source" / "build").exists()  # where README's `thenar compile -o build/` writes


@pytest.mark.slow
def test_a_checkout_without_links_says_what_to_do_and_builds_nothing(tmp_path: Path) -> None:
    """As git makes it with core.symlinks=false: a link is a file that holds its target."""
    checkout(tmp_path / "source")
    for link in (tmp_path / "source" / "src" / "thenar").iterdir():
        target = str(link.readlink())
        link.unlink()
        link.write_text(target)
    done = built(tmp_path / "source", tmp_path / "dist")
    assert done.returncode != 0
    assert "this checkout has no symbolic links" in done.stdout + done.stderr
    assert not list(tmp_path.glob("dist/*"))


@pytest.mark.slow
def test_the_metadata_of_both_distributions_passes_a_strict_check(distributions: Path) -> None:
    files = sorted(distributions.iterdir())
    assert [file.name.removeprefix(f"thenar-{PROJECT['project']['version']}") for file in files] == [
        "-py3-none-any.whl",
        ".tar.gz",
    ]
    check = [sys.executable, "-m", "twine", "check", "--strict", *map(str, files)]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("PASSED") == 2


@pytest.fixture(scope="module")
def board(distributions: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Python of a virtual environment with the wheel and its base dependencies and nothing else."""
    return environment(tmp_path_factory.mktemp("board"), distributions, needed())


def environment(folder: Path, distributions: Path, names: set[str]) -> Path:
    """Return the Python of a virtual environment with the wheel and the packages of these names."""
    venv.create(folder / "env", with_pip=False, symlinks=True)
    site = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder / "env"), "platbase": str(folder / "env")}))
    for name in names:
        for file in metadata.files(name) or []:
            top = file.parts[0]
            if top != ".." and not (site / top).exists():
                (site / top).symlink_to(Path(str(metadata.distribution(name).locate_file(top))))
    (wheel,) = distributions.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        content.extractall(site)
    return folder / "env" / "bin" / "python"


def on_board(board: Path, code: str) -> str:
    done = subprocess.run([board, "-I", "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_wheel_holds_every_module_template_and_data_file_and_no_other(board: Path) -> None:
    listed = on_board(
        board,
        "import thenar.runtime, pathlib; r = pathlib.Path(thenar.runtime.__file__).parents[1]; "
        "print(*sorted(p.relative_to(r).as_posix() for p in r.rglob('*') if p.is_file() and p.suffix != '.pyc'))",
    )
    files = (p for room in ROOMS for p in (ROOT / room).rglob("*") if p.is_file() and p.suffix != ".pyc")
    expected = sorted(p.relative_to(ROOT).as_posix() for p in files)
    assert listed.split() == expected
    assert any(path.startswith("firmware_templates/") and path.endswith(".j2") for path in expected)


@pytest.mark.slow
def test_a_board_has_none_of_the_workstations_packages_and_imports_the_runtime(board: Path) -> None:
    for name in ("sklearn", "scipy", "joblib", "matplotlib", "jinja2"):
        refusal = f"import importlib.util; assert importlib.util.find_spec('{name}') is None"
        on_board(board, refusal)
    on_board(board, "import thenar.runtime, thenar.drivers, thenar.compiler.recordings.graspset")


@pytest.mark.slow
def test_the_command_runs_on_a_board(board: Path) -> None:
    assert "compile" in on_board(board, "from thenar.cli import run; raise SystemExit(run(['--help']))")


@pytest.mark.slow
def test_an_installed_wheel_imports_compiles_and_replays(distributions: Path, tmp_path: Path) -> None:
    python = environment(tmp_path, distributions, needed("compiler"))
    table = ROOT / "examples" / "home_glove.csv"
    for command in (
        ["import", str(table), "-o", "set.grasps", "--yes"],
        ["compile", "set.grasps", "-o", "build", "--prune", "200", "--trainer", "logit", "--folds", "0", "--no-report"],
        ["run", "build", "--replay", "set.grasps"],
    ):
        run = [str(python), "-I", "-m", "thenar.cli", *command]
        done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    grasps = [line for line in done.stdout.splitlines() if '"grasp":' in line]
    assert len(grasps) == 2304


# Lines of the page that need a Raspberry Pi, its network or root.
OF_THE_PI = (
    "make dist",
    "scp ",
    "ssh ",
    "sudo raspi-config",
    "sudo apt",
    "sudo python3",
    "sudo cp",
    "cd ",
    "journalctl ",
)


@pytest.mark.slow
def test_the_commands_for_a_raspberry_pi_run_with_the_base_dependencies(board: Path, tmp_path: Path) -> None:
    page = (ROOT / "docs" / "how-to" / "raspberry-pi.md").read_text(encoding="utf-8")
    assert len(re.sub(r"\||-{2,}", " ", page).split()) <= 450
    labels = np.arange(30) % 3
    grasps = grasp_set_of(["cup", "pen", "rod"], labels, switches=[[n == 0, n == 1] for n in labels])
    compile_build(grasps, tmp_path / "build", rounds=5, folds=0)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "thenar").write_text(f'#!/bin/sh\nexec {board} -I -m thenar.cli "$@"\n')
    (tmp_path / "bin" / "thenar").chmod(0o755)
    names, port = json.dumps(grasps.switch_names), free_port()
    row = json.dumps(dict.fromkeys(grasps.switch_names, 1)).encode()
    (tmp_path / "glove.toml").write_text(f'[[stream]]\nport = "udp://127.0.0.1:{port}"\nswitches = {names}\n')
    with datagrams(port, lambda _number: row, 0.02):
        lines = [line for block in re.findall("```sh\n(.*?)```", page, re.DOTALL) for line in block.splitlines()]
        commands = [line for line in lines if not line.startswith(OF_THE_PI) and "pip install" not in line]
        assert len(commands) == 5
        for line in commands:
            below = f" --root {tmp_path / 'root'}" * ("service" in line)
            run = ["sh", "-c", line.removeprefix("sudo ") + below]
            ended = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
            assert ended.returncode == 0, (line, ended.stdout, ended.stderr)
    assert "@" not in (tmp_path / "root" / "etc" / "systemd" / "system" / "thenar.service").read_text()
