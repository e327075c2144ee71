from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.slow

# From scan to scan, as boards do where their board.toml says nothing.
SCAN_US = 1000
# A chip is looked after so often, one after the other.
CHIP_US = 1_000_000
# From showing a row until all that is read is of it.
SETTLE_US = 150_000
# What a busy computer adds.
SLACK_US = 300_000


ROWS, COLUMNS = 5, 6


def read_us(grasp: Any) -> int:
    """Return when the switches were read."""
    return int(grasp.time_us - (grasp.switch_age_us or 0))


def pins(kept: Sequence[str], _others: Sequence[str]) -> str:
    places = [f"P{port}{bit}" for port in "BCD" for bit in range(8) if f"P{port}{bit}" not in ("PB6", "PB7")]
    free = [place for place in places if place not in ("PC6", "PC7", "PD0", "PD1")]
    return 'part = "atmega328p"\n[pins]\n' + "".join(
        f'{name} = "{pin}"\n' for name, pin in zip(kept, free, strict=False)
    )


def matrix(kept: Sequence[str], others: Sequence[str], diodes: bool) -> str:
    rows, columns = [f"PA{bit}" for bit in range(ROWS)], [f"PC{bit}" for bit in range(COLUMNS)]
    names = [*kept, *others]
    table = [names[row * COLUMNS : (row + 1) * COLUMNS] for row in range(ROWS)]
    return (
        f'part = "atmega2560"\n[matrix]\nrows = {rows}\ncolumns = {columns}\n'
        f"switches = {table}\ndiodes = {str(diodes).lower()}\n"
    )


def chips(kept: Sequence[str], others: Sequence[str]) -> str:
    """Wire the kept switches in turn to three kinds of chips, with others between them."""
    text = 'part = "atmega328p"\n'
    kinds = [
        ("mcp23017", 0x20, "low", [f"GP{port}{bit}" for port in "AB" for bit in range(7)]),
        ("pca9555", 0x21, "low", [f"P{port}{bit}" for port in "01" for bit in range(8)]),
        ("tca6424a", 0x22, "high", [f"P{port}{bit}" for port in "012" for bit in range(8)]),
    ]
    for number, (kind, address, closed, places) in enumerate(kinds):
        mine = [*kept[number::3], *others[number:12:3]]
        text += f'[[chip]]\nkind = "{kind}"\naddress = {address}\nclosed = "{closed}"\n[chip.pins]\n'
        text += "".join(f'{pin} = "{name}"\n' for pin, name in zip(places[::2], mine, strict=False))
    return text


def no_diodes(kept: Sequence[str], others: Sequence[str]) -> str:
    return matrix(kept, others, diodes=False)


def diodes(kept: Sequence[str], others: Sequence[str]) -> str:
    return matrix(kept, others, diodes=True)


Wire = Callable[[Sequence[str], Sequence[str]], str]


@pytest.fixture
def started(stage: Any, firmware: Callable[[str], Any], run: Callable[[Any], Any]) -> Callable[[Wire], Any]:
    """Return what starts firmware for such wiring, and a run on it."""

    def start(wire: Wire) -> Any:
        truth = stage.truth("switches")
        others = [name for name in truth.performance.switch_names if name not in truth.switch_names]
        running = firmware(wire(truth.switch_names, others))
        running.scene.show(0)
        run(running)
        return running

    return start


@pytest.mark.parametrize("wire", [pins, diodes, chips])
def test_what_is_recognised_from_the_firmwares_frames_is_the_offline_classification(
    started: Callable[[Wire], Any], wire: Wire
) -> None:
    running = started(wire)
    scene = running.scene
    rows = range(len(scene.truth.performance))
    for row in rows:
        scene.show(row)
        scene.settled(row)
    assert len({scene.truth.answer(row) for row in rows}) > 5
    assert scene.check() >= len(rows)
    assert "short" not in running.board.said


def test_without_diodes_all_rows_are_recognised_and_keys_that_may_be_ghosts_are_missing(
    started: Callable[[Wire], Any],
) -> None:
    running = started(no_diodes)
    scene, truth = running.scene, running.scene.truth
    readable = 0
    for row in range(len(truth.performance)):
        scene.show(row)
        after_us = scene.shown[-1].done_us + SETTLE_US
        found = scene.grasps.wait(lambda g, after=after_us: read_us(g) >= after, after_us)
        readable += found.health != "unknown"  # of some rows most keys may be ghosts
    assert scene.check() >= readable > 0.5 * len(truth.performance)
    corners = [truth.switch_names[key] for key in (0, 1, COLUMNS, COLUMNS + 1)]
    names = truth.performance.switch_names
    since_us = running.board.set_keys([name in corners[:3] for name in names]).time_us
    found = scene.grasps.wait(lambda g: read_us(g) >= since_us + SETTLE_US and g.lost, since_us)
    assert set(found.lost) == set(corners)
    nothing = np.zeros(len(truth.switch_names), bool), np.zeros(0, np.uint16)
    lanes = truth.build.scorer.lanes_without(*nothing, np.isin(truth.switch_names, corners), np.zeros(0, bool))
    assert found.candidate == truth.build.grasps[lanes.index(max(lanes))]
    assert "short" not in running.board.said


@pytest.mark.parametrize("wire", [pins, diodes, chips])
@pytest.mark.parametrize("fault", ["inframe reset", "inframe brownout 30000", "reset", "brownout 500000"])
def test_a_board_that_restarts_is_followed_and_nothing_wrong_is_said(
    started: Callable[[Wire], Any], wire: Wire, fault: str
) -> None:
    running = started(wire)
    scene, dark_us = running.scene, int(fault.split()[-1]) if "brownout" in fault else 0
    scene.show(3)
    scene.settled(3)
    took_us, blind = list[int](), list[tuple[int, int]]()
    for _ in range(3):
        done = running.board.do(fault)
        again_us = done.time_us + dark_us
        blind.append((done.board_us, again_us))
        wanted = scene.truth.answer(3)
        well = scene.grasps.wait(lambda g: g.health == "ok" and g.candidate == wanted, again_us)  # noqa: B023
        took_us.append(well.time_us - again_us)
        scene.settled(3, again_us)
    print(f"well {', '.join(f'{one / 1000:.1f}' for one in took_us)} ms after")
    scene.show(9)
    scene.settled(9)
    seen = [g for g in scene.grasps.since(0) if not any(begun <= read_us(g) <= end for begun, end in blind)]
    assert scene.truth.check(seen, scene.shown) > 0


@pytest.mark.parametrize("wire", [pins, chips])
@pytest.mark.parametrize("fault", ["uart 0 off", "inframe uart 0 off"])
def test_a_cable_that_is_out_is_told_and_back_when_it_is_in_again(
    started: Callable[[Wire], Any], wire: Wire, fault: str, outage: Callable[..., float]
) -> None:
    running = started(wire)
    took_s = outage(
        running.scene,
        lambda: running.board.do(fault),
        lambda: running.board.do("uart 0 on"),
        lost=set(running.scene.truth.switch_names),
        period_us=50_000,
    )
    assert took_s >= 0


@pytest.mark.parametrize(("fault", "heal", "each"), [("unplug 0x20", "replug 0x20", 3), ("hold", "free", 1)])
def test_switches_that_the_board_cannot_read_are_missing_until_it_can(
    started: Callable[[Wire], Any], outage: Callable[..., float], fault: str, heal: str, each: int
) -> None:
    """Of three chips the first, or all. Once that was noticed nothing is said to be well, not even for a scan."""
    running = started(chips)
    scene = running.scene
    missing = scene.truth.switch_names[::each]
    columns = np.isin(scene.truth.switch_names, missing)
    assert (scene.truth.bits[3] != scene.truth.bits[9])[columns].any()
    times_us = list[int]()

    def do(command: str) -> None:
        times_us.append(running.board.do(command).time_us)

    outage(
        scene,
        lambda: do(fault),
        lambda: do(heal),
        lost=set(missing),
        period_us=SCAN_US,
        rows=(3, 9),
    )
    gone_us, healed_us = times_us
    noticed = scene.grasps.wait(lambda g: g.health != "ok", gone_us)
    during = [g for g in scene.grasps.since(noticed.time_us + 2 * SCAN_US) if g.time_us < healed_us]
    assert during
    assert all(g.health != "ok" for g in during)


@pytest.mark.parametrize(("fault", "heal"), [("unplug 0x20", "replug 0x20"), ("hold", "free")])
def test_a_chip_that_lost_its_registers_and_a_bus_that_hung_are_right_again(
    started: Callable[[Wire], Any], fault: str, heal: str
) -> None:
    running = started(chips)
    scene = running.scene
    scene.show(3)
    scene.settled(3)
    running.board.do(fault)
    scene.show(9)
    healed_us = running.board.do(heal).time_us
    wanted = scene.truth.answer(9)
    scene.grasps.wait(lambda g: g.candidate == wanted and read_us(g) >= healed_us, healed_us)
    scene.settled(9, healed_us + CHIP_US + SLACK_US)
