import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from mutating import table_file

HERE = Path(__file__).parent

# Formats whose readers fail in every way that there is.
FAULTY = """
import sys
from pathlib import Path
from random import Random

from fuzzing import Fuzzer
from material import Format
from thenar.drivers.errors import SettingError


def unexpected(data, folder):
    raise KeyError(data[0])


def endless(data, folder):
    while True:
        pass


def late_once(data, folder):
    # The first time, as on a machine that is busy for a moment.
    try:
        Path(folder, "late").touch(exist_ok=False)
    except FileExistsError:
        raise SettingError("refused in time") from None
    while True:
        pass


def greedy(data, folder):
    try:
        bytearray(1 << 30)
    except MemoryError as lack:
        raise SettingError("a refusal that came too late") from lack


def dead(data, folder):
    import os

    os._exit(3)


def sound(data, folder):
    raise SettingError("refused") if data[0] % 2 else FileNotFoundError(data)


readers = (unexpected, endless, late_once, greedy, dead, sound)
formats = [Format(read.__name__, lambda: [b"seed"], lambda data, random: random.randbytes(9), read) for read in readers]
fuzzer = Fuzzer(formats, Path(sys.argv[1]), Path(sys.argv[1]), 1)
for form in formats:
    fuzzer.mutate(form, 0, 1)
for failure in fuzzer.failures.values():
    print(failure.format, failure.place.split(":")[0], bool(failure.saved))
"""


def run(*arguments: str, timeout_s: float = 600) -> str:
    """Run mutants; what failed is the message of the failure."""
    command = [sys.executable, str(HERE / "run.py"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout_s)
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-3000:]
    return done.stdout


def test_every_input_that_ever_failed_and_some_new_ones_are_read_or_refused() -> None:
    told = run("--mutants", "540")
    assert int(re.findall(r"(\d+) inputs of the corpus", told)[0]) == sum(
        path.is_file() for path in (HERE / "corpus").glob("*/*")
    )
    assert int(re.findall(r"(\d+) mutants of 31 formats", told)[0]) >= 540


def test_mutants_of_a_table_are_small_enough_for_their_time() -> None:
    """Reading a mutant may take 2 s whatever its length: one of hundreds of megabytes is not written in that."""
    longest = 0
    for number in range(1000):
        random, data = Random(number), b"grasp,finger\n\n\npower,1\n" * 5
        for _ in range(3):
            data = table_file(data, random)
        longest = max(longest, len(data))
    assert 100_000 < longest < 50_000_000


def test_whatever_goes_wrong_with_a_mutant_is_seen(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FAULTY, str(tmp_path / "corpus")]
    environment = {**os.environ, "PYTHONPATH": str(HERE)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "unexpected KeyError True",
        "endless time True",
        "greedy memory True",
        "dead a process ended with 3 at mutant 1 False",
    ]
    assert len(list((tmp_path / "corpus").glob("*/*"))) == 3


@pytest.mark.slow
def test_thousands_of_mutants_of_every_format_are_read_or_refused() -> None:
    assert "mutants of 31 formats" in run("--mutants", "4096", "--seed", "2", timeout_s=1800)


@pytest.mark.slow
def test_mutants_that_coverage_guides_are_read_or_refused() -> None:
    if importlib.util.find_spec("atheris") is None:
        (pytest.fail if os.environ.get("THENAR_REQUIRE_ALL") == "1" else pytest.skip)("atheris is missing")
    formats = ("tables.bin", "glove.toml", "cyberglove", "lines", "mcap")
    told = run("--guided", "--mutants", "2000", "--formats", ",".join(formats))
    assert all(int(re.findall(rf"\b{re.escape(name)} (\d+)", told)[0]) > 50 for name in formats), told
