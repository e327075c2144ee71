"""Tables that are priced: a finalist's are those of the build, byte for byte."""

import numpy as np

from thenar.compiler.frontier.price import ClassifyModel, Equipment, price
from thenar.compiler.frontier.wirings import WIRE_ONLY, wirings
from thenar.compiler.placement.elements import names_of
from thenar.compiler.recogniser import Recogniser
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.runtime.model.integers import tables_to_bytes
from thenar.runtime.recipe import Recipe


def test_a_finalist_is_priced_with_what_its_build_holds_for_lost_inputs(grasp_set: GraspSet) -> None:
    samples, options = Samples.of(grasp_set), Recipe(rounds=20, table_bits=8)
    made = Recogniser.fit(samples, options)
    assert made.training is not None
    names, rows = names_of(grasp_set, made.elements), np.arange(len(samples.labels))
    equipment = Equipment(ClassifyModel("avr328p"), wirings(None), WIRE_ONLY)
    asked = samples, names, rows, made.selection, (options,), made.training
    (close,) = price(*asked, equipment, True)
    (quick,) = price(*asked, equipment, False)
    assert close.content == tables_to_bytes(made.tables) != quick.content == tables_to_bytes(made.integers)
    assert close.classified == equipment.model.cost(made.tables)
