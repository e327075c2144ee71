"""The folder of a classifier for a Cortex-M, but for the classifier itself."""

from collections.abc import Sequence

from thenar.firmware_templates.rendering import render

from .layout import Layout
from .machines import machine_of
from .self_test import CHECKS, check_header
from .targets import Target

STACK = 512  # bytes that the linker keeps free: main() and an answer take less

_CORES = {"cortex-m0plus": "Cortex-M0+", "cortex-m4": "Cortex-M4"}


def cortex_files(name: str, layout: Layout, target: Target, grasps: Sequence[str]) -> dict[str, str]:
    """Return path -> text: Makefile (program, self test in qemu, size, flash), start-up, linker script and main()."""
    machine = machine_of(target)
    values = {"name": name, "core": _CORES[target.part]}
    return {
        "Makefile": render("cortex_m/Makefile.j2", **values, part=target.part, machine=machine.name),
        "main.c": render("cortex_m/main.c.j2", **values, checks=CHECKS),
        f"thenar_{name}_check.h": check_header(name, layout, grasps),
        **bare_files(target.flash, target.ram),
    }


def bare_files(flash: int, ram: int) -> dict[str, str]:
    """Return path -> text of what a bare Cortex-M with so many bytes of flash (at 0) and RAM (at 0x20000000) needs."""
    memory = {"flash_origin": "0x00000000", "flash": flash, "ram_origin": "0x20000000", "ram": ram}
    return {
        "link.ld": render("cortex_m/link.ld.j2", **memory, stack=STACK),
        "startup.c": render("cortex_m/startup.c.j2"),
        "semihosting.h": render("cortex_m/semihosting.h.j2"),
    }
