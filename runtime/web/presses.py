"""Keys pressed on a page that several browsers may have open."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from typing import Generic, TypeVar

from thenar.drivers.errors import SettingError

Key = TypeVar("Key", bound=Enum)


class Presses(Generic[Key]):
    """Passes keys from the server's thread to the thread of the state machine.

    A press names the step that it was meant for: one that arrives too late, because another browser was quicker or
    something happened in between, has no effect.
    """

    def __init__(self, keys: type[Key]) -> None:
        self._keys = keys
        self._pressed: deque[tuple[int, Key]] = deque(maxlen=64)

    def take(self, asked: Mapping[str, object]) -> None:
        """Take a message of a page. Raises SettingError if it is not a press."""
        step, names = asked.get("step"), [key.value for key in self._keys]
        if asked["do"] not in names or type(step) is not int:
            raise SettingError(f"this page presses {', '.join(names)}, each at a step")
        self._pressed.append((step, self._keys(asked["do"])))

    def due(self, step: Callable[[], int]) -> Iterator[Key]:
        """Yield the keys pressed since the last call for `step()`, which every press may change."""
        while self._pressed:
            meant, key = self._pressed.popleft()
            if meant == step():
                yield key
