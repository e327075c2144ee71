"""A compiled classifier, run where its target can be run: on this machine, or in an emulator of the microcontroller."""

from collections.abc import Mapping

from . import avr_harness, avr_runner, cortex_runner, host_runner
from .answers import Answers, Frames
from .layout import Layout
from .targets import Target
from .tools import ARM_COMPILER, ARM_EMULATOR, HOST_COMPILER, lacking

__all__ = ["Answers", "run", "toolchain_missing"]

_RUNNERS = {"host": host_runner.run, "avr": avr_runner.run, "cortex-m": cortex_runner.run}


def run(
    files: Mapping[str, str],
    name: str,
    layout: Layout,
    target: Target,
    frames: Frames,
    *,
    incremental: bool = False,
) -> Answers:
    """Return what the classifier `name` answers to frames (n, F), uint8 as `layout.frame_bytes` makes them.

    files        of `classifier_files(name, manifest, layout, avr=target.kind == "avr")`: file name -> text
    incremental  each answer comes from update(), the change since the frame before, instead of classify()

    Raises FirmwareError if a tool is missing, or the files do not compile without any warning, do not fit, or do not
    run.
    """
    return _RUNNERS[target.kind](files, name, layout, target, frames, incremental=incremental)


def toolchain_missing(target: Target) -> str | None:
    """Return what keeps code for `target` from being compiled and run here, and what to install; None if nothing."""
    match target.kind:
        case "host":
            return lacking(HOST_COMPILER)
        case "cortex-m":
            return lacking(ARM_COMPILER, ARM_EMULATOR)
        case "avr":
            return avr_harness.missing()
