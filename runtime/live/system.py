"""A build and a harness combined: the devices, and the recogniser of their frames."""

from collections.abc import Sequence

from msgspec import Struct

from thenar.drivers.calibration import GloveCalibration

from ..build import Build
from ..calibration import Meaning, load_calibration, numbers_of, place_of
from ..harness.wiring import Harness, StreamWiring
from ..names import list_names
from ..policy import Policy
from ..scanning.scanmap import ScanMap
from ..sources.base import slowest_us, sources_of
from ..taxels import calibration_of, in_counts
from .recogniser import LiveRecognizer
from .sources import Sources


def unread_joints(harness: Harness, switch_names: Sequence[str], scan: ScanMap, joints: Sequence[str]) -> str:
    """Return a sentence on a build's `joints` if nothing in `harness` reads them; "" if all are read.

    Raises SettingError if the harness reads joints, but lacks one of the build.
    """
    if not joints or any(source.reads_joints for source in sources_of(harness, switch_names, scan)):
        for joint in joints if harness.joint_device is not None else ():
            place_of(joint, harness.sensor_names)
        return ""
    how = own_joints(list(joints)) or "add the [cyberglove] that measures them"
    return f"nothing in {harness.name!r} reads the build's joints, and every grasp is degraded: {how}"


def own_joints(joints: Sequence[str]) -> str:
    """Return a sentence on how to read joints that no CyberGlove measures; "" for others, and without joints."""
    from thenar.drivers.cyberglove_protocol import sensors_with

    if not joints or sensors_with(joints) is not None:
        return ""
    return (
        f"joints {list_names(joints)} need a source of your own: a board that prints them ([[stream]] of glove.toml), "
        "or a source that you add (docs/how-to/extend.md)"
    )


class LiveSystem(Struct, frozen=True, eq=False):
    """The running system: `scan` is the map of the build's inputs in the harness."""

    build: Build
    harness: Harness
    scan: ScanMap
    sensor_names: tuple[str, ...]
    calibration: GloveCalibration | None
    policy: Policy

    @classmethod
    def of(cls, build: Build, harness: Harness, policy: Policy | None = None) -> "LiveSystem":
        """Combine `build` and `harness`.

        Raises HarnessError if they do not fit, SettingError if the CyberGlove's calibration does not.
        """
        from pathlib import Path

        from ..scanning.plan import plan_scan  # it needs the chips

        calibration = None if harness.calibration is None else load_calibration(Path(harness.calibration))
        # A user's own source sends the codes of the build's joints, in order.
        names = harness.sensor_names or tuple(joint.name for joint in build.manifest.joints)
        scan = plan_scan([switch.name for switch in build.manifest.switches], harness)
        return cls(build, harness, scan, names, calibration, policy or Policy())

    @property
    def switch_names(self) -> tuple[str, ...]:
        """The kept switches, in the order of the frames' bits."""
        return tuple(switch.name for switch in self.build.manifest.switches)

    @property
    def unread(self) -> str:
        """A sentence on the build's joints if nothing in the harness reads them; "" if everything is read."""
        joints = [joint.name for joint in self.build.manifest.joints]
        return unread_joints(self.harness, self.switch_names, self.scan, joints)

    def recognizer(self) -> LiveRecognizer:
        """Return a recogniser for the frames of the devices.

        Raises SettingError if the CyberGlove cannot serve the build.
        """
        devices = sources_of(self.harness, self.switch_names, self.scan)
        return LiveRecognizer(
            self.build,
            sensor_names=self.sensor_names,
            calibration=self._meaning,
            switch_period_us=slowest_us(device for device in devices if device.owned),
            glove_period_us=slowest_us(device for device in devices if device.reads_joints),
            policy=self.policy,
        )

    @property
    def _meaning(self) -> Meaning:
        """The meaning of the joints' bytes: by the calibration, or by the ranges of a stream's numbers."""
        device = self.harness.joint_device
        if self.calibration is not None or not isinstance(device, StreamWiring):
            return self.calibration
        return numbers_of(device.joints)

    @property
    def _needed(self) -> tuple[str, ...]:
        """The sensors of the build's joints, in wire order."""
        joints = {joint.name for joint in self.build.manifest.joints}
        return tuple(name for name in self.sensor_names if name in joints)

    def read_sensors(self, *, all_sensors: bool = False) -> tuple[str, ...]:
        """Return the sensors that a run reads, in wire order: those of the build's joints, if it has any, for a board,
        which may print no others, and for a CyberGlove with a mask, unless it is to send `all_sensors`; else all.
        """
        device = self.harness.joint_device
        if isinstance(device, StreamWiring):
            some = device.board is not None
        else:
            some = device is not None and device.mask and not all_sensors
        return self._needed if some and self._needed else self.sensor_names

    def sources(self, *, all_sensors: bool = False) -> Sources:
        """Return the devices; with `all_sensors` the CyberGlove also sends the sensors that the build does not use.

        Raises SettingError if the calibration of the taxels cannot serve the build.
        """
        streamed = isinstance(self.harness.joint_device, StreamWiring)
        sensors = self._needed if streamed else self.read_sensors(all_sensors=all_sensors)
        taxels = calibration_of(self.harness.taxel_settings)
        scan = in_counts(self.scan, self.build.manifest.switches, taxels)
        return Sources(self.harness, self.switch_names, scan, sensors)
