import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.taxonomy import own

ROWS = 60


def recorded(folder: Path) -> tuple[Path, Path]:
    """Return a small set of grasps, and a build of it."""
    labels = np.arange(ROWS) % 3
    grasp_set = GraspSet(
        switches=np.eye(3, dtype=bool)[labels],
        switch_names=("s0", "s1", "s2"),
        codes=np.zeros((ROWS, 0), np.uint16),
        joints=(),
        grasps=np.array(["cup", "pen", "rod"])[labels],
        taxonomy=own(["cup", "pen", "rod"]),
        subjects=np.full(ROWS, "A"),
        objects=np.full(ROWS, "thing"),
        trials=np.arange(ROWS),
    )
    grasp_set.save(folder / "set.grasps")
    build = compile_build(grasp_set, folder / "build", rounds=10, folds=0, inputs="switches")
    return folder / "set.grasps", build.folder


def test_a_sink_of_another_package_is_in_the_help_and_gets_every_grasp(
    install: Callable[[str, str], Any], tmp_path: Path
) -> None:
    package = install("sink.py", "thenar.sinks")
    help_text = " ".join(package.thenar("run", "--help").split())
    assert "udp:HOST:PORT, a datagram of JSON a grasp" in help_text
    grasps, build = recorded(tmp_path)
    assert "udp:HOST:PORT" in package.thenar("run", str(build), "--replay", str(grasps), "--sink", "udp", code=2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(10.0)
        sink = f"udp:127.0.0.1:{reader.getsockname()[1]}"
        assert package.thenar("run", str(build), "--replay", str(grasps), "--sink", sink) == ""
        lines = [json.loads(reader.recv(65536)) for _ in range(ROWS)]
    assert [line["number"] for line in lines] == list(range(ROWS))
    assert {line["grasp"] for line in lines} == {"cup", "pen", "rod"}
    assert "no address" in package.thenar("run", str(build), "--replay", str(grasps), "--sink", "udp:here", code=2)
