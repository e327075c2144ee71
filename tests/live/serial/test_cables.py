"""Ports and plugs that go away and come back under a run."""

from collections.abc import Callable
from typing import Any

import pytest

MakeRun = Callable[..., Any]
Outage = Callable[..., float]

pytestmark = pytest.mark.slow

# The periods of both serial devices are at most this.
PERIOD_US = 20_000


@pytest.mark.parametrize(("line", "lost"), [(0, "joint_names"), (1, "switch_names")], ids=["glove", "board"])
def test_an_unplugged_port_is_missed_and_found_again(run: MakeRun, outage: Outage, line: int, lost: str) -> None:
    running = run("both", "glove", "board")
    assert max(running.periods_us()) <= PERIOD_US
    cable = running.bench.lines[line]
    for _ in range(2):
        names = set(getattr(running.scene.truth, lost))
        outage(running.scene, cable.unplug, cable.replug, lost=names, period_us=PERIOD_US)
    kind = ("cyberglove", "stream")[line]
    assert running.opened(kind) == [3]
    assert running.opened({"cyberglove": "stream", "stream": "cyberglove"}[kind]) == [1]


def test_without_any_port_nothing_is_claimed_and_both_come_back(run: MakeRun, outage: Outage) -> None:
    running = run("both", "glove", "board")
    glove, board = running.bench.lines
    everything = {*running.scene.truth.switch_names, *running.scene.truth.joint_names}

    def unplug() -> None:
        glove.unplug()
        board.unplug()

    def replug() -> None:
        board.replug()
        glove.replug()

    outage(running.scene, unplug, replug, lost=everything, period_us=PERIOD_US)
    missed = [grasp for grasp in running.scene.grasps.all if len(grasp.lost) == len(everything)]
    assert missed
    assert all((grasp.health, grasp.grasp) == ("unknown", "unknown") for grasp in missed)


@pytest.mark.parametrize(("line", "lost"), [(0, "joint_names"), (1, "switch_names")], ids=["glove", "board"])
def test_a_run_that_begins_without_a_device_finds_it_when_it_comes(run: MakeRun, line: int, lost: str) -> None:
    running = run("both", "glove", "board", unplugged=line)
    scene = running.scene
    missing = set(getattr(scene.truth, lost))
    scene.grasps.wait(lambda grasp: set(grasp.lost) == missing, 0)
    assert not any(grasp.health == "ok" for grasp in scene.grasps.all)
    state = running.device(("cyberglove", "stream")[line])
    assert not state.connected
    assert "there is no such port" in state.error
    plugged_us = running.now_us()
    running.bench.lines[line].replug()
    scene.well(plugged_us)
    state = running.device(("cyberglove", "stream")[line])
    assert (state.connected, state.error) == (True, "")


def test_a_glove_pulled_from_its_box_gives_no_answers(run: MakeRun, outage: Outage) -> None:
    """Its records go on, with 'eg' at their ends."""
    running = run("both", "glove", "board")
    glove = running.bench.glove
    outage(
        running.scene,
        lambda: setattr(glove.box, "plugged", False),
        lambda: setattr(glove.box, "plugged", True),
        lost=set(running.scene.truth.joint_names),
        period_us=running.periods_us()[0],
    )
    assert running.counts("cyberglove")["unplugged"] > 10
    assert running.opened("cyberglove") == [1]


def test_a_board_that_restarts_is_trusted_again(run: MakeRun) -> None:
    running = run("both", "glove", "board")
    scene = running.scene
    scene.settled(0)
    running.bench.streams[0].restart()
    scene.show(5)
    scene.settled(5)
    assert scene.check() > 0


def test_a_silent_board_is_missed_though_its_port_is_there(run: MakeRun, outage: Outage) -> None:
    running = run("both", "glove", "board")
    cable = running.bench.lines[1]
    outage(
        running.scene,
        lambda: setattr(cable, "damage", lambda _message: b""),
        lambda: setattr(cable, "damage", None),
        lost=set(running.scene.truth.switch_names),
        period_us=PERIOD_US,
    )
    assert running.opened("cyberglove") == [1]
