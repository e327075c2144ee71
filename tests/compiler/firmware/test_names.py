"""Names of every kind that the one rule lets in, in all the C that is made of them."""

import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.names import fault

from ...conftest import tool
from ...tables import describe
from .conftest import make_tables

PIECES = [
    "*/",
    "/*",
    "//",
    "??/",
    "\\",
    '"',
    "'",
    "%s",
    "%n",
    "{{",
    "}}",
    "{%",
    "#error",
    "$(shell x)",
    "`",
    "<b>",
    "é",
]
HOSTILE = st.lists(st.sampled_from(PIECES) | st.text(max_size=3), min_size=1, max_size=60).map("".join)
NAMES = HOSTILE.filter(lambda name: not fault(name))
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only")


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(names=st.lists(NAMES, min_size=12, max_size=12, unique=True), thenar=NAMES)
def test_whatever_names_hold_the_c_compiles_without_a_warning(tmp_path: Path, names: list[str], thenar: str) -> None:
    tables = make_tables(classes=5, switches=5, joints=2)
    plain, layout = describe(tables), Layout(tables)
    manifest = replace(
        plain,
        thenar=thenar,
        grasps=tuple(names[:5]),
        switches=tuple(replace(switch, name=name) for switch, name in zip(plain.switches, names[5:10], strict=True)),
        joints=tuple(replace(joint, name=name) for joint, name in zip(plain.joints, names[10:], strict=True)),
    )
    library = Library("hand", manifest, layout, notes=tuple(names))
    files = TARGETS["host"].files(library)
    arduino = TARGETS["arduino"].files(library)
    plainly = TARGETS["arduino"].files(Library("hand", plain, layout))
    for name, text in (files | arduino).items():
        assert text.isascii(), name
        assert all(line.isprintable() or name == "Makefile" for line in text.replace("\t", " ").splitlines()), name
    assert len(arduino["README.md"].splitlines()) == len(plainly["README.md"].splitlines())
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    sources = sorted(name for name in files if name.endswith(".c"))
    done = subprocess.run([tool("gcc"), *STRICT, *sources], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    # The sketch needs Arduino's headers to compile: its comments are all that names may change.
    sketches = [made["examples/Recognise/Recognise.ino"] for made in (arduino, plainly)]
    uncommented = ["".join(piece.partition("*/")[2] for piece in f"*/{text}".split("/*")) for text in sketches]
    assert uncommented[0] == uncommented[1]
