"""`thenar place`: which switches to keep."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .common import existing_file, json_flag, keep_apart, output_file, picture_file, print_json, progress
from .lines import echo
from .methods import WithMethods

if TYPE_CHECKING:
    from thenar.compiler.placement.methods.base import Method
    from thenar.compiler.placement.placement import Placement
    from thenar.compiler.placement.ports import PortCosts
    from thenar.compiler.recordings.graspset import GraspSet


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the user asked for."""

    grasps: Path
    method: str | None
    prune: int | None
    keep: int | None
    exact: bool
    crowd: bool
    joints: bool
    glove: Path | None
    jobs: int | None
    show_tree: bool
    draw: Path | None
    output: Path | None
    as_json: bool

    @property
    def chosen_by(self) -> "Method":
        """The method asked for, or the usual one."""
        from thenar.compiler.placement.methods.base import BEST, METHODS, PAPERS

        return METHODS.named(self.method or (BEST if self.crowd else PAPERS))

    def check(self) -> None:
        """Raise UsageError if the options do not go together."""
        from thenar.compiler.placement.methods.base import PAPERS

        method = self.chosen_by
        tree = method.name == PAPERS
        for wrong, reason in (
            (self.as_json and self.show_tree, "--tree is for people and --json for machines: take one of them"),
            (self.show_tree and not tree, "--tree prints the tree of the paper's ID3 alone"),
            (self.draw is not None and not (tree or self.crowd), "--draw draws ID3's tree, or a --crowd"),
            (self.exact and self.crowd, "--exact judges one placement and --crowd looks for one: take one of them"),
            (
                self.crowd and not method.by_number,
                "--crowd takes a method that is told how many switches to --keep",
            ),
            (self.joints and tree, "--joints is for the methods beside the paper's ID3"),
            (method.by_number and self.prune is not None, "--prune is for ID3: this method takes --keep"),
            (method.by_number and self.keep is None, "tell this method how many switches to --keep"),
            (
                not method.by_number and self.keep is not None,
                "ID3 takes --prune S: to --keep a number, name a --method",
            ),
        ):
            if wrong:
                raise click.UsageError(reason)
        if self.glove is not None and (self.crowd or not method.uses_ports):
            from thenar.compiler.placement.methods.base import METHODS

            heeding = ", ".join(name for name, each in METHODS.items() if each.uses_ports)
            raise click.UsageError(f"--glove says what scans cost: take it with a --method that heeds it: {heeding}")
        keep_apart(self.grasps, self.glove, self.draw, self.output)

    def ports(self, grasp_set: "GraspSet") -> "PortCosts | None":
        """Return what reading each switch costs."""
        from thenar.compiler.placement.ports import ports_of_whole_glove
        from thenar.runtime.harness.loading import load_harness

        harness = None if self.glove is None else load_harness(self.glove)
        lacking = set() if harness is None else set(grasp_set.switch_names) - set(harness.switches)
        if lacking:
            raise click.UsageError(
                f"{self.glove} has no place for {min(lacking)!r} of {self.grasps}: name the whole glove's glove.toml."
            )
        return ports_of_whole_glove(harness, grasp_set.switch_names)

    def found(self) -> "Placement":
        """Return the placement."""
        from thenar.compiler.placement.placement import place
        from thenar.compiler.placement.population import place_for_crowd
        from thenar.compiler.recordings.graspset import GraspSet

        grasp_set, method = GraspSet.load(self.grasps), self.chosen_by
        with progress(f"choosing switches by {method.name}") as report:
            if self.crowd:
                return place_for_crowd(
                    grasp_set,
                    self.keep or 1,
                    method=method.name,
                    joints=self.joints,
                    jobs=self.jobs or -1,
                    on_done=report,
                )
            return place(
                grasp_set,
                float((self.keep if method.by_number else self.prune) or 0),
                method=method.name,
                joints=self.joints,
                ports=self.ports(grasp_set) if method.uses_ports else None,
                exact=self.exact,
                on_round=report,
            )


@click.command("place", cls=WithMethods)
@click.argument("grasps", type=existing_file)
@click.option("--method", metavar="NAME", help="How to choose: see below.  [default: id3]")
@click.option("--prune", type=click.IntRange(min=0), metavar="S", help="ID3: end nodes of fewer than S rows.")
@click.option("--keep", type=click.IntRange(min=1), metavar="M", help="Other methods: keep at most M switches.")
@click.option("--joints", is_flag=True, help="Choose what helps beside the joints (default: switches alone).")
@click.option(
    "--glove",
    type=existing_file,
    help="A glove.toml: its ports' costs for methods that heed them.  [default: MCP23017]",
)
@click.option("--exact", is_flag=True, help="Also say how far the placement is from the best of as many switches.")
@click.option("--crowd", is_flag=True, help="One standard placement for many subjects, the worst-served included.")
@click.option("--jobs", type=click.IntRange(min=1), help="Processes for --crowd.  [default: all cores]")
@click.option("--tree", "show_tree", is_flag=True, help="ID3: also print the tree.")
@click.option("--draw", type=picture_file, help="Also draw ID3's tree, or how a crowd is served: an .svg or .png file.")
@click.option("-o", "--output", type=output_file, help="Also store the placement: a .json file to write.")
@json_flag
def command(**options: Any) -> None:
    """Choose the switches of GRASPS that tell its grasp types apart: with ID3, those that its tree asks for.

    They stand in the order in which the tree asks for them, each with the information it brought and the share of
    the grasp types' entropy that it and all before it brought. Other methods take a number of switches to keep.

    \b
    Example:
        thenar place set.grasps
        thenar place set.grasps --prune 13 --draw tree.svg -o placement.json
        thenar place set.grasps --method elimination --keep 16 --exact
        thenar place set.grasps --method id3-cost --keep 16 --glove glove.toml
        thenar place crowd.grasps --crowd --keep 16 --draw subjects.svg
    """
    asked = _Asked(**options)
    asked.check()
    placement = asked.found()
    if asked.draw is not None:
        from thenar.compiler.placement.drawing import draw_placement

        draw_placement(placement, asked.draw)
    if asked.output is not None:
        _store(placement, asked.output)
    if asked.as_json:
        print_json(placement.document())
        return
    from .place_tables import print_placement

    if asked.show_tree and placement.tree is not None:
        echo(placement.tree.text(placement.all_names, placement.grasps))
    print_placement(placement)


def _store(placement: "Placement", path: Path) -> None:
    import msgspec

    from thenar.runtime.files import write_atomically

    write_atomically(path, msgspec.json.format(msgspec.json.encode(placement.document()), indent=2) + b"\n")
