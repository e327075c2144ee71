"""`Glove`: a glove that recognises grasps, as an iterator of published moments."""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from os import PathLike
from threading import Event
from time import time_ns
from typing import TYPE_CHECKING, Self

from .build import Build
from .calibration import AngleReader
from .frames import GloveFrame, SwitchFrame, now_us
from .harness.wiring import Harness
from .live.quarantine import Quarantine
from .live.recogniser import Moment
from .live.sources import Snapshot
from .live.system import LiveSystem
from .policy import Policy
from .published import DeviceHealth, HealthReport, JointAngles, LiveGrasp, OutputTrouble, Quarantined
from .sinks.base import LATE_US, Fanout, Sink, SinkReport, open_sink
from .taxels import calibration_of

if TYPE_CHECKING:
    from .recording.session import Session
    from .recording.writer import LiveRecorder

_REPORT_US = 1_000_000
# A second brings fewer.
_MOST_FRAMES = 20_000


class Glove:
    """A glove that recognises grasps: an endless iterator of published moments.

    Devices may be disconnected and connected again: missing inputs make the health "degraded", and "unknown" when too
    few are left. There is a moment whenever a device has delivered something, and when something has expired. The
    recording and each sink have a separate thread: a disk or a reader that hangs delays no moment.

    Parameters
    ----------
    build : Build, str or path
        The recogniser: a build, or its folder.
    harness : Harness, str or path
        The glove's wiring: a harness, or its `glove.toml`.
    policy : Policy, optional
        The rules of when a grasp type is decided on, and when too much is missing.
    preshapes : str or path, optional
        Preshapes of a robot's hand: a shipped table, "barrett_bh8" or "parallel_gripper", or a file of your own.
    change_while_held : bool
        Whether the preshape may change while something is held. Otherwise it changes only after nothing was held, if
        the build was trained with such rows.
    sinks : sequence of str or Sink
        Further receivers of each moment: "tcp:7777", as `thenar run --sink` spells them.
    record : str or path, optional
        A new .mcap file for the raw frames and the predictions.
    status : bool
        Whether sinks get a report of the glove's health once a second, and whenever a device comes or goes.
    stop : threading.Event, optional
        Ends the iteration when it is set.
    feed : callable, optional
        Returns the newest frames, and all that arrived since the last call, instead of the harness's devices, which are
        then not opened.

    Attributes
    ----------
    frames : int
        The number of moments so far.
    system : LiveSystem
        The build and the harness, combined.
    sources : Sources
        The devices.
    recorder : LiveRecorder or None
        The writer of the recording.
    health : HealthReport or None
        The glove's health, updated once a second, and whenever a device comes or goes, or an input is quarantined or
        released.
    lacking : str
        A sentence on grasp types that have no preshape in `preshapes`; "" if there are none.

    Raises
    ------
    BuildError, HarnessError, SettingError
        If one of them is invalid, or they do not fit each other. Nothing is opened before.
    SinkError, OSError
        On entering the context, if a sink or the recording cannot be opened.
    SettingError
        While iterating, if a device can never work as configured in the harness.

    Examples
    --------
    ::

        from thenar.runtime import Glove

        with Glove("build", "glove.toml", preshapes="barrett_bh8") as glove:
            for moment in glove:
                print(moment.grasp.grasp, moment.grasp.probability, moment.preshape, glove.health.devices)
    """

    def __init__(
        self,
        build: Build | str | PathLike[str],
        harness: Harness | str | PathLike[str],
        *,
        policy: Policy | None = None,
        preshapes: str | PathLike[str] | None = None,
        change_while_held: bool = False,
        sinks: Sequence[str | Sink] = (),
        record: str | PathLike[str] | None = None,
        status: bool = False,
        stop: Event | None = None,
        feed: Callable[[], Snapshot] | None = None,
    ) -> None:
        loaded = build if isinstance(build, Build) else Build.load(build)
        if not isinstance(harness, Harness):
            from pathlib import Path

            from .harness.loading import load_harness

            harness = load_harness(Path(harness))
        self.system = system = LiveSystem.of(loaded, harness, policy)
        self.stop = Event() if stop is None else stop
        self.frames, self.lacking = 0, ""
        self.health: HealthReport | None = None
        self.recorder: LiveRecorder | None = None
        # A recording is for training: it holds all sensors.
        whole = record is not None
        devices = system.sources(all_sensors=whole)
        self._recognizer, self.sources = system.recognizer(), devices
        self.feed = feed
        self._selector = None
        if preshapes is not None:
            from .preshape import preshape_selector

            by_segments = system.policy.lag_us is not None
            self._selector, self.lacking = preshape_selector(
                preshapes, loaded, segments=by_segments, change_while_held=change_while_held
            )
        calibration = system.calibration
        read = system.read_sensors(all_sensors=whole)
        self._angles = None if calibration is None else AngleReader(system.sensor_names, calibration, read)
        self._measured: GloveFrame | None = None
        self._newest_angles: JointAngles | None = None
        self._sinks, self._record, self._status = tuple(sinks), record, status
        self._health, self._due_us = GloveHealth(self._recognizer.quarantine), 0
        self._quarantined: tuple[Quarantined, ...] = ()
        self._fanout = Fanout(())
        self._open = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as opening:
            sinks = []
            for sink in self._sinks:
                sinks.append(open_sink(sink) if isinstance(sink, str) else sink)
                opening.callback(sinks[-1].close)
            self._fanout = Fanout(sinks, live=True)
            opening.pop_all()
            opening.callback(self._fanout.close)
            self._fanout.begin(self.system.build)
            if self._record is not None:
                from pathlib import Path

                from .recording.writer import LiveRecorder

                self.recorder = opening.enter_context(LiveRecorder(Path(self._record), self._session()))
            if self.feed is None:
                opening.enter_context(self.sources)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def __iter__(self) -> Iterator[Moment]:
        return self

    def __next__(self) -> Moment:
        """Return the next moment. Recordings are in the order of use: the frames that arrived, then the grasp predicted
        from the newest of them; so a replay of the recording gives the same grasps.
        """
        if self.stop.is_set():
            raise StopIteration
        taken = self.sources.take() if self.feed is None else self.feed()
        now = taken.time_us
        moment = self._recognizer.step(now, time_ns() // 1000, taken.switches, taken.glove)
        grasp = moment.grasp
        if self.recorder is not None:
            self.recorder.moment(taken.arrived, grasp)
        if self._selector is not None:
            moment.preshape = self._selector.update(grasp)
        moment.angles = self._angles_of(taken.measured)
        # Only this process may have been stopped in between.
        if self.feed is not None or now_us() - now <= LATE_US:
            self._fanout.publish(grasp, moment.preshape, moment.angles, moment)
        self._health.update(grasp, taken.switches, taken.glove.time_us if taken.glove else None)
        if self._recognizer.quarantine.found != self._quarantined:
            self._quarantined, self._due_us = self._recognizer.quarantine.found, now
        if now >= self._due_us or self.sources.changed:
            self._look(now)
        self.frames += 1
        return moment

    @property
    def has_preshapes(self) -> bool:
        """Whether a robot's hand is controlled."""
        return self._selector is not None

    def devices(self) -> tuple[DeviceHealth, ...]:
        """Return the current state of every device."""
        return self.sources.health()

    def reports(self) -> tuple[SinkReport, ...]:
        """Return the state of every sink."""
        return self._fanout.reports()

    def _angles_of(self, measured: GloveFrame | None) -> JointAngles | None:
        if measured is not self._measured:
            self._measured = measured
            there = measured is not None and measured.plugged
            self._newest_angles = self._angles.angles(measured.sensors) if self._angles and measured and there else None
        return self._newest_angles

    def _look(self, now: int) -> None:
        self._due_us, self.sources.changed = now + _REPORT_US, False
        devices, overflowed = self.sources.health(), self.sources.overflowed
        failure = None if self.recorder is None else self.recorder.failure
        recording = () if failure is None else (OutputTrouble("recording", failure),)
        self.health = self._health.report(now, devices, overflowed, (*recording, *self._fanout.troubles()))
        if self._status:
            self._fanout.health(self.health)
        self.sources.raise_settings()

    def _session(self) -> "Session":
        # It takes a third as long to import as everything else.
        from importlib.metadata import version

        from .harness.writing import harness_to_toml
        from .recording.session import Session

        system = self.system
        return Session(
            thenar=version("thenar"),
            switches=system.switch_names,
            sensors=system.sensor_names,
            build=system.build.manifest.checksum,
            harness=harness_to_toml(system.harness),
            calibration=system.calibration,
            policy=system.policy,
            taxels=system.harness.taxel_names,
            taxel_calibration=calibration_of(system.harness.taxel_settings),
        )


class GloveHealth:
    """Counts published grasps and frames, for reports; `quarantine` finds the faults of inputs."""

    def __init__(self, quarantine: Quarantine) -> None:
        self._quarantine = quarantine
        # Times of frames.
        self._switches, self._glove = deque[int](maxlen=_MOST_FRAMES), deque[int](maxlen=_MOST_FRAMES)
        self._published = Counter[str]()

    def update(self, grasp: LiveGrasp, switches: SwitchFrame | None, glove_us: int | None = None) -> None:
        """Take a published grasp, the frame of switches behind it, and the time of the glove's; a frame that was seen
        before counts once.
        """
        self._published[grasp.health] += 1
        switches_us = None if switches is None else switches.time_us
        for times_us, time_us in ((self._switches, switches_us), (self._glove, glove_us)):
            if time_us is not None and (not times_us or time_us > times_us[-1]):
                times_us.append(time_us)

    def report(
        self,
        now_us: int,
        devices: Sequence[DeviceHealth] = (),
        overflowed: int = 0,
        outputs: tuple[OutputTrouble, ...] = (),
    ) -> HealthReport:
        """Return the current health."""
        published = self._published
        return HealthReport(
            time_us=now_us,
            switch_hz=_rate_hz(self._switches, now_us),
            glove_hz=_rate_hz(self._glove, now_us),
            frames=published.total(),
            changing=published["changing"],
            degraded=published["degraded"],
            unknown=published["unknown"],
            overflowed=overflowed,
            devices=tuple(devices),
            quarantined=self._quarantine.found,
            outputs=outputs,
        )


def _rate_hz(times_us: deque[int], now_us: int) -> float:
    """Return how many of these times are of the last second; older ones are dropped."""
    while times_us and times_us[0] <= now_us - _REPORT_US:
        times_us.popleft()
    return float(len(times_us))
