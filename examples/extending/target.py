"""A firmware target of your own: the classifier as one header for C++20, as header-only libraries are."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thenar.compiler.firmware.targets import Target

if TYPE_CHECKING:
    from thenar.compiler.firmware.classifier import Library

HEADER = """\
// {name}.hpp: include it where it is used; define {switch} before, in one of these files.
#pragma once

{declared}
#ifdef {switch}
{defined}#endif
"""


@dataclass(frozen=True, kw_only=True)
class SingleHeader(Target):
    """A package of one file, for any part that has a C++ compiler."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library's header and sources in one."""
        name = f"thenar_{library.name}"
        declared, defined = (
            re.sub(r'#include "thenar.*\n', "", "\n".join(library.files[part] for part in parts))
            for parts in (("thenar.h", f"{name}.h"), ("thenar_block.h", "thenar.c", f"{name}.c"))
        )
        switch = f"{name.upper()}_IMPLEMENTATION"
        return {f"{name}.hpp": HEADER.format(name=name, switch=switch, declared=declared, defined=defined)}


MEMBER = SingleHeader(
    name="cpp",
    part="cpp",
    help="one header for C++20",
    next_step="copy {folder}/*.hpp to where your compiler finds it",
    flash=256 << 10,
    ram=64 << 10,
)
