"""The bare core underneath a program: memory as C expects it, and an end that is heard."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.bare import STACK, Bare

CORES = {name: core for name, core in TARGETS.items() if isinstance(core, Bare)}
ARM = [name for name, core in CORES.items() if core.architecture == "arm"]
RAM_FIRST = 0x20000000

MEMORY = """
#include "semihosting.h"

#define AGAIN ((volatile uint32_t *)%(ram)#xu + 1024) /* between the variables and the stack */
void thenar_reset(void);

static uint32_t zero[300];
static uint32_t initial[3] = {1u, 0x80000000u, 77u};
static uint8_t odd = 9u;
static const char text[] = "in flash";

int main(void)
{
    bool right = initial[0] == 1u && initial[1] == 0x80000000u && initial[2] == 77u && odd == 9u;

    for (unsigned i = 0; i < 300u; ++i) {
        right = right && zero[i] == 0u;
        zero[i] = 5u;
    }
    right = right && (uintptr_t)text - %(flash)#xu < 0x10000u && (uintptr_t)initial - %(ram)#xu < 0x2000u;
    right = right && (uintptr_t)&right - %(ram)#xu < 0x2000u;
    initial[0] = 2u;
    odd = 3u;
    right = right && initial[0] == 2u && odd == 3u;
    if (right && !*AGAIN) { /* an emulator's memory starts as zero: once more, with memory that does not */
        *AGAIN = 1u;
        thenar_reset();
    }
    semihosting_print(right ? "right\\n" : "wrong\\n");
    semihosting_exit(!right);
    return 0;
}
"""


def memory(part: str) -> str:
    machine = CORES[part].machine
    return MEMORY % {"flash": machine.flash_at, "ram": machine.ram_at}


@pytest.fixture
def compiled(tool: Callable[[str], str], tmp_path: Path) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Return what compiles a main.c for a part with so much flash and RAM, to program.elf; optimised as `optimise`."""

    def compiled(main: str, part: str, flash: int = 65536, ram: int = 8192, optimise: str = "-O2") -> Result:
        core = CORES[part]
        for name, text in {**core.bare_files(flash, ram), "main.c": main}.items():
            (tmp_path / name).write_text(text)
        strict = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
        bare = [*core.flags, optimise, "-nostdlib", "-T", "link.ld"]
        command = [tool(f"{core.prefix}gcc"), *strict, *bare, "main.c", "startup.c", "-lgcc", "-o", "program.elf"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)

    return compiled


@pytest.fixture
def emulated(
    tool: Callable[[str], str], compiled: Callable[..., "Result"], tmp_path: Path
) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Return what compiles a main.c for a part and runs it in qemu."""

    def emulated(main: str, part: str, **how: object) -> Result:
        made = compiled(main, part, **how)
        assert (made.returncode, made.stderr) == (0, "")
        quiet = ["-display", "none", "-monitor", "none", "-serial", "none"]
        host = ["-semihosting-config", "enable=on,target=native", "-kernel", "program.elf"]
        core = CORES[part]
        command = [tool(core.emulator[0][0]), "-M", core.machine.name, *quiet, *host]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)

    return emulated


Result = subprocess.CompletedProcess[str]
Run = Callable[..., Result]


@pytest.mark.parametrize("optimise", ["-O0", "-O2", "-Os"])
@pytest.mark.parametrize("part", list(CORES))
def test_main_finds_its_variables_as_c_promises(emulated: Run, part: str, optimise: str) -> None:
    done = emulated(memory(part), part, optimise=optimise)
    assert (done.returncode, done.stderr) == (0, "right\n")


COPYING = """
#include "semihosting.h"

struct large { uint8_t bytes[200]; };
static struct large from, to;

int main(void)
{
    volatile uint8_t *inside = from.bytes;

    for (unsigned i = 0; i < 200u; ++i) {
        inside[i] = (uint8_t)(i + 1u);
    }
    to = from;
    from = (struct large){{0}};
    bool right = true;
    for (unsigned i = 0; i < 200u; ++i) {
        right = right && to.bytes[i] == (uint8_t)(i + 1u) && inside[i] == 0u;
    }
    semihosting_exit(!right);
    return 0;
}
"""


@pytest.mark.parametrize("part", list(CORES))
def test_what_the_compiler_copies_and_clears_needs_no_library(emulated: Run, part: str) -> None:
    assert emulated(COPYING, part, optimise="-Os").returncode == 0


HEARD = """
#include "semihosting.h"
#ifdef __riscv
#define SYSTEM_CALL "ecall"
#define UNDEFINED "unimp"
#else
#define SYSTEM_CALL "svc #0"
#define UNDEFINED "udf #0"
#endif

void thenar_fault(void);
void thenar_fault(void)
{
    semihosting_print("faulted\\n");
    semihosting_exit(true);
}

int main(void)
{
    %s
    return 0;
}
"""
ENDS = {
    "undefined_instruction": "__asm volatile(UNDEFINED);",
    "system_call": "__asm volatile(SYSTEM_CALL);",
    "no_memory": "*(volatile uint32_t *)0x5ffffff0u = 1u;",
    "return": "",
}


@pytest.mark.parametrize("end", list(ENDS))
@pytest.mark.parametrize("part", list(CORES))
def test_every_exception_and_a_return_from_main_end_in_the_fault_handler(emulated: Run, part: str, end: str) -> None:
    done = emulated(HEARD % ENDS[end], part)
    assert (done.returncode, done.stderr) == (1, "faulted\n")


@pytest.mark.parametrize("part", ARM)
def test_without_a_handler_of_its_own_a_fault_locks_the_core_up(emulated: Run, part: str) -> None:
    done = emulated("int main(void) { return 0; }\n", part)
    assert done.returncode != 0
    assert "Lockup" in done.stderr


FILES = """
#include "semihosting.h"

int main(void)
{
    static char held[6];
    const uint32_t from = semihosting_open("from", 4, SEMIHOSTING_RB);
    const uint32_t to = semihosting_open("to", 2, SEMIHOSTING_WB);
    const uint32_t none = semihosting_open("none", 4, SEMIHOSTING_RB);
    bool right = from != UINT32_MAX && to != UINT32_MAX && none == UINT32_MAX;

    right = right && semihosting_read(from, held, 6) && semihosting_write(to, held + 1, 4);
    right = right && !semihosting_read(from, held, 6); /* three are left */
    semihosting_exit(!right);
    return 0;
}
"""


@pytest.mark.parametrize("part", list(CORES))
def test_files_are_read_and_written_whole_or_said_not_to_be(emulated: Run, tmp_path: Path, part: str) -> None:
    (tmp_path / "from").write_bytes(b"abc\x00efghi")
    assert emulated(FILES, part).returncode == 0
    assert (tmp_path / "to").read_bytes() == b"bc\x00e"


def test_a_program_that_leaves_no_room_for_the_stack_does_not_link(compiled: Run) -> None:
    main = "static volatile unsigned char taken[{}];\nint main(void) {{ return taken[0]; }}\n"
    assert compiled(main.format(8192 - STACK), "cortex-m4").returncode == 0
    full = compiled(main.format(8192 - STACK + 4), "cortex-m4")
    assert full.returncode == 1
    assert f"less than {STACK} bytes of RAM are left for the stack" in full.stderr


def test_a_program_that_does_not_fit_the_flash_does_not_link(compiled: Run) -> None:
    main = "static const volatile unsigned char held[65536] = {1};\nint main(void) { return held[0]; }\n"
    assert "region `FLASH' overflowed" in compiled(main, "cortex-m4").stderr


def test_the_vector_table_stands_first_with_the_end_of_ram_as_stack(
    tool: Callable[[str], str], compiled: Run, tmp_path: Path
) -> None:
    assert compiled(memory("cortex-m0plus"), "cortex-m0plus", ram=4096).returncode == 0
    objcopy = tool("arm-none-eabi-objcopy")
    subprocess.run([objcopy, "-O", "binary", "program.elf", "program.bin"], cwd=tmp_path, check=True, timeout=60)
    image = (tmp_path / "program.bin").read_bytes()
    words = [int.from_bytes(image[at : at + 4], "little") for at in range(0, 64, 4)]
    assert words[0] == RAM_FIRST + 4096
    assert {number for number, word in enumerate(words) if word == 0} == {7, 8, 9, 10, 13}
    assert all(word % 2 == 1 and word < 65536 for word in words[1:] if word), "code in flash, in Thumb"
