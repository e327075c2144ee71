"""`thenar evaluate`: the paper's tables for the user's recordings."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thenar.compiler.text import DASH, counted

from .consoles import Table
from .options import (
    CHOOSING,
    LIMITS,
    TrainingCommand,
    asked_settings,
    glove_option,
    layout_option,
    method_list,
    prices_option,
    recipe_options,
    terms_of,
    trainer_option,
)
from .parameters import (
    ListOf,
    OutputFile,
    comma_separated,
    existing_file,
    jobs_option,
    keep_apart,
    overwrite_flag,
)
from .printing import json_flag, out, progress, show, table, wants_json, warning, write_json

if TYPE_CHECKING:
    from thenar.compiler.artifact.stream_study import StreamStudy, SubjectMean
    from thenar.compiler.evaluation.study import Study, StudyRun
    from thenar.compiler.evaluation.tables import RateTable
    from thenar.compiler.wearer_study import WearerStudy
    from thenar.runtime.recipe import Recipe

_USUAL = ("compositions", "generality", "pruning", "baselines")
TABLES = (*_USUAL, "trainers")


def _numbers(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, ...]:
    """Return the comma-separated whole numbers in `value`, each once, in the order given; none if not given."""
    if value is None:
        return ()
    parts = comma_separated(value)
    if not all(part.isascii() and part.isdigit() for part in parts):
        raise click.BadParameter(f"{value!r} is not a list of whole numbers such as 0,13,62")
    return tuple(dict.fromkeys(map(int, parts)))


def _protocols(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
    return ("paper", "nested") if value == "both" else (value,)


@click.command(cls=TrainingCommand)
@click.argument("grasps", type=existing_file)
@click.option("--subject", "subjects", multiple=True, metavar="NAME", help="Use only this subject; repeatable.")
@recipe_options("folds", least=2)
@click.option(
    "--by",
    "scheme",
    type=click.Choice(("trial", "subject", "object", "session")),
    default="trial",
    show_default=True,
    help="What a fold tests: trials at random, or a left-out subject, object or session.",
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=1,
    show_default=True,
    help="Repeats of random folds, each with another seed.",
)
@trainer_option("logitboost")
@recipe_options(*CHOOSING)
@layout_option
@prices_option
@glove_option
@click.option(
    "--prune-list",
    callback=_numbers,
    metavar="S,S,...",
    default="0,13,62",
    show_default=True,
    help="Values of S for pooled pruning.",
)
@click.option(
    "--protocol",
    "protocols",
    callback=_protocols,
    type=click.Choice(("both", "paper", "nested")),
    default="nested",
    show_default=True,
    help="Rows that choose the placement: all (paper), or those of each training fold (nested).",
)
@recipe_options("seed")
@jobs_option()
@click.option(
    "--baselines",
    type=method_list,
    default="cmim,mutual-information",
    show_default=True,
    help="Methods to compare the recipe's with, separated by commas.",
)
@click.option(
    "--tables",
    type=ListOf("table", lambda: TABLES, none=True),
    default=",".join(_USUAL),
    show_default=True,
    help="Tables to print, or none: compositions (the paper's II, V), generality (III, VI), pruning (IV, VII), "
    "baselines, and trainers, which takes longer.",
)
@click.option(
    "--streams",
    is_flag=True,
    help="Evaluate segmentation of whole movements instead, leaving out one subject at a time.",
)
@click.option(
    "--adapt",
    "numbers",
    callback=_numbers,
    metavar="N,N,...",
    help="Evaluate adaptation to each subject, left out, by the first N trials of each type instead.",
)
@click.option("-o", "--output", type=OutputFile(".json"), metavar="FILE", help="Write the whole result as JSON.")
@overwrite_flag
@json_flag
@click.pass_context
def command(
    context: click.Context,
    /,
    grasps: Path,
    jobs: int,
    streams: bool,
    numbers: tuple[int, ...],
    output: Path | None,
    layout: Path | None,
    prices: Path | None,
    glove: Path | None,
    **asked: Any,
) -> None:
    """Cross-validate GRASPS and print the paper's tables: accuracies in percent, with 95 % intervals.

    The placement is chosen inside each training fold; with --protocol paper from all rows, as the paper did, which is
    optimistic. Random and information-greedy placements with equally many switches are the baselines for ID3.

    Frames of one trial are never on both sides of a fold. Accuracies count trials, each classified by majority vote of
    its frames; if trials have several frames, the accuracy of single frames is added.

    --tables trainers compares trainers, each with hyperparameters chosen on its training rows.

    With --streams, GRASPS holds whole movements: placement, tables and segment costs are learnt without the subject
    whose streams are decoded, live and afterwards, and compared with the dwell rule.

    --by subject --adapt leaves out each subject. It adapts the others' model to the subject's first trials, as `thenar
    adapt` does with the strength that suits the other subjects, and tests it on the rest, before and after.

    \b
    Example:
        thenar evaluate set.grasps
        thenar evaluate set.grasps --by subject
        thenar evaluate movements.grasps --streams --trainer logit
        thenar evaluate set.grasps --by subject --adapt 1,2,3
        thenar evaluate set.grasps --by subject -o result.json
    """
    from thenar.compiler.evaluation.study import StudyDesign, StudyRun
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.recipe import Recipe, changed

    keep_apart(grasps, output, layout, prices, glove)
    training = asked_settings(context, asked)
    chosen = {name: asked.pop(name) for name in (*CHOOSING, "folds", "seed")}
    recipe = changed(Recipe(), chosen | training)
    if streams or numbers:
        kind = "streams" if streams else "adapt"
        given = {name: chosen[name] for name in LIMITS} | {"layout": layout, "prices": prices, "glove": glove}
        given["adapt"] = streams and numbers
        if unused := next((name for name, value in given.items() if value), ""):
            raise click.UsageError(f"--{unused.replace('_', '-')} is not for --{kind}: leave one of them out.")
        if numbers and (asked["scheme"] != "subject" or not all(numbers)):
            raise click.UsageError("--adapt leaves a subject out: give --by subject, and numbers of 1 or more trials.")
        _evaluate_people(grasps, recipe, asked["subjects"], numbers, jobs, output)
        return
    asked["tables"] = tuple(name for name in TABLES if name in asked["tables"])
    design = StudyDesign(recipe, **asked)
    grasp_set = GraspSet.load(grasps)
    run = StudyRun(grasp_set, design, **terms_of(recipe, grasp_set, layout, glove, prices))
    for sentence in run.study.warnings:
        warning(sentence)
    study = replace(run.study, tables=tuple(_tables(run, jobs)))
    if output is not None:
        write_json(output, study)
    show(study, _print_end)


def _evaluate_people(
    grasps: Path, recipe: "Recipe", subjects: tuple[str, ...], numbers: tuple[int, ...], jobs: int, output: Path | None
) -> None:
    """Leave out each subject: evaluate adaptation by these numbers of trials, or without any, decoders of segments."""
    import numpy as np

    from thenar.compiler.artifact.stream_study import study_streams
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.wearer_study import study_wearers

    with progress("adapting to each subject" if numbers else "evaluating streams", lines=not numbers) as report:
        grasp_set = GraspSet.load(grasps)
        if subjects:
            grasp_set = grasp_set.rows(np.isin(grasp_set.subjects, subjects))
        adapted = study_wearers(grasp_set.without_none(), recipe, (0, *numbers), jobs, report) if numbers else None
        decoded = study_streams(grasp_set, recipe, jobs, report) if adapted is None else None
    if output is not None:
        write_json(output, adapted or decoded)
    if adapted is not None:
        show(adapted, _print_wearers)
    elif decoded is not None:
        show(decoded, _print_streams)


def _print_wearers(study: "WearerStudy") -> None:
    numbers = ("mean", "worst")
    grid = table(("", *numbers), numbers, str(study.recipe))
    for row in study.rows:
        interval = "" if row.low is None or row.high is None else f" [{100 * row.low:.1f}, {100 * row.high:.1f}]"
        grid.add_row(row.title, f"{100 * row.mean:.1f}{interval}", f"{100 * min(row.people):.1f}")
    out().print()
    out().print(grid)
    people = counted(len(study.rows[0].people), "person", "people")
    out().print(f"{counted(study.trials, 'trial')} of {people}; accuracies in %, means over people with 95 % intervals")


def _print_streams(study: "StreamStudy") -> None:
    from thenar.compiler.artifact.stream_study import FALSE, SHARES, TIMES

    console = out()
    for inputs in dict.fromkeys(row.inputs for row in study.rows):
        for columns in (SHARES, (*TIMES, FALSE)):
            grid = table(("", "", *columns), columns, f"inputs: {inputs}; {study.recipe}")
            for row in study.rows:
                if row.inputs == inputs:
                    cells = (_cell(row.values[name], 100 if name in SHARES else 1) for name in columns)
                    grid.add_row(row.method, row.what, *cells)
            console.print()
            console.print(grid)
    console.print(
        f"{counted(study.movements, 'movement')} of {counted(len(study.subjects), 'subject')}, {study.seconds:,.0f} s; "
        "each subject left out in turn; shares in %, means over subjects with 95 % intervals (Student). Nothing held "
        "counts as background. False: segments announced while nothing is held, per hundred movements."
    )


def _cell(value: "SubjectMean", times: int) -> str:
    if value.mean is None:
        return DASH
    ends = [f"{times * end:.0f}" for end in (value.low, value.high) if end is not None]
    return f"{times * value.mean:.1f}" + (f" [{', '.join(ends)}]" if ends else "")


def _tables(run: "StudyRun", jobs: int) -> Iterator["RateTable"]:
    """Yield the tables; print each, laid out as in the paper, as soon as its fits are run."""
    from thenar.compiler.evaluation.folds import PROTOCOLS

    console = out()
    for protocol, meaning in PROTOCOLS.items():
        if protocol in run.study.options.protocols and not wants_json():
            console.print(f"Protocol {protocol}: {meaning}")
    for name in run.names:
        with progress(f"evaluating {name[0]}") as report:
            (rated,) = run.tables([name], jobs, report)
        if not wants_json():
            console.print()
            console.print(_rates(rated))
            if rated.note:
                console.print(rated.note)
        yield rated


def _print_end(study: "Study") -> None:
    """Print what has no table, and what was evaluated."""
    console = out()
    console.print()
    for missing in study.left_out:
        console.print(f"no table of {missing.name}: {missing.reason}")
    console.print(str(study))


def _rates(rated: "RateTable") -> Table:
    from thenar.compiler.evaluation.tables import both

    averaged = ["all"] if len(rated.columns) > 1 else []
    paired = [f"against {row.paired.than}" for row in rated.rows if row.paired is not None][:1]
    numbers = ("switches", *rated.columns, *averaged, *paired)
    grid = table(("", "", *numbers), numbers, rated.title)
    for row in rated.rows:
        average = [both(row.rate, row.frames)] if averaged else []
        compared = [str(row.paired or "")] if paired else []
        grid.add_row(row.name, row.what, str(row.switches), *map(str, row.cells), *average, *compared)
    return grid
