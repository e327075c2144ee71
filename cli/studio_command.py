"""`thenar studio`: choose sensors on a page in the browser."""

from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Any

import click

from .options import hand_of, layout_option, parts_of, prices_option
from .parameters import WEB_ADDRESS, OutputFolder, existing_file, jobs_option, web_token_option
from .printing import say


@click.command("studio")
@click.argument("grasps", metavar="SET.grasps", type=existing_file)
@click.option("-o", "--output", type=OutputFolder(), help="Folder of the build that the page trains.")
@layout_option
@prices_option
@jobs_option()
@click.option("--web", metavar="ADDRESS", default=WEB_ADDRESS, show_default=True, help="Address of the page.")
@web_token_option
def command(
    grasps: Path,
    output: Path | None,
    layout: Path | None,
    prices: Path | None,
    jobs: int,
    web: str,
    web_token: str | None,
) -> None:
    """Choose sensors on a page in the browser: click them on and off, and see what they recognise.

    The hand is the control. The accuracy of a new subject, the weakest pair, the time of a scan and the price follow
    each click. Measure runs nested folds; the curve shows what each sensor is worth; Train writes a build. A click on
    a number of the matrix of errors shows its trials.

    SIGINT, SIGTERM and SIGHUP end it at once, what is measured or trained included, with exit code 0.

    \b
    Example:
        thenar studio set.grasps
        thenar studio set.grasps -o build/ --layout layout.toml --prices prices.toml
    """
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.studio import ChoosePage

    grasp_set = GraspSet.load(grasps)
    files = {"--layout": layout, "--prices": prices}
    choices: dict[str, Any] = {
        "hand": hand_of(layout).fitted(grasp_set.element_names),
        "parts": parts_of(grasp_set, prices),
        "options": [word for option, path in files.items() if path is not None for word in (option, str(path))],
        "output": output,
        "jobs": jobs,
    }
    with suppress(KeyboardInterrupt), ChoosePage(grasp_set, grasps, web, token=web_token, **choices) as page:
        say(f"thenar: the page is at {page.server.url}")
        page.run(Event())
