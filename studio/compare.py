"""The page *Compare*: two builds on the trials in use and on one hand; and the report of a build as one file."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from shlex import join

from thenar.compiler.artifact.comparing import BuildComparison, compare_builds
from thenar.compiler.artifact.documents import REPORT_NAME, report_of_build
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import load_manifest
from thenar.runtime.files import write_atomically
from thenar.runtime.web.server import message

from .choose import ChoosePage, Recordings, drawn
from .sensors import sensors_read
from .studio import Asked, Handler, Job, Report, Studio


class ComparePage:
    """The page *Compare* of a studio, which compares on what `choose` has read."""

    def __init__(self, studio: Studio, choose: ChoosePage) -> None:
        self._studio, self._project, self._choose = studio, studio.project, choose
        requests: dict[str, Handler] = {"compare": self._job, "commands": self._commands, "report": self._export_job}
        studio.add(requests)

    def _chosen(self, asked: Asked) -> list[Path]:
        """Return two builds. Raises SettingError for other ids."""
        if len({*asked.ids}) != 2:
            raise SettingError("choose two builds to compare")
        return [self._project.path("build", member) for member in asked.ids]

    def _commands(self, asked: Asked) -> bytes:
        """Return the commands that do what the buttons do; "" for what cannot be done."""
        build, compare = self._project.path("build", asked.id), ""
        page = self._project.new_path(build.name, ".html")
        report = ["cp", str(build / REPORT_NAME), str(page)] if (build / REPORT_NAME).exists() else []
        with suppress(ThenarError):
            sets = [self._project.folder / name for name in self._choose.recordings.files]
            compare = self._project.command(["compare", *self._chosen(asked)], sets)
        return message("commands", report=join(report), compare=compare)

    def _job(self, asked: Asked) -> Job:
        return partial(_compare, asked.ids, self._chosen(asked), self._choose.recordings)

    def _export_job(self, asked: Asked) -> Job:
        return partial(self._export, self._project.path("build", asked.id))

    def _export(self, build: Path, _: Report) -> dict[str, object]:
        """Write the report of a build into the project, and return where."""
        page, saved = self._project.new_path(build.name, ".html"), report_of_build(build)
        write_atomically(page, saved)
        said = f"{page} works offline, in any browser"
        return {"said": said, "address": self._studio.server.offer(page.name, saved), "name": page.name}


def _compare(ids: Sequence[str], paths: Sequence[Path], now: Recordings, report: Report) -> dict[str, object]:
    found = compare_builds(paths[0], paths[1], now.grasp_set, report)
    a, b = (sensors_read(load_manifest(path)) for path in paths)
    return {
        "ids": ids,
        "numbering": now.numbering,
        "hand": drawn(now.grasp_set, now.hand),
        "names": [path.name for path in paths],
        "kept": {
            "both": [name for name in a if name in b],
            "a": [name for name in a if name not in b],
            "b": [name for name in b if name not in a],
        },
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
