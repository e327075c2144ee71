"""How runs end, and what survives of them."""

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thenar.runtime.live.replay import replayed
from thenar.runtime.policy import Policy
from thenar.runtime.recording.reader import Reader

MakeRun = Callable[..., Any]

pytestmark = pytest.mark.slow

FRANK = Policy(lead=0.0, dwell_us=0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_signal_ends_a_run_cleanly_with_its_recording_closed(
    run: MakeRun, tmp_path: Path, number: signal.Signals
) -> None:
    running, path = run("both", "glove", "board"), tmp_path / "run.mcap"
    client = running.start("--record", path)
    running.scene.settled(0)
    assert client.end(number) == 0
    reader = Reader(path)
    entries = list(reader)
    assert reader.end is not None
    assert (reader.end.closed, reader.end.reason, reader.altered) == (True, "", False)
    assert f"{len(running.scene.grasps.all)} frames" in client.said
    assert len(entries) > len(running.scene.grasps.all)
    assert all(then == now.grasp for then, now in replayed(running.scene.truth.build, path, FRANK))


def test_signals_end_a_run_whose_devices_are_all_gone(run: MakeRun, tmp_path: Path) -> None:
    running, path = run("both", "glove", "board", "bus"), tmp_path / "run.mcap"
    client = running.start("--record", path)
    running.scene.settled(0)
    for line in running.bench.lines:
        line.unplug()
    running.bench.i2c.unplug(0)
    gone_us = running.now_us()
    last = running.scene.grasps.wait(lambda grasp: grasp.health == "unknown", gone_us)
    assert last.grasp == "unknown"
    assert client.end(signal.SIGTERM) == 0
    pairs = list(replayed(running.scene.truth.build, path, FRANK))
    assert all(then == now.grasp for then, now in pairs)
    assert {then.health for then, _ in pairs} >= {"ok", "unknown"}


def test_a_killed_run_leaves_its_recording_and_free_devices(run: MakeRun, tmp_path: Path) -> None:
    running, path = run("both", "glove", "board", "bus"), tmp_path / "run.mcap"
    scene = running.scene
    client = running.start("--record", path)
    for row in (0, 5, 9):
        settled = len(scene.grasps.all)
        scene.show(row)
        scene.settled(row)
    client.process.kill()
    assert client.wait() == -signal.SIGKILL
    reader = Reader(path)
    list(reader)
    assert reader.end is not None
    assert not reader.end.closed
    pairs = list(replayed(scene.truth.build, path, FRANK))
    assert all(then == now.grasp for then, now in pairs)
    # What had been published long before had been recorded.
    assert settled <= pairs[-1][0].number
    # The glove still streams, the board has said HELLO: none of it matters.
    scene.show(12)
    again = running.start("--record", tmp_path / "second.mcap")
    scene.settled(12)
    assert again.end() == 0
    assert scene.check() > 0


def test_a_killed_emulator_is_missed_and_its_successor_found(run: MakeRun, stage: Any, tmp_path: Path) -> None:
    """Both are commands here: the ports of the one that is killed stay behind as dead links."""
    running = run("both", "glove", "board")
    running.bench.close()
    scene, glove = running.scene, tmp_path / "glove.toml"
    source = [str(stage.scene_file(tmp_path)), "--glove", str(glove), "--dir", str(tmp_path / "own")]
    command = [sys.executable, "-m", "thenar.cli", "emulate", *source, "--repeat", "--period-ms", "400"]
    links = [tmp_path / "own" / name for name in ("cyberglove", "stream0")]
    begun_us = running.now_us()
    first = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    client = running.start(glove=tmp_path / "own" / "glove.toml", after=links[1])
    try:
        scene.well(begun_us)
        first.kill()
        first.wait()
        killed_us = running.now_us()
        last = scene.grasps.wait(lambda grasp: grasp.health == "unknown", killed_us)
        scene.grasps.wait(lambda grasp: grasp.time_us > killed_us + 1_000_000, killed_us)
        assert all(grasp.health == "unknown" for grasp in scene.grasps.since(last.time_us))
        old = [link.lstat().st_mtime_ns for link in links]
    finally:
        first.kill()
        first.wait()
    second = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        running.eventually(lambda: all(link.lstat().st_mtime_ns != was for link, was in zip(links, old, strict=True)))
        back_us = running.now_us()
        scene.well(back_us)
        assert client.end() == 0
        assert second.poll() is None
    finally:
        second.send_signal(signal.SIGINT)
        assert second.wait(20.0) == 0
