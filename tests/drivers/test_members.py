"""The registry of the members of a kind: thenar's own in their order, then those of other packages."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

from thenar.drivers.errors import SettingError
from thenar.drivers.members import Members, MembersByName


@dataclass(frozen=True)
class Sort:
    name: str
    rank: int = 0


class Kind:
    """The base of a registry of classes."""

    name: ClassVar[str] = "kind"


def write_package(folder: Path, **modules: str) -> None:
    """Write a package of modules that define members of the classes Sort and Kind."""
    folder.mkdir()
    (folder / "__init__.py").touch()
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(f"from test_members import Kind, Sort\n{text}\n")


def write_distribution(folder: Path, name: str, kinds: Sequence[str] = ("sorts", "chips"), **points: str) -> None:
    """Write the metadata of a distribution with the same entry points for some kinds of members, as pip does."""
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = "".join(f"{point} = {value}\n" for point, value in points.items())
    (metadata / "entry_points.txt").write_text("".join(f"[thenar.{kind}]\n{lines}" for kind in kinds))


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder on the path of imports."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "test_members", sys.modules[__name__])
    return tmp_path


@pytest.fixture
def members(site: Path, request: pytest.FixtureRequest) -> Callable[..., Members[Sort]]:
    """Return what makes the registry of a package of these modules."""

    def made(**modules: str) -> Members[Sort]:
        package = f"package_of_{request.node.name.partition('[')[0]}"
        write_package(site / package, **modules)
        return Members("sort", Sort, package, "thenar.sorts")

    return made


OTHER = "from test_members import Sort\nONE = Sort('one')\nTWO = Sort('two')\nNONE = 3\n"


def test_members_come_by_rank_then_name(
    members: Callable[..., Members[Sort]],
) -> None:
    found = members(
        a="MEMBER = Sort('late', 2), Sort('b')", b="MEMBER = Sort('early', -1)", c="", d="MEMBER = Sort('a')"
    )
    assert list(found) == ["early", "a", "b", "late"]
    assert (len(found), found["late"].rank, found.named("a")) == (4, 2, Sort("a"))


def test_members_of_other_packages_come_last_by_entry_point(site: Path, members: Callable[..., Members[Sort]]) -> None:
    (site / "other_last.py").write_text(OTHER)
    write_distribution(site, "somebody", b="other_last:ONE", a="other_last:TWO")
    assert list(members(a="MEMBER = Sort('z', 9)")) == ["z", "two", "one"]


def test_an_unknown_name_is_answered_with_all_members(members: Callable[..., Members[Sort]]) -> None:
    with pytest.raises(SettingError, match="there is no sort 'x': choose one of a, b"):
        members(a="MEMBER = Sort('b'), Sort('a')").named("x")


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("other_bad:ONE", "two packages define the sort 'one': uninstall one of them"),
        ("no_such_module:ONE", "cannot be loaded: No module named 'no_such_module'; fix or uninstall it"),
        ("other_bad:THREE", "cannot be loaded: module 'other_bad' has no attribute 'THREE'; fix or uninstall it"),
        ("other_bad:NONE", r"the sort 'b' \(other_bad:NONE\) of another package is not a Sort: docs/how-to/extend.md"),
    ],
)
def test_an_invalid_foreign_member_is_refused_in_a_sentence(
    site: Path, members: Callable[..., Members[Sort]], value: str, said: str
) -> None:
    (site / "other_bad.py").write_text(OTHER)
    write_distribution(site, "somebody", b=value)
    registry = members(a="MEMBER = Sort('one')")
    with pytest.raises(SettingError, match=said):
        list(registry)


def test_a_foreign_class_derives_from_the_base_of_its_registry(site: Path) -> None:
    write_package(site / "package_of_classes", own="MEMBER = type('Own', (Kind,), {'name': 'own'})")
    (site / "other_classes.py").write_text("class Stranger: ...\n")
    registry: Members[type[Kind]] = Members("sort", type, "package_of_classes", "thenar.sorts", base=Kind)
    write_distribution(site, "somebody", b="other_classes:Stranger")
    with pytest.raises(SettingError, match=r"is not a class derived from Kind: docs/how-to/extend\.md"):
        list(registry)


@pytest.fixture
def by_name(site: Path, request: pytest.FixtureRequest) -> MembersByName[Sort]:
    """Return the registry of a package that defines the sorts "sort.grip" and "sort.object_pose"."""
    package = f"package_of_{request.node.name.partition('[')[0]}"
    names = ("sort.object_pose", "sort.grip")
    write_package(site / package, **{name.replace(".", "_"): f"MEMBER = Sort({name!r})" for name in names})
    return MembersByName("sort", Sort, package, "thenar.sorts")


def imported() -> set[str]:
    """Return which of the modules of the next test are imported."""
    return {"sort_grip", "sort_object_pose", "other_joint"} & {name.rpartition(".")[2] for name in sys.modules}


def test_names_are_listed_without_an_import_and_a_member_is_imported_alone(
    site: Path, by_name: MembersByName[Sort]
) -> None:
    (site / "other_joint.py").write_text("from test_members import Sort\nMEMBER = Sort('joint.offset')\n")
    write_distribution(
        site, "somebody", **{"joint.offset": "other_joint:MEMBER", "joint.lost": "no_such_module:MEMBER"}
    )
    assert list(by_name) == ["sort.grip", "sort.object_pose", "joint.lost", "joint.offset"]
    assert (len(by_name), "sort.grip" in by_name, "sort_grip" in by_name) == (4, True, False)
    with pytest.raises(SettingError, match=r"there is no sort 'x': choose one of sort.grip, sort.object_pose, joint"):
        by_name.named("x")
    assert imported() == set()
    assert by_name["sort.object_pose"] == Sort("sort.object_pose")
    assert imported() == {"sort_object_pose"}
    assert by_name.named("joint.offset") == Sort("joint.offset")
    assert imported() == {"sort_object_pose", "other_joint"}
    with pytest.raises(SettingError, match=r"'joint.lost' .* cannot be loaded: No module named 'no_such_module'; fix"):
        by_name["joint.lost"]


def test_taken_and_missing_member_names_are_refused(site: Path, by_name: MembersByName[Sort]) -> None:
    (site / "other_misnamed.py").write_text(OTHER)
    write_distribution(site, "somebody", **{"joint.one": "other_misnamed:ONE"})
    with pytest.raises(SettingError, match=r"'joint.one' .* has a different name, 'one': give its entry point"):
        by_name["joint.one"]
    write_distribution(site, "another", **{"sort.grip": "other_misnamed:ONE"})
    taken = MembersByName("sort", Sort, by_name.package, "thenar.sorts")
    with pytest.raises(SettingError, match=r"two packages define the sort 'sort.grip': uninstall one of them"):
        list(taken)


def thenar(site: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run a command where the distributions of a folder are installed."""
    path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-P", "-m", "thenar.cli", *words]
    return subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("value", ["no_such_module:MEMBER", "json:dumps"])
def test_a_command_says_so_and_exits_with_2(tmp_path: Path, value: str) -> None:
    write_distribution(tmp_path, "somebody", odd=value)
    done = thenar(tmp_path, "compile", "--help")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"thenar: the I2C chip 'odd' ({value}) of another package")
    assert done.stderr.count("\n") == 1


def test_what_is_broken_stops_no_command_that_does_not_need_it(tmp_path: Path) -> None:
    kinds = ("methods", "trainers", "targets", "chips", "sinks", "sources")
    write_distribution(tmp_path, "somebody", kinds, odd="no_such_module:MEMBER")
    done = thenar(tmp_path, "--help")
    assert (done.returncode, done.stderr) == (0, "")
