"""A small glove, its grasps and its build, made by thenar when they are needed; and the shape of a format."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import Harness


class Format(NamedTuple):
    """A format that thenar reads.

    seeds   healthy files    mutate  another file, from one and a source of randomness
    read    does with a file, in a folder of its own, what users do: raises ThenarError or OSError, or nothing
    weight  share of all mutants; less where each is read in a process of its own
    """

    name: str
    seeds: Callable[[], Sequence[bytes]]
    mutate: Callable[[bytes, Random], bytes]
    read: Callable[[bytes, Path], None]
    weight: float = 1.0


SWITCHES = tuple(f"finger_{number}" for number in range(6))
SENSORS = SENSORS_18[:3]
GRASPS = ("power", "pinch", "hook")

GLOVE_TOML = """\
name = "bench"
[cyberglove]
port = "/dev/ttyUSB0"
baud = 115200
joints = ["{sensors}"]
sensors = 18
[[bus]]
device = "/dev/i2c-1"
clock_hz = 400000
[[bus.chip]]
kind = "mcp23017"
address = 0x20
pins = {{ GPA0 = "finger_0", GPA1 = "finger_1", GPB0 = "finger_2" }}
[[bus.chip]]
kind = "pca9555"
address = 0x21
closed = "high"
mux = {{ address = 0x70, channel = 2 }}
pins = {{ P00 = "finger_3", P17 = "finger_4" }}
[[stream]]
port = "/dev/ttyACM0"
switches = ["finger_5"]
[stream.board]
pins = {{ finger_5 = "2" }}
[debounce]
press_lockout_ms = 5
release_ms = 10
""".format(sensors='", "'.join(SENSORS_18))


@cache
def harness() -> Harness:
    """Return the glove's wiring."""
    return parse_harness(GLOVE_TOML, "glove.toml")


@cache
def grasp_set() -> GraspSet:
    """Return 36 grasps of three types by two subjects: six switches, three joints."""
    random = np.random.default_rng(7)
    rows = 36
    labels = np.arange(rows) % 3
    bits = (random.random((3, 6)) < 0.5)[labels] ^ (random.random((rows, 6)) < 0.15)
    codes = random.integers(40, 200, (3, 3))[labels] + random.integers(-20, 20, (rows, 3))
    return GraspSet(
        switches=bits,
        switch_names=SWITCHES,
        codes=codes.astype(np.uint16),
        joints=tuple(Joint(name, "raw", 1, 1.0, 255, 255.0) for name in SENSORS),
        grasps=np.array(GRASPS)[labels],
        taxonomy=own(GRASPS),
        subjects=np.array(["anna", "bert"])[np.arange(rows) // 18],
        objects=np.full(rows, "mug"),
        trials=np.arange(rows),
    )


@cache
def build_files(linear: bool = False) -> dict[str, bytes]:
    """Return name -> content of the files that a build of the grasps is loaded from; its joints may be linear."""
    with TemporaryDirectory() as folder:
        logit: dict[str, Any] = {"trainer": "linear", "penalty": 1.0, "smoothness": 1.0}
        options = logit if linear else {"rounds": 4}
        compile_build(grasp_set(), Path(folder) / "build", folds=0, harness=harness(), **options)
        return {path.name: path.read_bytes() for path in sorted(Path(folder, "build").iterdir()) if path.is_file()}


def make_folder(files: dict[str, bytes], folder: Path) -> Path:
    """Write `files` as the only ones of `folder`; return it."""
    folder.mkdir(exist_ok=True)
    for path in folder.iterdir():
        path.unlink()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


@cache
def loaded_build() -> Build:
    """Return the build of the grasps."""
    with TemporaryDirectory() as folder:
        return Build.load(make_folder(build_files(), Path(folder)))
