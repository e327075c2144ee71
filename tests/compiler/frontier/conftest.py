"""Surveys of small sets."""

from thenar.compiler.frontier.cache import Cache
from thenar.compiler.frontier.price import ClassifyModel, Equipment
from thenar.compiler.frontier.search import Search
from thenar.compiler.frontier.survey import Cuts, Survey
from thenar.compiler.frontier.wirings import WIRE_ONLY
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples


def survey_of(grasp_set: GraspSet, cache: Cache, model: ClassifyModel | None = None) -> Survey:
    """Return the survey of a set's rows for a processor, by default an AVR, without a chip for its switches."""
    samples, search = Samples.of(grasp_set), Search(methods=("id3",))
    equipment = Equipment(model or ClassifyModel("avr328p"), (), WIRE_ONLY)
    return Survey(grasp_set, "set", samples, None, search, Cuts.of(samples, search), equipment, cache)
