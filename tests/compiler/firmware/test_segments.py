"""The decoder of segments in C, of any costs: the same states as Python's, tick by tick, on every part."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import segment_files
from thenar.compiler.firmware.generate import firmware_files
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.package import Package
from thenar.compiler.firmware.tools import call, workshop
from thenar.runtime.segmenting.model import SegmentModel

from ...tables import describe
from .conftest import make_tables

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"
LAG = 15


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the benchmark's module, which compiles and runs the decoder."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module("segments")


def _random_model(seed: int) -> SegmentModel:
    """Return costs that differ from state to state, with some shortest durations in common, and all shifts in turn."""
    random = np.random.default_rng(seed)
    n_types = int(random.choice([1, 2, 5, 14, 14, 20]))
    shift, many = seed % 9, seed % 5 == 0
    gain = int(random.integers(128, 256)) if shift else int(random.integers(100, 700))
    most = max(1, min(int(random.integers(1, 255)), 255 * gain >> 8))

    def costs(highest: int) -> tuple[int, ...]:
        return tuple(random.integers(0, highest, n_types).tolist())

    return SegmentModel(
        shift=shift,
        gain=gain,
        most=most,
        least=tuple(random.integers(1, 16 if many else 4, n_types + 1).tolist()),
        stay=(*costs(9), int(random.integers(0, 9))),
        enter=costs(3 * most),
        leave=(7,) * n_types if seed % 2 else costs(3 * most),
        direct=costs(5 * most),
        refusal=None if seed % 3 else int(random.integers(0, 200)),
    )


def _hostile(model: SegmentModel, ticks: int, seed: int) -> np.ndarray:
    """Return scores that dwell, jump from end to end of their range, tie, and lie at the limits of what is clipped."""
    random = np.random.default_rng(seed)
    ends = random.choice([-32767, 32767, 0, 1], (ticks, model.n_lanes))
    limit = min(-(-model.most * 256 // model.gain) << model.shift, 32767)
    edges = random.choice([-limit, 1 - limit, -1 - limit, 0], (ticks, model.n_lanes)).clip(-32767, 32767)
    slow = np.repeat(random.choice([-32767, 32767], (ticks // 9 + 1, model.n_lanes)), 9, axis=0)[:ticks]
    return np.concatenate([ends, edges, slow]).astype(np.int16)


def _lanes(runs: Any, model: SegmentModel, ticks: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    reaches = (max(2, 60 * 256 // model.gain << model.shift), 20_000)
    calm = [runs.random_lanes(ticks, model.n_lanes, seed, min(reach, 32_000)) for reach in reaches]
    lanes = np.concatenate([*calm, _hostile(model, ticks // 2, seed)])
    return lanes, (np.random.default_rng(seed).random(len(lanes)) < 0.2) & (model.refusal is not None)


# Seeds 0 to 8 have every shift, every lag, and types of common and of other costs to leave.
@pytest.mark.parametrize("seed", range(9))
def test_on_this_machine_it_is_pythons_state_at_every_tick(runs: Any, seed: int) -> None:
    model, lag = _random_model(seed), (1, 5, 15, 40, 250)[seed % 5]
    lanes, refused = _lanes(runs, model, 800, seed)
    expected = runs.python_states(model, lanes, refused, lag)
    np.testing.assert_array_equal(runs.run_host(model, lanes, refused, lag), expected)


@pytest.mark.parametrize(
    "seed", [0, 1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3, 4, 5, 6, 8, 9))]
)
def test_on_an_avr_it_is_pythons_state_at_every_tick(runs: Any, avr: None, seed: int) -> None:
    model, lag = _random_model(seed), (1, 5, 15, 30, 60)[seed % 5]
    lanes, refused = _lanes(runs, model, 250, seed)
    expected = runs.python_states(model, lanes, refused, lag)
    np.testing.assert_array_equal(runs.run_avr(model, lanes, refused, lag).states, expected)


@pytest.mark.slow
@pytest.mark.parametrize("core", ["cortex-m0plus", "cortex-m4"])
def test_on_arms_cores_it_is_pythons_state_at_every_tick(runs: Any, cores: Any, core: str) -> None:
    for model in (_random_model(5), runs.models()["each type its own"]):
        lanes, refused = _lanes(runs, model, 250, 1)
        expected = runs.python_states(model, lanes, refused, LAG)
        np.testing.assert_array_equal(runs.run_core(model, lanes, refused, LAG, cores[core]), expected)


def test_the_segment_decoder_takes_the_documented_avr_cycles_and_memory(runs: Any, avr: None) -> None:
    """Cycles of a simulated part are no times: they are the same on every machine."""
    for name in ("usual", "learnt", "each type its own", "no class none"):
        ram = 1050 if name == "learnt" else 468
        model = runs.models()[name]
        lanes, refused = _lanes(runs, model, 300, 1)
        run = runs.run_avr(model, lanes, refused, LAG)
        assert run.cycles.max() <= 7900
        assert run.flash <= 2200
        assert run.ram <= ram
        assert run.stack <= 44


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_firmware_of_builds_with_segment_costs_includes_the_decoder(avr: None, target: str) -> None:
    tables = make_tables()
    manifest = replace(describe(tables), segments=SegmentModel.usual(tables.n_classes, False, tables.scale))
    files = firmware_files(tables, manifest, target)
    plain = firmware_files(tables, describe(tables), target)
    if target == "micropython":
        assert "class Segmenter:" in files["thenar_glove.py"]
        return
    more = {path.rsplit("/", 1)[-1] for path in files.keys() - plain.keys()}
    assert more >= {"thenar_glove_segments.h", "thenar_glove_segments.c"}
    if isinstance(TARGETS[target], Package):
        assert "/src/thenar_glove_segments.c\n" in files["CMakeLists.txt"]
        return
    if "Makefile" not in files:
        return
    with workshop(files) as folder:
        call(["make", "all"], folder)
        assert (folder / "thenar_glove_segments.o").is_file()


def test_more_types_than_a_byte_numbers_are_refused() -> None:
    assert segment_files("hand", SegmentModel.usual(254, True, 9.0))
    with pytest.raises(FirmwareError, match="255 grasp types: the segment decoder takes at most 254"):
        segment_files("hand", SegmentModel.usual(255, True, 9.0))
