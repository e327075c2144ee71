import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import compile_build
from thenar.compiler.recordings.graspset import Joint

from ..sending import datagrams, free_port
from .conftest import sixty

HIGH = {"cup": (200, 30), "pen": (30, 200), "rod": (200, 200)}


def test_a_source_of_joints_of_ones_own_recognises_live(
    install: Callable[[str, str], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    switches, codes = np.zeros((60, 0)), np.array(list(HIGH.values()))[np.arange(60) % 3]
    joints = tuple(Joint(f"flex_{number}", "raw", 1, 1.0, 255, 255.0) for number in (1, 2))
    grasp_set = replace(sixty(switches, codes, ("flex_1", "flex_2")), joints=joints)
    build = compile_build(grasp_set, tmp_path / "build", rounds=10, folds=0, inputs="joints").folder
    (tmp_path / "mine.toml").write_text('name = "mine"\n')
    package, port = install("source.py", "thenar.sources"), free_port()
    monkeypatch.setenv("FLEX_PORT", str(port))
    with datagrams(port, lambda _number: bytes(HIGH["pen"])):
        told = package.thenar("run", str(build), "--glove", str(tmp_path / "mine.toml"), "--frames", "60")
    lines = [json.loads(line) for line in told.splitlines()]
    assert (lines[-1]["grasp"], lines[-1]["health"]) == ("pen", "ok")
