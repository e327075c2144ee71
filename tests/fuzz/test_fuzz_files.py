import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def run(*arguments: str, timeout_s: float = 600) -> str:
    """Run mutants; what failed is the message of the failure."""
    command = [sys.executable, str(HERE / "run.py"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout_s)
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-3000:]
    return done.stdout


def test_past_failures_and_new_mutants_are_read_or_refused() -> None:
    told = run("--mutants", "540")
    assert int(re.findall(r"(\d+) inputs of the corpus", told)[0]) == sum(
        path.is_file() for path in (HERE / "corpus").glob("*/*")
    )
    assert int(re.findall(r"(\d+) mutants of 31 formats", told)[0]) >= 540


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
