import os
from pathlib import Path

import pytest

from thenar.compiler.artifact import CompileError
from thenar.compiler.artifact.compile import check_target, publish

OLD = {"build.json": b"old", "tables.bin": b"old"}
NEW = {"build.json": b"new", "tables.bin": b"new", "ensemble.bin": b"new"}


# A build that carries firmware.
FIRM = {**OLD, "firmware/thenar_glove.c": b"old", "firmware/thenar_glove.h": b"old"}
# One with its report and the spec of its glove.
TOLD = {**FIRM, "report.html": b"old", "spec/spec.json": b"old", "spec/cutting.svg": b"old"}


def _content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _fill(folder: Path, files: dict[str, bytes]) -> None:
    folder.mkdir()
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)


@pytest.mark.parametrize("before", [None, {}, OLD, FIRM, TOLD])
def test_a_build_takes_its_place_and_leaves_nothing_beside_it(tmp_path: Path, before: dict[str, bytes] | None) -> None:
    if before is not None:
        _fill(tmp_path / "build", before)
    for files in (NEW, FIRM, TOLD, NEW):
        publish(files, check_target(tmp_path / "build"))
        assert _content(tmp_path / "build") == files
        assert [path.name for path in tmp_path.iterdir()] == ["build"]


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"notes.txt": b"mine"}, "is not empty and not a build"),
        ({**OLD, "notes.txt": b"mine"}, r"holds notes\.txt, which is not part of a build"),
        ({**FIRM, "firmware/main.c": b"mine"}, r"holds firmware/main\.c, which is not part of a build"),
        ({**TOLD, "spec/notes.txt": b"mine"}, r"holds spec/notes\.txt, which is not part of a build"),
        ({**OLD, "firmware": b"mine"}, r"holds firmware, which is not part of a build"),
        ({**OLD, "thenar_glove.c": b"mine"}, r"holds thenar_glove\.c, which is not part of a build"),
    ],
)
def test_a_users_files_are_never_deleted(tmp_path: Path, files: dict[str, bytes], reason: str) -> None:
    _fill(tmp_path / "build", files)
    with pytest.raises(CompileError, match=reason):
        check_target(tmp_path / "build")


def test_a_folder_named_like_a_builds_file_is_foreign(tmp_path: Path) -> None:
    _fill(tmp_path / "build", {"build.json": b"old"})
    _fill(tmp_path / "build" / "tables.bin", {"notes.txt": b"mine"})
    with pytest.raises(CompileError, match=r"holds tables\.bin, which is not part of a build"):
        check_target(tmp_path / "build")


def test_a_link_named_like_a_builds_folder_is_foreign(tmp_path: Path) -> None:
    _fill(tmp_path / "build", OLD)
    _fill(tmp_path / "mine", {"thenar_glove.c": b"mine"})
    (tmp_path / "build" / "firmware").symlink_to(tmp_path / "mine")
    with pytest.raises(CompileError, match=r"holds firmware, which is not part of a build"):
        check_target(tmp_path / "build")
    assert _content(tmp_path / "mine") == {"thenar_glove.c": b"mine"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_parent_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(CompileError, match="is not writable"):
            check_target(tmp_path / "build")
    finally:
        tmp_path.chmod(0o755)


def test_leftovers_of_a_killed_spec_publication_are_cleared(tmp_path: Path) -> None:
    _fill(tmp_path / "build", TOLD)
    (tmp_path / "build" / ".spec.01234567.part" / "part").mkdir(parents=True)
    (tmp_path / "build" / ".spec.01234567.part" / "part" / "bom.csv").write_bytes(b"ne")
    publish(NEW, check_target(tmp_path / "build"))
    assert _content(tmp_path / "build") == NEW
