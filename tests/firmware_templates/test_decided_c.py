"""The C of early exit against runtime.scanning.decided.EarlyExit: the same answer after every port of every scan."""

import ctypes
from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
import pytest

from thenar.compiler.firmware.protocol import decided_files
from thenar.runtime.scanning.decided import EarlyExit
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

SharedLibrary = Callable[..., ctypes.CDLL]
Ports = Sequence[Sequence[int]]

# What stands in for the classifier: the scores, written by the test.
HEADER = """
#include <stdbool.h>
#include <stdint.h>

typedef uint8_t thenar_tiny_class;
typedef struct { int16_t scores[1024]; } thenar_tiny;
"""


def small_tables(seed: int, largest: int = 3, classes: int = 3, switches: int = 6) -> IntegerTables:
    """Few classes and small steps, so that ties are common; means that need not lie between open and closed."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-largest, largest + 1, shape).astype(np.int16)

    return IntegerTables(rows(classes), rows(switches, classes), (), (), rows(switches, classes), rows(0, classes), 1.0)


class Decided:
    """thenar_tiny_decided.c, with scores as the classifier makes them."""

    def __init__(self, shared_library: SharedLibrary, tables: IntegerTables, ports: Ports) -> None:
        grasps = [f"grasp {number}" for number in range(tables.n_classes)]
        files = decided_files("tiny", tables, grasps, ports)
        self._library = shared_library({**files, "thenar_tiny.h": HEADER})
        self._library.thenar_tiny_decided.restype = ctypes.c_bool
        self._scores = (ctypes.c_int16 * 1024)()
        self._scorer = Scorer(tables)
        self._width, self._ports = tables.n_switches, ports

    def scan(self, closed: Sequence[bool]) -> list[bool]:
        """Return the answer after each port of a scan of switches in this state."""
        answers = []
        read: set[int] = set()
        for number, port in enumerate(self._ports):
            read |= set(port)
            seen = [closed[switch] and switch in read for switch in range(self._width)]
            scores = [
                lane - (1 << 15)
                for lane in self._scorer.lanes_without(np.array(seen), [], np.zeros(self._width, bool), [])
            ]
            for grasp, score in enumerate(scores):
                self._scores[grasp] = score
            answers.append(bool(self._library.thenar_tiny_decided(self._scores, number, scores.index(max(scores)))))
        return answers


def expected(tables: IntegerTables, ports: Ports, closed: Sequence[bool]) -> list[bool]:
    masks = [sum(1 << switch for switch in port) for port in ports]
    early, state = EarlyExit(Scorer(tables), masks), sum(1 << switch for switch, bit in enumerate(closed) if bit)
    early.start([])
    return [early.after(port, state & mask) for port, mask in enumerate(masks)]


@pytest.mark.parametrize("ports", [((0,), (1,), (2,), (3,), (4,), (5,)), ((4, 2), (1, 3, 0), (), (5,)), (range(6),)])
@pytest.mark.parametrize("seed", range(4))
def test_in_every_state_of_the_switches_it_answers_as_python_does(
    shared_library: SharedLibrary, seed: int, ports: Ports
) -> None:
    tables, ended = small_tables(seed), 0
    decided = Decided(shared_library, tables, ports)
    for closed in product((False, True), repeat=6):
        answers = decided.scan(closed)
        assert answers == expected(tables, ports, closed)
        ended += answers.index(True) < len(ports) - 1
    assert ended or len(ports) == 1


def test_of_fourteen_classes_and_many_switches_too(shared_library: SharedLibrary) -> None:
    tables = small_tables(1, largest=300, classes=14, switches=33)
    ports = [range(first, min(first + 8, 33)) for first in range(0, 33, 8)]
    decided, random = Decided(shared_library, tables, ports), np.random.default_rng(2)
    for density in random.random(300):
        closed = (random.random(33) < density).tolist()
        assert decided.scan(closed) == expected(tables, ports, closed)


@pytest.mark.parametrize("leader", [0, 1])
def test_the_most_that_a_score_can_lead_is_not_enough_where_the_rest_can_bring_as_much(
    shared_library: SharedLibrary, leader: int
) -> None:
    """Scores 65534 apart, and hurdles that do not fit 16 bits."""
    top = 16383
    rows = np.array([[top, -top], [-top, top], [-top, top]], np.int16)[:, :: 1 - 2 * leader]
    tables = IntegerTables(rows[0] * np.int16(0), rows[:2], (), (), rows[:2] * np.int16(0), rows[:0], 1.0)
    decided = Decided(shared_library, tables, [(0,), (1,)])
    for closed in product((False, True), repeat=2):
        assert decided.scan(closed) == expected(tables, [(0,), (1,)], closed)


def test_above_256_classes_the_leader_is_a_wider_number(shared_library: SharedLibrary) -> None:
    tables = small_tables(3, classes=300, switches=2)
    decided = Decided(shared_library, tables, [(0,), (1,)])
    for closed in product((False, True), repeat=2):
        assert decided.scan(closed) == expected(tables, [(0,), (1,)], closed)
