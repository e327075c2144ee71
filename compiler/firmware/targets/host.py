"""The target host, this machine: portable C, compiled by gcc or clang and run with sanitizers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thenar.firmware_templates.rendering import render

from ..tools import HOST_COMPILER, STRICT, call, compile_objects, find, lacking, workshop
from .base import Target

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

# With sanitizers -O1, as their manuals advise: -O2 takes half as long again to compile.
_SANITIZED = ("-O1", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@dataclass(frozen=True, kw_only=True)
class Host(Target):
    """A machine with an operating system and a C compiler."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, a Makefile (library, self test, size) and the self test."""
        from ..probes import CHECKS, check_header

        return {
            **library.whole,
            "Makefile": render("host/Makefile.j2", name=library.name, sources=library.sources),
            "check.c": render("host/check.c.j2", name=library.name, checks=CHECKS),
            f"thenar_{library.name}_check.h": check_header(library.name, library.layout),
        }

    def sources(self, library: "Library") -> dict[str, str]:
        """Return the classifier and the decoder of segments, for `run`."""
        return library.files | library.segments

    def missing(self) -> str | None:
        """Return how to install a compiler if there is none."""
        return lacking(HOST_COMPILER)

    def run(
        self, files: Mapping[str, str], name: str, layout: "Layout", frames: "Frames", *, lost: "Lost | None" = None
    ) -> "Predictions":
        """Return the predictions for frames (n, F), as in the base class.

        A finding of the address and undefined behaviour sanitizers is an error.
        """
        from ..probes import answers_in, record_files, sent_frames

        sent = sent_frames(frames, lost, layout).tobytes()
        command = find(self.compiler or HOST_COMPILER)
        segments = f"thenar_{name}_segments.c" in files
        main = record_files(name, layout, "host", lost=lost is not None, segments=segments)
        with workshop({**files, **main}) as folder:
            sources = sorted(path for path in (*files, *main) if path.endswith(".c"))
            objects = compile_objects([command, *STRICT, *_SANITIZED], sources, folder)
            call([command, *_SANITIZED, *objects, "-o", "classifier"], folder)
            return answers_in(call([str(folder / "classifier")], folder, sent), len(frames), layout)


MEMBER = Host(
    name="host",
    part="host",
    title="this machine",
    help="a library for this machine, with a Makefile and a self test",
    next_step="`make -C {folder} check` compiles and tests it",
    rank=0,
    carried=True,
    kind="host",
)
