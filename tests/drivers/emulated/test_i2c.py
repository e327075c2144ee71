import os
import select
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from thenar.drivers.emulated.i2c import EmulatedBus, EmulatedChip, EmulatedI2c
from thenar.drivers.errors import DeviceError, SettingError

from ...conftest import tool

MCP = EmulatedChip("mcp23017", 0x20)

TIMED_READS = """
from time import monotonic
from smbus2 import SMBus, i2c_msg
with SMBus("/dev/i2c-3") as bus:
    pair = i2c_msg.write(0x20, [0x12]), i2c_msg.read(0x20, 2)
    start = monotonic()
    for _ in range(100):
        bus.i2c_rdwr(*pair)
    print(monotonic() - start)
"""

TWO_READS = """
from smbus2 import SMBus, i2c_msg
for device in ("/dev/i2c-3", "/dev/i2c-5"):
    byte = i2c_msg.read(0x20, 1)
    SMBus(device).i2c_rdwr(byte)
    print(*byte)
"""


@pytest.fixture
def umockdev() -> None:
    tool("umockdev-wrapper")


def client(emulated: EmulatedI2c, *command: str) -> str:
    environment = {**os.environ, **emulated.environment}
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True, timeout=30).stdout


@pytest.mark.usefixtures("umockdev")
def test_a_transfer_takes_at_least_as_long_as_on_a_wire() -> None:
    with EmulatedI2c([EmulatedBus("/dev/i2c-3", 100_000, "any", (MCP,))]) as emulated:
        took_s = float(client(emulated, sys.executable, "-c", TIMED_READS))
        seen = emulated.counters(0)
    assert seen.scl_periods == 100 * 48
    assert took_s >= 100 * (48 / 100_000 + 4.7e-6)


@pytest.mark.usefixtures("umockdev")
def test_several_buses_are_served_at_a_time_each_with_its_own_chips() -> None:
    buses = [
        EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,), paced=False),
        EmulatedBus("/dev/i2c-5", 100_000, "i2c-gpio", (EmulatedChip("pcf8574", 0x20),), paced=False),
    ]
    with EmulatedI2c(buses) as emulated:
        emulated.set_all([[0x0000], [0x5A]])
        assert client(emulated, sys.executable, "-c", TWO_READS).split() == ["255", str(0x5A)]  # IODIRA, and the pins
        assert [emulated.counters(bus).total_bytes for bus in range(2)] == [2, 2]


@pytest.mark.usefixtures("umockdev")
def test_programs_that_know_nothing_of_thenar_meet_the_chips_too() -> None:
    program = tool("i2ctransfer")
    with EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,), paced=False)]) as emulated:
        assert client(emulated, program, "-y", "3", "w1@0x20", "0x00", "r1").strip() == "0xff"


@pytest.mark.usefixtures("umockdev")
def test_nothing_stays_behind_when_it_is_closed() -> None:
    emulated = EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,))])
    folder = Path(emulated.environment["UMOCKDEV_DIR"])
    assert (folder / "dev" / "i2c-3").is_symlink()
    emulated.close()
    emulated.close()
    assert not folder.exists()


@pytest.mark.usefixtures("umockdev")
def test_several_threads_may_speak_to_it_at_a_time() -> None:
    buses = [EmulatedBus(f"/dev/i2c-{n}", 400_000, "any", (MCP,), paced=False) for n in range(3, 6)]
    with EmulatedI2c(buses) as emulated, ThreadPoolExecutor(4) as pool:
        for seen in pool.map(emulated.counters, list(range(3)) * 50):
            assert (seen.calls, seen.traffic) == (0, {})


HOST = """
from thenar.drivers.emulated.i2c import EmulatedBus, EmulatedChip, EmulatedI2c
emulated = EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (EmulatedChip("mcp23017", 0x20),))])
print(emulated._server.pid, emulated.environment["UMOCKDEV_DIR"], flush=True)
input()
"""


@pytest.mark.usefixtures("umockdev")
def test_nothing_stays_behind_of_a_program_that_was_killed() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOST], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as host:
        assert host.stdout is not None
        pid, folder = host.stdout.readline().split()
        server = os.pidfd_open(int(pid))
        try:
            host.kill()
            assert select.select([server], [], [], 30.0)[0]
        finally:
            os.close(server)
    assert not Path(folder).exists()


@pytest.mark.usefixtures("umockdev")
def test_nothing_stays_behind_of_a_server_that_was_killed() -> None:
    emulated = EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,))])
    emulated._server.kill()
    with pytest.raises(DeviceError, match="the emulated I2C buses have ended"):
        emulated.counters(0)
    with pytest.raises(DeviceError, match="have ended: create new ones"):
        emulated.counters(0)
    emulated.close()
    assert not Path(emulated.environment["UMOCKDEV_DIR"]).exists()


@pytest.mark.usefixtures("umockdev")
def test_a_server_that_ended_says_why() -> None:
    emulated = EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,))])
    with pytest.raises(DeviceError, match=r"the emulated I2C buses have ended.*IndexError"):
        emulated.fault(0, "reset", 7)
    emulated.close()


def test_a_machine_without_umockdev_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(DeviceError, match="umockdev-wrapper is missing: install the packages umockdev"):
        EmulatedI2c([])


def test_a_chip_that_cannot_be_emulated_is_refused_by_name() -> None:
    bus = EmulatedBus("/dev/i2c-3", 400_000, "any", (EmulatedChip("mcp23s17", 0x20),))
    with pytest.raises(SettingError, match="cannot emulate mcp23s17; supported: mcp23017"):
        EmulatedI2c([bus])


@pytest.mark.usefixtures("umockdev", "hostile_folder")
def test_the_bus_server_imports_no_module_of_the_current_folder() -> None:
    with EmulatedI2c([EmulatedBus("/dev/i2c-3", 400_000, "any", (MCP,))]) as emulated:
        assert emulated.counters(0).transfers == 0
