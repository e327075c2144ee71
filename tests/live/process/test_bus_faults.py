"""What goes wrong on an I2C bus under a run."""

import errno
from collections.abc import Callable
from itertools import product
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


def assert_no_chip_was_given_up(running: Any, begun_us: int) -> None:
    """On a busy computer a whole scan may be late; some switches alone are missed only if their chip is given up."""
    bus = everything_on_the_bus(running)
    missed = [set(grasp.lost) & bus for grasp in running.scene.grasps.since(begun_us)]
    assert all(names in (set(), bus) for names in missed)


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


@pytest.mark.parametrize("address", [PCA9555, MCP23008])
def test_a_chip_back_right_after_a_search_is_found(run: MakeRun, address: int) -> None:
    """The worst moment to come back."""
    running = run("both", "glove", "bus")
    scene, client, i2c = running.scene, running.start(), running.bench.i2c
    scene.settled(0)
    chip = {PCA9555: STRAIGHT, MCP23008: BEHIND}[address]
    i2c.fault(0, "remove", chip)
    scene.grasps.wait(lambda grasp: set(grasp.lost) == running.bus_names(chip), running.now_us())

    def looked() -> int:
        return sum(count for place, count in running.wire().traffic.items() if place.address == address)

    before = looked()
    running.eventually(lambda: looked() > before)
    i2c.fault(0, "heal")
    back_us = running.now_us()
    took_us = scene.well(back_us).time_us - back_us
    print(f"well {took_us / 1000:.1f} ms after")
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


@pytest.mark.parametrize("address", [PCA9555, MCP23008, MUX, None])
def test_what_fails_once_or_twice_is_tried_again_and_never_missed(run: MakeRun, address: int | None) -> None:
    running = run("both", "glove", "bus")
    scene, client, i2c = running.scene, running.start(), running.bench.i2c
    scene.settled(0)
    begun_us = running.now_us()
    for code, times in product((errno.EREMOTEIO, errno.EIO, errno.ETIMEDOUT, errno.EAGAIN), (1, 2, 1)):
        print(errno.errorcode[code], times)
        i2c.fault(0, "fail", code, address=address, times=times)
        scene.show(3 * times)
        scene.settled(3 * times)
    assert_no_chip_was_given_up(running, begun_us)
    assert client.end() == 0
    assert scene.check() > 0


@pytest.mark.parametrize(
    ("chip", "kind", "other"), [(STRAIGHT, "pca9555", "mcp23017"), (BEHIND, "mcp23008", "pca9555")]
)
def test_a_wrong_chip_is_not_believed_the_right_one_is(run: MakeRun, chip: int, kind: str, other: str) -> None:
    running = run("both", "glove", "bus")
    scene, client, i2c = running.scene, running.start(), running.bench.i2c
    scene.settled(0)
    scene.show(5)
    scene.settled(5)
    i2c.fault(0, "remove", chip)
    lost = running.bus_names(chip)
    scene.grasps.wait(lambda grasp: set(grasp.lost) == lost, running.now_us())
    i2c.replace(0, chip, other)
    i2c.fault(0, "heal")
    begun_us = running.now_us()
    scene.grasps.wait(lambda grasp: grasp.time_us > begun_us + 1_500_000, begun_us)
    assert all(grasp.health != "ok" for grasp in scene.grasps.since(begun_us))
    i2c.replace(0, chip, kind)
    scene.show(9)
    scene.settled(9)
    assert client.end() == 0
    assert scene.check() > 0
