import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.tools import call, compile_objects, find, lacking, workshop

from ...conftest import tool

NOWHERE = (("no-such-compiler", "nor-this-one"), "no-such-package")
SHELL = (("no-such-shell", "sh"), "dash")


def test_what_is_missing_is_named_with_its_packages() -> None:
    wanted = "no-such-compiler or nor-this-one not found; Debian: apt-get install no-such-package"
    assert lacking(SHELL, NOWHERE) == wanted
    with pytest.raises(FirmwareError, match=f"^{wanted}$"):
        find(NOWHERE)


def test_a_workshop_that_cannot_be_written_is_an_error_that_says_where() -> None:
    with pytest.raises(FirmwareError, match=r"/a/b cannot be written: File exists"), workshop({"a": "", "a/b": ""}):
        pass


def test_where_no_folder_can_be_made_is_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(FirmwareError, match="no temporary folder: No such file or directory"), workshop({}):
        pass


def test_a_failing_call_is_an_error_with_what_it_said(tmp_path: Path) -> None:
    with pytest.raises(FirmwareError, match=r"^sh ended with 3: alas$"):
        call(["sh", "-c", "echo printed; echo alas >&2; exit 3"], tmp_path)
    with pytest.raises(FirmwareError, match=r"^sh ended with 3: printed$"):
        call(["sh", "-c", "echo printed; exit 3"], tmp_path)
    with pytest.raises(FirmwareError, match=r"^false ended with 1: without a message$"):
        call(["false"], tmp_path)


def test_a_hanging_call_is_stopped_and_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FirmwareError, match=r"^sleep was stopped, since it had not ended after 0\.2 s$"):
        call(["sleep", "600"], tmp_path, limit_s=0.2)


def test_what_cannot_be_started_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FirmwareError, match=r"^nothing cannot be started: No such file or directory$"):
        call([str(tmp_path / "nothing")], tmp_path)


INTERRUPTED = """
import sys
import tempfile
from thenar.compiler.firmware.tools import call, workshop
with workshop({"held": "held"}) as folder:
    call(["sh", "-c", 'echo "$PWD" > "$0"; exec sleep 600', sys.argv[1]], folder)
"""


def test_the_workshop_is_removed_after_ctrl_c_too(tmp_path: Path) -> None:
    started, temporary = tmp_path / "started", tmp_path / "temporary"
    os.mkfifo(started)
    temporary.mkdir()
    environment = os.environ | {"TMPDIR": str(temporary)}
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(started)], env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        folder = Path(started.read_text().strip())
        assert (folder.parent, folder.exists()) == (temporary, True)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in said
    assert list(temporary.iterdir()) == []


def test_what_was_compiled_of_the_same_texts_is_not_compiled_again(tmp_path: Path) -> None:
    tool("gcc")
    compiler = tmp_path / "compiler"
    compiler.write_text(f'#!/bin/sh\necho "$*" >> {tmp_path}/calls\nexec gcc "$@"\n')
    compiler.chmod(0o755)
    texts = {"a.c": '#include "a.h"\nint a = B;\n', "a.h": '#include "b.h"\n', "b.h": "#define B 1\n"}
    for command, changes in (
        ([], {}),
        ([], {}),
        ([], {"b.h": "#define B 2\n"}),
        (["-O2"], {}),
        ([], {"a.c": "int a;\n"}),
        ([], {}),
    ):
        with workshop(texts | changes | {"main.c": "int main(void) { return 0; }\n"}) as folder:
            objects = compile_objects([str(compiler), *command], ["a.c", "main.c"], folder)
            call(["gcc", *objects, "-o", "program"], folder)
    done = [line.split() for line in (tmp_path / "calls").read_text().splitlines()]
    assert [words[:-2] for words in done if "a.c" in words] == [["-c", "a.c"]] * 2 + [
        ["-O2", "-c", "a.c"],
        ["-c", "a.c"],
    ]
    with workshop({"a.c": "int a = 1.5f +;\n"}) as folder, pytest.raises(FirmwareError, match="compiler ended with 1"):
        compile_objects([str(compiler)], ["a.c"], folder)
