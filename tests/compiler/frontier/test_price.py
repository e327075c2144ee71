"""Tables that are priced: a finalist's are the build's, byte for byte; what is measured is simulated once, and kept."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.frontier.cache import Cache, Store, question
from thenar.compiler.frontier.price import ClassifyModel, Equipment, price, random_tables
from thenar.compiler.frontier.search import Search
from thenar.compiler.frontier.wirings import WIRE_ONLY, ReadingCost, wirings
from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.compiler.placement.elements import Element, names_of
from thenar.compiler.placement.placement import InputSelection
from thenar.compiler.recogniser import Recogniser
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.runtime.model.integers import tables_to_bytes
from thenar.runtime.recipe import Recipe

from ...conftest import tool
from .conftest import survey_of


def test_a_finalist_is_priced_with_what_its_build_holds_for_lost_inputs(grasp_set: GraspSet) -> None:
    samples, options = Samples.of(grasp_set), Recipe(rounds=20, table_bits=8)
    made = Recogniser.fit(samples, options)
    names, rows = names_of(grasp_set, made.elements), np.arange(len(samples.labels))
    equipment = Equipment(ClassifyModel("avr328p"), wirings(None), WIRE_ONLY)
    asked = samples, names, rows, made.selection, (options,), made.training
    (close,) = price(*asked, equipment, True)
    (quick,) = price(*asked, equipment, False)
    assert close.content == tables_to_bytes(made.tables) != quick.content == tables_to_bytes(made.integers)
    assert close.classified == equipment.model.cost(made.tables)


TABLES = random_tables(6, 0, 4)
CONTENT = tables_to_bytes(TABLES)


@pytest.mark.slow
def test_on_a_host_the_runtime_is_timed_once(grasp_set: GraspSet, tmp_path: Path) -> None:
    model = ClassifyModel("host", python=(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0))
    with Store(tmp_path / "store", "here") as store:
        survey = survey_of(grasp_set, Cache(store, lambda *_: None, jobs=1), model)
        timed = survey.measured([CONTENT, CONTENT])
        known = len(store)
        assert survey.measured([CONTENT]) == timed
        assert len(store) == known == 1
    assert timed[CONTENT].how == "measured"
    assert 0 < timed[CONTENT].us < 100_000


@pytest.mark.slow
def test_on_an_avr_the_time_is_what_was_simulated(grasp_set: GraspSet, tmp_path: Path) -> None:
    tool("avr-gcc")
    model = ClassifyModel("avr328p")
    assert not model.unmeasured
    with Store(tmp_path / "store", "here") as store:
        found = survey_of(grasp_set, Cache(store, lambda *_: None, jobs=1)).measured([CONTENT])[CONTENT]
    predicted = model.cost(TABLES)
    assert predicted is not None
    assert found.how == "simulated"
    assert found.us == pytest.approx(predicted.us, rel=0.1)


def test_what_cannot_be_measured_here_has_no_time(grasp_set: GraspSet, tmp_path: Path) -> None:
    model = ClassifyModel("pi", python=(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0))
    with Store(tmp_path / "store", "here") as store:
        assert survey_of(grasp_set, Cache(store, lambda *_: None, jobs=1), model).measured([CONTENT]) == {}


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
