"""The drawing of a build's hand: `hand.json`, computed from the positions of the glove's switches."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.hand import HandDrawing, Line, Spot, drawn_joints, drawn_switches, drawn_taxels, grid_hand
from thenar.runtime.manifest import Manifest

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

    def places(names: Sequence[str]) -> dict[str, tuple[float, float]]:
        return dict(zip(names, _rounded(hand.places[hand.numbers_of(names)]), strict=True))

    return HandDrawing(
        view=hand.view,
        placed=True,
        radius_mm=round(hand.radius_mm, 2),
        outline=_thinned(hand.outline),
        strips=tuple(map(_thinned, hand.strips)),
        creases=tuple(map(_thinned, hand.creases)),
        labels=tuple(Spot(name, x, y) for name, (x, y) in zip(hand.part_names, _rounded(hand.labels), strict=False)),
        switches=drawn_switches(manifest, places(switch_names)),
        taxels=drawn_taxels(manifest, places(taxel_names)),
        joints=drawn_joints(manifest.joints, ranges),
    )


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
