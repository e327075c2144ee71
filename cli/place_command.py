"""`thenar place`: choose the sensors, or by a method the switches, to keep."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from thenar.compiler.text import DASH, counted
from thenar.runtime.recipe import AUTO

from .options import (
    CHOOSING,
    TrainingCommand,
    asked_settings,
    glove_option,
    hand_of,
    layout_option,
    parts_of,
    prices_option,
    recipe_options,
    terms_of,
    trainer_option,
)
from .parameters import OutputFile, existing_file, jobs_option, keep_apart, overwrite_flag, picture_file
from .printing import echo, json_flag, out, print_json, progress, show, table, wants_json, write_json, write_picture

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thenar.compiler.artifact.sensor_study import SensorStudy
    from thenar.compiler.placement.placement import Placement
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.recipe import Recipe


# Options with which a method chooses switches, instead of the search among all sensors.
_OF_METHODS = {"placement", "keep", "prune", "keep_joints", "apart_mm", "at_most_taxels", "budget_us", "show_tree"}


@click.command("place", cls=TrainingCommand)
@click.argument("grasps", type=existing_file)
@recipe_options(*CHOOSING)
@recipe_options("inputs")
@click.option("--drop", type=click.IntRange(1), metavar="N", help="Keep all sensors but the N that are missed least.")
@click.option("--instead-of", metavar="NAME", help="Replace this one of the chosen sensors, or of those of --have.")
@layout_option
@prices_option
@glove_option
@recipe_options("folds", least=2)
@recipe_options("seed", "by")
@trainer_option(AUTO)
@jobs_option()
@click.option("--tree", "show_tree", is_flag=True, help="Also print ID3's tree.")
@click.option("--draw", type=picture_file, help="Also draw the curve and the hand: an .svg or .png file.")
@click.option("-o", "--output", type=OutputFile(".json"), help="Also store the placement as JSON.")
@overwrite_flag
@json_flag
@click.pass_context
def command(
    context: click.Context,
    /,
    grasps: Path,
    jobs: int,
    drop: int | None,
    instead_of: str | None,
    layout: Path | None,
    prices: Path | None,
    glove: Path | None,
    show_tree: bool,
    draw: Path | None,
    output: Path | None,
    **chosen: Any,
) -> None:
    """Say which sensors of GRASPS, a .grasps file, are worth keeping: switches, pads and joints in one pool.

    It prints the accuracy for new subjects (or new trials, of one subject) with the best 1, 2, 3 ... sensors, what each
    next one is worth, and where more stop to matter; with --sensors N or --price the best ones alone. Sensors are
    chosen and models trained inside each fold. `thenar compile` with the same options keeps the same.

    With --method, or --prune, it lists what a placement method keeps instead: the paper's ID3 the switches of its tree,
    in the order of their decisions, with their information gain; other methods a given number of switches, best first.
    Joints are then counted apart; `thenar evaluate` measures the accuracy.

    \b
    Example:
        thenar place set.grasps --draw curve.svg
        thenar place set.grasps --sensors 8
        thenar place set.grasps --price 60 --prices prices.toml
        thenar place set.grasps --have flex_thumb,flex_index --sensors 5
        thenar place set.grasps --drop 2
        thenar place set.grasps --sensors 8 --instead-of palm_3
        thenar place set.grasps --prune 13 --tree -o placement.json
        thenar place set.grasps --method id3-cost --keep 16 --glove glove.toml
        thenar place set.grasps --method elimination --keep 16 --have thumb_distal_5 --apart-mm 8
    """
    from thenar.compiler.placement.placement import place
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.recipe import Recipe, changed

    training = asked_settings(context, chosen)
    recipe = changed(Recipe(), chosen | training)
    keep_apart(grasps, glove, layout, prices, draw, output)
    asked = {name for name in context.params if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    if not asked & _OF_METHODS:
        if glove is not None:
            raise click.UsageError("--glove gives scan costs, and sensors are chosen without: leave it out")
        if layout is not None and draw is None:
            raise click.UsageError("--layout gives positions for --draw, or for --apart-mm with a --method: add that")
        _place_sensors(GraspSet.load(grasps), recipe, drop, instead_of, layout, prices, jobs, draw, output)
        return
    if drop or instead_of:
        raise click.UsageError("--drop and --instead-of are for sensors: leave --method and its options out")
    _check(asked, recipe, training, show_tree, draw)
    grasp_set = GraspSet.load(grasps)
    terms = terms_of(recipe, grasp_set, layout, glove, prices)
    with progress(f"choosing switches by {recipe.placement}"):
        placement = place(grasp_set, recipe, **terms)
    if output is not None:
        write_json(output, placement.document())
    if wants_json():
        print_json(placement.document())
        return
    if show_tree and placement.tree is not None:
        echo(placement.tree.text(placement.all_names, placement.grasps))
    _print(placement)


def _place_sensors(
    grasp_set: "GraspSet",
    recipe: "Recipe",
    drop: int | None,
    instead_of: str | None,
    layout: Path | None,
    prices: Path | None,
    jobs: int,
    draw: Path | None,
    output: Path | None,
) -> None:
    """Print the worth of sensors: of each number, or of those that are asked for."""
    from thenar.compiler.artifact.sensor_study import draw_curve, number_without, study_sensors, without_one
    from thenar.runtime.recipe import changed

    if drop:
        if recipe.sensors is not None or recipe.price is not None:
            raise click.UsageError("--drop says how many sensors are left: leave --sensors and --price out")
        recipe = changed(recipe, {"sensors": number_without(grasp_set, recipe, drop)})
    terms = terms_of(recipe, grasp_set, None, None, prices)
    if instead_of:
        recipe = without_one(grasp_set, recipe, terms["limits"], instead_of)
        terms = terms_of(recipe, grasp_set, None, None, prices)
    with progress("measuring what sensors are worth") as report:
        study = study_sensors(grasp_set, recipe, limits=terms["limits"], jobs=jobs, report=report, rough=_print_rough)
    if draw is not None:
        hand = hand_of(layout).fitted(grasp_set.element_names)
        write_picture(draw, partial(draw_curve, study, hand))
    if output is not None:
        write_json(output, study)
    parts = {} if prices is None else {name: part.name for name, part in parts_of(grasp_set, prices).items()}
    show(study, lambda found: _print_sensors(found, parts))
    if instead_of and not wants_json():
        echo(f"{study.chosen[-1].name} replaces {instead_of}; the other sensors were chosen from all rows")


def _print_rough(done: int, folds: int, rates: dict[int, float]) -> None:
    """Print the accuracies of the first of several folds, long before all are measured."""
    if done == 1 < folds and len(rates) > 1:
        shown = ", ".join(f"{number}: {100 * rate:.0f} %" for number, rate in rates.items())
        echo(f"rough, from the first of {folds} folds: {shown}", err=True)


def _print_sensors(study: "SensorStudy", parts: "Mapping[str, str]") -> None:
    """Print the curve, where it stops to matter, and the chosen sensors."""
    own = study.points[0].adapted is not None
    paper = study.points[0].papers is not None
    columns = ["sensors", f"{study.of}, %", "worth of the last, points"]
    columns += ["after 2 own trials, %"] * own + ["as many by ID3, %"] * paper
    grid = table((*columns, "added"), columns, title="What sensors are worth")
    for point in study.points:
        cells = [str(point.number), f"{100 * point.mean:.1f} [{100 * point.low:.1f}, {100 * point.high:.1f}]"]
        cells += [DASH if point.worth is None else str(point.worth)]
        cells += [DASH if point.adapted is None else f"{100 * point.adapted:.1f}"] * own
        cells += [DASH if point.papers is None else f"{100 * point.papers:.1f}"] * paper
        grid.add_row(*cells, ", ".join([*point.added, *(f"without {name}" for name in point.removed)]))
    if len(study.points) > 1:
        out().print(grid)
        echo(_where_it_ends(study))
    if len(study.left_out) < len(study.chosen):
        echo(f"left out: {', '.join(study.left_out) or 'none'}")
    else:
        _print_chosen(study, parts)
    point = study.point
    rate = f"{100 * point.mean:.1f} [{100 * point.low:.1f}, {100 * point.high:.1f}] % {study.of}"
    price = "" if study.price is None else f", price {study.price:.2f}"
    echo(f"{len(study.chosen)} of {study.there} sensors{price}: {rate}; {study.recipe}")


def _print_chosen(study: "SensorStudy", parts: "Mapping[str, str]") -> None:
    """Print the chosen sensors, and which of them another one is worth nearly as much as."""
    priced = study.price is not None
    heads = ("", "sensor", "chosen in folds", *(["part", "price"] if priced else []), "stand-in", "loss with it")
    chosen = table(heads, ("", "chosen in folds", "price", "loss with it"), title=f"The best {len(study.chosen)}")
    for number, row in enumerate(study.chosen, 1):
        cost = [parts.get(row.name, ""), f"{row.price:.2f}"] if priced and row.price is not None else []
        rise = DASH if row.rise is None else f"{100 * row.rise:+.1f} %"
        chosen.add_row(str(number), row.name, f"{row.folds} of {study.folds}", *cost, row.stand_in or DASH, rise)
    out().print(chosen)
    for row in study.alike:
        echo(f"{row.stand_in} is worth nearly as much as {row.name}: take the one that is cheaper or easier to mount")


def _where_it_ends(study: "SensorStudy") -> str:
    """Return the sentence that says after how many sensors more stop to matter."""
    later = next((point.worth for point in study.points if point.number > study.enough), None)
    if later is None:
        return f"the curve does not flatten up to {counted(study.enough, 'sensor')}"
    return f"after {counted(study.enough, 'sensor')} the next is worth {later} points"


def _check(asked: set[str], recipe: "Recipe", training: dict[str, Any], show_tree: bool, draw: Path | None) -> None:
    """Raise UsageError if options conflict, or are for an accuracy that is not measured."""
    from thenar.compiler.placement.methods.base import PAPERS

    if wants_json() and show_tree:
        raise click.UsageError("--tree is for people and --json for machines: give one of them")
    if show_tree and recipe.placement != PAPERS:
        raise click.UsageError("--tree prints the tree of the paper's ID3 only: leave it out")
    if draw is not None:
        raise click.UsageError("--draw draws what sensors are worth: leave --method and its options out")
    for name in sorted(asked & {"by", "seed", "folds", *training}):
        raise click.UsageError(f"--{name.replace('_', '-')} is for an accuracy, which evaluate measures: leave it out")


def _print(placement: "Placement") -> None:
    """Print the table of switches, their value, and remarks on how they were found."""
    tree, sensors = placement.tree, str(placement.sensors)
    if tree is None:
        rows = ((str(order), str(kept.number), kept.name) for order, kept in enumerate(placement.switches, 1))
        out().print(table(("order", "column", "name"), title="Placement", rows=rows))
        echo(f"{sensors}{', in addition to the joints' if placement.joints else ''}. {placement.how}")
    else:
        switches = table(("column", "name", "gain, bits", "cumulative share"), title="Placement")
        for kept in placement.switches:
            switches.add_row(str(kept.number), kept.name, f"{kept.gain_bits:.4f}", f"{kept.cumulative_share:.1%}")
        out().print(switches)
        pruned = f", pruned at S = {tree.min_samples}" if tree.min_samples else ""
        bits = f"{placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits of the grasp type"
        echo(
            f"{sensors}: {bits}; the tree has "
            f"{len(tree.nodes) - tree.n_leaves} decisions, {tree.n_leaves} leaves, depth {tree.depth}{pruned}"
        )
        if placement.entropy_bits == 0:
            echo("all rows are of one grasp type: there is nothing to distinguish")
        elif placement.rows < tree.min_samples:
            echo(f"no decision was made: the {placement.rows} rows are fewer than S = {tree.min_samples}")
        for remark in tree.remarks("switch"):
            echo(remark)
    if placement.kept_joints:
        echo(f"the kept joints, in addition: {', '.join(placement.kept_joints)}")
