"""The drawing of a build's hand, `hand.json`, or of a recorded glove, from the positions of the glove's switches."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.hand import (
    GRID_RADIUS_MM,
    DrawnSwitch,
    DrawnTaxel,
    HandDrawing,
    Line,
    Spot,
    drawn_joints,
    drawn_switches,
    drawn_taxels,
    grid_hand,
    grid_places,
)
from thenar.runtime.manifest import Calibration, Manifest
from thenar.runtime.recording.session import Session

from ..hand import Floats, HandShape

_NEAREST_MM = 0.5  # points closer than this to the last one drawn are omitted


def drawn_hand(
    manifest: Manifest,
    hand: HandShape | None,
    switch_names: Sequence[str],
    taxel_names: Sequence[str],
    codes: NDArray[np.uint16],
) -> HandDrawing:
    """Return the drawing of a build on `hand`, with all recorded switches and taxels and the kept ones marked.

    `codes` (n, j) are the codes of the build's joints in the training rows. Without a hand that has positions for the
    switches, the kept ones are drawn in a grid.
    """
    ranges = None if not len(codes) else list(zip(codes.min(axis=0).tolist(), codes.max(axis=0).tolist(), strict=True))
    if not manifest.switches or hand is None or not hand.knows([*switch_names, *taxel_names]):
        return grid_hand(manifest, ranges)
    return HandDrawing(
        **_shape(hand),
        switches=drawn_switches(manifest, _places(hand, switch_names)),
        taxels=drawn_taxels(manifest, _places(hand, taxel_names)),
        joints=drawn_joints(manifest.joints, ranges),
    )


def drawn_glove(session: Session, hand: HandShape) -> HandDrawing:
    """Return the drawing of a recorded glove: every switch as the bit that it has in a frame.

    Switches with the names of those on `hand` are drawn there, others in a grid. Calibrated sensors are in degrees,
    others show their bytes.
    """
    names, n = (*session.switches, *session.taxels), len(session.switches)
    fits = hand.fitted(names) is not None
    places = _places(hand, names) if fits else grid_places(names)
    lines = {} if session.calibration is None else {line.name: line for line in session.calibration.sensors}
    joints = []
    for number, name in enumerate(session.sensors):
        line = lines.get(name)
        ends = (1, 1.0, 255, 255.0) if line is None else (line.raw_a, line.value_a, line.raw_b, line.value_b)
        joints.append(Calibration(number, name, "raw" if line is None else "deg", *ends))
    return HandDrawing(
        **(_shape(hand) if fits else {"view": "", "placed": False, "radius_mm": GRID_RADIUS_MM}),
        switches=tuple(DrawnSwitch(name, *places[name], bit) for bit, name in enumerate(session.switches)),
        # One level each: hand.js draws how far a taxel is pressed, and no frame has a bit for it.
        taxels=tuple(DrawnTaxel(name, *places[name], ((0, n + at),)) for at, name in enumerate(session.taxels)),
        joints=drawn_joints(joints),
    )


def _shape(hand: HandShape) -> dict[str, Any]:
    """Return the fields of a drawing that show the hand."""
    return {
        "view": hand.view,
        "placed": True,
        "radius_mm": round(hand.radius_mm, 2),
        "outline": _thinned(hand.outline),
        "strips": tuple(map(_thinned, hand.strips)),
        "creases": tuple(map(_thinned, hand.creases)),
        "labels": tuple(Spot(name, x, y) for name, (x, y) in zip(hand.part_names, _rounded(hand.labels), strict=False)),
    }


def _places(hand: HandShape, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    return dict(zip(names, _rounded(hand.places[hand.numbers_of(names)]), strict=True))


def _thinned(points: Floats) -> Line:
    if not len(points):
        return ()
    drawn = [points[0]]
    for point in points[1:-1]:
        if np.hypot(*(point - drawn[-1])) >= _NEAREST_MM:
            drawn.append(point)
    return tuple(_rounded(np.array([*drawn, points[-1]])))


def _rounded(points: Floats) -> list[tuple[float, float]]:
    # Adding 0 turns a rounded -0 into 0.
    return [(x, y) for x, y in (np.round(points, 1) + 0.0).tolist()]
