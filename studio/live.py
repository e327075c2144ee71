"""The page *Live*: the build in use on the project's glove, or one of its recordings.

The run is one for all pages. A recording is shown to each page that asks for it, by the ids in its address; the few
that were shown last stay read.
"""

from contextlib import suppress
from pathlib import Path
from shlex import quote
from threading import Event

from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build
from thenar.runtime.glove import Glove
from thenar.runtime.web.live import LivePage
from thenar.runtime.web.replay import Replay

from .studio import Asked, Handler, Report, Studio

_MOST_REPLAYS = 4


class StudioLive:
    """The page *Live* of a studio."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._project = studio, studio.project
        # The checksum of the build that runs; and set when another came into use.
        self._running, self._swap = "", Event()
        self._unread = ""  # a sentence on inputs that the running build lacks on this glove
        # By their ids, with the recording's size and time of change: one that was continued is read anew.
        self._replays = dict[tuple[str, ...], tuple[tuple[int, int], Replay]]()
        requests: dict[str, Handler] = {
            "run": self._run,
            "halt": lambda _: studio.station.stop() if studio.station.doing == "live" else None,
            "use-build": self._use,
            "replay": lambda asked: self._replay(asked.ids, anew=True).about,
            **dict.fromkeys(("overview", "moments"), self._reply),
        }
        studio.add(requests, self.read)
        studio.closing.callback(self._close)

    def read(self, _: Report) -> None:
        """Let a run go on with the build in use, and tell the page."""
        with suppress(SettingError):
            if self._running not in ("", self._project.build()[1].manifest.checksum):
                self._swap.set()
        self._tell()

    def _tell(self) -> None:
        """Publish the commands that do what the page's buttons do, and what is wrong."""
        project = self._project
        members = project.members("recording") | project.members("build")
        paths = {member: quote(str(path)) for member, path in members.items()}
        run = why = ""
        try:
            run = project.command(["run", self._runnable()[0], "--glove", project.harness, "--web"])
        except ThenarError as reason:
            why = str(reason)
        self._studio.publish("live", paths=paths, run=run, why=why, unread=self._unread)

    def _runnable(self) -> tuple[Path, Build]:
        """Return the build to run. Raises ThenarError for what a run lacks."""
        if not self._project.harness.exists():
            raise SettingError(f"{self._project.harness} is missing: it says how the glove is wired")
        return self._project.build()

    def _run(self, _: Asked) -> None:
        self._runnable()
        if self._studio.station.doing != "live":
            self._studio.station.start("live", self._work)

    def _work(self, stop: Event) -> None:
        """Run the build in use, and whichever comes into use then, until `stop` is set."""
        page: LivePage | None = None
        try:
            while not stop.is_set():
                self._swap.clear()
                folder, build = self._runnable()
                self._running = build.manifest.checksum
                with Glove(build, self._project.harness, stop=stop) as glove:
                    self._unread = glove.system.unread
                    self._tell()
                    page = LivePage(self._studio.server, glove, folder, page)
                    for moment in glove:
                        page.show(moment)
                        if self._swap.is_set():
                            break
        finally:
            self._running = self._unread = ""
            self._tell()

    def _use(self, asked: Asked) -> None:
        self._project.remember(build=self._project.path("build", asked.id).name)
        self._studio.changed()

    def _replay(self, ids: tuple[str, ...], *, anew: bool = False) -> Replay:
        """Return a recording, the first id, with builds, the others, or with the build in use; `anew`: as it is now."""
        builds, current = self._project.members("build"), self._project.state.build
        used = [member for member, path in builds.items() if path.name == current]
        key = (*ids, *used) if len(ids) == 1 else ids
        if not 2 <= len(key) <= 3:
            raise ThenarError("choose a recording, and one build or two")
        if anew or key not in self._replays:
            path = self._project.path("recording", key[0])
            state = path.stat()
            version = state.st_size, state.st_mtime_ns
            if key not in self._replays or self._replays[key][0] != version:
                made = Replay(path, [self._project.path("build", build) for build in key[1:]])
                if key in self._replays:
                    self._replays.pop(key)[1].close()
                self._replays[key] = version, made
            for old in list(self._replays)[:-_MOST_REPLAYS]:
                self._replays.pop(old)[1].close()
        return self._replays[key][1]

    def _reply(self, asked: Asked) -> bytes:
        return self._replay(asked.ids).reply({"do": asked.do, "numbers": asked.numbers})

    def _close(self) -> None:
        for _, replay in self._replays.values():
            replay.close()
