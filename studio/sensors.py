"""`GloveSensors`: the switches, taxels and joints of a project's glove, as pages draw them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.hand import HandShape, grid_places, moved_by, places_of, shape_of, unknown_shape
from thenar.runtime.calibration import load_calibration, numbers_of
from thenar.runtime.errors import HarnessError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.hand import DrawnJoint, DrawnSwitch, DrawnTaxel, HandDrawing
from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.timing import scan_us
from thenar.runtime.taxels import calibration_of

from .project import Project


class GloveSensors:
    """The sensors of a glove, numbered from 0: switches, then taxels, then joints.

    Parameters
    ----------
    project : Project
        The project, on whose hand switches and taxels are drawn, if it knows all of them.

    Attributes
    ----------
    names, kinds : tuple of str
        Of each sensor its name, and "switch", "pad" or "joint".
    drawing : HandDrawing
        The hand; its bits are the numbers of switches and taxels.
    lacks : tuple of str
        The kinds, "joint" or "pad", of which one is not calibrated.

    Raises
    ------
    ThenarError, OSError
        If the glove's files cannot be read.
    """

    def __init__(self, project: Project) -> None:
        harness = project.wiring()
        switches, taxels, joints = harness.switches, harness.taxel_names, harness.sensor_names
        self.names = (*switches, *taxels, *joints)
        self.kinds = ("switch",) * len(switches) + ("pad",) * len(taxels) + ("joint",) * len(joints)
        device, path = harness.joint_device, harness.calibration
        known = numbers_of(device.joints) if device is not None and not isinstance(device, GloveWiring) else ()
        calibrated = () if path is None else load_calibration(Path(path)).sensors
        self._lines = {line.name: line for line in (*known, *calibrated)}
        pads = calibration_of(harness.taxel_settings)
        self._pads = [None if pads is None else pads.line(name) for name in taxels]
        # The numbers of the first taxel and of the first joint.
        self._pad, self._joint = len(switches), len(self.names) - len(joints)
        self.lacks = ("joint",) * (bool(joints) and path is None) + ("pad",) * (None in self._pads)
        places, fields = placed((*switches, *taxels), project.hand())
        angles = {line.name for line in calibrated}
        self.drawing = HandDrawing(
            **fields,
            switches=tuple(DrawnSwitch(name, *places[name], bit) for bit, name in enumerate(switches)),
            taxels=tuple(
                DrawnTaxel(name, *places[name], ((0, bit),)) for bit, name in enumerate(taxels, start=len(switches))
            ),
            joints=tuple(self._drawn_joint(number, name, name in angles) for number, name in enumerate(joints)),
        )

    def _drawn_joint(self, number: int, name: str, calibrated: bool) -> DrawnJoint:
        low, high = sorted(self._value(name, byte) for byte in (1, 255))
        return DrawnJoint(name, number, "deg" if calibrated else "", low, high, *moved_by(name))

    def read(self, switches: SwitchFrame | None, glove: GloveFrame | None) -> list[int | None]:
        """Return the value of each sensor: 1 or 0, the count of a taxel, the byte of a joint; None: it is not read."""
        shown: list[int | None] = [None] * len(self.names)
        if switches is not None:
            closed, lost = switches.closed, switches.lost
            shown[: self._pad] = [None if lost >> bit & 1 else closed >> bit & 1 for bit in range(self._pad)]
        if switches is not None and switches.taxels is not None:
            shown[self._pad : self._joint] = switches.taxels
        if glove is not None and glove.plugged:
            shown[self._joint :] = [byte or None for byte in glove.sensors]
        return shown

    def drawn(self, shown: Sequence[int | None]) -> dict[str, object]:
        """Return the drawn hand: `closed` and `lost` by bit, `pressed` from 0 to 1, `values` of the joints."""
        first, last = self._pad, self._joint
        return {
            "closed": [value == 1 for value in shown[:first]] + [False] * len(self._pads),
            "lost": [value is None for value in shown[:last]],
            "pressed": [
                None if count is None or line is None else round((count - line.raw_a) / (line.raw_b - line.raw_a), 3)
                for count, line in zip(shown[first:last], self._pads, strict=True)
            ],
            "values": [
                None if byte is None else self._value(name, byte)
                for name, byte in zip(self.names[last:], shown[last:], strict=True)
            ],
        }

    def _value(self, name: str, byte: int) -> float:
        return round(self._lines[name].value(byte), 3) if name in self._lines else float(byte)


def sensors_read(manifest: Manifest) -> dict[str, None]:
    """Return the names of the switches, pads and joints that a build reads, each once."""
    return dict.fromkeys([switch.source for switch in manifest.switches] + [joint.name for joint in manifest.joints])


def scan_time_us(elements: Sequence[str], project: Project | None = None) -> float | None:
    """Return the time on the wire of a scan of switches and pads; None if the harness does not read them.

    The harness is that of the project; without one, it is the chips that are proposed.
    """
    try:
        harness = project.wiring() if project is not None and project.harness.exists() else propose_harness(elements)
        scan = plan_scan(elements, harness)
    except HarnessError:
        return None
    return scan_us(scan, harness).us if scan.ports else 0.0


def placed(names: Sequence[str], hand: HandShape | None) -> tuple[dict[str, tuple[float, float]], dict[str, Any]]:
    """Return where switches and taxels lie, by name, on a hand or in a grid, and the fields of a drawing of it."""
    if hand is not None and names and hand.knows(names):
        return places_of(hand, names), shape_of(hand)
    return grid_places(names), unknown_shape("the positions of the sensors are unknown")
