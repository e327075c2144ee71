import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.build.ensemble import ensemble_to_bytes
from thenar.runtime.tables import IntegerTables, tables_to_bytes

RUNS = 20_000


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """The content of sound files, for mutation to start from."""
    rows = np.arange(-6, 6, dtype=np.int16).reshape(4, 3)
    tables = IntegerTables(rows[0], rows, (np.array([4, 9], np.uint16),), (rows[:3],), rows, rows[:1], 3.0)
    stumps = Stumps(5, np.zeros((2, 3), np.int32), np.zeros((2, 3)), np.zeros((2, 3, 3)), 1.0)
    (tmp_path / "corpus").mkdir()
    for name, data in (("tables", tables_to_bytes(tables)), ("ensemble", ensemble_to_bytes(stumps))):
        (tmp_path / "corpus" / name).write_bytes(data[56:])
    (tmp_path / "corpus" / "manifest").write_text(json.dumps({"schema": 1, "checksum": "", "grasps": ["a", "b"]}))
    return tmp_path / "corpus"


@pytest.mark.slow
def test_fuzzing_finds_no_crash(corpus: Path, tmp_path: Path) -> None:
    if importlib.util.find_spec("atheris") is None:
        (pytest.fail if os.environ.get("THENAR_REQUIRE_ALL") == "1" else pytest.skip)("atheris is missing")
    harness = Path(__file__).with_name("fuzz_build.py")
    limits = [f"-runs={RUNS}", "-seed=1", "-max_len=4096", "-rss_limit_mb=1024", f"-artifact_prefix={tmp_path}/"]
    command = [sys.executable, str(harness), *limits, str(corpus)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"Done {RUNS} runs" in done.stderr
