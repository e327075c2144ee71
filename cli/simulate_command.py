"""`thenar simulate`: a scene in, a set of grasps out."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import counted

from .parameters import OutputFile, jobs_option, keep_apart, overwrite_flag, seed_range
from .printing import echo, json_flag, out, progress, show, table, warning

if TYPE_CHECKING:
    from thenar.simulator.pipeline.report import SimulationReport
    from thenar.simulator.scenes.scene import Rest

_SHOWN = 10  # unsettled repetitions that are listed individually


@click.command("simulate")
@click.argument("scene", required=False)
@click.option(
    "-o", "--output", type=OutputFile(".grasps"), metavar="SET.grasps", help="Simulate, and write the set here."
)
@overwrite_flag
@click.option("--list", "listing", is_flag=True, help="Only list the shipped scenes.")
@click.option("--repetitions", type=click.IntRange(1, 100_000), help="Trials per grasp type and subject.")
@click.option(
    "--more",
    metavar="N",
    type=click.IntRange(1, 100_000),
    help="Simulate N new grasps per type and subject instead: the same hands, habits and glove, later trials.",
)
@click.option(
    "--seed",
    type=seed_range,
    help="Redraw everything random: habits, calibrations, the glove's parts, all grasps. Hand sizes stay.",
)
@click.option("--subject", "names", multiple=True, metavar="NAME", help="Simulate only this subject; repeatable.")
@click.option("--subjects", metavar="N", type=click.IntRange(1), help="Simulate only the first N subjects.")
@click.option(
    "--rest",
    type=click.Choice(("relaxed", "flat")),
    help="Return to this open hand between grasps, for the scene's rest_ms; needs a scene of whole movements.",
)
@click.option("--keep-unsettled", is_flag=True, help="Keep repetitions in which the hand did not come to rest.")
@jobs_option("Worker processes. The set does not depend on it.")
@json_flag
def command(
    scene: str | None,
    output: Path | None,
    listing: bool,
    repetitions: int | None,
    more: int | None,
    seed: int | None,
    names: tuple[str, ...],
    subjects: int | None,
    rest: "Rest | None",
    keep_unsettled: bool,
    jobs: int,
) -> None:
    """Simulate SCENE: a TOML file, or a shipped scene's name.

    The same scene gives the same set on any machine and any number of cores. All data is labelled as simulated.

    \b
    Example:
        thenar simulate --list
        thenar simulate quick -o set.grasps
        thenar simulate quick --more 3 -o fresh.grasps
        thenar simulate crowd --subjects 20 --repetitions 6 -o hands.grasps
        thenar simulate continuous --rest flat -o flat.grasps
    """
    from thenar.simulator.errors import SceneError
    from thenar.simulator.pipeline.scene_file import load_scene, located, own_file, shipped_scenes

    if listing:
        if scene is not None or output is not None:
            raise click.UsageError("--list shows all shipped scenes: give it alone")
        scenes = shipped_scenes()
        listed = [{"name": name, "what": what} for name, what in scenes.items()]
        show(listed, lambda _: echo("\n".join(f"{name:<16}{what}" for name, what in scenes.items())))
        return
    if scene is None:
        raise click.UsageError("name a scene: a TOML file, or a shipped one (thenar simulate --list)")
    loaded = load_scene(scene).varied(repetitions, seed, names, more, rest, subjects)
    if output is None:
        raise click.UsageError("name the set to write: -o SET.grasps")
    from thenar.simulator.pipeline.simulation import simulate

    keep_apart(own_file(scene), output)
    try:
        with progress(f"simulating {loaded.name}") as report:
            simulated = simulate(loaded, jobs, report, keep_unsettled=keep_unsettled)
    except SceneError as fault:
        raise located(scene, fault) from fault
    simulated.grasp_set.save(output)
    show(simulated.report, _print_report, output, simulated.grasp_set.size)


def _print_report(report: "SimulationReport", path: Path, size: str) -> None:
    """Print the grasps by type, and warn of grasps that did not settle."""
    console = out()
    fresh = f"after repetition {report.done}, " if report.done else ""
    console.print(
        f"{path}: {size}, simulated: scene {report.scene}, seed {report.seed}, {fresh}"
        f"{counted(len(report.subjects), 'subject')}, {counted(report.repetitions, 'grasp')} in {report.seconds:.1f} s"
    )
    console.print()
    columns = (
        *("grasps", "frames", "switches ON", "from - to", "distinct patterns", "no contact", "unsettled"),
        *("N between switches", "largest residual N", "N mm"),
    )
    grasps = table(("grasp type", *columns), columns, "Grasps, simulated")
    for grasp in report.grasps:
        counts = (grasp.patterns, grasp.no_contact, grasp.unsettled)
        grasps.add_row(
            *(grasp.grasp, str(grasp.repetitions), str(grasp.rows)),
            *(f"{grasp.switches_mean:.1f}", f"{grasp.switches_least} - {grasp.switches_most}", *map(str, counts)),
            *(f"{grasp.between_n:.1f}", f"{grasp.residual_n:.2f}", f"{grasp.residual_nmm:.1f}"),
        )
    console.print(grasps)
    if report.lost_frames:
        console.print(f"{report.lost_frames} frames were lost; the frame received before is used in their place")
    if report.unsettled:
        what = "kept as requested" if report.kept_unsettled else "left out of the set (--keep-unsettled keeps them)"
        warning(f"{len(report.unsettled)} of {report.repetitions} grasps did not settle, and are {what}:")
        for one in report.unsettled[:_SHOWN]:
            place = f"subject {one.subject}, {one.grasp} with {one.object}, repetition {one.repetition}"
            echo(f"  {place}: {one.why}", err=True)
        if len(report.unsettled) > _SHOWN:
            echo(f"  and {len(report.unsettled) - _SHOWN} more: --json lists them all", err=True)
