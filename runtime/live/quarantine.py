"""Switches that are read but wrong: found live, treated as lost while they are, and used again when they recover.

**Stuck switches.** Each switch has two cumulative sums (E. S. Page, Biometrika 41, 1954), one for "stuck closed", one
for "stuck open". A grasp adds to each the logarithm of

    P(what the switch shows | stuck) / P(what the switch shows | it works, and what all other inputs show)

and no sum falls below 0. The scores without the switch, replaced by its mean row, give the probabilities of the grasp
types; the build holds the share of a subject's trials of each type in which the switch was closed. Of the training
subjects the one that best explains the observation counts (P. J. Huber, Ann. Math. Stat. 36, 1965, tests the least
favourable pair in the same way), and nothing is assumed less probable than 1/20: people do what no recording holds. A
stuck switch is assumed to move all the same in 1/32 of the grasps.

If the model holds, the mean of the ratio is at most 1 while the switch works. Then a sum needs on average at least e^h
observations to reach h (G. Lorden, Ann. Math. Stat. 42, 1971). All sums together may do so once in GRASPS grasps, of
two observations each; so h is ln(2 * switches * 2 * GRASPS).

A hand that never closes a switch looks like a switch that never closes. So a switch is called stuck open only after it
was seen to close: the share of grasps of this run in which it closed when expected multiplies the build's share.

A fault makes other inputs look wrong. So of several sums that reach h together only the largest counts; from the next
grasp on, its switch is lost.

**A grasp** is one observation, however many frames it lasts: contacts that have not changed by half for SETTLED_US. A
switch that cannot be read for a while keeps its last state: an outage begins no grasp. The frame with the fewest
contacts between two grasps, however short, is also one, if it differs by half from both. There a switch counts as
closed if it was never seen open in between: an opening hand opens all of its switches. So next to no other contact a
working switch is assumed to stay closed in no less than 1/100 of the cases.

**Chatter.** A change of a switch costs 1/20 s, paid off as time passes. A switch that is a second in debt changes
faster than a hand, which is typical of a loose contact; it recovers once the debt is paid, at the latest 2 s after the
last change.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..build import Build
from ..frames import Mask, SwitchFrame, bits
from ..published import Quarantined

# Time for which contacts must stay the same before a grasp is evaluated.
SETTLED_US = 100_000
# Average number of grasps between two false alarms.
GRASPS = 1_000
# Evidence is counted in sixteenths of a nat.
_NAT = 16
_SLIPS, _LEAST, _LEAST_ALONE = 1 / 32, 1 / 20, 1 / 100
# A switch begins with one grasp in which it closed as expected and one in which it did not (Laplace's rule).
_DOUBT = 255

# Nobody presses and releases a switch ten times a second; a loose contact does.
MOST_CHANGES = 20
STUCK_CLOSED, STUCK_OPEN, CHATTERING = "stuck closed", "stuck open", "chattering"
Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]


class StuckTest:
    """The sums of all switches, and the faults found by them.

    stuck  the stuck switches, each with the row of `sums` that found it, in the order of detection
    sums   evidence (2, s) of being stuck closed and open, in sixteenths of a nat
    limit  the required h
    """

    def __init__(self, build: Build) -> None:
        """Take a build that says how often its switches are closed."""
        tables, switches = build.tables, build.manifest.switches
        least, most = (
            np.array([list(bytes.fromhex(text)) for text in texts], np.int64)
            for texts in zip(*((switch.closed_least, switch.closed_most) for switch in switches), strict=True)
        )
        self._shares = np.stack([most, 255 - (least + most) // 2])
        # Twice the number of contacts of a grasp type, in 255ths.
        self._contacts: Ints = (least + most).sum(axis=0)
        self._rows, self._means = (rows.astype(np.int64) for rows in (tables.switch_rows, tables.switch_means))
        self._gain = round(65536 * _NAT / tables.scale)
        # exp(-i / 16), in 65535ths; the last is 0.
        self._weights = np.array([round(65535 * math.exp(-i / _NAT)) for i in range(200)])
        # Evidence of being stuck if a switch shows the state of a stuck one, and if it does not, by the share of
        # grasps, in 255ths, in which a working one would show the former.
        self._shown, self._alone = (
            np.array([max(round(_NAT * math.log((1 - _SLIPS) / max(q / 255, least))), 0) for q in range(256)])
            for least in (_LEAST, _LEAST_ALONE)
        )
        moved = (_NAT * math.log(_SLIPS / max(1 - q / 255, _SLIPS)) for q in range(256))
        self._moved = np.array([min(round(evidence), 0) for evidence in moved])
        self.limit = math.ceil(_NAT * math.log(2 * len(switches) * 2 * GRASPS))
        self.sums = np.zeros((2, len(switches)), np.int64)
        self.stuck: dict[int, int] = {}
        self._due, self._seen = np.zeros(len(switches), np.int64), np.zeros(len(switches), np.int64)

    def weigh(self, biased_scores: Sequence[int], closed: Mask, read: Mask, lost: Mask) -> None:
        """Take a grasp: the scores of a frame, the switches closed and read, and those scored as lost."""
        scores = np.array(biased_scores, np.int64)
        shut, shown, without = (_flags(mask, len(self._rows)) for mask in (closed, read, lost))
        shares, contacts = self._shares_of(scores, shut, without), int(np.count_nonzero(shut & ~without))
        # With fewer than half of the likeliest type's contacts, an open switch means nothing.
        held = 4 * 255 * contacts >= int(self._contacts[int(scores.argmax())])
        self.sums = np.maximum(self.sums + self._evidence(shut, shown, shares, held, contacts <= 1), 0)
        due = np.where(shown & held, 255 - shares[1], 0)
        self._due, self._seen = self._due + due, self._seen + due * shut
        self._judge()

    def _judge(self) -> None:
        for switch, kind in tuple(self.stuck.items()):
            if not self.sums[kind, switch]:
                del self.stuck[switch]
                self.sums[:, switch] = 0
        known = np.zeros(len(self._rows), bool)
        known[list(self.stuck)] = True
        self.sums = np.where(known, np.minimum(self.sums, self.limit), self.sums)
        if (fresh := np.where(known, -1, self.sums)).max(initial=-1) >= self.limit:
            kind, switch = divmod(int(fresh.argmax()), len(self._rows))
            self.stuck[switch] = kind

    def _shares_of(self, biased_scores: Ints, closed: Flags, lost: Flags) -> Ints:
        """Return the share of grasps, in 255ths (2, s), in which by training a switch is closed, and open, given the
        type as far as all other inputs determine it.
        """
        scores = biased_scores + np.where(lost[:, np.newaxis], 0, self._means - self._rows * closed[:, np.newaxis])
        behind = (scores.max(axis=1, keepdims=True) - scores) * self._gain >> 16
        weights = self._weights[np.minimum(behind, len(self._weights) - 1)]
        found: Ints = (self._shares * weights).sum(axis=2) // weights.sum(axis=1)
        return found

    def _evidence(self, closed: Flags, read: Flags, shares: Ints, held: bool, alone: bool) -> Ints:
        # Doubt whether this hand closes a switch at all decreases as it is seen to do so.
        closes = (255 - shares[1]) * (self._seen + _DOUBT) // (self._due + 2 * _DOUBT)
        shares = np.stack([shares[0], 255 - closes])
        shown = np.stack([closed, ~closed])
        sticks = np.stack([(self._alone if alone else self._shown)[shares[0]], self._shown[shares[1]]])
        evidence = np.where(shown, sticks, self._moved[shares])
        evidence[1] *= held | closed
        return evidence * read


class Chattering:
    """Finds switches that change faster than a hand."""

    def __init__(self, switches: int) -> None:
        self._closed: Mask = 0
        self._paid_us = [0] * switches
        self.switches: Mask = 0
        # No switch recovers before.
        self._next_us = 0

    def frame(self, time_us: int, closed: Mask, read: Mask) -> None:
        """Take a frame in which the switches `read` were read; `switches` are then those that chatter."""
        changed = (closed ^ self._closed) & read
        self._closed ^= changed
        for number in numbers(changed):
            paid_us = max(self._paid_us[number], time_us)
            self._paid_us[number] = paid_us = min(paid_us + 1_000_000 // MOST_CHANGES, time_us + 2_000_000)
            if paid_us - time_us > 1_000_000:
                self.switches |= 1 << number
                self._next_us = min(self._next_us, paid_us)
        if self.switches and time_us >= self._next_us:
            in_debt = [number for number in numbers(self.switches) if self._paid_us[number] > time_us]
            self.switches = sum(1 << number for number in in_debt)
            self._next_us = min((self._paid_us[number] for number in in_debt), default=0)


class Quarantine:
    """The switches that are left out of the scores, though they are read.

    found  every wrong switch, and whether it is still used
    """

    def __init__(self, build: Build, fits: Callable[[Mask, Mask], bool], *, active: bool = True) -> None:
        """Take the test whether these switches and joints may be lost together; not `active`: leave nothing out."""
        switches = build.manifest.switches
        self._names = [switch.name for switch in switches]
        self._fits, self._active, self._all = fits, active, (1 << len(switches)) - 1
        # Only compiled builds say how often their switches are closed.
        self._stuck = StuckTest(build) if switches and switches[0].closed_least else None
        self._chattering = Chattering(len(switches))
        self._wrong: dict[int, str] = {}
        self.found: tuple[Quarantined, ...] = ()
        # The switches left out, and the lost inputs for which they were chosen: those seldom change.
        self._chosen: Mask = 0
        self._chosen_for: tuple[Mask, Mask] | None = None
        self._seen_us = self._since_us = -1
        # The last known state of the switches, the contacts of the grasp, and the switches read as it began.
        self._shown: Mask = 0
        self._contacts: Mask = 0
        self._read: Mask = 0
        self._weighed = True
        self._state: tuple[Mask, Mask, Mask] = 0, 0, 0
        # Since the last grasp: the switches that stayed closed, and the frame with the fewest contacts.
        self._before: Mask = 0
        self._stayed: Mask = self._all
        self._fewest: tuple[Mask, Mask, Mask, Sequence[int], Mask] | None = None

    def left_out(self, lost: Mask, joints_lost: Mask) -> Mask:
        """Return the switches to leave out, when these and these joints are lost as well: in the order of detection, as
        long as the result does not become unknown because of them.
        """
        if (lost, joints_lost) != self._chosen_for:
            self._chosen_for = lost, joints_lost
            self._chosen, self.found = self._choose(lost, joints_lost)
        return self._chosen

    def _choose(self, lost: Mask, joints_lost: Mask) -> tuple[Mask, tuple[Quarantined, ...]]:
        out, found = 0, list[Quarantined]()
        # If too much is lost anyway, using any of them would not help.
        unknown = not self._fits(lost, joints_lost)
        for number, reason in self._wrong.items():
            more = out | 1 << number
            fits = self._active and (unknown or self._fits(lost | more, joints_lost))
            out = more if fits else out
            found.append(Quarantined(self._names[number], reason, not fits))
        return out, tuple(found)

    def look(self, frame: SwitchFrame, biased_scores: Sequence[int], lost: Mask) -> None:
        """Take a frame, its scores, and the switches that are scored as lost."""
        time_us = frame.time_us
        if time_us <= self._seen_us:
            return
        self._seen_us, read = time_us, self._all & ~frame.lost
        chattering = self._chattering.switches
        self._chattering.frame(time_us, frame.closed, read)
        stuck = self._stuck
        if chattering != self._chattering.switches:
            self._sort()
        if stuck is None:
            return
        if (state := (frame.closed, read, lost)) == self._state and self._weighed:
            return
        closed = frame.closed & read
        self._shown = closed | self._shown & ~read
        self._state, contacts = state, self._shown & ~(lost & read)
        self._stayed &= closed | ~read
        if self._fewest is None or contacts.bit_count() < self._fewest[0].bit_count():
            self._fewest = contacts, closed, read, biased_scores, lost
        if _differ(contacts, self._contacts):
            self._contacts, self._since_us, self._read, self._weighed = contacts, time_us, read, False
        elif not self._weighed and time_us - self._since_us >= SETTLED_US and not self._read & ~read:
            self._contacts, self._weighed = contacts, True
            quiet = ~self._chattering.switches
            least, kept, seen, scores, without = self._fewest
            if _differ(least, contacts) and _differ(least, self._before):
                stuck.weigh(scores, kept, seen & quiet & ~(kept & ~self._stayed), without)
            stuck.weigh(biased_scores, closed, read & quiet, lost)
            self._before, self._stayed, self._fewest = contacts, self._all, None
            self._sort()

    def _sort(self) -> None:
        """Update the list of wrong switches, in the order of detection."""
        stuck = {} if self._stuck is None else self._stuck.stuck
        now = {number: (STUCK_CLOSED, STUCK_OPEN)[kind] for number, kind in stuck.items()}
        now |= dict.fromkeys(numbers(self._chattering.switches), CHATTERING)
        if now != self._wrong:
            self._wrong = {which: now[which] for which in (*(each for each in self._wrong if each in now), *now)}
            self._chosen_for = None


def _differ(contacts: Mask, others: Mask) -> bool:
    changed = contacts ^ others
    return changed != 0 and 2 * changed.bit_count() >= (contacts | others).bit_count()


def _flags(mask: Mask, bits: int) -> Flags:
    packed = np.frombuffer(mask.to_bytes((bits + 7) // 8, "little"), np.uint8)
    return np.unpackbits(packed, count=bits, bitorder="little").astype(bool)


def numbers(mask: Mask) -> list[int]:
    """Return the numbers of the bits of `mask`."""
    return [bit.bit_length() - 1 for bit in bits(mask)]
