"""Recordings that are wrong inside and sound outside, through everything that reads recordings: rows, a sentence, or
an error of ours, and nothing else.
"""

import resource
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Literal

import numpy as np
import pytest
from mutating_mcap import Record, joined, mcap_file, records_of

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, GloveWiring, Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.replay import replayed
from thenar.runtime.live.system import System
from thenar.runtime.policy import Policy
from thenar.runtime.recording.guide import planned, read_journal
from thenar.runtime.recording.session import Collection, Label, Session, Task
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks.jsonl import encode
from thenar.simulator.playing.performance import of_recording

TYPES = ("cup", "pen", "rod")
SENSORS = tuple(f"j{number}" for number in range(18))
FRAMES = 12


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    draw = np.random.default_rng(4)
    labels = np.arange(30) % 3
    grasps = GraspSet(
        switches=np.array([[0, 0, 1, 1], [0, 1, 0, 1], [1, 0, 0, 1]], bool)[labels] ^ (draw.random((30, 4)) < 0.1),
        switch_names=tuple(f"s{number}" for number in range(4)),
        codes=(60 * labels[:, None] + draw.integers(1, 60, (30, 2))).astype(np.uint16),
        joints=tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in SENSORS[:2]),
        grasps=np.array(TYPES)[labels],
        taxonomy=own(TYPES),
        subjects=np.full(30, "A"),
        objects=np.full(30, "thing"),
        trials=np.arange(30),
    )
    return Build.load(compile_build(grasps, tmp_path_factory.mktemp("fuzz") / "build", rounds=10, folds=0).folder)


@pytest.fixture(scope="module")
def whole(build: Build, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return a recording that is a run of `build` and a collection at once, and was resumed."""
    names = tuple(switch.name for switch in build.manifest.switches)
    chip = ChipWiring("mcp23017", 0x20, pins={f"GPA{number}": name for number, name in enumerate(names)})
    buses = (BusWiring("/dev/zero", chips=(chip,)),)
    harness = Harness("fuzzed", GloveWiring("/dev/null", joints=SENSORS), buses=buses)
    calibration = GloveCalibration(sensors=tuple(SensorCalibration(name, 1, 0.0, 255, 127.0) for name in SENSORS))
    system = System(build, harness, System.map_of(build, harness), SENSORS, calibration, Policy())
    session = Session(
        thenar="0.0.1",
        switches=names,
        sensors=SENSORS,
        build=build.manifest.checksum,
        harness=harness_to_toml(harness),
        calibration=calibration,
        policy=system.policy,
        collection=Collection("A", "own", TYPES, tuple(Task(name, ("mug", "jar")) for name in TYPES), 2, 7),
    )
    path = tmp_path_factory.mktemp("fuzz") / "whole.mcap"
    recognizer = system.recognizer()
    for begun in range(2):
        tail = read_journal(path).tail if begun else None
        with Recorder(path, session, tail=tail) as recorder:
            for number in range(FRAMES):
                time_us = 10_000 * (FRAMES * begun + number)
                glove = GloveFrame(time_us, bytes((10 + 10 * number, *[200] * 17)))
                switches = SwitchFrame(time_us, number % (1 << len(names)), lost=int(number == 5))
                recorder.glove(glove)
                recorder.switches(switches)
                recorder.grasp(recognizer.step(time_us + 10, 10**15 + time_us, switches, glove).grasp)
                event: Literal["captured", "accepted"] = "captured" if number % 2 == 0 else "accepted"
                trial = 1 + begun * FRAMES // 2 + number // 2
                recorder.label(Label(time_us + 20, event, trial, TYPES[trial % 3], "A", "mug"))
    return path.read_bytes()


def read_in_every_way(build: Build, path: Path) -> Iterator[int]:
    """Yield how much each reader made of the file; an error of ours is nothing."""
    for reader in (imported, resumed, run_again, played):
        try:
            yield reader(build, path)
        except (ThenarError, OSError) as reason:
            said = str(reason)
            assert said
            assert len(said) < 2000, said
            assert said.isprintable(), said
            yield 0


def imported(_build: Build, path: Path) -> int:
    return len(import_recordings([path])[0])


def resumed(_build: Build, path: Path) -> int:
    collection = read_journal(path).session.collection
    assert collection is not None
    return len(planned(collection))


def run_again(build: Build, path: Path) -> int:
    return sum(len(encode(now, None, None)) for _, now in replayed(build, path))


def played(_build: Build, path: Path) -> int:
    return len(of_recording(path, 10_000))


@pytest.mark.parametrize(
    "seeds",
    [pytest.param(range(400), id="a few"), pytest.param(range(400, 3_400), marks=pytest.mark.slow, id="3,000")],
)
def test_no_mutant_raises_anything_but_our_errors(build: Build, whole: bytes, tmp_path: Path, seeds: range) -> None:
    path = tmp_path / "mutant.mcap"
    made = [0, 0, 0, 0]
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in seeds:
        path.write_bytes(mcap_file(whole, Random(seed)))
        made = [one + more for one, more in zip(made, read_in_every_way(build, path), strict=True)]
    # Most mutants are read by most readers: the fuzz goes deep.
    assert all(many > len(seeds) for many in made), made
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 200_000


def test_a_replay_and_an_emulation_tell_of_damage(build: Build, whole: bytes, tmp_path: Path) -> None:
    path, said = tmp_path / "damaged.mcap", list[str]()
    path.write_bytes(whole)
    list(replayed(build, path, warn=said.append))
    assert said == []
    data = bytearray(path.read_bytes())
    place = data.rindex(b'{"time_us"')
    data[place + len('{"time_us":')] ^= 1
    path.write_bytes(data)
    list(replayed(build, path, warn=said.append))
    of_recording(path, 10_000, warn=said.append)
    assert said == ["damaged.mcap is altered: the checksum of its data does not match"] * 2


def test_a_replay_of_other_switches_than_the_builds_is_refused(build: Build, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "others.mcap"
    kept = ",".join(f'"{switch.name}"' for switch in build.manifest.switches).encode()
    others = kept.replace(b"s", b"t")
    records = [Record(op, data.replace(b"[" + kept + b"]", b"[" + others + b"]")) for op, data in records_of(whole)]
    path.write_bytes(joined(records))
    with pytest.raises(SettingError, match="names other switches than its build"):
        list(replayed(build, path))
