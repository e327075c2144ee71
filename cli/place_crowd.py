"""`thenar place --crowd`: one standard placement for many subjects."""

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from .common import out, progress
from .lines import echo
from .place_chosen import Kept, learning_of, named

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from thenar.compiler.placement.crowd import Standard
    from thenar.compiler.recordings.graspset import GraspSet

_BETTERED = {"plain": "as chosen", "mean": "bettered for the mean", "worst tenth": "bettered for the worst tenth"}


class CrowdPlacement(msgspec.Struct, frozen=True):
    """What `thenar place --crowd` finds: `study` tells how, and whom it serves how well."""

    switches: tuple[Kept, ...]
    n_switches: int
    joints: bool
    rows: int
    fingerprint: str
    study: "Standard"


def crowded(grasp_set: "GraspSet", method: str, keep: int, *, joints: bool, jobs: int) -> CrowdPlacement:
    """Return the standard placement of a set. Raises PlacementError if it has too few subjects."""
    import numpy as np

    from thenar.compiler.placement.crowd import Asked, standard_placement
    from thenar.compiler.placement.serving import Crowd

    subjects = np.unique(grasp_set.subjects, return_inverse=True)[1]
    crowd = Crowd(learning_of(grasp_set, joints=joints), subjects)
    with progress("learning from more and more subjects") as report:
        study = standard_placement(crowd, Asked(keep, method), jobs, report)
    switches = named(grasp_set, study.columns)
    return CrowdPlacement(switches, len(grasp_set.switch_names), joints, len(grasp_set), grasp_set.fingerprint(), study)


def print_crowd(placement: CrowdPlacement) -> None:
    """Print the switches, and how held-out subjects are served."""
    from rich.table import Table

    study = placement.study
    table = Table("order", "switch", "name", title="Standard placement")
    for order, kept in enumerate(placement.switches, 1):
        table.add_row(str(order), str(kept.number), kept.name)
    out().print(table)
    served = Table(
        *("subjects", "placement", "mean, %", "worst tenth, %", "lowest, %"),
        title=f"Recognition of {study.held_out} held-out subjects",
    )
    for point in study.curve:
        rates = (point.served.mean, point.served.worst_tenth, point.served.lowest)
        served.add_row(str(point.subjects), _BETTERED[point.aim], *(f"{100 * rate:.1f}" for rate in rates))
    out().print(served)
    echo(
        f"{len(placement.switches)} of {placement.n_switches} switches, chosen by {study.method}, "
        f"{_BETTERED[study.aim]}: this did best within the subjects learnt from. Learnt again from {study.rows} rows "
        f"of all {study.subjects} subjects"
    )
    echo(
        "bettered: the switches chosen last exchanged for the next ones, where half of the subjects learnt from then "
        "recognise the other half better. Counting badly served subjects more often was tried on 80 simulated hands, "
        "gained no more than another draw of rows did, and is not done"
    )


def draw_crowd(placement: CrowdPlacement, path: Path) -> None:
    """Draw recognition of held-out subjects against the number of subjects learnt from. Raises PictureError."""
    from thenar.compiler.pictures import painting, rendered
    from thenar.runtime.files import write_atomically

    with painting(font_size=10):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.5, 5.0), layout="constrained", dpi=120)
        _draw(figure.subplots(), placement.study)
        figure.legend(frameon=False, loc="outside lower center", ncols=3, fontsize=8)
        write_atomically(path, rendered(figure, path.suffix.lower().removeprefix(".")))


def _draw(axes: "Axes", study: "Standard") -> None:
    """Draw a pair of lines for every aim: the mean and the worst tenth."""
    for aim, colour in (("plain", "#595959"), ("mean", "#0072b2"), ("worst tenth", "#d55e00")):
        points = [point for point in study.curve if point.aim == aim]
        sizes = [point.subjects for point in points]
        for what, style in (("mean", "-"), ("worst_tenth", "--")):
            rates = [100 * getattr(point.served, what) for point in points]
            label = f"{'mean' if what == 'mean' else 'worst tenth'}, {_BETTERED[aim]}"
            axes.plot(sizes, rates, style, marker="o", markersize=4, color=colour, label=label)
    axes.set_xscale("log")
    sizes = sorted({point.subjects for point in study.curve})
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.set_xlabel("subjects learnt from")
    axes.set_ylabel(f"recognition of {study.held_out} other subjects, %")
    axes.set_title(f"{len(study.columns)} switches for everybody")
    axes.grid(visible=True, alpha=0.3)
