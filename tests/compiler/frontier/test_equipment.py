import numpy as np
from msgspec.structs import replace

from thenar.compiler.frontier.cache import question
from thenar.compiler.frontier.price import ClassifyModel, Equipment, price
from thenar.compiler.frontier.search import Search
from thenar.compiler.frontier.wirings import WIRE_ONLY, ReadingCost, wirings
from thenar.compiler.placement.elements import Element
from thenar.compiler.placement.placement import InputSelection
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.runtime.scanning.propose import propose_board, propose_harness

MODEL = ClassifyModel("cortex-m4")
NAMES = ["s0", "s1", "s2"]


def test_whatever_times_depend_on_is_part_of_the_question(grasp_set: GraspSet) -> None:
    glove, board = propose_harness(NAMES), propose_board(NAMES)
    slower = replace(glove, buses=tuple(replace(bus, clock_hz=100_000) for bus in glove.buses))
    other = replace(board, streams=tuple(replace(each, baud=9600) for each in board.streams), buses=slower.buses)
    faster = replace(other, streams=board.streams)
    equipments = [
        Equipment(MODEL, wirings(None), WIRE_ONLY),
        Equipment(ClassifyModel("avr328p"), wirings(None), WIRE_ONLY),
        Equipment(MODEL, wirings(None), ReadingCost(each_us=1.0)),
        *(Equipment(MODEL, wirings(given), WIRE_ONLY) for given in (glove, slower, other, faster)),
    ]
    names, samples = tuple(NAMES), Samples.of(grasp_set)
    kept = InputSelection.of(tuple(map(Element, range(3))), ())
    training = Search().training
    asked = {
        question(price, (samples, names, np.arange(9), kept, (), training, each, False), {}) for each in equipments
    }
    assert len(asked) == len(equipments)


def test_switches_need_a_wiring_with_a_place_for_each() -> None:
    equipment = Equipment(MODEL, wirings(propose_harness(NAMES[:2])), WIRE_ONLY)
    assert equipment.scans(()) == ()
    assert "as wired" in [scan.wiring for scan in equipment.scans(NAMES[:2])]
    assert "as wired" not in [scan.wiring for scan in equipment.scans(NAMES)]
