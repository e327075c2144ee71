"""`report_html`: one HTML file that needs no other, no network and no date."""

from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ..text import counted
from .confusion_view import ConfusionView, confusion_view, study_confusions
from .content import ReportContent
from .embedding import embed
from .frontier_charts import frontier_charts
from .frontier_view import frontier_view
from .guarantee_view import guarantee_view
from .hand_picture import HandPicture, hand_picture
from .overview import honest_rate, overview
from .placement_view import placement_view
from .provenance import provenance
from .scan_view import ScanView, scan_view
from .study_view import study_view
from .tree_chart import tree_chart
from .tree_view import TreeView, tree_view


def report_html(content: ReportContent) -> bytes:
    """Return the report in UTF-8; the same content gives the same bytes. Raises ReportError without Plotly."""
    environment = _environment()
    manifest, frontier = content.manifest, content.frontier
    tree = _tree(content)
    charts = () if frontier is None else frontier_charts(frontier)
    shown = (
        None if frontier is None else frontier_view(frontier, manifest.source.fingerprint, content.hand, content.point)
    )
    tree_charts = () if tree is None else (tree_chart(tree),)
    page = environment.get_template("report.html.j2").render(
        overview=overview(content),
        hand=_hand(content),
        placement=placement_view(manifest, content.tree, content.hand),
        tree=tree,
        tree_charts=tree_charts,
        study=None if content.study is None else study_view(content.study),
        no_study=content.no_study,
        confusions=_confusions(content),
        frontier=shown,
        charts=charts,
        guarantee=guarantee_view(content),
        scan=_scan(content),
        provenance=provenance(manifest, content.scan is not None),
        style=_file(environment, "report.css"),
        embedded=embed(_file(environment, "report.js"), (*tree_charts, *charts), shown),
    )
    return page.encode()


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader(__package__, "templates"),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _file(environment: Environment, name: str) -> Markup:
    """Return a file beside the templates, as it is."""
    assert environment.loader is not None
    return Markup(environment.loader.get_source(environment, name)[0])


def _tree(content: ReportContent) -> TreeView | None:
    tree = content.tree
    if tree is None or not tree.inputs:
        return None
    kept = {switch.column: switch.name for switch in content.manifest.switches}
    names = [kept.get(number, f"switch {number}") for number in range(tree.n_inputs)]
    return tree_view(tree, names, content.manifest.grasps)


def _hand(content: ReportContent) -> HandPicture | None:
    if content.hand is None or not content.switch_names:
        return None
    kept, most = len(content.switch_names), len(content.hand.names)
    summary = (
        f"A right hand, palm up, thumb right, the sides of its digits unfolded; {kept} of {most} switches are kept and "
        "numbered in the order in which they were chosen. The table beside it says which they are."
    )
    return hand_picture(content.hand, content.switch_names, "kept-hand", "Kept switches on the hand", summary)


def _confusions(content: ReportContent) -> tuple[ConfusionView, ...]:
    own = []
    if content.confusion is not None:
        rate = honest_rate(content)
        folds = "honest folds" if rate is None else counted(rate.folds, "honest fold")
        own.append(confusion_view(f"This build's own recipe, {folds}", content.manifest.grasps, content.confusion))
    return (*own, *(() if content.study is None else study_confusions(content.study)))


def _scan(content: ReportContent) -> ScanView | None:
    if content.scan is None or content.harness is None:
        return None
    return scan_view(content.scan, content.harness, content.switch_names, len(content.manifest.joints))
