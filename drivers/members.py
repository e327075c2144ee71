"""Registries: all members of one kind, from thenar and from other packages."""

import importlib
from collections.abc import Container, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from .errors import SettingError
from .names import shortened

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


class Named(Protocol):
    """The interface of every registry member: a name by which users choose it."""

    @property
    def name(self) -> str:
        """The name, as the command line spells it."""
        ...


M = TypeVar("M", bound=Named)


class Members(Mapping[str, M], Generic[M]):
    """All members of a kind by name: those of a folder in its order, then those of entry points by name.

    Each module of the folder may define `MEMBER`, one object or a tuple of objects. Another package adds a member with
    an entry point in `group` that names the object::

        [project.entry-points."thenar.chips"]
        max7301 = "my_package.max7301:CHIP"

    Nothing is imported before the first use.

    Parameters
    ----------
    kind : str
        The word for a member in messages, such as "chip".
    shape : type
        The class of all members.
    package : str
        The folder's import name.
    group : str
        The group of entry points.
    base : type, optional
        What all members, which are classes, derive from.

    Raises
    ------
    SettingError
        On use, if a member of another package cannot be imported, is not a `shape`, or has a name that is taken.
    """

    def __init__(self, kind: str, shape: type[M], package: str, group: str, base: type | None = None) -> None:
        self.kind, self.shape, self.package, self.group, self.base = kind, shape, package, group, base

    @cached_property
    def _members(self) -> dict[str, M]:
        found: dict[str, M] = {}
        for module in self._modules():
            defined = getattr(importlib.import_module(f"{self.package}.{module}"), "MEMBER", ())
            for member in defined if isinstance(defined, tuple) else (defined,):
                found[member.name] = member
        found = dict(sorted(found.items(), key=lambda item: (getattr(item[1], "rank", 0), item[0])))
        for point in self._points():
            member = self._loaded(point)
            self._check_free(member.name, found)
            found[member.name] = member
        return found

    def _modules(self) -> list[str]:
        from pkgutil import iter_modules  # as below

        return sorted(info.name for info in iter_modules(importlib.import_module(self.package).__path__))

    def _points(self) -> "list[EntryPoint]":
        # Imported only where members are needed: it takes a third as long as everything else.
        from importlib.metadata import entry_points

        return sorted(entry_points(group=self.group), key=lambda point: point.name)

    def _check_free(self, name: str, taken: Container[str]) -> None:
        if name in taken:
            raise SettingError(f"two packages define the {self.kind} {shortened(name)!r}: uninstall one of them")

    def _where(self, point: "EntryPoint") -> str:
        return f"the {self.kind} {shortened(point.name)!r} ({shortened(point.value)}) of another package"

    def _loaded(self, point: "EntryPoint") -> M:
        try:
            member: object = point.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            # str() of a SystemExit is only its number.
            what = str(error) if isinstance(error, Exception) else repr(error)
            said = f"cannot be loaded: {shortened(what)}; fix or uninstall it"
            raise SettingError(f"{self._where(point)} {said}") from error
        derives = self.base is None or (isinstance(member, type) and issubclass(member, self.base))
        if not (isinstance(member, self.shape) and derives):
            wanted = f"a {self.shape.__name__}" if self.base is None else f"a class derived from {self.base.__name__}"
            said = f"is not {wanted}: docs/how-to/extend.md says what to define"
            raise SettingError(f"{self._where(point)} {said}")
        return member

    def __getitem__(self, name: str) -> M:
        return self._members[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def named(self, name: str) -> M:
        """Return a member. Raises SettingError, which lists all names, if there is none of that name."""
        if name not in self:
            raise SettingError(f"there is no {self.kind} {shortened(name)!r}: choose one of {', '.join(self)}")
        return self[name]


class MembersByName(Members[M]):
    """Members that are imported one by one on first use: listing their names imports none.

    The module hand_object_pose of the folder defines the member "hand.object_pose" as `MEMBER`. A member of another
    package has the name of its entry point. Names come in alphabetical order, those of other packages last.

    Raises
    ------
    SettingError
        On use, if a name is taken. On access to a member of another package, if it cannot be imported, is not a
        `shape`, or has a different name from its entry point.
    """

    @cached_property
    def _places(self) -> "dict[str, EntryPoint | None]":
        """Entry points by member name; None for members of the folder."""
        places: dict[str, EntryPoint | None] = {module.replace("_", ".", 1): None for module in self._modules()}
        for point in self._points():
            self._check_free(point.name, places)
            places[point.name] = point
        return places

    def __getitem__(self, name: str) -> M:
        point = self._places[name]
        if point is None:
            member: M = importlib.import_module(f"{self.package}.{name.replace('.', '_')}").MEMBER
            return member
        member = self._loaded(point)
        if member.name != name:
            said = f"has a different name, {shortened(member.name)!r}: give its entry point that name"
            raise SettingError(f"{self._where(point)} {said}")
        return member

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)
