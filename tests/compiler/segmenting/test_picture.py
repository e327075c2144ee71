"""The timeline as a picture: axes are named, names fit into their segments, and equal timelines are equal bytes."""

import re
from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.segmenting import picture
from thenar.compiler.segmenting.streams import SegmentingError
from thenar.compiler.segmenting.timeline import Timeline

TYPES = ("pinch", "W" * 12, "fist")


def timeline(ticks: int = 2500) -> Timeline:
    states = np.random.default_rng(1).integers(0, 4, ticks // 25).repeat(25)
    truth = np.roll(states, 3)
    return Timeline("A", "1", 0, 10_000, TYPES, states, np.ones(len(states)), truth)


def test_equal_timelines_are_equal_bytes() -> None:
    one, other = (picture.draw([timeline(600)], "svg") for _ in range(2))
    assert one == other
    assert re.search(rb"<svg", one)


def test_of_nothing_there_is_no_picture() -> None:
    nothing = replace(timeline(), states=np.zeros(0, np.intp), truth=None)
    with pytest.raises(SegmentingError, match="no frame"):
        picture.draw([nothing], "svg")
