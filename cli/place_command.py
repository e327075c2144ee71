"""`thenar place`: choose the switches to keep."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .common import (
    OutputFile,
    existing_file,
    json_flag,
    keep_apart,
    out,
    overwrite_flag,
    picture_file,
    print_json,
    progress,
    table,
    wants_json,
    write_json,
)
from .lines import echo
from .options import (
    WithMethods,
    hand_of,
    keep_joints_option,
    keep_option,
    layout_option,
    levels_option,
    limit_options,
    method_option,
    prune_option,
    warn_of_budget,
)

if TYPE_CHECKING:
    from thenar.compiler.placement.constraints import Limits
    from thenar.compiler.placement.methods.base import Method
    from thenar.compiler.placement.placement import Placement
    from thenar.compiler.placement.ports import PortCosts
    from thenar.compiler.placement.tree import Tree
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.harness.wiring import Harness


@dataclass(frozen=True, slots=True)
class _Asked:
    """The user's options."""

    grasps: Path
    method: str | None
    prune: int
    keep: int | None
    joints: bool
    levels: int | None
    keep_joints: int | None
    glove: Path | None
    keep_these: tuple[str, ...]
    never: tuple[str, ...]
    apart_mm: float | None
    at_most: int | None
    budget_us: float | None
    robust: bool
    layout: Path | None
    show_tree: bool
    draw: Path | None
    output: Path | None

    @property
    def chosen_by(self) -> "Method":
        """The requested method, or the usual one."""
        from thenar.compiler.placement.methods.base import METHODS, PAPERS

        return METHODS.named(self.method or PAPERS)

    def check(self) -> None:
        """Raise UsageError if options conflict."""
        from thenar.compiler.placement.methods.base import PAPERS

        method = self.chosen_by
        tree = method.name == PAPERS
        for wrong, reason in (
            (wants_json() and self.show_tree, "--tree is for people and --json for machines: give one of them"),
            (self.show_tree and not tree, "--tree prints the tree of the paper's ID3 only: leave it out"),
            (self.draw is not None and not tree, "--draw draws the tree of the paper's ID3 only: leave it out"),
            (self.layout is not None and self.apart_mm is None, "--layout gives positions for --apart-mm: add that"),
            (self.joints and tree, "--joints is for methods other than the paper's ID3"),
        ):
            if wrong:
                raise click.UsageError(reason)
        method.check_given(self.keep, self.prune)
        if self.glove is not None and not (method.uses_ports or self.budget_us is not None):
            from thenar.compiler.placement.methods.base import METHODS

            heeding = ", ".join(name for name, each in METHODS.items() if each.uses_ports)
            raise click.UsageError(f"--glove gives the scan costs: use it with a --method that weighs them: {heeding}")
        keep_apart(self.grasps, self.glove, self.draw, self.output)

    def limits(self, grasp_set: "GraspSet") -> "Limits | None":
        """Return the limits of the placement."""
        from thenar.compiler.placement.constraints import Limits
        from thenar.runtime.manifest import Options

        hand = hand_of(self.layout).by_name if self.apart_mm else {}
        asked = Options(
            keep_these=self.keep_these,
            never=self.never,
            apart_mm=self.apart_mm,
            at_most_taxels=self.at_most,
            budget_us=self.budget_us,
        )
        glove = None if self.harness is None else self.harness.cyberglove
        warn_of_budget(self.budget_us, grasp_set.joint_names if self.keep_joints else (), glove)
        return Limits.of(asked, grasp_set, hand, glove)

    @property
    def harness(self) -> "Harness | None":
        """The wiring of the whole glove."""
        from thenar.runtime.harness.loading import load_harness

        return None if self.glove is None else load_harness(self.glove)

    def ports(self, grasp_set: "GraspSet") -> "PortCosts | None":
        """Return the reading cost of each switch."""
        from thenar.compiler.placement.ports import ports_of_whole_glove
        from thenar.runtime.scanning.plan import unwired

        harness = self.harness
        lacking = [] if harness is None else unwired(harness, grasp_set.element_names)
        if lacking:
            raise click.UsageError(
                f"{self.glove} does not wire {min(lacking)!r} of {self.grasps}: name the whole glove's glove.toml."
            )
        return ports_of_whole_glove(harness, grasp_set.element_names, len(grasp_set.taxel_columns))

    def found(self) -> "Placement":
        """Return the placement."""
        from thenar.compiler.placement.placement import place
        from thenar.compiler.recordings.graspset import GraspSet

        grasp_set, method = GraspSet.load(self.grasps), self.chosen_by
        with progress(f"choosing switches by {method.name}"):
            return place(
                grasp_set,
                float(self.prune if self.keep is None else self.keep),
                method=method.name,
                joints=self.joints,
                ports=self.ports(grasp_set) if method.uses_ports or self.budget_us is not None else None,
                limits=self.limits(grasp_set),
                robust=self.robust,
                levels=self.levels,
                keep_joints=self.keep_joints,
            )


@click.command("place", cls=WithMethods)
@click.argument("grasps", type=existing_file)
@method_option
@keep_option
@levels_option
@keep_joints_option
@prune_option
@limit_options
@layout_option
@click.option("--joints", is_flag=True, help="Choose switches that add to the joints.  [default: switches alone]")
@click.option(
    "--glove",
    type=existing_file,
    help="A glove.toml: the costs of its ports, for methods that weigh them.  [default: MCP23017]",
)
@click.option("--tree", "show_tree", is_flag=True, help="Also print ID3's tree.")
@click.option("--draw", type=picture_file, help="Also draw ID3's tree: an .svg or .png file.")
@click.option("-o", "--output", type=OutputFile(".json"), help="Also store the placement as JSON.")
@overwrite_flag
@json_flag
def command(**options: Any) -> None:
    """Choose the switches and levels of GRASPS, a .grasps file, that distinguish its grasp types.

    The paper's method, ID3, keeps the switches of its tree, printed in the order of their decisions, each with its
    information gain and the cumulative share of the grasp types' entropy. Other methods keep a given number of
    switches, best first.

    \b
    Example:
        thenar place set.grasps
        thenar place set.grasps --prune 13 --draw tree.svg -o placement.json
        thenar place set.grasps --method elimination --keep 16
        thenar place set.grasps --method id3-cost --keep 16 --glove glove.toml
        thenar place set.grasps --method elimination --keep 16 --keep-these thumb_distal_5 --apart-mm 8
    """
    asked = _Asked(**options)
    asked.check()
    placement = asked.found()
    if asked.draw is not None:
        from thenar.compiler.placement.drawing import draw_placement

        draw_placement(placement, asked.draw)
    if asked.output is not None:
        write_json(asked.output, placement.document())
    if wants_json():
        print_json(placement.document())
        return
    if asked.show_tree and placement.tree is not None:
        echo(placement.tree.text(placement.all_names, placement.grasps))
    _print(placement)


def _print(placement: "Placement") -> None:
    """Print the table of switches, their value, and remarks on how they were found."""
    if placement.tree is not None:
        switches = table(("column", "name", "gain, bits", "cumulative share"), title="Placement")
        for kept in placement.switches:
            switches.add_row(str(kept.number), kept.name, f"{kept.gain_bits:.4f}", f"{kept.cumulative_share:.1%}")
    else:
        switches = table(("order", "column", "name"), title="Placement")
        for order, kept in enumerate(placement.switches, 1):
            switches.add_row(str(order), str(kept.number), kept.name)
    out().print(switches)
    for sentence in _sentences(placement):
        echo(sentence)


def _sentences(placement: "Placement") -> Iterator[str]:
    kept = str(placement.sensors)
    if placement.tree is not None:
        tree, prune = placement.tree, placement.tree.min_samples
        yield (
            f"{kept}: {placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits of the grasp type; the tree has "
            f"{len(tree.nodes) - tree.n_leaves} decisions, {tree.n_leaves} leaves, depth {tree.depth}"
            + (f", pruned at S = {prune}" if prune else "")
        )
        yield from _of_tree(placement, tree)
    else:
        yield f"{kept}{', in addition to the joints' if placement.joints else ''}. {placement.how}"
    if placement.kept_joints:
        yield f"the kept joints, in addition: {', '.join(placement.kept_joints)}"


def _of_tree(placement: "Placement", tree: "Tree") -> Iterator[str]:
    """Yield the reasons if nothing was decided, or something was decided without a gain."""
    if placement.entropy_bits == 0:
        yield "all rows are of one grasp type: there is nothing to distinguish"
    elif placement.rows < tree.min_samples:
        yield f"no decision was made: the {placement.rows} rows are fewer than S = {tree.min_samples}"
    yield from tree.remarks("switch")
