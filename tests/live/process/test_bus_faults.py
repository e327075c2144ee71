"""What goes wrong on an I2C bus under a run."""

import errno
from collections.abc import Callable
from typing import Any

import pytest

MakeRun = Callable[..., Any]
Outage = Callable[..., float]
Do = Callable[[Any], object]

pytestmark = pytest.mark.slow

# Of the bus: less would take a busy computer for a cut cable.
PERIOD_US = 10_000
# Numbers and addresses of the harness's chips.
STRAIGHT, BEHIND = 1, 2
PCA9555, MCP23008, MUX = 0x21, 0x22, 0x70


def everything_on_the_bus(running: Any) -> set[str]:
    return set(running.bus_names(0, 1, 2, 3))


LASTING: dict[str, tuple[Do, tuple[int, ...]]] = {
    "a chip answers nobody": (lambda i2c: i2c.fault(0, "remove", STRAIGHT), (1,)),
    "a chip behind the mux answers nobody": (lambda i2c: i2c.fault(0, "remove", BEHIND), (2,)),
    "the mux answers nobody": (lambda i2c: i2c.fault(0, "remove_mux", MUX), (2, 3)),
    "EIO at a chip": (lambda i2c: i2c.fault(0, "fail", errno.EIO, address=PCA9555), (1,)),
    "EREMOTEIO at a chip behind the mux": (lambda i2c: i2c.fault(0, "fail", errno.EREMOTEIO, address=MCP23008), (2,)),
    "ETIMEDOUT at a chip": (lambda i2c: i2c.fault(0, "fail", errno.ETIMEDOUT, address=PCA9555), (1,)),
    "EIO everywhere": (lambda i2c: i2c.fault(0, "fail", errno.EIO), (0, 1, 2, 3)),
    "ETIMEDOUT everywhere": (lambda i2c: i2c.fault(0, "fail", errno.ETIMEDOUT), (0, 1, 2, 3)),
    "SDA held low": (lambda i2c: i2c.fault(0, "hold_sda"), (0, 1, 2, 3)),
}


@pytest.mark.parametrize("fault", list(LASTING))
def test_what_cannot_be_read_is_missed_and_comes_back(run: MakeRun, outage: Outage, fault: str) -> None:
    running = run("both", "glove", "bus")
    scene, client, i2c = running.scene, running.start(), running.bench.i2c
    do, chips = LASTING[fault]
    scene.settled(0)
    held = client.held
    lost = running.bus_names(*chips)
    outage(scene, lambda: do(i2c), lambda: i2c.fault(0, "heal"), lost=lost, period_us=PERIOD_US)
    outage(scene, lambda: do(i2c), lambda: i2c.fault(0, "heal"), lost=lost, period_us=PERIOD_US)
    assert client.held == held
    assert client.count("i2c", "failures") > 0
    assert client.end() == 0


def test_an_adapter_that_is_pulled_out_is_missed_and_found_again(run: MakeRun, outage: Outage) -> None:
    running = run("both", "glove", "board", "bus")
    scene, client, i2c = running.scene, running.start(), running.bench.i2c
    scene.settled(0)
    held = client.held
    lost = everything_on_the_bus(running)
    for _ in range(2):
        outage(scene, lambda: i2c.unplug(0), lambda: i2c.replug(0), lost=lost, period_us=PERIOD_US)
    assert client.held == held
    assert client.end() == 0


@pytest.mark.parametrize("part", ["glove", "board"])
def test_beside_a_bus_the_serial_devices_come_and_go_likewise(run: MakeRun, outage: Outage, part: str) -> None:
    running = run("both", "glove", "board", "bus")
    scene, client = running.scene, running.start()
    scene.settled(0)
    held = client.held
    number = ["glove", "board"].index(part)
    boards = set(scene.truth.switch_names) - everything_on_the_bus(running)
    lost = [set(scene.truth.joint_names), boards][number]
    cable = running.bench.lines[number]
    for _ in range(2):
        outage(scene, cable.unplug, cable.replug, lost=lost, period_us=PERIOD_US)
    assert client.held == held
    assert client.end() == 0
