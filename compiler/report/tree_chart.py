"""The tree as an icicle: every node as wide as it has rows."""

from .charts import Chart, figure, words
from .tree_view import ShownNode, TreeView

_LEVELS = 6
_LEGIBLE = {"minsize": 10, "mode": "hide"}


def tree_chart(view: TreeView) -> Chart:
    """Return the chart of the nodes of `view`; a click on one shows what is below it."""
    nodes = view.nodes
    icicle = {
        "type": "icicle",
        "ids": [str(node.number) for node in nodes],
        "parents": ["" if node.parent < 0 else str(node.parent) for node in nodes],
        "labels": [words(_label(node)) for node in nodes],
        "values": [node.size for node in nodes],
        "text": [words(node.words) for node in nodes],
        "branchvalues": "total",
        "sort": False,  # in the order of the answers, as in the list
        "maxdepth": _LEVELS,
        "hovertemplate": "%{text}<extra></extra>",
        "textinfo": "label",
        "tiling": {"orientation": "v"},
        "leaf": {"opacity": 1},
        "pathbar": {"visible": True},
        "marker": {
            "colors": ["var(--leaf)" if node.is_leaf else "var(--decision)" for node in nodes],
            "line": {"color": "var(--paper)", "width": 1},
        },
    }
    caption = "The tree, the root at the top, every node as wide as it has rows. Click a node to see what is below it."
    return Chart(
        "tree-chart", caption, figure([icicle], margin={"l": 0, "r": 0, "t": 24, "b": 0}, uniformtext=_LEGIBLE)
    )


def _label(node: ShownNode) -> str:
    return f"{node.answer}: {node.name}" if node.answer else node.name
