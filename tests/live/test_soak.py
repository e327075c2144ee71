import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml

from .soaked import Sample

pytestmark = pytest.mark.slow

SOAKED = Path(__file__).with_name("soaked.py")
# Five minutes of switches a millisecond apart.
FRAMES = 300_000
MOST_BYTES = 48 << 20
# Until caches are full and every path was taken once, in windows of 10,000 frames.
WARM_UP = 5
MOST_KIB = 128
MOST_SHARE = 0.02
PHASES = pytest.mark.parametrize("recording", [True, False], ids=["while recording", "once the file was full"])


def growth(samples: Sequence[Sample], of: Callable[[Sample], float]) -> float:
    """Return by how much it grows over all samples, if it grows as the median pair of them does."""
    pairs = combinations(range(len(samples)), 2)
    slope = median((of(samples[later]) - of(samples[first])) / (later - first) for first, later in pairs)
    return slope * (len(samples) - 1)


@pytest.fixture(scope="module")
def samples(
    stage: Any, harness_of: Callable[..., Harness], tmp_path_factory: pytest.TempPathFactory
) -> Sequence[Sample]:
    folder, truth = tmp_path_factory.mktemp("soak"), stage.truth("both")
    (folder / "calibration.toml").write_text(stage.performance.calibration.to_toml())
    harness = harness_of("both", "glove", "board", glove='calibration = "calibration.toml"')
    (folder / "glove.toml").write_text(harness_to_toml(harness))
    np.savez(folder / "rows.npz", bits=truth.bits, sensors=stage.performance.sensors)
    inputs = [stage.builds["both"], folder / "glove.toml", folder / "rows.npz", folder]
    command = [sys.executable, str(SOAKED), *map(str, (*inputs, FRAMES, MOST_BYTES))]
    # Python's allocator takes a mebibyte at a time, and glibc an arena a thread, as the load of the machine has it.
    environment = {**os.environ, "PYTHONMALLOC": "malloc", "MALLOC_ARENA_MAX": "1"}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, timeout=600, check=True)
    found = [msgspec.json.decode(line, type=Sample) for line in done.stdout.splitlines()]
    print(f"{found[-1].frames} frames, {found[-1].frames / 60_000:.1f} minutes of them")
    return found


@PHASES
def test_no_memory_thread_or_file_is_gathered(samples: Sequence[Sample], recording: bool) -> None:
    assert len({(sample.threads, sample.files) for sample in samples[WARM_UP:]}) == 1
    # Once its file is full, a recording goes another way.
    later = [sample for sample in samples if sample.recording == recording][WARM_UP:]
    assert len(later) >= 5
    print(f"{growth(later, lambda sample: sample.used_kib):.0f} KiB more, at {later[-1].used_kib} KiB")
    assert growth(later, lambda sample: sample.used_kib) <= MOST_KIB
    assert max(sample.rss_kib for sample in samples) <= 80 << 10


@PHASES
def test_no_frame_does_more_than_the_ones_before(samples: Sequence[Sample], recording: bool) -> None:
    """By the calls of Python and C that a frame makes, which no other load of the machine changes."""
    later = [sample for sample in samples[WARM_UP:] if sample.recording == recording]
    assert len(later) >= 5
    usual = median(sample.calls for sample in later)
    share = growth(later, lambda sample: sample.calls) / usual
    print(f"{usual:.1f} calls a frame, {share:+.1%} from the first of {len(later)} windows to the last")
    assert share <= MOST_SHARE


def test_a_recording_ends_where_its_file_may_not_grow_and_says_so(samples: Sequence[Sample]) -> None:
    assert samples[0].recording
    assert not samples[-1].recording
    assert "File too large" in samples[-1].failure
