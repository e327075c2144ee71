"""What is drawn of a placement: the picture of ID3's tree, and the names of the kept switches."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from thenar.runtime.build import load_manifest
from thenar.runtime.files import read_file, write_atomically
from thenar.runtime.names import fault, shortened
from thenar.runtime.nesting import check_json

from ..pictures import on_paper, painting, rendered
from ..samples import TrainingError
from .placement import Placement
from .tree import Node, Tree, edge_label, names_for, sizes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LINE_INCHES, _STEP_INCHES, _KEY_INCHES, _LARGEST_INCHES = 0.17, 0.22, 2.0, 200.0
_KEY_LINES = 2
_LETTER_INCHES = 0.062  # of _FONT_SIZE
_FONT_SIZE = 7
_LARGEST_LIST = 4_000_000  # bytes; a placement of the largest set has fewer
_WANTED = "name a build folder, a file of `thenar place -o`, or a text file with one name per line"


def draw_placement(placement: Placement, path: Path) -> None:
    """Draw the tree of a placement by ID3 with `draw_tree`. Raises TrainingError for a placement without a tree."""
    if placement.tree is None:
        raise TrainingError(f"a placement by {placement.method} has no tree to draw")
    draw_tree(placement.tree, path, placement.all_names, placement.grasps)


def draw_tree(tree: Tree, path: Path, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> None:
    """Write the picture of `tree` to `path`, .svg or .png: decisions with input and gain, leaves with class and rows.

    The tree is drawn as an icicle: one line per node, from the root down, with children indented. The same tree gives
    the same bytes. Raises PictureError for another kind of file or without matplotlib.
    """
    names, class_names = names_for(tree, names, class_names)
    labels = [edge_label(tree, number) + _label(node, names, class_names) for number, node in enumerate(tree.nodes)]
    right = max(
        _LETTER_INCHES * len(label) + _STEP_INCHES * (depth + 1)
        for label, depth in zip(labels, tree.depths, strict=True)
    )
    width, lines = max(right, _KEY_INCHES * 3.5), len(tree.nodes) + _KEY_LINES
    with painting(_FONT_SIZE):
        from matplotlib.figure import Figure

        tall = min(_LINE_INCHES * lines, _LARGEST_INCHES)
        figure = Figure(figsize=(min(width, _LARGEST_INCHES), tall), dpi=110, facecolor=on_paper("paper"))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, width), ylim=(lines, 0))
        axes.axis("off")
        for place, (words, leaf) in enumerate((("switch? gain in bits", False), ("grasp type, its rows / all", True))):
            _draw_box(axes, (place * _KEY_INCHES, 0.2, _KEY_INCHES - _STEP_INCHES, 1), words, leaf=leaf)
        axes.text(2 * _KEY_INCHES, 0.7, "open, closed: the switch state that leads there", va="center_baseline")
        boxes = zip(tree.nodes, tree.depths, sizes_of(tree), labels, strict=True)
        for line, (node, depth, size, label) in enumerate(boxes, _KEY_LINES):
            left = _STEP_INCHES * depth
            _draw_box(axes, (left, line, width - left, size), label, leaf=node.input is None)
        picture = rendered(figure, path.suffix.lower().removeprefix("."))
    write_atomically(path, picture)


def _label(node: Node, names: Sequence[str], class_names: Sequence[str]) -> str:
    if node.input is None:
        return f"{class_names[node.majority]} {max(node.counts)}/{node.size}"
    return f"{names[node.input]}? {'no gain' if node.gains_nothing else f'{node.gain:.3g}'}"


def _draw_box(axes: "Axes", box: tuple[float, float, float, float], label: str, *, leaf: bool) -> None:
    from matplotlib.patches import Rectangle

    x, y, width, height = box
    colour = on_paper("leaf" if leaf else "decision")
    axes.add_patch(Rectangle((x, y), width, height, facecolor=colour, edgecolor=on_paper("paper"), linewidth=0.8))
    axes.text(x + _STEP_INCHES / 3, y + 0.5, label, color=on_paper("ink"), va="center_baseline")


def kept_names(path: Path) -> tuple[str, ...]:
    """Return the names of the kept switches, in the order in which they were chosen.

    path is a build's folder, a JSON file (a placement's document, or an array of names), or a text file with one name
    per line. Raises TrainingError if it is none of these or names no switch, BuildError if it is a damaged build.
    """
    names = tuple(kept.name for kept in load_manifest(path).switches) if path.is_dir() else _of_file(path)
    for name in names:
        if reason := fault(name):
            raise TrainingError(f"{path}: switch {shortened(repr(name))} {reason}")
    if not names:
        raise TrainingError(f"{path} keeps no switches: there is nothing to draw")
    return names


def _of_file(path: Path) -> tuple[str, ...]:
    try:
        text = read_file(path, _LARGEST_LIST, TrainingError).decode()
    except UnicodeDecodeError:
        raise TrainingError(f"{path} is not a text file: {_WANTED}") from None
    if text.lstrip()[:1] not in ("{", "["):
        return tuple(filter(None, map(str.strip, text.splitlines())))
    try:
        check_json(text.encode())
        found = msgspec.json.decode(text)
        if isinstance(found, dict):
            switches = msgspec.convert(found.get("switches"), list[dict[str, Any]])
            found = [switch.get("name") for switch in switches]
        return msgspec.convert(found, tuple[str, ...])
    except ValueError as reason:
        why = shortened(str(reason))
        raise TrainingError(f"{path} is not a list of switches ({why}): {_WANTED}") from None
