"""Lines that the user types while something else goes on."""

import os
import select

import click


class TypedLines:
    """Whole lines from a descriptor, without waiting for them."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def take(self) -> str | None:
        """Return the next line, stripped, or None if none is complete yet. Raises click.ClickException at the end."""
        if b"\n" not in self._rest and select.select([self._descriptor], [], [], 0.0)[0]:
            typed = os.read(self._descriptor, 4096)
            if not typed:
                raise click.ClickException("the input ended before all was answered: nothing is written")
            self._rest += typed
        line, end, rest = self._rest.partition(b"\n")
        if not end:
            return None
        self._rest = rest
        return line.decode("utf-8", "replace").strip()
