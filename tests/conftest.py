"""What several tests need: where the real recordings and Weka's answers are, and what a missing one means."""

import gc
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, NoReturn

import pytest
from hypothesis import Phase, settings

REQUIRE_ALL = os.environ.get("THENAR_REQUIRE_ALL") == "1"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


# Who starts the tests under nohup, or in the background, hands ignored signals down to the programs under test; those
# that are caught here, they meet as usual.
for _signal in (signal.SIGHUP, signal.SIGINT):
    if signal.getsignal(_signal) is signal.SIG_IGN:
        signal.signal(_signal, lambda *_: None)

# Tests start hundreds of programs, and every worker imports all test modules: without bytecode each compiles them anew.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Under xdist each worker has a core: where the number of processes is not the point, one does the work.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")


def _not_waiting(file: int) -> None:
    os.fstat(file)  # a wrong descriptor is an error all the same


# What is written here has to survive no power cut, and no test can tell: nobody waits until it is on the disk.
for _name in ("fsync", "fdatasync"):
    setattr(os, _name, _not_waiting)

# Every run draws the same examples, on every machine: what failed once fails again.
# Where a fault was made on purpose (tests/mutants), that a test fails is enough: no simpler example is looked for.
_PHASES = [phase for phase in Phase if phase is not Phase.shrink or "THENAR_MUTATED" not in os.environ]
settings.register_profile("repeatable", derandomize=True, deadline=None, phases=_PHASES)
settings.load_profile("repeatable")

WEKA_JAR = Path("/usr/share/java/weka.jar")  # where Debian's package puts it


def lacking(what: str) -> NoReturn:
    """Fail under THENAR_REQUIRE_ALL=1, as in CI; skip by name elsewhere."""
    (pytest.fail if REQUIRE_ALL else pytest.skip)(f"{what} is missing")


def need(path: Path) -> Path:
    """Return `path`, a data set or a file of a package, if it is there."""
    return path if path.exists() else lacking("/".join(path.parts[-2:]))


def tool(name: str) -> str:
    """Return the path of program `name` if it is installed."""
    return shutil.which(name) or lacking(f"program {name}")


@pytest.fixture(scope="session")
def cases() -> Path:
    """Return the folder of small inputs that were once read or judged wrongly, each with a README."""
    return need(SHARED_DATA.parent / "cases")


@pytest.fixture(scope="session")
def weka() -> Callable[..., str]:
    """Return a function that runs a class of the real Weka 3.6 with arguments and returns what it prints."""
    command = [tool("java"), "-cp", str(need(WEKA_JAR))]

    def run(*arguments: str) -> str:
        return subprocess.run([*command, *arguments], check=True, capture_output=True, text=True).stdout

    return run


def module_at(path: Path) -> ModuleType:
    """Import the file at `path` by its name, wherever it is."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def calls(work: Callable[[], object]) -> int:
    """Count the calls of Python and C functions that some work makes: no other load changes them."""
    number = 0

    def count(_frame: FrameType, event: str, _what: object) -> None:
        nonlocal number
        number += event in {"call", "c_call"}

    gc.disable()  # hypothesis watches every search for garbage
    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
        gc.enable()
    return number


def peak_bytes(work: Callable[[], object]) -> int:
    """Return the most memory that some work holds at a time, arrays included."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture
def one_way_to_train() -> Iterator[None]:
    """Let each trainer have one set of settings, in this process: how they choose is tested where it is done."""
    from .sets import single_settings

    with single_settings():
        yield


@pytest.fixture(scope="session")
def c_compiler() -> str:
    return tool("cc")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `pytest --update-golden`: golden files are written as they come out today, to be read before a commit."""
    parser.addoption("--update-golden", action="store_true", help="write the files of tests/golden anew")


# Rooms whose tests run whole gloves in real time. On a computer that is busy with something else one of them may be
# late; only what is late three times in a row is wrong. The summary names those that were run again.
IN_REAL_TIME = {"live"}


# Files that take minutes, the longest first. `make test-slow` deals out whole files in this order: so no worker is left
# alone with a long one at the end, and what a module sets up is set up once.
LONGEST = (
    "stability/test_catalogue.py",
    "compiler/firmware/test_costs.py",
    "test_docs_commands.py",
    "simulator/planning/test_plan_scene.py",
    "test_written_bytes.py",
    "live/process/test_bus_faults.py",
    "live/test_soak.py",
    "cli/test_run_outside.py",
    "compiler/frontier/test_find.py",
    "cli/test_every_option.py",
    "mutants/test_named_faults.py",
    "fuzz/test_fuzz_files.py",
    "compiler/firmware/test_core.py",
    "live/process/test_end_to_end.py",
    "compiler/artifact/test_random_builds.py",
    "fuzz/test_fuzz_recordings.py",
    "test_examples.py",
    "runtime/live/test_losses.py",
    "compiler/frontier/test_luck.py",
    "test_quarantine_benchmark.py",
    "stability/test_spoiled.py",
    "cli/test_frontier_command.py",
    "test_packaging.py",
    "compiler/firmware/test_cppcheck.py",
    "compiler/artifact/test_verify.py",
    "compiler/evaluation/test_real_data.py",
    "compiler/artifact/test_real_recordings.py",
    "compiler/artifact/test_compile.py",
    "runtime/recording/test_reader.py",
    "cli/test_narrow.py",
    "cli/test_compile_documents.py",
    "simulator/pipeline/test_simulation.py",
)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave files without a slow test out of `pytest -m slow`: importing all takes every worker half a minute."""
    if config.getoption("-m") != "slow" or not collection_path.match("test_*.py"):
        return None
    return True if "mark.slow" not in collection_path.read_text(encoding="utf-8") else None


def pytest_collection(session: pytest.Session) -> None:
    """Let every worker begin with other files: a file whose assertions one of them has rewritten, the others read.

    Until all is collected no garbage is searched for: half a million objects are made, and stay.
    """
    gc.disable()
    here, config = Path(__file__).parent, session.config
    if [Path(argument).absolute() for argument in config.args] == [here]:
        entries = sorted(str(path) for path in here.iterdir() if path.is_dir() or path.match("test_*.py"))
        workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        number = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
        start = len(entries) * number // workers
        config.args = entries[start:] + entries[:start]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let tests in real time be run again, at most twice; put those that take long first."""
    here = Path(__file__).parent
    places = {here / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (places.get(item.path, len(places)), item.path))
    for item in items:
        if item.path.relative_to(here).parts[0] in IN_REAL_TIME:
            item.add_marker(pytest.mark.flaky(reruns=2))


def pytest_collection_finish() -> None:
    """Leave what was collected, half a million objects, out of every later search for garbage."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def update_golden(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-golden"))


@pytest.fixture(scope="session")
def new_chromium() -> Callable[..., Any]:
    """Return a function that starts a Chromium without a window, with `flags` of its own, that keeps these `logs`."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    def start(*flags: str, logs: tuple[str, ...] = ("browser",)) -> webdriver.Chrome:
        options = webdriver.ChromeOptions()
        options.binary_location = tool("chromium")
        for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", *flags):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", dict.fromkeys(logs, "ALL"))
        return webdriver.Chrome(options=options, service=Service(executable_path=tool("chromedriver")))

    return start


ARDUINO = Path("/usr/share/arduino/hardware")
BUILDER = Path("/usr/share/arduino-builder")  # where Debian's package says where the IDE's tools are


@pytest.fixture(scope="session")
def arduino(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that has Arduino's builder compile a sketch for a board; no warning may name `quiet`."""
    if not ARDUINO.is_dir():
        tool("arduino-core-avr")
    cores = tmp_path_factory.mktemp("cores")  # of Arduino, compiled once
    shipped = ARDUINO / "arduino" / "avr" / "libraries"

    def compiled(sketch: Path, quiet: str, board: str = "uno", libraries: Path = shipped, given: str = "") -> Path:
        out = tmp_path_factory.mktemp("sketch")
        # <float.h> of avr-g++ 5.4 lacks what the core asks for.
        flags = f"-DDECIMAL_DIG=__DECIMAL_DIG__ {given}"
        options = ["-tools=/usr/bin", f"-prefs=compiler.cpp.extra_flags={flags}", "-warnings=all"]
        where = [f"-hardware={BUILDER}", f"-hardware={ARDUINO}", f"-libraries={libraries}", f"-build-path={out}"]
        command = [tool("arduino-builder"), *options, *where, f"-build-cache={cores}", f"-fqbn=arduino:avr:{board}"]
        done = subprocess.run([*command, str(sketch)], capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0, done.stderr
        assert quiet not in done.stderr, done.stderr
        return out / f"{sketch.name}.elf"

    return compiled


@pytest.fixture(scope="session")
def weka_data() -> Path:
    return need(SHARED_DATA / "weka")


@pytest.fixture(scope="session")
def icub_table() -> Path:
    return need(SHARED_DATA / "icub_tactile_encoders" / "trials.csv.gz")


@pytest.fixture(scope="session")
def aml_table() -> Path:
    return need(SHARED_DATA / "aml_flex6_grasptypes" / "trials.csv.gz")


@pytest.fixture(scope="session")
def r2g_table() -> Path:
    return need(SHARED_DATA / "r2g_apertures29" / "frames.csv.gz")


# What our children import before anything of ours, or soon after.
SHADOWED = (
    *("argparse", "collections", "ctypes", "ensurepip", "json", "msgspec", "pickle", "platform", "runpy", "signal"),
    *("struct", "subprocess", "threading", "typing", "joblib", "numpy", "gi", "drivers", "thenar"),
)
HOSTILE = """
from pathlib import Path
with open(Path(__file__).with_name("mark"), "a") as mark:
    print(__name__, file=mark)
"""


@pytest.fixture
def hostile_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Make a folder of modules by the names of others the current one; at the end none of them may have run."""
    folder = tmp_path / "downloads"
    folder.mkdir()
    for name in SHADOWED:
        (folder / f"{name}.py").write_text(HOSTILE)
    monkeypatch.chdir(folder)
    yield folder
    assert not (folder / "mark").exists(), (folder / "mark").read_text()


@pytest.fixture(scope="session")
def examples() -> Any:
    """Return the module with example_frontier, the made-up frontier for all tests that show one."""
    return module_at(Path(__file__).parent / "fuzz" / "example_frontier.py")
