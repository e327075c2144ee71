"""Whatever nobody foresaw ends a command in one sentence, which names the file with the traceback."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

# A real command that meets an error nobody expects.
PROGRAM = """
import sys
from thenar.cli import run
from thenar.compiler.recordings.graspset import GraspSet
def load(path):
    raise {error}
GraspSet.load = load
sys.exit(run(["info", {file!r}]))
"""


@pytest.mark.parametrize(
    "error",
    [
        "RecursionError",
        "OverflowError('x')",
        "SystemError",
        "KeyError('\\ud800')",
        "UnicodeEncodeError('a', 'b', 0, 1, 'c')",
    ],
)
def test_an_unexpected_error_is_one_sentence_and_a_file_for_its_owner(error: str, tmp_path: Path) -> None:
    (tmp_path / "t.grasps").touch()
    program = PROGRAM.format(error=error, file=str(tmp_path / "t.grasps"))
    done = _run(program, TMPDIR=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    said = re.fullmatch(
        r"thenar: unexpected (\w+) in \S+: this is a bug; please report it with the file (\S+), which holds the "
        "traceback",
        line,
    )
    assert said is not None
    kept = Path(said[2])
    assert error.startswith(said[1])
    assert kept.parent == tmp_path
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    assert kept.read_text().startswith("Traceback (most recent call last)")


def test_where_no_file_can_be_written_the_sentence_says_so(tmp_path: Path) -> None:
    (tmp_path / "t.grasps").touch()
    program = PROGRAM.format(error="SystemError", file=str(tmp_path / "t.grasps"))
    program = f"import tempfile\ntempfile.tempdir = {str(tmp_path / 'gone')!r}\n{program}"
    done = _run(program)
    assert done.returncode == 2
    assert done.stderr.startswith("thenar: unexpected SystemError in __main__: ")
    assert "could not be written (No such file or directory)" in done.stderr


def _run(program: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    seen = {**os.environ, **environment}
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, env=seen)
