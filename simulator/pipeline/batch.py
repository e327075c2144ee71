"""A batch: repetitions of one condition in the pipeline."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats

from ..body.condition import Condition
from ..contact.model import Contact, Load
from ..streams import Site
from .ramp import NEVER, Ramp


@dataclass(frozen=True, slots=True, eq=False)
class SerialTraffic:
    """The bytes of n repetitions, F frames each; of a frame's B bytes the first `board` are on the board's line, the
    others on the CyberGlove's.

    A byte keeps its index from sending to receiving, so that faults of one byte do not affect another.

    data    (n, F, B) uint8  as they arrive
    at_us   (n, F, B)        arrival time of each full byte
    arrives (n, F, B)        False for a lost byte
    """

    data: NDArray[np.uint8]
    at_us: NDArray[np.int64]
    arrives: NDArray[np.bool_]
    board: int


Integers = NDArray[np.int64]
Bits = NDArray[np.bool_]

# An object that slid this far was dropped: ours.
SLID_OUT_MM = 20.0


@dataclass(slots=True, eq=False)
class Batch:
    """n repetitions, s switches, F frames. A field exists only after a step has written it.

    Time starts at the first contact of a repetition, in microseconds; the transition before it is negative.

    repetitions (n,)      their numbers within the condition, from 0
    trials      (n,)      their places in the subject's session, from 0
    previous_deg (n, 20)  start of the hand: the planned posture of the previous trial, or its rest
    rest_deg    (n, 20)   the rest after the release; None: it does not rest
    posture_deg (n, 20)   joint angles; first as commanded, then as settled by the contact model
    pose        (n, 6)    the object in hand axes: mm, rotation vector in radians; likewise
    commanded_deg, commanded_pose  the input of the contact model, (n, 20) and (n, 6)
    grip_n      (n,)      total force of the pads
    forces_n    (n, s)    on every switch at full grip
    settled     (n,)      False if the contact model gave up: such a repetition is always reported
    residual_n, residual_nmm (n,)   unbalanced force and moment on the object
    between_n   (n,)      force on skin between the switches
    thresholds_n (s,)     closing force of each switch
    on_us, off_us (n, s)  when each switch closes and opens; NEVER
    frame_us    (n, F)    when each frame's scan begins
    delay_us              delay of the reading of each switch, broadcast to (n, F, s); None: 0
    bits        (n, F, s) the board's readings; for a place with a taxel, those of a switch there
    sensors_deg (n, F, 18) angles of the CyberGlove's sensors
    raw         (n, F, 18) uint8, its bytes, 1 to 255
    traffic               the bytes on the serial lines, between sending and receiving
    lost        (n, F)    frames that did not arrive
    ramp                  the growth of the forces; None: at once
    taxels_n    (n, F, t) force on each taxel
    taxels      (n, F, t) uint16, its counts; None: no taxels
    """

    condition: Condition
    repetitions: Integers
    trials: Integers
    previous_deg: Floats
    rest_deg: Floats | None = field(init=False, default=None)
    posture_deg: Floats = field(init=False)
    pose: Floats = field(init=False)
    commanded_deg: Floats = field(init=False)
    commanded_pose: Floats = field(init=False)
    grip_n: Floats = field(init=False)
    forces_n: Floats = field(init=False)
    settled: Bits = field(init=False)
    residual_n: Floats = field(init=False)
    residual_nmm: Floats = field(init=False)
    between_n: Floats = field(init=False)
    thresholds_n: Floats = field(init=False)
    on_us: Integers = field(init=False)
    off_us: Integers = field(init=False)
    frame_us: Integers = field(init=False)
    delay_us: Integers | None = None
    bits: Bits = field(init=False)
    sensors_deg: Floats = field(init=False)
    raw: NDArray[np.uint8] = field(init=False)
    traffic: SerialTraffic = field(init=False)
    lost: Bits | None = None
    ramp: Ramp | None = None
    taxels_n: Floats = field(init=False)
    taxels: NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.repetitions)

    def site(self) -> Site:
        """Return the draw site of its effects."""
        return self.condition.site(self.repetitions)

    def holds(self, let_go_us: int | None) -> Bits:
        """Return in which frames (n, F) the hand holds something: from first contact until no place is pressed hard
        enough any more to close a switch, after it let go at let_go_us.
        """
        over = np.full(len(self), NEVER if let_go_us is None else let_go_us)
        if self.ramp is not None and let_go_us is not None:
            first = self.on_us.min(axis=1)
            # Forces fall as they grew.
            over += np.where(first == NEVER, 0, round(self.ramp.rise_us) - np.where(first == NEVER, 0, first))
        held: Bits = (self.frame_us >= 0) & (self.frame_us < over[:, None])
        return held

    def load(self) -> Load:
        """Return the commands of the batch's hands."""
        return Load(self.condition, self.posture_deg, self.pose, self.grip_n)

    def slid_mm(self) -> Floats:
        """Return the distance (n,) of each object from its commanded position."""
        x, y, z = (self.pose[:, :3] - self.commanded_pose[:, :3]).T
        distance: Floats = np.sqrt(x * x + y * y + z * z)
        return distance

    def take(self, contact: Contact) -> None:
        """Let the hands rest as solved. A grasp whose object slid out of the hand has not settled: what holds it then
        is no hand.
        """
        self.commanded_deg, self.commanded_pose = self.posture_deg, self.pose
        self.posture_deg, self.pose, self.forces_n = contact.posture_deg, contact.pose, contact.forces_n
        self.settled, self.between_n = contact.settled & (self.slid_mm() <= SLID_OUT_MM), contact.between_n
        self.residual_n, self.residual_nmm = contact.residual_n, contact.residual_nmm
