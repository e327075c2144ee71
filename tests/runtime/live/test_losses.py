"""Inputs that are lost and come back in any pattern: what an "ok" line then says of the grasp that it carries."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random

import numpy as np
import pytest

from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.policy import Policy
from thenar.runtime.published import UNKNOWN, LiveGrasp
from thenar.runtime.scores import Scorer

MakeBuild = Callable[..., Build]

SWITCHES, JOINTS = 6, 3
ALL = (1 << SWITCHES) - 1
FRAME_US = 10_000
ROWS = 240
SHAKY = Policy(max_lost=1.0)
NAMES = tuple(f"j{number}" for number in range(JOINTS))


@dataclass(frozen=True)
class Row:
    """A frame of a recording, and the scores that it has with everything read."""

    closed: int
    sensors: bytes
    biased_scores: tuple[int, ...]


def recording(build: Build, seed: int) -> list[Row]:
    """Grasps that are held for some frames each, with a switch or a joint that moves now and then."""
    random, scorer = Random(seed), Scorer(build.tables)
    rows: list[Row] = []
    closed, sensors = 0, bytes(JOINTS)
    while len(rows) < ROWS:
        if random.random() < 0.1:
            closed, sensors = random.getrandbits(SWITCHES), random.randbytes(JOINTS)
        elif random.random() < 0.3:
            closed ^= 1 << random.randrange(SWITCHES)
        bits = np.array([closed >> switch & 1 for switch in range(SWITCHES)], bool)
        whole = scorer.biased_scores(bits, list(sensors), np.zeros(SWITCHES, bool), np.zeros(JOINTS, bool))
        rows.append(Row(closed, sensors, tuple(whole)))
    return rows


def recognizer(build: Build, policy: Policy) -> LiveRecognizer:
    return LiveRecognizer(build, sensor_names=NAMES, switch_period_us=FRAME_US, glove_period_us=FRAME_US, policy=policy)


def losses(random: Random, frames: int) -> Iterator[tuple[int, bool]]:
    """Which switches are lost, and whether the joints are, in bursts of any length."""
    lost, unplugged = 0, False
    for _ in range(frames):
        if random.random() < 0.3:
            lost = random.choice((0, 0, ALL, random.getrandbits(SWITCHES)))
            unplugged = random.random() < 0.2
        yield lost, unplugged


class Player:
    """Plays sequences of rows on one recogniser, and counts the "ok" lines that are wrong."""

    def __init__(self, build: Build, policy: Policy) -> None:
        self._live, self._grasps = recognizer(build, policy), build.grasps
        self._lead = policy.lead_steps(build.tables.scale)
        self._now, self._last, self._confirmed = 0, UNKNOWN, False
        self.ok = self.changing = self.wrong = 0

    def play(self, rows: list[Row], patterns: Iterator[tuple[int, bool]]) -> None:
        """Play a sequence; nothing is decided on when it begins."""
        self._now += 10 * FRAME_US
        self._last = self._live.step(self._now, 0, None, None).grasp.grasp
        assert self._last == UNKNOWN
        for row, (lost, unplugged) in zip(rows, patterns, strict=True):
            self._now += FRAME_US
            glove = GloveFrame(self._now, row.sensors, 0 if unplugged else 1)
            frame = SwitchFrame(self._now, row.closed, lost, glove)
            self._check(row, self._live.step(self._now, 0, frame, glove).grasp, whole=not (frame.lost or unplugged))

    def _check(self, row: Row, found: LiveGrasp, *, whole: bool) -> None:
        if found.grasp != self._last:
            self._last, self._confirmed = found.grasp, whole
        self._confirmed |= whole and row.biased_scores.index(max(row.biased_scores)) == self._index(found.grasp)
        self.changing += found.health == "changing"
        if found.health == "ok":
            behind = max(row.biased_scores) - row.biased_scores[self._grasps.index(found.grasp)]
            self.ok += 1
            self.wrong += behind > self._lead or not self._confirmed

    def _index(self, grasp: str) -> int:
        return -1 if grasp == UNKNOWN else self._grasps.index(grasp)


POLICIES = {
    "hysteresis": Policy(),
    "anything may be lost": SHAKY,
    "no lead": Policy(lead=0.0, dwell_us=30_000, hold_us=60_000, max_lost=1.0),
}


def played(build: Build, policy: Policy, sequences: int, seed: int) -> Player:
    """Play as many sequences, of which one at least begins at every row of a recording."""
    rows, random, player = recording(build, seed), Random(seed), Player(build, policy)
    for number in range(sequences):
        first, frames = number % ROWS, random.randint(2, 24)
        taken = [rows[(first + place) % ROWS] for place in range(frames)]
        player.play(taken, losses(random, frames))
    return player


@pytest.mark.parametrize("name", POLICIES)
def test_ok_lines_rest_on_whole_frames_that_agree(make_build: MakeBuild, name: str) -> None:
    player = played(make_build(), POLICIES[name], sequences=2 * ROWS, seed=1)
    assert player.ok > ROWS
    assert player.changing > ROWS / 4
    assert player.wrong == 0


@pytest.mark.slow
def test_in_a_hundred_thousand_sequences_there_is_no_wrong_ok_line(make_build: MakeBuild) -> None:
    wrong = ok = 0
    for seed in range(4):
        for policy in POLICIES.values():
            player = played(make_build(seed), policy, 5000, seed)
            wrong, ok = wrong + player.wrong, ok + player.ok
    assert ok > 100_000
    assert wrong == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_still_hands_ok_lines_keep_its_grasp_through_losses(make_build: MakeBuild, seed: int) -> None:
    """150 ms of whole frames, 100 ms without switches, and whole frames again, of every state of the switches."""
    build, policy, other, ok = make_build(seed), Policy(max_lost=1.0), 0, 0
    for closed in range(ALL + 1):
        live, lines = recognizer(build, policy), []
        for number in range(40):
            lost = ALL if 15 <= number < 25 else 0
            now = number * FRAME_US
            lines.append(live.step(now, 0, SwitchFrame(now, closed, lost), GloveFrame(now, bytes((9, 99, 200)))).grasp)
        other += lines[20].candidate != lines[0].candidate
        assert {line.health for line in lines[15:25]} == {"degraded"}
        sure = [line for line in lines if line.health == "ok"]
        assert all(line.grasp == lines[0].candidate for line in sure)
        ok += len(sure)
        assert len(sure) == 30
    assert other > 0
    assert ok > 30
