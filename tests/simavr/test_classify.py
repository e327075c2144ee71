import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

PARTS = ("atmega328p", "atmega2560")
OUTPUT = 2
RECORD = np.dtype([("output", "<u2"), ("returned", "<u2"), ("cycles", "<u4"), ("stack", "<u2")])


def in_assembly(body: str) -> str:
    return f"""
#include <avr/io.h>
.comm input, 2
.comm output, 2
.global function
function:
    {body}
    ret
callee:
    ret
.global main
main:
    call function
    rjmp main
"""


class Measure:
    """Runs `function` of a program on frames of two bytes."""

    def __init__(self, program: Path, compiled: Callable[..., Path]) -> None:
        self._program, self._compiled = program, compiled

    def command(self, text: str, part: str) -> list[str]:
        elf = self._compiled(text, part, ".S")
        listed = subprocess.run(["avr-nm", str(elf)], check=True, capture_output=True, text=True).stdout.splitlines()
        found = {line.split()[-1]: "0x" + line.split()[0] for line in listed}
        spans = f"{found['input']}:2", f"{found['output']}:{OUTPUT}"
        return [str(self._program), part, "16000000", str(elf), found["function"], found["_end"], *spans]

    def __call__(self, text: str, part: str, frames: bytes) -> np.ndarray:
        command = self.command(text, part)
        done = subprocess.run(command, input=frames, check=True, capture_output=True, timeout=60)
        return np.frombuffer(done.stdout, RECORD)


@pytest.fixture
def measure(program: Callable[[str], Path], compiled: Callable[..., Path]) -> Measure:
    return Measure(program("simavr_classify"), compiled)


# Of the data sheet's instruction set summary. The larger part has program addresses of three bytes: calls take longer.
CYCLES = {
    "nop": 1,
    "mul r18, r19": 2,
    "movw r18, r20": 1,
    "lds r18, input": 2,
    "sts output, r18": 2,
    "ldi r30, 0\n ldi r31, 1\n lpm r0, Z+": 1 + 1 + 3,
    "ldi r30, 0\n ldi r31, 1\n lpm": 1 + 1 + 3,
    "ldi r30, 0\n ldi r31, 2\n ld r0, Z+": 1 + 1 + 2,
    "ldi r30, 0\n ldi r31, 2\n ldd r0, Z+3": 1 + 1 + 2,
    "push r18\n pop r18": 2 + 2,
    "adiw r24, 1": 2,
    "sbiw r24, 1": 2,
    "subi r24, 1": 1,
    "in r18, 0x3f": 1,
    "sbi 0x05, 1": 2,
    "clz\n breq .+2\n nop": 1 + 1 + 1,
    "sez\n breq .+2\n nop": 1 + 2,
    "set\n bld r18, 0\n sbrs r18, 0\n nop": 1 + 1 + 2,
    "set\n bld r18, 0\n sbrs r18, 0\n lds r19, input": 1 + 1 + 3,
    "rjmp .+0": 2,
    "1: jmp 2f\n 2:": 3,
}
CALLS = {"rcall callee": {"atmega328p": 3 + 4, "atmega2560": 4 + 5}, "call callee": {"atmega328p": 8, "atmega2560": 10}}
RETURN = {"atmega328p": 4, "atmega2560": 5}


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("body", [*CYCLES, *CALLS], ids=lambda body: "_".join(body.split()))
def test_instructions_take_the_cycles_of_the_data_sheet(measure: Measure, body: str, part: str) -> None:
    wanted = CALLS[body][part] if body in CALLS else CYCLES[body]
    measured = measure(in_assembly(body), part, bytes(4))["cycles"]
    assert measured.tolist() == [wanted + RETURN[part]] * 2


def test_what_is_no_whole_frame_is_not_answered(measure: Measure) -> None:
    assert len(measure(in_assembly("nop"), PARTS[0], bytes(5))) == 2
    assert len(measure(in_assembly("nop"), PARTS[0], b"")) == 0


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("pushed", [0, 1, 17])
def test_the_stack_of_a_function_is_what_it_and_its_callees_push(measure: Measure, pushed: int, part: str) -> None:
    body = "clr r18\n" + "push r18\n" * pushed + "rcall callee\n" + "pop r18\n" * pushed
    address = 2 if part == "atmega328p" else 3
    measured = measure(in_assembly(body), part, bytes(40))["stack"]
    assert measured.max() == pushed + 2 * address


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (in_assembly("1: rjmp 1b"), "frame 0: the function does not return within 5000000 cycles"),
        (in_assembly("nop").replace("call function", "nop"), "the program does not call the function"),
        (in_assembly("cli\n sleep"), "the program stopped at"),
    ],
    ids=["hangs", "never called", "stops"],
)
def test_a_program_that_does_not_answer_is_an_error_in_one_line(measure: Measure, text: str, said: str) -> None:
    command = measure.command(text, PARTS[0])
    done = subprocess.run(command, input=bytes(2), capture_output=True, timeout=60, check=False)
    assert done.returncode == 2
    assert said in done.stderr.decode()
    assert done.stderr.count(b"\n") == 1


def test_arguments_that_are_wrong_are_an_error_in_one_line(program: Callable[[str], Path], tmp_path: Path) -> None:
    junk = tmp_path / "junk.elf"
    junk.write_text("no program")
    command = [str(program("simavr_classify")), "atmega328p", "16000000"]
    for arguments, said in (
        ([], "usage"),
        ([str(tmp_path / "none.elf"), "0", "0", "0:1", "0:1"], "cannot be read"),
        ([str(junk), "0", "0", "0:1", "0:1"], "no program for an AVR"),
    ):
        done = subprocess.run([*command, *arguments], capture_output=True, timeout=60, check=False)
        assert (done.returncode, said in done.stderr.decode()) == (2, True), done.stderr
