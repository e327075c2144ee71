"""The page *Compare*: two builds on the trials in use and on one hand; and the report of a build as one file."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from shlex import join

from thenar.compiler.artifact.comparing import BuildComparison, compare_builds
from thenar.compiler.artifact.documents import REPORT_NAME, report_of_build
from thenar.compiler.facts import SensorCount
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import TABLES_NAME, Build
from thenar.runtime.files import write_atomically
from thenar.runtime.web.server import message

from .choose import ChoosePage, Recordings, drawn
from .project import Project
from .sensors import scan_time_us, sensors_read
from .studio import Asked, Handler, Report, Studio


def add_compare_page(studio: Studio, choose: ChoosePage) -> None:
    """Add the page *Compare* to a studio, which compares on what `choose` has read."""
    requests: dict[str, Handler] = {
        "compare": lambda asked: partial(_compare, studio.project, _chosen(studio, asked), asked.ids, choose.recordings),
        "commands": partial(_commands, studio, choose),
        "report": lambda asked: partial(_export, studio, studio.project.path("build", asked.id)),
    }
    studio.add(requests)


def _chosen(studio: Studio, asked: Asked) -> list[Path]:
    """Return two builds. Raises SettingError for other ids."""
    if len({*asked.ids}) != 2:
        raise SettingError("choose two builds to compare")
    return [studio.project.path("build", member) for member in asked.ids]


def _compare(
    project: Project, paths: Sequence[Path], ids: Sequence[str], now: Recordings, report: Report
) -> dict[str, object]:
    builds = [Build.load(path) for path in paths]
    found = compare_builds(paths[0], paths[1], now.grasp_set, report)
    kept = [sensors_read(build.manifest) for build in builds]
    shown = [
        {
            "name": path.name,
            "right": right,
            "ends": ends,
            "sensors": str(SensorCount.of_build(build.manifest)),
            "scan_us": scan_time_us([switch.name for switch in build.manifest.switches], project),
            "bytes": (path / TABLES_NAME).stat().st_size,
            "price": sum(now.prices[name] for name in names) if now.parts else None,
            "stated": str(build.manifest.headline or "not measured"),
        }
        for path, build, names, right, ends in zip(paths, builds, kept, (found.a, found.b), found.ends, strict=True)
    ]
    return {
        "ids": ids,
        "numbering": now.numbering,
        "hand": drawn(now.grasp_set, now.hand),
        "builds": shown,
        "both": [name for name in kept[0] if name in kept[1]],
        "only": [[name for name in one if name not in other] for one, other in (kept, kept[::-1])],
        "found": found,
        "said": _said(found, *(path.name for path in paths)),
    }


def _said(found: BuildComparison, a: str, b: str) -> str:
    """Return the difference of build b from build a in a sentence."""
    middle, low, high = (100 * share for share in (found.difference, found.low, found.high))
    ahead = f"{b} is {middle:.1f} points better" if middle else f"{a} and {b} are equally good"
    if middle < 0:
        ahead, low, high = f"{a} is {-middle:.1f} points better", -high, -low
    return f"{ahead} [{low:.1f}, {high:.1f}], on {found.trials} {found.of}"


def _commands(studio: Studio, choose: ChoosePage, asked: Asked) -> bytes:
    """Return the commands that do what the buttons do; "" for what cannot be done."""
    build, compare = studio.project.path("build", asked.id), ""
    page = studio.project.new_path(build.name, ".html")
    report = ["cp", str(build / REPORT_NAME), str(page)] if (build / REPORT_NAME).exists() else []
    with suppress(ThenarError):
        sets = [studio.project.folder / name for name in choose.recordings.files]
        compare = studio.project.command(["compare", *_chosen(studio, asked)], sets)
    return message("commands", report=join(report), compare=compare)


def _export(studio: Studio, build: Path, _: Report) -> dict[str, object]:
    """Write the report of a build into the project, and return where."""
    page, saved = studio.project.new_path(build.name, ".html"), report_of_build(build)
    write_atomically(page, saved)
    said = f"{page} works offline, in any browser"
    return {"said": said, "address": studio.server.offer(page.name, saved), "name": page.name}
