"""The page *Compare*: two builds on the same trials and on one hand; and the report of a build as one file."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from shlex import join

from thenar.compiler.artifact.comparing import BuildComparison, compare_builds
from thenar.compiler.artifact.documents import REPORT_NAME, report_of_build
from thenar.compiler.facts import SensorCount
from thenar.drivers.errors import SettingError
from thenar.runtime.build import TABLES_NAME, Build
from thenar.runtime.files import write_atomically
from thenar.runtime.web.server import message

from .choose import drawn
from .project import Project
from .sensors import scan_time_us, sensors_read
from .studio import Asked, Handler, Job, Report, Studio


def add_compare_page(studio: Studio) -> None:
    """Add the page *Compare* to a studio."""
    requests: dict[str, Handler] = {
        "compare": lambda asked: partial(_compare, studio.project, asked.ids, *_chosen(studio, asked)),
        "commands": partial(_commands, studio),
        "report": partial(_exporting, studio),
    }
    studio.add(requests)


def _chosen(studio: Studio, asked: Asked) -> tuple[list[Path], list[Path]]:
    """Return two builds and sets. Raises SettingError for other ids."""
    if len(asked.ids) < 3 or asked.ids[0] == asked.ids[1]:
        raise SettingError("choose two builds to compare, and recordings on which to compare them")
    builds = [studio.project.path("build", member) for member in asked.ids[:2]]
    return builds, [studio.project.path("set", member) for member in asked.ids[2:]]


def _compare(
    project: Project, ids: Sequence[str], paths: Sequence[Path], sets: Sequence[Path], report: Report
) -> dict[str, object]:
    builds = [Build.load(path) for path in paths]
    grasp_set, _, unused = project.recordings(sets)
    found = compare_builds(paths[0], paths[1], grasp_set, report)
    a, b = kept = [sensors_read(build.manifest) for build in builds]
    prices = {name: part.price for name, part in project.parts(list({**a, **b})).items()}
    shown = [
        {
            "name": path.name,
            "right": right,
            "ends": ends,
            "sensors": str(SensorCount.of_build(build.manifest)),
            "scan_us": scan_time_us([switch.name for switch in build.manifest.switches], project),
            "bytes": (path / TABLES_NAME).stat().st_size,
            "price": sum(prices[name] for name in names) if prices else None,
            "stated": str(build.manifest.headline or "not measured"),
        }
        for path, build, names, right, ends in zip(paths, builds, kept, (found.a, found.b), found.ends, strict=True)
    ]
    return {
        "ids": ids,
        "hand": drawn(grasp_set, project.hand().fitted(grasp_set.element_names)),
        "builds": shown,
        "kept": {
            "both": [name for name in a if name in b],
            "a": [name for name in a if name not in b],
            "b": [name for name in b if name not in a],
        },
        "found": found,
        "said": _said(found, *(path.name for path in paths)),
        "unused": unused,
    }


def _said(found: BuildComparison, a: str, b: str) -> str:
    """Return the difference of build b from build a in a sentence."""
    middle, low, high = (100 * share for share in (found.difference, found.low, found.high))
    ahead = f"{b} is {middle:.1f} points better" if middle else f"{a} and {b} are equally good"
    if middle < 0:
        ahead, low, high = f"{a} is {-middle:.1f} points better", -high, -low
    return f"{ahead} [{low:.1f}, {high:.1f}], on {found.trials} {found.of}"


def _commands(studio: Studio, asked: Asked) -> bytes:
    """Return the commands that do what the buttons do; "" for what cannot be done."""
    build, compare = studio.project.path("build", asked.id), ""
    page = studio.project.new_path(build.name, ".html")
    report = ["cp", str(build / REPORT_NAME), str(page)] if (build / REPORT_NAME).exists() else []
    with suppress(SettingError):
        builds, sets = _chosen(studio, asked)
        compare = studio.project.command(["compare", *builds], sets)
    return message("commands", report=join(report), compare=compare)


def _exporting(studio: Studio, asked: Asked) -> Job:
    return partial(_export, studio, studio.project.path("build", asked.id))


def _export(studio: Studio, build: Path, _: Report) -> dict[str, object]:
    """Write the report of a build into the project, and return where."""
    page, saved = studio.project.new_path(build.name, ".html"), report_of_build(build)
    write_atomically(page, saved)
    said = f"{page} works offline, in any browser"
    return {"said": said, "address": studio.server.offer(page.name, saved), "name": page.name}
