import re
import subprocess
from pathlib import Path

import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import CORE_FILES
from thenar.compiler.firmware.costs import fit_for
from thenar.compiler.firmware.generate import SUMS, firmware_files, sums, write_folder
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build

from ...conftest import tool
from ...tables import describe
from ..conftest import content
from .conftest import make_tables

COMPILERS = {"avr": "avr-gcc", "host": "gcc"}


def classifier(build: Build, platform: str) -> dict[str, str]:
    return firmware_files(build.tables, build.manifest, platform)


def make(folder: Path, *arguments: str) -> str:
    strict = "CFLAGS=-Os -Werror"
    done = subprocess.run(["make", "-C", str(folder), strict, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
    return done.stdout


@pytest.mark.parametrize("platform", [name for name in TARGETS if name.startswith(tuple(COMPILERS))])
def test_the_folder_of_a_classifier_compiles_without_a_warning_and_tests_itself(
    build: Build, platform: str, tmp_path: Path
) -> None:
    tool(COMPILERS[next(kind for kind in COMPILERS if platform.startswith(kind))])
    folder = write_folder(classifier(build, platform), tmp_path / "firmware")
    make(folder)
    assert "text" in make(folder, "size")
    if not platform.startswith("avr"):
        assert "\n18 frames, predicted as by Python\n" in make(folder, "check")
    make(folder, "clean")
    assert {path.name for path in folder.iterdir()} == {*classifier(build, platform), "SHA256SUMS"}


@pytest.mark.parametrize("platform", TARGETS)
def test_files_are_called_by_the_name_and_no_name_is_rewritten(build: Build, platform: str) -> None:
    files = firmware_files(build.tables, build.manifest, platform, name="anne_2")
    assert any("thenar_anne_2" in path or "thenar_anne_2" in text for path, text in files.items())
    own = {path: text for path, text in files.items() if path.removeprefix("src/") not in CORE_FILES}
    assert not any("thenar_glove" in path or "thenar_glove" in text for path, text in own.items())
    with pytest.raises(FirmwareError, match="'Anne' cannot be the name"):
        firmware_files(build.tables, build.manifest, platform, name="Anne")


@pytest.mark.parametrize(("switches", "joints", "words"), [(9, 0, "9 switches"), (0, 3, "3 joints")])
def test_nobody_reads_of_inputs_that_there_are_none_of(switches: int, joints: int, words: str) -> None:
    tables = make_tables(switches=switches, joints=joints)
    files = classifier(Build(describe(tables), tables), "arduino")
    for path in ("src/thenar_glove.h", "README.md", "library.properties"):
        assert re.search(rf"grasp types\s+from {words} of a glove", files[path]), path


def test_a_part_is_never_chosen_beyond_its_flash(build: Build) -> None:
    fit = fit_for(TARGETS["arduino"], build.tables, 1 << 20)
    assert fit.target.part == "atmega328p"


@pytest.mark.slow
def test_a_build_too_large_for_an_uno_gets_a_larger_part() -> None:
    tables = make_tables(classes=40, switches=40, joints=12, bins=30)
    build = Build(describe(tables), tables)
    assert fit_for(TARGETS["arduino"], build.tables).target.part == "atmega2560"
    for classes, bins, part in ((60, 60, "cortex-m4"), (90, 60, "host")):
        huge = make_tables(classes=classes, switches=60, joints=20, bins=bins)
        assert fit_for(TARGETS["arduino"], huge).target.part == part
    huge = make_tables(classes=200, switches=60, joints=20, bins=60)
    with pytest.raises(FirmwareError, match="firmware has at most 65535"):
        _ = fit_for(TARGETS["arduino"], huge)


OLD = {"thenar_glove.c": "old\n", "examples/one/one.ino": "old\n", "gone.h": "old\n"}
NEW = {"thenar_glove.c": "new\n", "examples/one/one.ino": "new\n", "Makefile": "all:\n"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(OLD, tmp_path / "firmware")


def test_a_new_or_empty_folder_takes_the_files_and_their_sums(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty"):
        folder = write_folder(NEW, tmp_path / name)
        assert content(folder) == {**NEW, SUMS: sums(NEW)}
        subprocess.run([tool("sha256sum"), "--check", "--strict", "--quiet", SUMS], cwd=folder, check=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "new"]


def test_what_was_changed_since_is_not_replaced(folder: Path) -> None:
    (folder / "thenar_glove.c").write_text("better\n")
    with pytest.raises(FirmwareError, match=r"thenar_glove\.c was changed since thenar wrote it"):
        write_folder(NEW, folder, overwrite=True)
    assert (folder / "thenar_glove.c").read_text() == "better\n"


@pytest.mark.parametrize("name", [SUMS, "thenar_glove.c"])
def test_a_link_to_what_never_ends_is_refused_unread(folder: Path, name: str) -> None:
    (folder / name).unlink()
    (folder / name).symlink_to("/dev/zero")
    with pytest.raises(FirmwareError, match="is a device or a pipe"):
        write_folder(NEW, folder, overwrite=True)


def test_a_folder_of_somebody_elses_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "firmware").mkdir()
    (tmp_path / "firmware" / "main.c").write_text("mine")
    with pytest.raises(FirmwareError, match="is not empty and was not written by thenar"):
        write_folder(NEW, tmp_path / "firmware", overwrite=True)
    assert content(tmp_path / "firmware") == {"main.c": "mine"}
