"""Registries: the members of one kind of thing, thenar's own and those of other packages."""

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import entry_points
from typing import Generic, Protocol, TypeVar

from .errors import ThenarError
from .names import shortened


class MemberError(ThenarError, ValueError):
    """A member of a registry that there is not, or that cannot be loaded."""


class Named(Protocol):
    """What every member of a registry has: the name by which people choose it."""

    @property
    def name(self) -> str:
        """The name, as the command line spells it."""
        ...


M = TypeVar("M", bound=Named)


class Members(Mapping[str, M], Generic[M]):
    """All members of a kind by their names: those of a folder, in its order, then those of entry points, by name.

    Each module of the folder that defines `MEMBER`, one object or a tuple of several, adds what it defines. Another
    package adds a member with an entry point in `group`, that names the object::

        [project.entry-points."thenar.chips"]
        max7301 = "my_package.max7301:CHIP"

    Nothing is imported before the first use.

    Parameters
    ----------
    kind : str
        What a member is called in messages: "chip".
    shape : type
        The class of all members.
    package : str
        The folder's import name.
    group : str
        The group of entry points.

    Raises
    ------
    MemberError
        On use, if a member of another package cannot be imported, is no `shape`, or has a name that is taken.
    """

    def __init__(self, kind: str, shape: type[M], package: str, group: str) -> None:
        self.kind, self.shape, self.package, self.group = kind, shape, package, group

    @cached_property
    def _members(self) -> dict[str, M]:
        found: dict[str, M] = {}
        folder = importlib.import_module(self.package)
        for module in sorted(info.name for info in pkgutil.iter_modules(folder.__path__)):
            defined = getattr(importlib.import_module(f"{self.package}.{module}"), "MEMBER", ())
            for member in defined if isinstance(defined, tuple) else (defined,):
                found[member.name] = member
        found = dict(sorted(found.items(), key=lambda item: (getattr(item[1], "rank", 0), item[0])))
        for point in sorted(entry_points(group=self.group), key=lambda point: point.name):
            member = self._loaded(point.name, point.value, point.load)
            if member.name in found:
                raise MemberError(f"two packages define the {self.kind} {member.name!r}: uninstall one of them")
            found[member.name] = member
        return found

    def _loaded(self, name: str, value: str, load: object) -> M:
        where = f"the {self.kind} {shortened(name)!r} ({shortened(value)}) of another package"
        try:
            member = load() if callable(load) else None
        except Exception as error:
            raise MemberError(f"{where} cannot be loaded: {shortened(str(error))}; mend or uninstall it") from error
        if not isinstance(member, self.shape):
            raise MemberError(f"{where} is no {self.shape.__name__}: docs/extending.md says what one defines")
        return member

    def __getitem__(self, name: str) -> M:
        return self._members[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def named(self, name: str) -> M:
        """Return a member. Raises MemberError, which lists all names, if there is none of that name."""
        if name not in self._members:
            raise MemberError(f"there is no {self.kind} {shortened(name)!r}: choose one of {', '.join(self._members)}")
        return self._members[name]
