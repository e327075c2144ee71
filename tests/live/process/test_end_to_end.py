import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest

from thenar.runtime.live.replay import replayed
from thenar.runtime.policy import Policy
from thenar.runtime.published import LiveGrasp
from thenar.runtime.sinks import GraspLine, Line

MakeRun = Callable[..., Any]

pytestmark = pytest.mark.slow

FRANK = Policy(lead=0.0, dwell_us=0)
# Registers of the chips' ports.
GPIOA_23017, GPIOB_23017 = 0x12, 0x13

# How long each row is played. A device that a busy computer keeps waiting for over two of its periods is missing until
# it comes to it, and a row lasts long enough for all of them to be there once.
PLAYED_US = 1_000_000


@pytest.mark.parametrize(
    ("inputs", "parts"),
    [
        ("switches", ("bus",)),
        ("joints", ("glove",)),
        ("switches", ("board",)),
        ("both", ("glove", "bus")),
        ("both", ("glove", "board", "bus")),
    ],
    ids=["bus", "glove", "board", "glove and bus", "all"],
)
def test_live_and_replayed_answers_are_the_offline_classification(
    run: MakeRun, tmp_path: Path, inputs: str, parts: tuple[str, ...]
) -> None:
    running = run(inputs, *parts)
    scene = running.scene
    client = running.start("--record", tmp_path / "run.mcap")
    rows = range(len(scene.truth.performance))
    for row in rows:
        scene.show(row)
        scene.settled(row)
    assert client.end() == 0
    assert len({scene.truth.answer(row) for row in rows}) > 5
    assert scene.check() >= len(rows)
    pairs = list(replayed(scene.truth.build, tmp_path / "run.mcap", FRANK))
    assert all(then == now.grasp for then, now in pairs)
    published = {grasp.number: grasp for grasp in scene.grasps.all}
    assert all(
        _as_recorded(published[then.number]) == _as_printed(then) for then, _ in pairs if then.number in published
    )
    assert len(published) > 0.9 * len(pairs)


def _as_printed(grasp: LiveGrasp) -> LiveGrasp:
    shares = {name: round(getattr(grasp, name), 4) for name in ("probability", "segment_probability")}
    return msgspec.structs.replace(grasp, **shares)


def _as_recorded(line: Any) -> LiveGrasp:
    return LiveGrasp(**{name: getattr(line, name) for name in LiveGrasp.__struct_fields__})


def test_chips_and_ports_without_a_kept_switch_are_never_touched(run: MakeRun) -> None:
    running = run("both", "glove", "bus")
    client, scene = running.start(), running.scene
    for row in (0, 6, 12):
        scene.show(row)
        scene.settled(row)
    assert client.end() == 0
    chips = running.bench.harness.buses[0].chips
    seen = running.wire().traffic
    touched = {(place.address, place.mux, place.channel) for place in seen}
    used = {(chip.address, *((chip.mux.address, chip.mux.channel) if chip.mux else (None, None))) for chip in chips[:4]}
    # Nobody has address 0x7F: reading there is how a stuck bus would be noticed.
    assert touched - {(0x7F, None, None)} == used | {(0x70, None, None)}
    # Port B of the first chip holds a switch that is not kept: only port A's GPIO register is read, a byte each time.
    first = {place.register: count for place, count in seen.items() if place.address == chips[0].address}
    assert first.get(GPIOB_23017, 0) == 0
    assert first.get(GPIOA_23017, 0) % 4 == 0  # address and register, address and the one byte
    assert first.get(GPIOA_23017, 0) >= 100


class Played(msgspec.Struct):
    time_us: int
    row: int
    grasp: str


def test_emulate_plays_a_set_and_run_recognises_it_row_by_row(run: MakeRun, stage: Any, tmp_path: Path) -> None:
    """Two commands, as a user has them; default policy, so that only the candidate is of the frame alone."""
    running = run("both", "glove", "board", "bus")
    scene, glove = running.scene, tmp_path / "glove.toml"
    own = tmp_path / "own"
    own.mkdir()
    running.bench.close()
    log, out, recording = tmp_path / "played.jsonl", tmp_path / "out.jsonl", tmp_path / "run.mcap"
    thenar = [sys.executable, "-m", "thenar.cli"]
    scene_file = stage.scene_file(tmp_path)
    client = [*thenar, "run", str(stage.builds["both"]), "--glove", "{glove}", "--sink", f"jsonl:{out}?every"]
    client += ["--record", str(recording), "--lead", "0", "--dwell-ms", "0"]
    emulate = [*thenar, "emulate", str(scene_file), "--glove", str(glove), "--dir", str(own)]
    emulate += ["--period-ms", str(PLAYED_US // 1000)]
    done = subprocess.run(
        [*emulate, "--log", str(log), "--", *client], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    played = [msgspec.json.decode(line, type=Played) for line in log.read_bytes().splitlines()]
    assert [line.row for line in played] == list(range(len(scene.truth.performance)))
    lines = msgspec.json.Decoder(Line).decode_lines(out.read_bytes())
    grasps = [line for line in lines if isinstance(line, GraspLine)]
    met = stage.check_played(scene.truth, grasps, [(line.time_us, line.row) for line in played], PLAYED_US)
    # The first rows may pass while the run starts.
    begun = next(grasp.time_us for grasp in grasps if grasp.health == "ok")
    whole = {this.row for this, after in pairwise(played) if this.time_us > begun and after}
    assert whole <= met
    assert len(met) > 15
    assert all(then == now.grasp for then, now in replayed(scene.truth.build, recording, FRANK))
