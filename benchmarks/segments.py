"""The cost of a tick of the segment decoder, with 14 types and none, 10 ms a tick, a lag of 150 ms.

    python benchmarks/segments.py

Prints a table for the usual costs, for those that `thenar compile` learns from the scene continuous-rest, for separate
costs of each type, and for a build without a class "none": Python's us on this machine, cycles on an ATmega328P in
libsimavr, flash, RAM and stack. Every compiled result is compared with Python's.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from firmwarerun import AVR, on_avr, on_core, symbols
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.compiler.firmware.classifier import segment_files
from thenar.compiler.firmware.tools import (
    AVR_COMPILER,
    HOST_COMPILER,
    STRICT,
    call,
    compile_objects,
    find,
    workshop,
)
from thenar.firmware_templates.rendering import file_text
from thenar.runtime.segmenting.decoder import Decoder
from thenar.runtime.segmenting.model import SegmentModel

SCALE = 1000.0
_NAME = "hand"
_SANITIZE = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
Lanes = NDArray[np.int16]
Flags = NDArray[np.bool_]

# It starts when it is called first, and returns a byte alone. `copy` also runs alone, to subtract its cycles.
_PROGRAM = """\
#include "thenar_hand_segments.h"
struct {{ int16_t lanes[{lanes}]; uint8_t best, refused; }} input;
int16_t scores[{lanes}];
uint16_t memory[THENAR_HAND_SEGMENT_MEMORY];
thenar_segmenter stream;
uint8_t copy(void);
uint8_t predict(void);
__attribute__((noinline, noclone)) uint8_t copy(void)
{{
    static bool begun = false;
    if (!begun)
        thenar_segment_start(&stream, &thenar_hand_segment_model, memory);
    begun = true;
    for (uint8_t lane = 0u; lane < {lanes}u; lane++)
        scores[lane] = input.lanes[lane];
    return input.best;
}}
__attribute__((noinline, noclone)) uint8_t predict(void)
{{
    const uint8_t best = copy();
    return thenar_segment_push(&stream, scores, best, input.refused != 0u);
}}
"""
_HOST_MAIN = """
#include <stdio.h>
int main(void)
{
    while (fread(&input, sizeof input, 1, stdin) == 1)
        (void)putchar(predict());
    return fflush(stdout) != 0;
}
"""
_AVR_MAIN = "int main(void) {{ for (;;) (void){}(); }}\n"


@dataclass(frozen=True, slots=True)
class Run:
    """The results of a decoder on an AVR: states, cycles per tick, and bytes of flash, RAM and stack."""

    states: NDArray[np.uint8]
    cycles: NDArray[np.int64]
    flash: int
    ram: int
    stack: int


def records(lanes: Lanes, refused: Flags) -> NDArray[np.uint8]:
    """Return the inputs (n, bytes) of the programs: scores, the number of the best, whether it is rejected."""
    held = np.zeros(len(lanes), [("lanes", "<i2", lanes.shape[1:]), ("best", "u1"), ("refused", "u1")])
    held["lanes"], held["best"], held["refused"] = lanes, lanes.argmax(axis=1), refused
    return held.view(np.uint8).reshape(len(lanes), -1)


def sources(model: SegmentModel, main: str = "") -> dict[str, str]:
    """Return path -> text of a program around the decoder."""
    program = _PROGRAM.format(lanes=model.n_lanes) + main
    return {**segment_files(_NAME, model), "thenar.h": file_text("core/thenar.h"), "program.c": program}


def _compiled(files: Mapping[str, str]) -> list[str]:
    return sorted(path for path in files if path.endswith(".c"))


def _lag(ticks: int) -> str:
    return f"-DTHENAR_HAND_LAG_TICKS={ticks}u"


def run_host(model: SegmentModel, lanes: Lanes, refused: Flags, lag: int) -> NDArray[np.uint8]:
    """Return the states of the decoder on this machine, with sanitizers."""
    files = sources(model, _HOST_MAIN)
    with workshop(files) as folder:
        call([find(HOST_COMPILER), *STRICT, *_SANITIZE, _lag(lag), *_compiled(files), "-o", "program"], folder)
        return np.frombuffer(call([str(folder / "program")], folder, records(lanes, refused).tobytes()), np.uint8)


def run_avr(model: SegmentModel, lanes: Lanes, refused: Flags, lag: int) -> Run:
    """Run the decoder on an ATmega328P in libsimavr; its cycles are those of push() only."""
    runs = []
    for function in ("predict", "copy"):
        files = sources(model, _AVR_MAIN.format(function))
        with workshop(files) as folder:
            command = [find(AVR_COMPILER), f"-mmcu={AVR.part}", "-Os", *STRICT, _lag(lag)]
            objects = compile_objects(command, _compiled(files), folder)
            call([*command, *objects, "-o", "program.elf"], folder)
            runs.append(on_avr(folder, records(lanes, refused), function))
            sizes = call(["avr-size", *(path for path in objects if path != "program.c.o")], folder)
            flash = sum(int(line.split()[0]) + int(line.split()[1]) for line in sizes.decode().splitlines()[1:])
            ram = sum(symbols(folder)[symbol][1] for symbol in ("stream", "memory"))
    timed, copied = runs
    cycles = timed["cycles"].astype(np.int64) - copied["cycles"]
    return Run(timed["returned"].astype(np.uint8), cycles, flash, ram, int(timed["stack"].max()))


def run_core(model: SegmentModel, lanes: Lanes, refused: Flags, lag: int, core: Any) -> NDArray[np.uint8]:
    """Return the states of the decoder on a core of tests/qemu."""
    states, _ = on_core(core, sources(model), records(lanes, refused), (*STRICT, _lag(lag)))
    return states.astype(np.uint8)


def python_states(model: SegmentModel, lanes: Lanes, refused: Flags, lag: int) -> NDArray[np.uint8]:
    """Return the states of Python's decoder, tick by tick."""
    decoder = Decoder(model, lag)
    pairs = zip(lanes.tolist(), refused.tolist(), strict=True)
    return np.array([decoder.push(row, no).state for row, no in pairs], np.uint8)


def random_lanes(ticks: int, lanes: int, seed: int, reach: int) -> Lanes:
    """Return scores that stay about 20 ticks on a level, with noise of a third."""
    random = np.random.default_rng(seed)
    level = np.cumsum(random.random(ticks) < 0.05)
    levels = random.integers(-reach, reach + 1, (ticks + 1, lanes))
    noise = random.integers(-reach // 3 - 1, reach // 3 + 2, (ticks, lanes))
    found: Lanes = np.clip(levels[level] + noise, -32767, 32767).astype(np.int16)
    return found


def models() -> dict[str, SegmentModel]:
    """Return the costs in the table."""
    usual = SegmentModel.usual(14, True, SCALE)
    own = replace(
        usual,
        enter=tuple(60 + 3 * k for k in range(14)),
        direct=tuple(150 - k for k in range(14)),
        leave=tuple(30 + k for k in range(14)),
        stay=(*(k % 4 for k in range(14)), 1),
    )
    enter = (73, 73, 73, 73, 75, 73, 78, 73, 75, 73, 73, 78, 73, 73)
    learnt = SegmentModel(
        shift=8,
        gain=196,
        most=34,
        least=(29,) * 14 + (30,),
        stay=(0,) * 15,
        enter=enter,
        leave=(32,) * 14,
        direct=tuple(cost + 92 for cost in enter),
    )
    without = SegmentModel.usual(14, False, SCALE)
    return {"usual": usual, "learnt": learnt, "each type its own": own, "no class none": without}


def main() -> None:
    """Print the table."""
    print("costs             | Python us: median, 99 % | AVR cycles: mean, most | flash | RAM + stack | differing")
    for name, model in models().items():
        lag, ticks = 150_000 // model.tick_us, 4000
        lanes = np.concatenate([random_lanes(ticks, model.n_lanes, seed, 10**seed) for seed in (2, 3, 4)])
        refused = np.random.default_rng(1).random(len(lanes)) < 0.1
        decoder, took = Decoder(model, lag), []
        for row, no in zip(lanes.tolist(), refused.tolist(), strict=True):
            began = time.perf_counter_ns()
            decoder.push(row, no)
            took.append((time.perf_counter_ns() - began) / 1000)
        run, expected = run_avr(model, lanes, refused, lag), python_states(model, lanes, refused, lag)
        python = f"{np.median(took):10.1f}, {np.percentile(took, 99):10.1f}"
        print(
            f"{name:17} | {python:23} | {run.cycles.mean():8.0f}, {run.cycles.max():12,} | {run.flash:5,} | "
            f"{run.ram:3} + {run.stack:5} | {np.count_nonzero(run.states != expected)} of {len(expected)}"
        )


if __name__ == "__main__":
    main()
