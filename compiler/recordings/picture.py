"""Draw a set: the number of grasps of each type, its contacts with switches and taxels, and its joint values."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..pictures import painting, rendered
from .errors import RecordingError
from .graspset import GraspSet, Joint
from .summary import contacts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_BLUE = "#2f6690"
_PALE = "#8fb3cc"
_ORANGE = "#e07a1f"
_JOINTS_A_ROW = 6
# With more joints the picture would be too large for image viewers.
_DRAWN_JOINTS = 60
# Pixels; hundreds of grasp types are drawn smaller, to stay within the limits of the renderer.
_TALLEST = 20_000
# With more columns than this their names are not legible next to each other.
_NAMED_SWITCHES = 90
_LONGEST_NAME = 30


def draw(grasp_set: GraspSet, kind: str) -> bytes:
    """Return the picture as the bytes of a "png" or "svg"; the same set gives the same bytes.

    Raises RecordingError if the set has no rows, PictureError if matplotlib is not installed.
    """
    if not len(grasp_set):
        raise RecordingError("a set without rows cannot be drawn")
    with painting(font_size=8):
        from matplotlib.figure import Figure

        types = 0.17 * len(_present(grasp_set)) + 0.9
        rows_of_joints = -(-min(len(grasp_set.joints), _DRAWN_JOINTS) // _JOINTS_A_ROW)
        heights = [types + 0.9, *([rows_of_joints * types + 0.4] if rows_of_joints else [])]
        size = (max(9.0, 5.0 + 0.13 * min(len(grasp_set.element_names), 120)), sum(heights))  # inches
        figure = Figure(figsize=size, layout="constrained", dpi=min(130, _TALLEST / size[1]))
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        if grasp_set.element_names:
            balance, contacts = parts[0].subplots(1, 2, width_ratios=(1, 3), sharey=True)
            _draw_contacts(contacts, grasp_set)
        else:
            balance = parts[0].subplots()
        _draw_balance(balance, grasp_set)
        if grasp_set.joints:
            _draw_joints(parts[-1], grasp_set)
        return rendered(figure, kind)


def _present(grasp_set: GraspSet) -> NDArray[np.intp]:
    return np.unique(grasp_set.labels)


def _types(grasp_set: GraspSet) -> list[str]:
    return [_short(grasp_set.taxonomy.names[label]) for label in _present(grasp_set)]


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"


def _draw_balance(axes: "Axes", grasp_set: GraspSet) -> None:
    present = _present(grasp_set)
    counts = np.bincount(grasp_set.labels)[present]
    bars = axes.barh(np.arange(len(present)), counts, color=_BLUE)
    axes.bar_label(bars, padding=2)
    axes.set_yticks(np.arange(len(present)), _types(grasp_set))
    axes.set_ylim(len(present) - 0.5, -0.5)
    axes.margins(x=0.1)
    axes.set_title(grasp_set.size)
    axes.set_xlabel("frames")


def _draw_contacts(axes: "Axes", grasp_set: GraspSet) -> None:
    touched, kinds = contacts(grasp_set), {"switches": grasp_set.switch_names, "taxels": grasp_set.taxel_columns}
    closed = np.stack([touched[grasp_set.labels == label].mean(axis=0) for label in _present(grasp_set)])
    image = axes.imshow(closed, aspect="auto", cmap="Blues", vmin=0, vmax=1, interpolation="nearest")
    axes.figure.colorbar(
        image,
        ax=axes,
        label="share of frames "
        + " or ".join(["closed"] * bool(kinds["switches"]) + ["pressed"] * bool(kinds["taxels"])),
        pad=0.01,
    )
    axes.tick_params(axis="y", labelleft=False, left=False)
    names = grasp_set.element_names
    if len(names) <= _NAMED_SWITCHES:
        axes.set_xticks(np.arange(len(names)), list(map(_short, names)), rotation=90, fontsize=6)
    else:
        axes.set_xlabel("number of the switch or taxel, from 0" if kinds["taxels"] else "number of the switch, from 0")
    axes.set_title("contact on " + " and ".join(f"{len(some)} {kind}" for kind, some in kinds.items() if some))


def _draw_joints(part: "SubFigure", grasp_set: GraspSet) -> None:
    count = min(len(grasp_set.joints), _DRAWN_JOINTS)
    which = "" if count == len(grasp_set.joints) else f" of the first {count} of {len(grasp_set.joints)} joints"
    part.suptitle(
        f"joint values{which}: line from least to largest, bar the middle half, orange the median", fontsize=9
    )
    rows = -(-count // _JOINTS_A_ROW)
    panels = part.subplots(rows, min(count, _JOINTS_A_ROW), sharey=True, squeeze=False).ravel()
    for panel, joint, codes in zip(panels, grasp_set.joints, grasp_set.codes.T, strict=False):
        _draw_joint(panel, joint, codes, grasp_set)
    for panel in panels[count:]:
        panel.set_axis_off()


def _draw_joint(axes: "Axes", joint: Joint, codes: NDArray[np.uint16], grasp_set: GraspSet) -> None:
    present = _present(grasp_set)
    points = [np.percentile(joint.value(codes[grasp_set.labels == label]), [0, 25, 50, 75, 100]) for label in present]
    least, low, median, high, largest = np.array(points).T
    where = np.arange(len(present))
    axes.hlines(where, least, largest, color=_PALE, linewidth=1.2)
    axes.hlines(where, low, high, color=_BLUE, linewidth=4)
    axes.plot(median, where, "|", color=_ORANGE, markersize=8, markeredgewidth=1.8)
    axes.set_yticks(where, _types(grasp_set))
    axes.set_ylim(len(present) - 0.5, -0.5)
    axes.set_title(_short(joint.name))
    axes.set_xlabel(_short(joint.unit))
