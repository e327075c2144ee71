"""A live recording run through once more."""

from collections.abc import Callable, Iterator
from pathlib import Path

from thenar.drivers.errors import SettingError

from ..build import Build
from ..frames import GloveFrame, SwitchFrame
from ..harness.loading import parse_harness
from ..policy import Policy
from ..published import LiveGrasp
from ..recording.reader import Reader
from .recogniser import Moment
from .system import System


def replayed(
    build: Build, recording: Path, policy: Policy | None = None, warn: Callable[[str], None] = lambda _: None
) -> Iterator[tuple[LiveGrasp, LiveGrasp]]:
    """Yield what was recognised and what is now, moment by moment, decided as it was then or by another `policy`.

    The newest frames at each moment are those that stand before it in the recording, as the live loop wrote them. At
    the end `warn` takes a sentence on each fault of the file.

    Raises McapError if it is no recording, SettingError if it is of another build.
    """
    for entry, moment in moments(build, recording, policy, warn):
        yield entry, moment.grasp


def moments(
    build: Build, recording: Path, policy: Policy | None = None, warn: Callable[[str], None] = lambda _: None
) -> Iterator[tuple[LiveGrasp, Moment]]:
    """Yield what was recognised and all that is known now; see `replayed`."""
    reader = Reader(recording)
    recognizer = _system(build, reader, policy).recognizer()
    switches: SwitchFrame | None = None
    glove: GloveFrame | None = None
    for entry in reader:
        if isinstance(entry, SwitchFrame):
            switches = entry
        elif isinstance(entry, GloveFrame):
            glove = entry
        elif isinstance(entry, LiveGrasp):
            yield entry, recognizer.step(entry.time_us, entry.unix_us, switches, glove)
    for fault in reader.faults():
        warn(fault.message)


def _system(build: Build, reader: Reader, policy: Policy | None) -> System:
    session = reader.session
    if session.build != build.manifest.checksum:
        raise SettingError(f"{reader.path.name} was recorded with another build: its frames hold other switches")
    harness = parse_harness(session.harness, reader.path.name)
    scan = System.map_of(build, harness)
    system = System(build, harness, scan, session.sensors, session.calibration, policy or session.policy or Policy())
    if session.switches != system.switch_names:
        raise SettingError(f"{reader.path.name} names other switches than its build has: it is damaged")
    return system
