import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from thenar.drivers.emulated.i2c import AdapterKind, EmulatedBus, EmulatedChip, EmulatedI2c
from thenar.drivers.emulated.i2c_wire import Place

from ...conftest import tool

DEVICE = "/dev/i2c-7"
CLIENT = Path(__file__).with_name("bus_client.py")


class Client:
    """An I2cBus in a process of its own, which sees the emulated nodes."""

    def __init__(self, emulated: EmulatedI2c, chips: tuple[EmulatedChip, ...], check_every_s: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, CLIENT],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **emulated.environment},
        )
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([DEVICE, [asdict(chip) for chip in chips], check_every_s]) + "\n")

    def ask(self, verb: str, *arguments: Any) -> Any:
        answer, error = self._tell(verb, *arguments)
        assert error is None, error
        return answer

    def fails(self, verb: str, *arguments: Any) -> str:
        """Return the error that it must come to."""
        _, error = self._tell(verb, *arguments)
        assert error is not None, f"{verb} worked"
        return str(error)

    def state(self) -> SimpleNamespace:
        state = self.ask("state")
        state["chips"] = [SimpleNamespace(**chip) for chip in state["chips"]]
        return SimpleNamespace(**state)

    def kill(self) -> None:
        """As SIGKILL does in the middle of a run."""
        self._process.kill()
        self._process.communicate(timeout=10)

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.communicate(timeout=10)
            assert self._process.returncode == 0

    def _tell(self, verb: str, *arguments: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([verb, *arguments]) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


class Rig:
    """A glove's chips on an emulated bus, and a client that reads them."""

    def __init__(
        self, stack: ExitStack, emulated: EmulatedI2c, chips: tuple[EmulatedChip, ...], every_s: float
    ) -> None:
        self._stack, self._chips, self._every_s = stack, chips, every_s
        self.emulated = emulated
        self.client = self.another_client()

    def another_client(self) -> Client:
        client = Client(self.emulated, self._chips, self._every_s)
        self._stack.callback(client.close)
        return client

    def traffic(self) -> Mapping[Place, int]:
        """Bytes so far by address, mux, channel and register."""
        return self.emulated.counters(0).traffic


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[Callable[..., Rig]]:
    """Return what makes a rig of chips (kind, address[, mux, channel]) on an adapter, with the bus open."""
    tool("umockdev-wrapper")
    with ExitStack() as stack:

        def make(
            *places: tuple[Any, ...], adapter: AdapterKind = "any", check_every_s: float = 1.0, opened: bool = True
        ) -> Rig:
            chips = tuple(EmulatedChip(*place) for place in places)
            emulated = stack.enter_context(EmulatedI2c([EmulatedBus(DEVICE, 400_000, adapter, chips, paced=False)]))
            made = Rig(stack, emulated, chips, check_every_s)
            if opened:
                made.client.ask("open")
            return made

        yield make
