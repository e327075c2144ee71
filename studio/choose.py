"""The page *Choose*: click sensors on and off, and see what they recognise.

Every browser has its own choice, so a page sends it whole and gets its own reply. What takes longer, a measurement
with nested folds or the curve of what sensors are worth, is queued, done one at a time by `run`, and sent to all pages.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from pathlib import Path
from queue import Empty, SimpleQueue
from shlex import quote
from threading import Event
from typing import Any

import msgspec

from thenar.compiler.artifact.compile import check_target, compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.artifact.sensor_study import SensorStudy, study_sensors
from thenar.compiler.glove.prices import Part
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.hand import HandShape, grid_places, places_of, shape_of, unknown_shape
from thenar.compiler.placement.constraints import Limits
from thenar.compiler.placement.elements import elements_of, names_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.drivers.closing import Closing
from thenar.drivers.errors import ThenarError
from thenar.runtime.errors import HarnessError
from thenar.runtime.hand import DrawnSwitch, HandDrawing
from thenar.runtime.recipe import Recipe
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us
from thenar.runtime.web.server import Server, message

from .quick import QuickAccuracy

PAGES = Path(__file__).parent / "pages"
_MOST_QUEUED = 8
_LOOK_S = 0.2


class _Asked(msgspec.Struct, frozen=True):
    """What a page asks for: "choose", "measure", "train", "add" (the best) or "drop" (the least) for sensors by their
    numbers, a "trial" by its number as they read it, or the "curve".
    """

    do: str
    sensors: tuple[int, ...] = ()
    trial: int = 0


class ChoosePage(Closing):
    """Serves the page until it is closed; a context manager.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings.
    path : Path
        Their file, as commands are to name it.
    address, token
        As for `Server`.
    hand : HandShape, optional
        The glove laid flat, with the positions of all switches and pads. Without, they are drawn in a grid.
    parts : mapping of str to Part, optional
        The part of a price list for every sensor, by name.
    options : sequence of str
        Options of `thenar compile` that name the files of hand and parts, for the command that the page shows.
    output : Path, optional
        The folder of the builds that the page trains; without one it trains none.
    jobs : int
        Worker processes of a measurement.

    Attributes
    ----------
    server : Server
        The server of the page; `server.url` is its address.

    Raises
    ------
    CompileError, EvaluationError
        If the recordings have a single grasp type, or cannot be cut into folds, or `output` holds other things.
    SettingError, SinkError
        As `Server` does.
    """

    def __init__(
        self,
        grasp_set: GraspSet,
        path: Path,
        address: str,
        *,
        token: str | None,
        hand: HandShape | None = None,
        parts: Mapping[str, Part] | None = None,
        options: Sequence[str] = (),
        output: Path | None = None,
        jobs: int = -1,
    ) -> None:
        self._path, self._set, self._jobs = path, grasp_set, jobs
        self._parts, self._options = parts or {}, options
        self._prices = {name: part.price for name, part in self._parts.items()}
        self._hand, self._output = hand, None if output is None else check_target(output)
        self._quick = QuickAccuracy(self._set)
        self._levels = self._levels_of()
        self._queue = SimpleQueue[_Asked]()
        drawn = _drawn(self._set, hand)
        kinds = ["switch"] * len(self._set.switch_names) + ["pad"] * len(self._set.taxel_columns)
        kinds += ["joint"] * len(self._set.joints)
        about = {
            "name": path.name,
            "trains": output is not None,
            "grasps": self._quick.grasps,
            "trials": self._quick.trials,
            "sensors": [
                {"name": name, "kind": kind, "price": self._prices.get(name)}
                for name, kind in zip(self._quick.names, kinds, strict=True)
            ],
        }
        self._first = message("set", about), message("hand", drawn)
        self.server = Server(
            "choose", address, token=token, on_message=self._take, hello=lambda: self._first, folder=PAGES
        )

    def run(self, stop: Event) -> None:
        """Measure what pages ask for, until `stop` is set."""
        while not stop.is_set():
            try:
                asked = self._queue.get(timeout=_LOOK_S)
            except Empty:
                continue
            try:
                self._measure(asked)
            except (ThenarError, OSError, BrokenExecutor) as reason:
                # Parameters are named between backticks, for commands to spell.
                self.server.publish("work", message("work", done=0, total=0, why=str(reason).replace("``", "")))

    def close(self) -> None:
        """Close the page."""
        self.server.close()

    def _take(self, fields: Mapping[str, object]) -> bytes | None:
        """Reply to a page. Raises ThenarError for a request that cannot be met."""
        try:
            asked = msgspec.convert(fields, _Asked)
        except msgspec.ValidationError as wrong:
            raise ThenarError(f"the page sent an invalid message: {wrong}") from None
        if asked.do == "choose":
            return self._reply(asked.sensors)
        if asked.do in ("add", "drop"):
            find = self._quick.best_next if asked.do == "add" else self._quick.least
            return message(asked.do, sensor=find(asked.sensors), sensors=asked.sensors)
        if asked.do == "trial":
            return message("trial", self._quick.trial(asked.trial, asked.sensors), trial=asked.trial)
        if asked.do not in ("measure", "curve", "train"):
            raise ThenarError(f"a page cannot {asked.do}")
        if asked.do == "train" and self._output is None:
            raise ThenarError("no folder is known for a build: start thenar studio with -o")
        if asked.do != "curve" and not asked.sensors:
            raise ThenarError("choose a sensor first: without any, nothing can be learnt")
        if self._queue.qsize() >= _MOST_QUEUED:
            raise ThenarError(f"{_MOST_QUEUED} measurements are waiting already: let them finish")
        self._names(asked.sensors)
        self._queue.put(asked)
        return None

    def _names(self, sensors: Sequence[int]) -> tuple[str, ...]:
        """Return the names of sensors, each once, in this order. Raises EvaluationError if there is no such number."""
        self._quick.check(sensors)
        return tuple(dict.fromkeys(self._quick.names[sensor] for sensor in sensors))

    def _reply(self, sensors: Sequence[int]) -> bytes:
        names = self._names(sensors)
        return message(
            "quick",
            self._quick.of(sensors),
            sensors=sensors,
            scan_us=self._scan_us(names),
            price=sum(self._prices[name] for name in names) if self._prices else None,
            command=self._command(names),
        )

    def _command(self, names: Sequence[str]) -> str:
        """Return the command that compiles a build of these sensors."""
        if not names:
            return ""
        folder, have = quote(str(self._output or "build")), quote(",".join(names))
        more = "".join(f" {quote(option)}" for option in self._options)
        return f"thenar compile {quote(str(self._path))} -o {folder}{more} --sensors {len(names)} --have {have}"

    def _scan_us(self, names: Sequence[str]) -> float | None:
        """Return the time on the wire of a scan of the switches and pads in `names`, on the chips that are proposed;
        None if one bus has no room for them.
        """
        read = [self._levels[name] for name in names if name in self._levels]
        try:
            harness = propose_harness(read)
        except HarnessError:
            return None
        return scan_us(whole_scan(harness, read), harness).us if read else 0.0

    def _levels_of(self) -> dict[str, str]:
        """Return the element that a switch or a pad is read as, by its name: itself, or a level."""
        held = self._set.without_none()
        elements = elements_of(Samples.of(held), 1)
        every = self._set.element_names
        return {every[one.column]: name for one, name in zip(elements, names_of(held, elements), strict=True)}

    def _measure(self, asked: _Asked) -> None:
        """Measure the curve, or the accuracy of chosen sensors, or train a build of these; tell all pages."""

        def report(done: int, total: int) -> None:
            self.server.publish("work", message("work", done=done, total=total, what=asked.do))

        report(0, 1)
        names = self._names(asked.sensors)
        recipe = Recipe() if asked.do == "curve" else Recipe(sensors=len(names), have=names)
        many: dict[str, Any] = {"jobs": self._jobs}
        if asked.do == "train":
            assert self._output is not None
            documents = Documents(self._hand, parts=self._parts)
            built = compile_build(self._set, self._output, recipe, documents=documents, progress=report, **many)
            content: dict[str, Any] = {"folder": str(self._output), "facts": [str(fact) for fact in built.facts]}
        else:
            limits = Limits.of(recipe, self._set, {}, prices=self._prices)
            content = self._content(study_sensors(self._set, recipe, limits=limits, report=report, **many))
        self.server.publish(asked.do, message(asked.do, sensors=asked.sensors, **content))
        report(1, 1)

    def _content(self, study: SensorStudy) -> dict[str, object]:
        numbers = {name: number for number, name in enumerate(self._quick.names)}
        return {
            "of": study.of,
            "enough": study.enough,
            "recipe": str(study.recipe),
            "points": [
                {
                    "sensors": [numbers[name] for name in point.sensors],
                    **{name: getattr(point, name) for name in ("mean", "low", "high", "adapted", "papers")},
                    "worth": "" if point.worth is None else str(point.worth),
                }
                for point in study.points
            ],
        }


def _drawn(grasp_set: GraspSet, hand: HandShape | None) -> HandDrawing:
    """Return a drawing in which every switch and pad of a set is one to click on: its number is the sensor's."""
    names = grasp_set.element_names
    known = hand if hand is not None and names and hand.knows(names) else None
    places = grid_places(names) if known is None else places_of(known, names)
    switches = tuple(DrawnSwitch(name, x, y, number) for number, (name, (x, y)) in enumerate(places.items()))
    shown = unknown_shape("the positions of the sensors are unknown") if known is None else shape_of(known)
    return HandDrawing(**shown, switches=switches, taxels=(), joints=())
