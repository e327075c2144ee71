"""Replay a recording: by its own build, or by another that reads the same inputs."""

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path

from msgspec.structs import replace

from thenar.drivers.errors import SettingError

from ..build import Build
from ..frames import BitRemap, GloveFrame, SwitchFrame
from ..harness.loading import parse_harness
from ..names import list_names
from ..policy import Policy
from ..published import LiveGrasp
from ..recording.reader import Entry, Reader
from ..recording.session import Session
from ..scanning.plan import plan_scan
from ..taxels import LiveTaxel, count_limit
from .recogniser import LiveRecognizer, Moment
from .system import LiveSystem

# The period of a device is the one that nineteen of twenty of its frames kept.
_USUALLY = 0.95


def replayed(
    build: Build, recording: Path, policy: Policy | None = None, warn: Callable[[str], None] = lambda _: None
) -> Iterator[tuple[LiveGrasp, Moment]]:
    """Yield the recorded prediction and the new moment, one by one, decided as before or by another `policy`.

    The newest frames at each moment are those that precede it in the recording, as the live loop wrote them. At the end
    `warn` takes a sentence on each fault of the file.

    Raises FormatError if it is not a recording, SettingError if it is from another build.
    """
    reader = Reader(recording)
    if reader.session.build != build.manifest.checksum:
        raise SettingError(
            f"{reader.path.name} was recorded with another build: replay it with its own, or let "
            "`thenar segment` classify it with this one"
        )
    for entry, moment in _stepped(reader, Stepper(build, reader.path.name, (None, None), policy), warn):
        if isinstance(entry, LiveGrasp):
            yield entry, moment


def recognised(build: Build, recording: Path, warn: Callable[[str], None] = lambda _: None) -> Iterator[Moment]:
    """Yield a build's moments for a recording of any build, or of none, decided by the default policy.

    Moments are those of the recorded run; without a run, those at which a frame came. For another build's recording,
    switches and joints are matched by name, and levels of taxels taken from the recorded counts. `warn` as for
    `replayed`.

    Raises FormatError if it is not a recording, SettingError if it lacks an input of the build.
    """
    reader = Reader(recording)
    own = reader.session.build == build.manifest.checksum
    periods = (None, None) if own else periods_us(Reader(recording))
    for _, moment in _stepped(reader, Stepper(build, recording.name, periods), warn):
        yield moment


def _stepped(reader: Reader, stepper: "Stepper", warn: Callable[[str], None]) -> Iterator[tuple[Entry, Moment]]:
    """Yield the moments of all entries of a recording."""
    for entry in reader:
        if (moment := stepper.take(entry)) is not None:
            yield entry, moment
    for fault in reader.faults():
        warn(fault.message)


class Stepper:
    """Takes the entries of a recording one by one, a session first, from anywhere in the file; `session` is theirs.

    Recordings of the same build are decided as before. Raises SettingError if the recording lacks an input of the
    build.
    """

    def __init__(
        self, build: Build, name: str, periods: tuple[int | None, int | None], policy: Policy | None = None
    ) -> None:
        """Take the build, the file's name, and the periods of its frames (`periods_us`); recordings of the same build
        are decided by `policy`, if one is given.
        """
        self._build, self._name, self._periods, self._policy = build, name, periods, policy
        self.session: Session | None = None
        self.switches: SwitchFrame | None = None
        self.glove: GloveFrame | None = None
        self._now_us = 0

    def take(self, entry: Entry) -> Moment | None:
        """Return the moment of an entry: for a run at each grasp, for other recordings at each frame."""
        if isinstance(entry, Session):
            self._begin(entry)
        elif isinstance(entry, SwitchFrame):
            self.switches = self._matched(entry) if self._foreign else entry
        elif isinstance(entry, GloveFrame):
            self.glove = entry
        session = self.session
        if session is None:
            return None
        if isinstance(entry, LiveGrasp):
            return self._recognizer.step(entry.time_us, entry.unix_us, self.switches, self.glove)
        if isinstance(entry, SwitchFrame | GloveFrame) and not session.build:
            # Frames of several devices are not always in the order of their times.
            self._now_us = max(self._now_us, entry.time_us)
            unix_us = session.clock_ns // 1000 + self._now_us
            return self._recognizer.step(self._now_us, unix_us, self.switches, self.glove)
        return None

    def _begin(self, session: Session) -> None:
        """Begin with a session, which has another clock: earlier entries are from another time."""
        self.session, self.switches, self.glove, self._now_us = session, None, None, 0
        if session.build == self._build.manifest.checksum:
            self._foreign = False
            self._recognizer = _system(self._build, session, self._name, self._policy).recognizer()
        else:
            self._foreign = True
            self._match(session)
            self._recognizer = LiveRecognizer(
                self._build,
                sensor_names=session.sensors,
                calibration=session.calibration,
                switch_period_us=self._periods[0],
                glove_period_us=self._periods[1],
            )

    def _match(self, session: Session) -> None:
        """Find the build's inputs in a session of another build. Raises SettingError if it lacks one."""
        harness = parse_harness(session.harness, self._name)
        manifest, pins = self._build.manifest, set(harness.switches)
        pairs, lacking = list[tuple[int, int]](), list[str]()
        levels: dict[str, list[tuple[int, int]]] = {name: [] for name in session.taxels}
        for number, switch in enumerate(manifest.switches):
            taxel = None if switch.threshold is None or switch.name in pins else switch.threshold
            if taxel is not None and taxel.taxel.name in levels:
                levels[taxel.taxel.name].append((count_limit(taxel, session.taxel_calibration), number))
            elif taxel is None and switch.name in session.switches:
                pairs.append((session.switches.index(switch.name), number))
            else:
                lacking.append(switch.name)
        lacking += [joint.name for joint in manifest.joints if joint.name not in session.sensors]
        if lacking:
            raise SettingError(
                f"{self._name} was recorded without {list_names(lacking)}, which the build reads: use a build "
                "of the recorded inputs, or record all inputs of the build"
            )
        self._turn = BitRemap(pairs)
        self._taxels = [LiveTaxel(name, own, session.taxel_calibration) for name, own in levels.items()]
        self._levels = 0, sum(taxel.owned for taxel in self._taxels)

    def _matched(self, frame: SwitchFrame) -> SwitchFrame:
        """Return a recorded frame with the bits of the build's switches; levels come from the newest counts."""
        if frame.taxels is not None:
            read = [taxel.read(code) for taxel, code in zip(self._taxels, frame.taxels, strict=True)]
            self._levels = sum(closed for closed, _ in read), sum(lost for _, lost in read)
        turn, (closed, lost) = self._turn, self._levels
        return replace(frame, closed=turn(frame.closed) | closed, lost=turn(frame.lost) | lost)


def periods_us(entries: Iterable[Entry]) -> tuple[int | None, int | None]:
    """Return the periods of switches and glove records among these entries; None if there were none."""
    times: dict[type, list[int]] = {SwitchFrame: [], GloveFrame: []}
    for entry in entries:
        if isinstance(entry, SwitchFrame | GloveFrame):
            times[type(entry)].append(entry.time_us)
    steps = [sorted(b - a for a, b in pairwise(each) if b > a) or [0] * len(each[:1]) for each in times.values()]
    switches, glove = (each[int(_USUALLY * (len(each) - 1))] if each else None for each in steps)
    return switches, glove


def _system(build: Build, session: Session, name: str, policy: Policy | None) -> LiveSystem:
    harness = parse_harness(session.harness, name)
    scan = plan_scan([switch.name for switch in build.manifest.switches], harness)
    system = LiveSystem(
        build, harness, scan, session.sensors, session.calibration, policy or session.policy or Policy()
    )
    if session.switches != system.switch_names:
        raise SettingError(f"{name} names other switches than its build: it is damaged")
    return system
