"""`thenar place`: which switches to keep."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .common import existing_file, json_flag, keep_apart, output_file, picture_file, print_json, progress
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.recordings.graspset import GraspSet

_PAPERS = "id3"
_FOR_CROWDS = "elimination"


@dataclass(frozen=True, slots=True)
class _Options:
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

    def check(self) -> None:
        """Raise UsageError if the options do not go together."""
        for wrong, reason in (
            (self.as_json and self.show_tree, "--tree is for people and --json for machines: take one of them"),
            (self.show_tree and not self.of_tree, "--tree prints the tree of the paper's ID3 alone"),
            (self.draw is not None and not (self.of_tree or self.crowd), "--draw draws ID3's tree, or a --crowd"),
            (self.exact and self.crowd, "--exact judges one placement and --crowd looks for one: take one of them"),
            (self.crowd and self.method == _PAPERS, "--crowd takes a method that is told how many switches to --keep"),
            (self.joints and self.of_tree, "--joints is for the methods beside the paper's ID3"),
            (
                self.by_size and self.prune is not None,
                "--prune is for ID3: this method takes --keep",
            ),
            (self.by_size and self.keep is None, "tell this method how many switches to --keep"),
            (not self.by_size and self.keep is not None, "ID3 takes --prune S: to --keep a number, name a --method"),
        ):
            if wrong:
                raise click.UsageError(reason)
        if self.glove is not None:
            self._check_priced()
        keep_apart(self.grasps, self.glove, self.draw, self.output)

    def _check_priced(self) -> None:
        from thenar.compiler.frontier.search import PRICED_METHODS

        if self.crowd or self.method not in PRICED_METHODS:
            raise click.UsageError(
                f"--glove says what scans cost: take it with a --method that heeds it: {', '.join(PRICED_METHODS)}"
            )

    @property
    def of_tree(self) -> bool:
        """Whether the paper's ID3 is all that is wanted."""
        return self.method in (None, _PAPERS) and not self.exact and not self.crowd

    @property
    def by_size(self) -> bool:
        """Whether the method takes a number of switches."""
        return self.crowd or self.method not in (None, _PAPERS)


@click.command("place")
@click.argument("grasps", type=existing_file)
@click.option("--method", metavar="NAME", help="How to choose; a wrong NAME lists them all.  [default: id3]")
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
    from thenar.compiler.recordings.graspset import GraspSet

    asked = _Options(**options)
    asked.check()
    grasp_set = GraspSet.load(asked.grasps)
    found = _answer(asked, grasp_set)
    if asked.output is not None:
        _store(found, asked.output)
    if asked.as_json:
        print_json(found)


def _answer(asked: _Options, grasp_set: "GraspSet") -> Any:
    if asked.of_tree:
        return _of_tree(asked, grasp_set)
    return _of_crowd(asked, grasp_set) if asked.crowd else _of_method(asked, grasp_set)


def _of_tree(asked: _Options, grasp_set: "GraspSet") -> Any:
    from thenar.compiler.placement.placement import place

    with progress(f"growing the tree of {asked.grasps.name}"):
        placement, tree = place(grasp_set, asked.prune or 0)
    types = [grasp_set.taxonomy.types[number] for number in map(int, tree.classes)]
    if asked.draw is not None:
        from thenar.compiler.placement.draw import draw_tree

        draw_tree(tree, asked.draw, grasp_set.switch_names, types)
    if asked.show_tree:
        echo(tree.text(grasp_set.switch_names, types))
    if not asked.as_json:
        from .place_tree import print_placement

        print_placement(placement)
    return placement


def _of_method(asked: _Options, grasp_set: "GraspSet") -> Any:
    from thenar.compiler.frontier.timing.whole_glove import ports_of_whole_glove
    from thenar.runtime.harness.loading import load_harness

    from .place_chosen import chosen, print_chosen

    method, parameter = asked.method or _PAPERS, asked.keep if asked.by_size else asked.prune
    harness = None if asked.glove is None else load_harness(asked.glove)
    lacking = set() if harness is None else set(grasp_set.switch_names) - set(harness.switches)
    if lacking:
        raise click.UsageError(
            f"{asked.glove} has no place for {min(lacking)!r} of {asked.grasps}: name the whole glove's glove.toml."
        )
    ports = ports_of_whole_glove(harness, grasp_set.switch_names)
    choice = chosen(grasp_set, method, float(parameter or 0), joints=asked.joints, exact=asked.exact, ports=ports)
    if not asked.as_json:
        print_chosen(choice)
    return choice


def _of_crowd(asked: _Options, grasp_set: "GraspSet") -> Any:
    from .place_crowd import crowded, draw_crowd, print_crowd

    method, keep = asked.method or _FOR_CROWDS, asked.keep or 1
    placement = crowded(grasp_set, method, keep, joints=asked.joints, jobs=asked.jobs or -1)
    if asked.draw is not None:
        draw_crowd(placement, asked.draw)
    if not asked.as_json:
        print_crowd(placement)
    return placement


def _store(found: Any, path: Path) -> None:
    import msgspec

    from thenar.runtime.files import write_atomically

    write_atomically(path, msgspec.json.format(msgspec.json.encode(found), indent=2) + b"\n")
