"""`thenar simulate`: a scene in, a set of grasps out, and what each of its effects does and costs."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import json_flag, keep_apart, output_file, print_json, progress
from .lines import echo

if TYPE_CHECKING:
    from thenar.simulator.scenes.scene import Scene

_MODES = ("--output", "--explain", "--ablate", "--list")


@click.command("simulate")
@click.argument("scene", required=False)
@click.option("-o", "--output", type=output_file, metavar="SET.grasps", help="Simulate, and write the set there.")
@click.option("--explain", is_flag=True, help="Only say which steps would run, in which order, and what each costs.")
@click.option("--ablate", is_flag=True, help="Remove each effect in turn: what that does to recognition and time.")
@click.option("--list", "listing", is_flag=True, help="Only list the scenes that are shipped.")
@click.option("--repetitions", type=click.IntRange(1, 100_000), help="Of each grasp type by each subject.")
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), help="Other random numbers; the subjects stay.")
@click.option("--subject", "subjects", multiple=True, metavar="NAME", help="Only this subject; may be given again.")
@click.option("--keep-unsettled", is_flag=True, help="Keep repetitions in which the hand did not come to rest.")
@click.option(
    "--jobs", type=click.IntRange(1), help="Worker processes. The set does not depend on it.  [default: all cores]"
)
@json_flag
def command(
    scene: str | None,
    output: Path | None,
    explain: bool,
    ablate: bool,
    listing: bool,
    repetitions: int | None,
    seed: int | None,
    subjects: tuple[str, ...],
    keep_unsettled: bool,
    jobs: int | None,
    as_json: bool,
) -> None:
    """Simulate SCENE: a TOML file, or a shipped scene by its name.

    The same scene gives the same set on any machine and any number of cores. Whatever comes out is simulated.

    \b
    Example:
        thenar simulate --list
        thenar simulate quick --explain
        thenar simulate quick -o set.grasps
    """
    _check_modes(scene, (output, explain, ablate, listing), keep_unsettled=keep_unsettled)
    if scene is None:
        _list(as_json=as_json)
        return
    from thenar.simulator.scenes.decode import load_scene, own_file

    loaded = load_scene(scene).varied(repetitions, seed, subjects)
    with _located(scene):
        if output is not None:
            keep_apart(own_file(scene), loaded.postures, output)
            _simulate(loaded, output, jobs or -1, keep_unsettled=keep_unsettled, as_json=as_json)
        elif explain:
            _explain(loaded, jobs or -1, as_json=as_json)
        else:
            _ablate(loaded, jobs or -1, as_json=as_json)


def _check_modes(scene: str | None, given: tuple[object, ...], *, keep_unsettled: bool) -> None:
    """Raise UsageError unless exactly one thing is asked for, with what it needs."""
    asked = [name for name, value in zip(_MODES, given, strict=True) if value]
    if len(asked) != 1:
        raise click.UsageError(f"say one of {', '.join(_MODES)}")
    if (asked == ["--list"]) != (scene is None):
        raise click.UsageError(
            "name a scene: a TOML file, or a shipped one (thenar simulate --list)"
            if scene is None
            else f"--list shows all shipped scenes: leave out {scene}"
        )
    if keep_unsettled and asked != ["--output"]:
        raise click.UsageError("--keep-unsettled is about the set that --output writes")


@contextmanager
def _located(name: str) -> Iterator[None]:
    """Say of what is wrong with a scene in which file and line it stands."""
    from thenar.simulator.errors import SceneError
    from thenar.simulator.scenes.decode import located

    try:
        yield
    except SceneError as fault:
        raise located(name, fault) from fault


def _simulate(scene: "Scene", output: Path, jobs: int, *, keep_unsettled: bool, as_json: bool) -> None:
    from thenar.simulator.running.simulation import simulate

    with progress(f"simulating {scene.name}") as report:
        simulated = simulate(scene, jobs, report, keep_unsettled=keep_unsettled)
    simulated.grasp_set.save(output)
    if as_json:
        print_json(simulated.report)
        return
    from .simulate_tables import print_report

    print_report(simulated.report, output)


def _explain(scene: "Scene", jobs: int, *, as_json: bool) -> None:
    from thenar.simulator.running.explain import explain

    explanation = explain(scene, jobs)
    if as_json:
        print_json(explanation)
        return
    from .simulate_tables import print_explanation

    print_explanation(explanation)


def _ablate(scene: "Scene", jobs: int, *, as_json: bool) -> None:
    from thenar.simulator.running.ablation import ablate

    with progress(f"removing the effects of {scene.name}") as report:
        ablation = ablate(scene, jobs, report)
    if as_json:
        print_json(ablation)
        return
    from .simulate_tables import print_ablation

    print_ablation(ablation)


def _list(*, as_json: bool) -> None:
    from thenar.simulator.scenes.decode import shipped_scenes

    found = shipped_scenes()
    if as_json:
        print_json(found)
        return
    for scene in found:
        echo(f"{scene.name:<16}{scene.what}")
