"""The folder of a classifier for this machine, but for the classifier itself."""

from collections.abc import Sequence

from thenar.firmware_templates.rendering import render

from .layout import Layout
from .self_test import CHECKS, check_header


def host_files(name: str, layout: Layout, grasps: Sequence[str]) -> dict[str, str]:
    """Return path -> text: a Makefile (library, self test, size) and the self test of the classifier `name`
    of the types `grasps`.
    """
    return {
        "Makefile": render("host/Makefile.j2", name=name),
        "check.c": render("host/check.c.j2", name=name, checks=CHECKS),
        f"thenar_{name}_check.h": check_header(name, layout, grasps),
    }
