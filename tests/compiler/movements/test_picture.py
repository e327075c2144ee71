"""The timeline as a picture: axes are named, names fit into their segments, and equal timelines are equal bytes."""

import re
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from thenar.compiler.artifact import timeline as timelines
from thenar.compiler.artifact.timeline import Timeline
from thenar.compiler.recordings import RecordingError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TYPES = ("pinch", "W" * 12, "fist")


def timeline(ticks: int = 2500) -> Timeline:
    states = np.random.default_rng(1).integers(0, 4, ticks // 25).repeat(25)
    truth = np.roll(states, 3)
    return Timeline("A", "1", 0, 10_000, TYPES, states, np.ones(len(states)), truth)


def test_names_lie_within_their_segments_and_the_axes_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []

    def keep(figure: "Figure", _: str) -> bytes:
        drawn.append(figure)
        return b""

    monkeypatch.setattr(timelines, "rendered", keep)
    timelines.draw([timeline(), replace(timeline(), subject="B", truth=None)], "png")
    figure = drawn[0]
    figure.canvas.draw()
    assert figure.axes[-1].get_xlabel() == "time in s"
    labels = {label.get_text() for axes in figure.axes for label in axes.get_yticklabels()}
    assert labels == {"A, found", "A, true", "B, found"}
    named = 0
    for axes in figure.axes:
        boxes = [patch.get_window_extent() for patch in axes.patches if isinstance(patch, Rectangle)]
        for text in axes.texts:
            place = text.get_window_extent()
            assert any(box.x0 <= place.x0 and place.x1 <= box.x1 and box.y0 <= place.y0 for box in boxes)
            named += 1
        rows = [(one, other) for one, other in pairwise(boxes) if one.y0 == other.y0]
        assert all(one.x1 <= other.x0 + 0.01 for one, other in rows)
    assert named > 10


def test_equal_timelines_are_equal_bytes() -> None:
    one, other = (timelines.draw([timeline(600)], "svg") for _ in range(2))
    assert one == other
    assert re.search(rb"<svg", one)


def test_of_nothing_there_is_no_picture() -> None:
    nothing = replace(timeline(), states=np.zeros(0, np.intp), truth=None)
    with pytest.raises(RecordingError, match="no frame"):
        timelines.draw([nothing], "svg")
