"""Programs around one function, `int predict(void)`, which reads the bytes `input`, on an emulated ATmega328P and on
emulated cores of 32 bits.
"""

import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.avr import harness
from thenar.compiler.firmware.tools import call

AVR = TARGETS["avr328p"]
QEMU = Path(__file__).parents[1] / "tests" / "qemu"
sys.path.append(str(QEMU))
CORES = import_module("qemu").CORES
# Prints what a function of one instruction and then what each frame took.
MAIN = """
#include <stdbool.h>
#include <stdint.h>
#include "semihosting.h"
#include "ticks.h"
extern uint8_t input[BYTES];
int predict(void);
void thenar_fault(void);
void thenar_fault(void) { for (;;) semihosting_exit(true); }
__attribute__((naked)) static int nothing(void) { __asm volatile("bx lr"); }
static uint32_t said[2];
__attribute__((noinline, noclone)) static void run(int (*function)(void))
{
    const uint32_t before = ticks_left();
    said[0] = (uint32_t)function();
    said[1] = (before - ticks_left()) & TICKS_MOST;
}
int main(void)
{
    const uint32_t frames = semihosting_open("frames", 6, SEMIHOSTING_RB);
    const uint32_t predictions = semihosting_open("predictions", 11, SEMIHOSTING_WB);
    start_ticking();
    run(nothing);
    do {
        (void)semihosting_write(predictions, said, sizeof said);
    } while (semihosting_read(frames, input, sizeof input) && (run(predict), true));
    semihosting_exit(false);
    return 0;
}
"""


def symbols(folder: Path) -> dict[str, tuple[int, int]]:
    """Return address and size of the symbols in the folder's `program.elf`."""
    words = [line.split() for line in call(["avr-nm", "-P", "program.elf"], folder).decode().splitlines()]
    return {word[0]: (int(word[2], 16), int(word[3], 16) if len(word) > 3 else 0) for word in words if len(word) > 2}


def on_avr(folder: Path, frames: NDArray[np.uint8], function: str = "predict") -> NDArray[Any]:
    """Run the folder's `program.elf` in libsimavr: what `function` returns for frames (n, F), its cycles and stack."""
    at = {name: f"{address:#x}" for name, (address, _) in symbols(folder).items()}
    places = [at[function], at["_end"], f"{at['input']}:{frames.shape[1]}", f"{at['input']}:1"]
    command = [str(harness("simavr_classify")), AVR.part, str(AVR.clock_hz), "program.elf", *places]
    record = np.dtype([("echo", "u1"), ("returned", "<u2"), ("cycles", "<u4"), ("stack", "<u2")])
    return np.frombuffer(call(command, folder, frames.tobytes()), record)


def on_core(
    core: Any, files: Mapping[str, str], frames: NDArray[np.uint8], flags: Sequence[str] = ("-w",)
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Return the results of `predict` for frames (n, F) on a core of tests/qemu, and the instructions that it takes."""
    main = {"main.c": MAIN.replace("BYTES", str(frames.shape[1])), "ticks.h": (QEMU / "ticks.h").read_text()}
    written = core.emulate({**files, **main, "frames": frames.tobytes()}, flags=flags)
    found = np.frombuffer(written, np.dtype([("returned", "<u4"), ("ticks", "<u4")]))
    return found["returned"][1:], core.instructions(found["ticks"][1:], int(found["ticks"][0]))
