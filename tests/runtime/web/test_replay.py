"""The page of a recording that no build recognised: what a build makes of it now, and what was labelled."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.hand import grid_hand
from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.build import MANIFEST_NAME, TABLES_NAME
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.hand import HAND_NAME, hand_to_bytes
from thenar.runtime.manifest_file import manifest_to_bytes
from thenar.runtime.model.integers import tables_to_bytes
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.web.replay import ReplayPage

NAMES = tuple(f"s{number}" for number in range(6))
HARNESS = f'name = "mine"\n[[stream]]\nport = "/dev/none"\nswitches = {list(NAMES)}\n'.replace("'", '"')
HELD_US = 1_000_000


@pytest.fixture
def folder(make_build: Callable[..., Build], tmp_path: Path) -> Path:
    build = make_build(joints=0)
    hand = hand_to_bytes(grid_hand(build.manifest))
    manifest = replace(build.manifest, hand_sha256=hashlib.sha256(hand).hexdigest())
    (tmp_path / TABLES_NAME).write_bytes(tables_to_bytes(build.tables))
    (tmp_path / HAND_NAME).write_bytes(hand)
    (tmp_path / MANIFEST_NAME).write_bytes(manifest_to_bytes(manifest))
    return tmp_path


def collected(path: Path, switches: tuple[str, ...], rows: tuple[int, ...]) -> Path:
    """Record rows for a second each, as trials of two types by turns; the last one is done again."""
    session = Session(thenar="1", switches=switches, sensors=(), harness=HARNESS)
    with Recorder(path, session) as recorder:
        for number, row in enumerate(rows):
            start, kind = 1_000_000 + number * HELD_US, ("hook", "pinch")[number % 2]
            recorder.label(Label(start, "begun", number + 1, kind, "A", "cup"))
            for time_us in range(start, start + HELD_US, 10_000):
                recorder.frame(SwitchFrame(time_us, row))
            end = "redone" if row == rows[-1] else "accepted"
            for event in ("captured", end):
                recorder.label(Label(start + HELD_US - 1, event, number + 1, kind, "A", "cup"))  # type: ignore[arg-type]
    return path


def test_what_the_build_makes_of_a_collection_stands_beside_its_labels(
    folder: Path, tmp_path: Path, hear: Callable[..., dict[str, Any]], visit: Callable[..., Any]
) -> None:
    build, rows = Build.load(folder), (0b101, 0b11010, 0b111111)
    path = collected(tmp_path / "anna.mcap", NAMES, rows)
    stop = Event()
    with ReplayPage(path, "127.0.0.1:0", token=None, build=folder) as page:
        thread = Thread(target=page.run, args=(stop,))
        thread.start()
        try:
            assert page._scanned.wait(60)
            first = page._first_us
            assert first is not None
            for number, row in enumerate(rows):
                page._take({"do": "seek", "value": first + number * HELD_US + 900_000})
                grasp = build.recognise(np.array([row >> bit & 1 for bit in range(6)], bool), np.zeros(0, int)).grasp
                with visit(page.server).open() as live:
                    while True:
                        told = hear(live)
                        if told["topic"] == "frame" and told["closed"] == f"{row:06b}"[::-1]:
                            break
                assert told["grasp"] == grasp
            assert [span[2] for span in page._overview.truth] == ["hook", "pinch"]
            begun, end, _ = page._overview.truth[1]
            assert (begun - first, end - begun) == (HELD_US, HELD_US - 1)
            assert page._overview.truth_at(begun) == "pinch"
            assert page._overview.truth_at(begun - 1) is None
            assert page._overview.truth_at(end) is None
            assert page._faults == []
        finally:
            stop.set()
            thread.join()


def test_a_recording_that_lacks_an_input_of_the_build_is_refused(folder: Path, tmp_path: Path) -> None:
    path = collected(tmp_path / "few.mcap", NAMES[:4], (1, 2))
    with pytest.raises(SettingError, match="recorded without s4"):
        ReplayPage(path, "127.0.0.1:0", token=None, build=folder)
