"""Placements as pictures: the tree of ID3, and how well many subjects are served."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from thenar.runtime.files import write_atomically

from ..pictures import painting, rendered
from .inputs import PlacementError
from .placement import Aim, Placement, Standard
from .tree import Tree, names_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAF_INCHES, _LEVEL_INCHES, _LARGEST_INCHES = 0.6, 0.9, 200.0
_LETTER_INCHES = 0.055  # of _FONT_SIZE
_FONT_SIZE = 6

BETTERED: dict[Aim, str] = {
    "plain": "as chosen",
    "mean": "bettered for the mean",
    "worst tenth": "bettered for the worst tenth",
}


def draw_placement(placement: Placement, path: Path) -> None:
    """Write a picture to `path`, .svg or .png: of ID3 its tree, of many subjects how they are served.

    The tree has decisions with switch and gain, and leaves with grasp type and rows. Raises PictureError for another
    kind of file or without matplotlib, PlacementError where there is neither a tree nor a study.
    """
    if placement.tree is not None:
        draw_tree(placement.tree, path, placement.all_names, placement.grasps)
    elif placement.study is not None:
        draw_study(placement.study, path)
    else:
        raise PlacementError(f"a placement by {placement.method} has no tree to draw")


def draw_tree(tree: Tree, path: Path, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> None:
    """Write the picture of `tree` to `path`, .svg or .png: decisions with input and gain, leaves with class and rows.

    The same tree gives the same bytes. Raises PictureError for another kind of file or without matplotlib.
    """
    names, class_names = names_for(tree, names, class_names)
    leaf_inches = max(_LEAF_INCHES, _LETTER_INCHES * max(map(len, class_names)) + 0.2)
    size = (leaf_inches * tree.n_leaves + 1.5, _LEVEL_INCHES * tree.depth + 1.2)
    with painting(_FONT_SIZE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(min(size[0], _LARGEST_INCHES), min(size[1], _LARGEST_INCHES)), dpi=110)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(-1, tree.n_leaves), ylim=(-tree.depth - 0.5, 0.5))
        axes.axis("off")
        _compose(axes, tree, names, class_names)
        picture = rendered(figure, path.suffix.lower().removeprefix("."))
    write_atomically(path, picture)


def _compose(axes: "Axes", tree: Tree, names: Sequence[str], class_names: Sequence[str]) -> None:
    places = [(across, -depth) for across, depth in zip(_places(tree), tree.depths, strict=True)]
    for (x, y), node, children in zip(places, tree.nodes, tree.children, strict=True):
        for value, child in zip(node.values, children, strict=True):
            to_x, to_y = places[child]
            axes.plot((x, to_x), (y, to_y), color="0.6", linewidth=0.8, zorder=1)
            middle = ((x + to_x) / 2, (y + to_y) / 2)
            axes.text(*middle, str(value), color="0.35", ha="center", va="center", backgroundcolor="white")
        if node.input is None:
            words, box = f"{class_names[node.majority]}\n{max(node.counts)}/{node.size}", ("round", "#e3efda")
        else:
            gain = "no gain" if node.gains_nothing else f"{node.gain:.3g}"
            words, box = f"{names[node.input]}\n{gain}", ("square", "#dae3f3")
        frame = {"boxstyle": box[0], "facecolor": box[1], "edgecolor": "0.5"}
        axes.text(x, y, words, ha="center", va="center", bbox=frame, zorder=3)


def _places(tree: Tree) -> list[float]:
    """Return each node's place across: leaves side by side, a decision over the middle of its children."""
    places = [0.0] * len(tree.nodes)
    leaves = iter(range(len(tree.nodes)))
    for number, node in enumerate(tree.nodes):
        if node.input is None:
            places[number] = next(leaves)
    # In preorder children come after their parents, so backwards they are placed before them.
    for number in reversed(range(len(tree.nodes))):
        children = tree.children[number]
        if children:
            places[number] = (places[children[0]] + places[children[-1]]) / 2
    return places


def draw_study(study: Standard, path: Path) -> None:
    """Draw recognition of held-out subjects against the number of subjects learnt from. Raises PictureError."""
    with painting(font_size=10):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.5, 5.0), layout="constrained", dpi=120)
        _draw_study(figure.subplots(), study)
        figure.legend(frameon=False, loc="outside lower center", ncols=3, fontsize=8)
        write_atomically(path, rendered(figure, path.suffix.lower().removeprefix(".")))


def _draw_study(axes: "Axes", study: Standard) -> None:
    """Draw a pair of lines for every aim: the mean and the worst tenth."""
    for (aim, words), colour in zip(BETTERED.items(), ("#595959", "#0072b2", "#d55e00"), strict=True):
        points = [point for point in study.curve if point.aim == aim]
        sizes = [point.subjects for point in points]
        for what, style in (("mean", "-"), ("worst_tenth", "--")):
            rates = [100 * getattr(point.served, what) for point in points]
            label = f"{'mean' if what == 'mean' else 'worst tenth'}, {words}"
            axes.plot(sizes, rates, style, marker="o", markersize=4, color=colour, label=label)
    axes.set_xscale("log")
    sizes = sorted({point.subjects for point in study.curve})
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.set_xlabel("subjects learnt from")
    axes.set_ylabel(f"recognition of {study.held_out} other subjects, %")
    axes.set_title(f"{len(study.columns)} switches for everybody")
    axes.grid(visible=True, alpha=0.3)
