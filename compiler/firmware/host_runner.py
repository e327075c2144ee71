"""The compiled classifier on this machine: every frame through a small program that gcc or clang makes of it."""

from collections.abc import Mapping
from dataclasses import replace

from .answers import Answers, Frames, answers_from, check_frames, names_in
from .layout import Layout
from .record import record_files
from .targets import Target
from .tools import HOST_COMPILER, STRICT, call, find, workshop

SANITIZE = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def run(
    files: Mapping[str, str],
    name: str,
    layout: Layout,
    target: Target,
    frames: Frames,
    *,
    incremental: bool = False,
    compiler: str | None = None,
    sanitize: bool = False,
) -> Answers:
    """Return what the classifier `name` in `files` (file name -> text, not for AVR) answers to frames (n, F).

    incremental  each answer comes from update(), the change since the frame before, instead of classify();
                 switches are then set by set_switch()
    compiler     "gcc" or "clang"; without it, the first that is installed
    sanitize     with the address and undefined behaviour sanitizers: a finding is an error

    Raises FirmwareError if there is no compiler, or the files do not compile without any warning, or do not run.
    """
    check_frames(frames, layout)
    command = find(HOST_COMPILER if compiler is None else ((compiler,), compiler))
    main = record_files(name, layout, "host", "update" if incremental else "classify")
    with workshop({**files, **main}) as folder:
        sources = sorted(path for path in (*files, *main) if path.endswith(".c"))
        call([command, *STRICT, "-O2", *(SANITIZE if sanitize else ()), *sources, "-o", "classifier"], folder)
        names, printed = names_in(call([str(folder / "classifier")], folder, frames.tobytes()), layout)
        return replace(answers_from(printed, frames, layout), names=names)
