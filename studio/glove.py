"""The page *Glove*: connect a glove, watch its sensors, and calibrate them."""

import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from threading import Event
from time import monotonic
from typing import get_args

from thenar.drivers.errors import SettingError, ThenarError
from thenar.drivers.transports import line_port_fault
from thenar.runtime.files import write_atomically
from thenar.runtime.frames import GloveFrame, now_us
from thenar.runtime.harness.checks import faults
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.sources import Sources
from thenar.runtime.live.stream_probe import CYBERGLOVE, propose_glove
from thenar.runtime.names import list_names, of_device, shortened
from thenar.runtime.posing import PoseGuide, PoseKey
from thenar.runtime.published import DeviceHealth
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.web.server import message

from .calibrating import PRESS_WORDS, Codes, PressStage, lead_poses, lead_presses
from .collecting import WAIT_US
from .sensors import GloveSensors
from .studio import Asked, Report, Studio, glove_shown

_LISTEN_S, _HOLD_S, _BAUD = 5.0, 1.0, 115_200
_SHOW_S, _RATE_S, _PAST_S = 0.2, 1.0, 30.0
_MOST_KEPT = 3000
# By this much a value changes when a hand moves, and so often do others while a sensor that stays the same is stuck.
_LEAST_CHANGE = {"switch": 1, "pad": 10, "joint": 3}
_CHANGES_OF_OTHERS = {"switch": 20, "pad": 500, "joint": 500}
_PORTS = ("serial/by-id/*", "ttyUSB*", "ttyACM*")
_ADVICE = {
    "lost": "cannot be read: check its wire and its place in glove.toml",
    "stuck": "stays the same while others change: look whether it sticks, or its wires touch",
    "never seen": "has not changed yet: press it, or bend the finger",
}
_JOINTS_FILE, _PADS_FILE = "joints.toml", "taxels.toml"
_UNCALIBRATED = {"joint": "The joints are not calibrated.", "pad": "The taxels are not calibrated."}


class GlovePage:
    """The page *Glove* of a studio."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._project = studio, studio.project
        self._proposal = ""
        self._past: Sequence[deque[tuple[float, int | None]]] = ()
        requests: Mapping[str, Callable[[Asked], bytes | None]] = {
            "watch": lambda _: studio.station.start("watching", self._watch),
            "find": self._on_find,
            "connect": self._on_connect,
            "past": self._on_past,
            "calibrate": self._on_calibrate,
        }
        studio.add(requests, self.read)

    def read(self, report: Report) -> None:
        """Show the glove of the project, or what one can be connected to."""
        there, why = self._project.harness.exists(), ""
        content: dict[str, object] = {"hand": None, "names": (), "kinds": (), "lacks": ()}
        if there:
            try:
                sensors = GloveSensors(self._project)
                content = {"hand": sensors.drawing, "names": sensors.names}
                content |= {"kinds": sensors.kinds, "lacks": sensors.lacks}
            except (ThenarError, OSError) as reason:
                why = str(reason)
        ports = sorted(str(port) for pattern in _PORTS for port in Path("/dev").glob(pattern))
        words = ["calibrate", self._project.harness, "--overwrite", "--subject", self._project.state.wearer]
        commands = {
            "joint": self._project.command([*words, "-o", self._project.folder / _JOINTS_FILE]),
            "pad": self._project.command([*words, "--taxels", "-o", self._project.folder / _PADS_FILE]),
        }
        self._studio.publish("glove-hand", content, there=there, why=why, ports=ports, commands=commands)

    def _on_find(self, asked: Asked) -> None:
        """Listen at an address, and propose a glove.toml."""
        port = asked.name.removeprefix(CYBERGLOVE)
        if fault := "is not an address of a glove" if port == "-" else line_port_fault(port):
            raise SettingError(f"{shortened(repr(asked.name))} {fault}")
        self._proposal = ""
        self._studio.station.start("looking", partial(self._find, asked.name))

    def _find(self, port: str, stop: Event) -> None:
        self._studio.publish("found", port=port, busy=True)
        text, wrong = "", list[str]()
        try:
            found = propose_glove(port, _BAUD, _LISTEN_S)
            wrong = [reason for _, reason in faults(found.harness)] if found.sensors else ["no column is a sensor"]
            text = harness_to_toml(found.harness)
            content: dict[str, object] = {"columns": found.columns, "rows": found.rows, "remarks": found.remarks}
        except (ThenarError, OSError) as reason:
            content, wrong = {"columns": (), "rows": 0, "remarks": ()}, [of_device(port, str(reason))]
        self._proposal = "" if wrong else text
        command = self._project.command(["doctor", "--line", port, "--propose", self._project.harness])
        self._studio.publish("found", content, port=port, busy=False, text=text, wrong=wrong, command=command)

    def _on_connect(self, _asked: Asked) -> None:
        """Write the proposed glove.toml."""
        if self._project.harness.exists():
            raise SettingError("the project has a glove.toml already: change it, or delete it first")
        if not self._proposal:
            raise SettingError("no glove was found yet: press Find first")
        write_atomically(self._project.harness, self._proposal.encode())
        self._studio.changed()

    def _watch(self, stop: Event) -> None:
        """Show the state of every sensor, until `stop` is set."""
        sensors = GloveSensors(self._project)
        harness, kinds = self._project.wiring(), sensors.kinds
        past = self._past = [deque[tuple[float, int | None]](maxlen=_MOST_KEPT) for _ in kinds]
        last: list[int | None] = [None] * len(kinds)
        changes, before = [0] * len(kinds), [0] * len(kinds)
        moved = dict.fromkeys(_LEAST_CHANGE, 0)
        came, rates = {"switches and pads": 0, "joints": 0}, dict[str, float]()
        shown_s = rated_s = monotonic()
        scan = whole_scan(harness, harness.switches, every_taxel=True)
        with ExitStack() as ending, Sources(harness, harness.switches, scan) as sources:
            # A page that is opened later shows nothing old.
            ending.callback(self._studio.publish, "glove-state", states=())
            while not stop.is_set():
                snapshot = sources.take(WAIT_US)
                sources.raise_settings()
                now_s = monotonic()
                for frame in snapshot.arrived:
                    came["joints" if isinstance(frame, GloveFrame) else "switches and pads"] += 1
                shown = sensors.read(snapshot.switches, snapshot.measured)
                for at, (value, kind) in enumerate(zip(shown, kinds, strict=True)):
                    if not past[at] or past[at][-1][1] != value:
                        past[at].append((now_s, value))
                    reference = last[at]
                    if value is None or (reference is not None and abs(value - reference) < _LEAST_CHANGE[kind]):
                        continue
                    last[at] = value
                    if reference is not None:
                        changes[at] += 1
                        moved[kind] += 1
                        before[at] = moved[kind]
                if now_s - rated_s >= _RATE_S:
                    rates = {what: round(count / (now_s - rated_s), 1) for what, count in came.items() if count}
                    came, rated_s = dict.fromkeys(came, 0), now_s
                if now_s - shown_s >= _SHOW_S:
                    shown_s = now_s
                    states = [
                        _state(value, kind, changed, moved[kind] - since)
                        for value, kind, changed, since in zip(shown, kinds, changes, before, strict=True)
                    ]
                    devices = sources.health()
                    self._studio.publish("glove", glove_shown(devices))
                    self._studio.publish(
                        "glove-state",
                        sensors.drawn(shown),
                        states=states,
                        devices=devices,
                        rates=rates,
                        problem=_problem(sensors, states, devices),
                    )

    def _on_past(self, asked: Asked) -> bytes:
        """Return the changes of a sensor in the last 30 s: how long ago, and the value."""
        if not 0 <= asked.trial < len(self._past):
            raise SettingError(f"{len(self._past)} sensors are watched, numbered from 0")
        now_s, found = monotonic(), list(self._past[asked.trial])
        first = next((at for at, (time_s, _) in enumerate(found) if now_s - time_s < _PAST_S), len(found))
        # The value of the time before is the first.
        kept = [(round(min(now_s - time_s, _PAST_S), 2), value) for time_s, value in found[max(first - 1, 0) :]]
        return message("shown", sensor=asked.trial, past=kept, changes=len(found) - max(first, 1))

    def _on_calibrate(self, asked: Asked) -> None:
        """Calibrate the joints, or the pads: the name says which."""
        work = {"joint": self._calibrate_joints, "pad": self._calibrate_pads}.get(asked.name)
        if work is None or not self._project.harness.exists():
            raise SettingError("joints or pads of a glove.toml can be calibrated")
        self._studio.station.start("calibrating", partial(self._calibrate, work), get_args(PoseKey))

    def _calibrate(self, work: Callable[[Event], str], stop: Event) -> None:
        said = ""
        try:
            said = work(stop)
        finally:
            self._studio.publish("calibrating", step="", said=said)

    def _calibrate_joints(self, stop: Event) -> str:
        def view(guide: PoseGuide) -> list[PoseKey]:
            words = {"accept": "I hold it", "back": "Back to the previous pose"}
            if guide.stage == "doubted":
                words = {"accept": "Hold it again", "keep": "Keep it anyway"}
            offered, silent = guide.offered(now_us()), guide.silent(now_us())
            states = zip(guide.names, guide.states(), strict=False)
            content = {
                "step": f"Pose {min(len(guide.taken) + 1, len(guide.poses))} of {len(guide.poses)}: {guide.pose.name}",
                "what": "Hold still." if guide.stage == "held" else guide.pose.instruction,
                "problems": guide.problems if guide.stage == "doubted" else [],
                "faults": ["The glove is silent."] * silent + [f"{name}: {state}" for name, state in states if state],
                "keys": {key: what for key, what in words.items() if key in offered},
            }
            self._studio.publish("calibrating", content)
            return self._studio.station.pressed()

        guide = lead_poses(str(self._project.harness), _BAUD, _HOLD_S, view, stop)
        if guide is None:
            return ""
        lines = guide.calibration(self._project.state.wearer)
        device = "cyberglove" if self._project.wiring().cyberglove is not None else "stream"
        return self._written(device, _JOINTS_FILE, [line.name for line in lines.sensors], guide.names, lines.to_toml())

    def _calibrate_pads(self, stop: Event) -> str:
        words = {"untouched": "Nothing is pressed", "pressing": "All were pressed"}

        def view(stage: PressStage, names: tuple[str, ...], counts: Codes, rested: Codes) -> bool:
            content = {
                "step": "Pads at rest" if stage != "pressing" else "Pads pressed",
                "what": PRESS_WORDS[stage],
                "problems": [],
                "faults": [f"{name}: not read" for name, count in zip(names, counts, strict=True) if count is None],
                "keys": {"accept": words[stage]} if stage in words else {},
            }
            self._studio.publish("calibrating", content)
            return "accept" in self._studio.station.pressed()

        found = lead_presses(self._project.harness, _HOLD_S, view, stop, self._project.state.wearer)
        if found is None:
            return ""
        names, pads = found
        return self._written("taxels", _PADS_FILE, [line.name for line in pads.sensors], names, pads.to_toml())

    def _written(self, table: str, file: str, found: Sequence[str], names: Sequence[str], text: str) -> str:
        """Write a calibration of sensors, name it in glove.toml, and return how many of the names it has, in words."""
        if not found:
            raise SettingError("no sensor moved, so nothing can be calibrated")
        harness = self._project.harness
        write_atomically(self._project.folder / file, text.encode())
        write_atomically(harness, _naming(harness.read_text(encoding="utf-8"), table, file).encode())
        lacking = [name for name in names if name not in found]
        said = f"{file}: {len(found)} of {len(names)} are calibrated"
        self._studio.changed()
        return said + (f"; {list_names(lacking)} did not move" if lacking else "")


def _state(value: int | None, kind: str, changes: int, others: int) -> str:
    """Return the state of a sensor that shows `value` after `changes`; `others` changed so often since its last one."""
    if value is None:
        return "lost"
    if others >= _CHANGES_OF_OTHERS[kind] and (value == 1 if kind == "switch" else changes):
        return "stuck"
    return "ok" if changes else "never seen"


def _problem(sensors: GloveSensors, states: Sequence[str], devices: Sequence[DeviceHealth]) -> dict[str, object] | None:
    """Return the next problem to solve, in words, and the number of the sensor or the kind that has it."""
    for device in devices:
        if not device.connected:
            words = f"{of_device(device.name, device.error)}: check its cable, its power and its port in glove.toml"
            return {"words": words, "sensor": None, "calibrate": ""}
    for state, advice in _ADVICE.items():
        if state in states:
            at = states.index(state)
            return {"words": f"{sensors.names[at]} {advice}", "sensor": at, "calibrate": ""}
    for kind in sensors.lacks:
        return {"words": f"{_UNCALIBRATED[kind]} Calibrate them now.", "sensor": None, "calibrate": kind}
    return None


def _naming(text: str, table: str, file: str) -> str:
    """Return the text of a glove.toml in which a calibration is named: in place of the one before, or in its table."""

    def named(text: str) -> str | None:
        harness = parse_harness(text, "glove.toml")
        return harness.taxel_settings.calibration if table == "taxels" else harness.calibration

    line = f'calibration = "{file}"'
    places = [found.span() for found in re.finditer(r"""\bcalibration\s*=\s*("[^"\n]*"|'[^'\n]*')""", text)]
    heads = [found.end() for found in re.finditer(rf"^\[+\s*{table}\s*\]+[^\n]*", text, re.MULTILINE)]
    tries = [text, *(text[:start] + line + text[end:] for start, end in places)]
    tries += [f"{text[:at]}\n{line}{text[at:]}" for at in heads]
    tries.append(f"{text.rstrip()}\n\n[{table}]\n{line}\n")
    for one in tries:
        with suppress(ThenarError):
            if named(one) == file:
                return one
    raise SettingError(f"{file} is written: name it in the table {table} of glove.toml, with {line}")
