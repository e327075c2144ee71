"""The page *Compare*: two builds on the same trials and on one hand; and what is exported of a build."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from shlex import join, quote
from zipfile import ZipFile

from thenar.compiler.artifact.comparing import BuildComparison, compare_builds
from thenar.compiler.artifact.documents import REPORT_NAME, report_of_build
from thenar.compiler.facts import SensorCount
from thenar.compiler.firmware.generate import firmware_files, write_folder
from thenar.compiler.firmware.targets import TARGETS
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
        **dict.fromkeys(("report", "firmware"), partial(_exporting, studio)),
    }
    studio.add(requests)
    studio.publish("targets", targets=[(name, target.help) for name, target in TARGETS.items()])


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
    kept = [sensors_read(build.manifest) for build in builds]
    prices = {name: part.price for name, part in project.parts(list({**kept[0], **kept[1]})).items()}
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
        "both": [name for name in kept[0] if name in kept[1]],
        "only": [[name for name in one if name not in other] for one, other in (kept, kept[::-1])],
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


def _places(project: Project, asked: Asked) -> tuple[Path, Path, Path]:
    """Return the folder of a build, and the file and the folder to export to. Raises SettingError for another id, and
    for a name that is no target.
    """
    build, target = project.path("build", asked.id), TARGETS.named(asked.name)
    return build, project.new_path(build.name, ".html"), project.new_path(f"{build.name}-{target.name}")


def _commands(studio: Studio, asked: Asked) -> bytes:
    """Return the commands that do what the buttons do; "" for what cannot be done."""
    build, page, folder = _places(studio.project, asked)
    firmware = studio.project.command(["firmware", build, "--target", asked.name, "-o", folder])
    report = ["cp", str(build / REPORT_NAME), str(page)] if (build / REPORT_NAME).exists() else []
    compare = ""
    with suppress(SettingError):
        builds, sets = _chosen(studio, asked)
        compare = studio.project.command(["compare", *builds], sets)
    return message("commands", report=join(report), firmware=firmware, compare=compare)


def _exporting(studio: Studio, asked: Asked) -> Job:
    _places(studio.project, asked)
    return partial(_export, studio, asked)


def _export(studio: Studio, asked: Asked, _: Report) -> dict[str, object]:
    """Write a build's report, or its firmware, into the project, and return where."""
    build, page, folder = _places(studio.project, asked)
    if asked.do == "firmware":
        loaded, content = Build.load(build), BytesIO()
        write_folder(firmware_files(loaded.tables, loaded.manifest, asked.name), folder)
        with ZipFile(content, "w") as archive:
            for path in sorted(folder.rglob("*")):
                archive.write(path, path.relative_to(folder.parent))
        name, saved = f"{folder.name}.zip", content.getvalue()
        said = TARGETS[asked.name].next_step.format(folder=quote(str(folder)))
    else:
        name, saved, said = page.name, report_of_build(build), f"{page} works offline, in any browser"
        write_atomically(page, saved)
    return {"said": said, "address": studio.server.offer(name, saved), "name": name}
