"""Keys that are pressed on a page which several browsers may have open."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from typing import Generic, TypeVar

from thenar.drivers.errors import SettingError

Key = TypeVar("Key", bound=Enum)


class Presses(Generic[Key]):
    """Keys from the server's thread for the one that has the state machine.

    A press says at which step of it it was meant: one that comes too late, because another browser was quicker or
    something happened meanwhile, does nothing.
    """

    def __init__(self, keys: type[Key]) -> None:
        self._keys = keys
        self._pressed: deque[tuple[int, Key]] = deque(maxlen=64)

    def take(self, asked: Mapping[str, object]) -> None:
        """Take a message of a page. Raises SettingError for one that is no press."""
        step, names = asked.get("step"), [key.value for key in self._keys]
        if asked["do"] not in names or type(step) is not int:
            raise SettingError(f"this page presses {', '.join(names)}, each at a step")
        self._pressed.append((step, self._keys(asked["do"])))

    def due(self, step: Callable[[], int]) -> Iterator[Key]:
        """Yield what was pressed since the last time and is meant for `step()`, which every press may change."""
        while self._pressed:
            meant, key = self._pressed.popleft()
            if meant == step():
                yield key
