"""A small scene as a subject plays it, builds of it, harnesses for them, and what must be true of what is published.

The oracle is offline: `Scorer.biased_scores` on the bits that were shown and the codes that the subject's
calibration gives to the bytes that were shown.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition
from time import monotonic
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import thenar.simulator.scenes
from thenar.compiler import compile_build
from thenar.runtime import Build
from thenar.runtime.calibration import CodeTables
from thenar.runtime.frames import now_us
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.published import UNKNOWN, LiveGrasp
from thenar.simulator import load_scene, simulate
from thenar.simulator.playing.bench import Bench
from thenar.simulator.playing.performance import Performance, of_scene

# From showing a frame until it is all that the devices have sent: 10 ms of debounce, 2 to 9 ms on the wires, and what
# threads and processes of a busy computer need to be woken.
SETTLE_US = 150_000
LONG_S = 20.0
# So many grasps of what is left show that the rest goes on.
AGAIN = 10


class Grasps:
    """What was published so far; whoever waits is woken by every new one."""

    def __init__(self) -> None:
        self.all: list[LiveGrasp] = []
        self._came = Condition()

    def add(self, grasp: LiveGrasp) -> None:
        with self._came:
            self.all.append(grasp)
            self._came.notify_all()

    def since(self, time_us: int) -> list[LiveGrasp]:
        with self._came:
            return [grasp for grasp in self.all if grasp.time_us >= time_us]

    def wait(self, wanted: Callable[[LiveGrasp], bool], since_us: int, seconds: float = LONG_S) -> LiveGrasp:
        """Return the first one of since_us or later that is `wanted`."""
        end, seen = monotonic() + seconds, 0
        with self._came:
            while True:
                for grasp in self.all[seen:]:
                    if grasp.time_us >= since_us and wanted(grasp):
                        return grasp
                seen = len(self.all)
                left = end - monotonic()
                if left <= 0:
                    break
                self._came.wait(left)
            last = self.all[-1] if self.all else None
        raise AssertionError(f"no such grasp in {seconds:g} s of {seen}; the last one: {last}")


@dataclass(frozen=True, slots=True)
class Shown:
    """Row `row` was put on the devices between these two moments."""

    begun_us: int
    done_us: int
    row: int


# A record of the glove that is older than two of its periods is late.
LATE_US = 20_000


@dataclass(eq=False)
class Truth:
    """What a build makes of the rows of a performance."""

    build: Build
    performance: Performance
    bits: np.ndarray = field(init=False)
    codes: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        played, manifest = self.performance, self.build.manifest
        columns = [played.switch_names.index(switch.name) for switch in manifest.switches]
        names = [sensor.name for sensor in played.calibration.sensors]
        tables = CodeTables(manifest.joints, names, played.calibration)
        self.bits = played.switches[:, columns]
        rows = [tables.codes(row.tobytes()) for row in played.sensors]
        self.codes = np.array(rows, np.uint16).reshape(len(played), len(manifest.joints))
        self.switch_names = tuple(switch.name for switch in manifest.switches)
        self.joint_names = tuple(joint.name for joint in manifest.joints)

    def answer(self, row: int) -> str:
        """Return the offline classification."""
        return self.build.classify(self.bits[row], self.codes[row])

    def candidate(self, switch_row: int, glove_row: int, lost: Sequence[str]) -> str:
        """Return it with the means of what is lost."""
        without = [np.isin(names, lost) for names in (self.switch_names, self.joint_names)]
        lanes = self.build.scorer.biased_scores(self.bits[switch_row], self.codes[glove_row], *without)
        return self.build.grasps[lanes.index(max(lanes))]

    def check(self, grasps: Sequence[LiveGrasp], shown: Sequence[Shown]) -> int:
        """Hold every grasp against what was shown when its frames were read; return how many could be.

        In the first SETTLE_US of a row there may be some of the row before.
        """
        checked = 0
        for grasp in grasps:
            if grasp.health == "unknown":
                assert (grasp.grasp, grasp.probability, grasp.margin) == (UNKNOWN, 0.0, 0), grasp
                continue
            late = grasp.health == "degraded" and (grasp.glove_age_us or 0) > LATE_US
            assert (grasp.health in ("ok", "changing")) == (not grasp.lost and not late), grasp
            ages = grasp.switch_age_us, grasp.glove_age_us
            rows = [
                0 if set(names) <= set(grasp.lost) else _row_at(shown, grasp.time_us - (age or 0))
                for names, age in zip((self.switch_names, self.joint_names), ages, strict=True)
            ]
            if rows[0] is not None and rows[1] is not None:
                checked += 1
                assert grasp.candidate == self.candidate(rows[0], rows[1], grasp.lost), (rows, grasp)
        return checked


def _row_at(shown: Sequence[Shown], time_us: int) -> int | None:
    """Return the row that was being shown, None while it was new."""
    number = bisect_right(shown, time_us, key=lambda one: one.begun_us) - 1
    if number < 0 or time_us < shown[number].done_us + SETTLE_US:
        return None
    return shown[number].row


@dataclass(eq=False)
class Stage:
    """The performance, builds by the inputs that they use, and where files may go."""

    performance: Performance
    builds: dict[str, Path]
    scene: str

    def scene_file(self, folder: Path) -> Path:
        """Write the scene that is played where a command can read it."""
        path = folder / "played.toml"
        path.write_text(self.scene)
        return path

    def check_played(
        self, truth: Truth, grasps: Sequence[LiveGrasp], played: Sequence[tuple[int, int]], period_us: int
    ) -> set[int]:
        """Hold grasps against what an emulator's log says, and return the rows that were recognised while all was well.

        The log has the moments at which rows were on the devices. They are shown on a schedule, and never before; how
        long showing one takes is up to the computer, but of all of them the quickest takes less than 20 ms.
        """
        start_us = min(time_us - row * period_us for time_us, row in played) - 20_000
        shown = [Shown(start_us + row * period_us, time_us, row) for time_us, row in played]
        assert truth.check(grasps, shown) > 0
        settled = [grasp for grasp in grasps if grasp.health == "ok"]
        rows = {_row_at(shown, oldest_us(grasp)) for grasp in settled} - {None}
        return {row for row in rows if row is not None}

    def truth(self, inputs: str) -> Truth:
        return Truth(Build.load(self.builds[inputs]), self.performance)


@pytest.fixture(scope="session")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    folder = tmp_path_factory.mktemp("live")
    text = _smaller((Path(thenar.simulator.scenes.__file__).parent / "quick.toml").read_text())
    (folder / "scene.toml").write_text(text)
    scene = load_scene(str(folder / "scene.toml"))
    recorded = simulate(scene, 1).grasp_set
    builds = {
        inputs: compile_build(recorded, folder / inputs, rounds=15, folds=0, inputs=inputs).folder
        for inputs in ("both", "switches", "joints")
    }
    return Stage(of_scene(scene, jobs=1), builds, text)


def _smaller(scene: str) -> str:
    """Return the scene with one subject and two repetitions."""
    before, _, after = scene.replace("repetitions = 12", "repetitions = 2").rpartition("[[subjects]]")
    return before + after[after.index("\n[effects") :]


def _bus(kept: Sequence[str], others: Sequence[str]) -> str:
    """Return a bus of four chips with the kept switches, and a port and two chips without any.

    Chips 0 and 1 are straight on the bus, 2 and 3 behind a mux; 4, 5 and port B of 0 have none of the kept switches.
    """
    parts = np.array_split(np.array(kept), 4)
    spare = list(others[:4])
    chips = [
        ("mcp23017", 0x20, "", ["GPA0", "GPA1", "GPA2", "GPA5", "GPA6"], "low"),
        ("pca9555", 0x21, "", ["P00", "P07", "P10", "P12", "P17"], "high"),
        ("mcp23008", 0x22, "mux = { address = 0x70, channel = 1 }", ["GP0", "GP2", "GP3", "GP6"], "low"),
        ("pcf8574", 0x27, "mux = { address = 0x70, channel = 4 }", ["P0", "P3", "P6", "P7"], "low"),
        ("mcp23017", 0x24, "", ["GPA0"], "low"),
        ("pca9555", 0x25, "mux = { address = 0x70, channel = 6 }", ["P00"], "low"),
    ]
    text = '[[bus]]\ndevice = "/dev/i2c-7"\nclock_hz = 100000\n'
    for number, (kind, address, mux, pins, closed) in enumerate(chips):
        names = list(parts[number]) if number < 4 else [spare[number - 4]]
        if len(names) > len(pins):
            raise AssertionError(f"{len(kept)} switches are kept: more than this harness has pins for")
        wired = dict(zip(pins, names, strict=False)) | ({"GPB1": spare[2]} if number == 0 else {})
        lines = "".join(f'{pin} = "{name}"\n' for pin, name in wired.items())
        text += (
            f'[[bus.chip]]\nkind = "{kind}"\naddress = {address}\nclosed = "{closed}"\n{mux}\n[bus.chip.pins]\n{lines}'
        )
    return text


def _board(kept: Sequence[str], others: Sequence[str]) -> str:
    """Return a board on whose I2C bus every second switch is one of the kept ones."""
    names = [str(name) for pair in zip(kept, others, strict=False) for name in pair]
    text = f'[[stream]]\nport = "board"\nbaud = 1000000\nrate_hz = 200\nswitches = {names!r}\n[stream.board]\n'
    for number, first in enumerate(range(0, len(names), 16)):
        text += f'[[stream.board.chip]]\nkind = "pca9555"\naddress = {0x20 + number}\n[stream.board.chip.pins]\n'
        pins = enumerate(names[first : first + 16])
        text += "".join(f'P{bit // 8}{bit % 8} = "{name}"\n' for bit, name in pins)
    return text


@pytest.fixture(scope="session")
def harness_of(stage: Stage) -> Callable[..., Harness]:
    """Return what makes a harness of "glove", "board" and "bus"; switches are shared between the latter two."""

    def make(inputs: str, *parts: str, glove: str = "") -> Harness:
        kept = stage.truth(inputs).switch_names
        others = [name for name in stage.performance.switch_names if name not in kept]
        boards = kept[: len(kept) // 3] if "bus" in parts else kept
        text = 'name = "bench"\n'
        text += f'[cyberglove]\nport = "glove"\n{glove}\n' if "glove" in parts else ""
        text += _board(boards, others) if "board" in parts else ""
        text += _bus(kept[len(boards) :] if "board" in parts else kept, others[50:]) if "bus" in parts else ""
        return parse_harness(text, "glove.toml")

    return make


class Scene:
    """Devices on which rows are shown, a run that reads them, and what it has published: `grasps`."""

    def __init__(self, truth: Truth, show: Callable[[list[bool], bytes], None]) -> None:
        self.truth, self._show = truth, show
        self.grasps = Grasps()
        self.shown: list[Shown] = []

    def show(self, row: int) -> None:
        begun_us, played = now_us(), self.truth.performance
        self._show(played.switches[row].tolist(), played.sensors[row].tobytes())
        self.shown.append(Shown(begun_us, now_us(), row))

    def settled(self, row: int, since_us: int = 0) -> LiveGrasp:
        """Wait for the first grasp that is well and whose inputs were all read once `row` had been shown for long."""
        after_us = self.shown[-1].done_us + SETTLE_US
        found = self.grasps.wait(
            lambda grasp: grasp.health == "ok" and oldest_us(grasp) >= after_us, max(since_us, after_us)
        )
        assert found.candidate == found.grasp == self.truth.answer(row), found
        return found

    def well(self, since_us: int, seconds: float = LONG_S) -> LiveGrasp:
        """Wait for the first grasp that is well and of inputs that were read after since_us."""
        return self.grasps.wait(lambda g: g.health == "ok" and oldest_us(g) >= since_us, since_us, seconds)

    def check(self) -> int:
        return self.truth.check(self.grasps.since(0), self.shown)


def oldest_us(grasp: LiveGrasp) -> int:
    """Return when the older of the inputs was read."""
    return grasp.time_us - max(grasp.switch_age_us or 0, grasp.glove_age_us or 0)


def on_bench(stack: ExitStack, scene: Scene, harness: Harness, folder: Path, **how: Any) -> tuple[Bench, Harness]:
    """Put up the devices of a harness, on which the scene's rows are shown; return them, and their harness with the
    calibration of who plays.
    """
    performance, path = scene.truth.performance, folder / "calibration.toml"
    bench = stack.enter_context(Bench(harness, performance.switch_names, folder, **how))
    scene._show, wired = bench.show, bench.harness
    path.write_text(performance.calibration.to_toml())
    if wired.cyberglove is not None:
        wired = replace(wired, cyberglove=replace(wired.cyberglove, calibration=str(path)))
    return bench, wired


@pytest.fixture(scope="session")
def make_scene() -> type[Scene]:
    return Scene


@pytest.fixture(scope="session")
def outage() -> Callable[..., float]:
    """Return what checks that something goes and comes back: it gives the seconds until all was well again."""

    def check(
        scene: Scene,
        fault: Callable[[], object],
        heal: Callable[[], object],
        *,
        lost: set[str],
        period_us: int,
        rows: tuple[int, int] | None = None,
    ) -> float:
        """Show a row; let `fault` happen and show another row; heal.

        Exactly `lost` must come to be missing, and be missing until it is healed: nothing else stops. Then all must be
        well and right again. How soon is printed: in test_recogniser.py the clock is the test's own.
        """
        before, during = rows or (0, 5)
        scene.show(before)
        scene.settled(before)
        fault()
        gone_us = now_us()
        scene.show(during)
        first = scene.grasps.wait(lambda g: g.health != "ok" and set(g.lost) == lost, gone_us)
        # The rest goes on: such grasps come again and again. (A busy computer may be late with the rest for a while.)
        again_us = sure_us = first.time_us + 2 * period_us + SETTLE_US
        for _ in range(AGAIN):
            again_us = scene.grasps.wait(lambda g: set(g.lost) == lost, again_us + 1).time_us
        healed_us = now_us()
        heal()
        back_us = now_us()
        told = [g for g in scene.grasps.since(sure_us) if g.time_us < healed_us]
        assert all(g.health != "ok" and lost <= set(g.lost) for g in told)
        well = scene.well(back_us)
        took_us = well.time_us - back_us
        print(f"missed {(first.time_us - gone_us) / 1000:.1f} ms after, well {took_us / 1000:.1f} ms after")
        scene.settled(during, back_us)
        assert scene.check() > 0
        return took_us / 1e6

    return check
