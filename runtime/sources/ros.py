"""Topics of ROS 2 as rows, through Eclipse Cyclone DDS (extra `ros`), without a ROS installation.

    ros:/TOPIC                         sensor_msgs/JointState: columns are the names of the joints, by their positions
    ros:/TOPIC?type=UInt8MultiArray    std_msgs: columns in the order of `columns`
    ros:/TOPIC?type=Float32MultiArray  the same

A JointState's stamp is the sender's clock, unless it is zero. Nodes of this machine are received, others if
CYCLONEDDS_URI or `&public` allows them; ROS_DOMAIN_ID sets the domain. Messages of a second publisher are left out.
"""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.extras import optional
from thenar.drivers.lines import LineCounts, Row, RowReader, finite
from thenar.drivers.names import shortened
from thenar.drivers.senders import FirstSender

from ..frames import now_us
from .rows import row_kinds

_TYPES = ("JointState", "UInt8MultiArray", "Float32MultiArray")
_PORT = re.compile(rf"ros:(/[^?]*)(?:\?(?:type=({'|'.join(_TYPES)})&?)?(public)?)?")
_MOST = 256
_ANY = 0xFFFFFFFF  # samples, views and instances of all states


class RosReader(RowReader):
    """Rows of the messages of a topic. Its constructor opens nothing."""

    def __init__(self, port: str) -> None:
        self._port, self._counts = port, LineCounts()
        found = _PORT.fullmatch(port)
        self.kind = "joint" if found and (found[2] or _TYPES[0]) == _TYPES[0] else ""
        self._reader: Any = None
        self._waiting: Any = None
        self._domain: Any = None
        self._senders = FirstSender()

    def open(self) -> None:
        """Subscribe to the topic, which may not have a publisher yet."""
        found = _PORT.fullmatch(self._port)
        if found is None:
            ways = f"ros:/TOPIC, optionally followed by ?type= one of {', '.join(_TYPES)}, or ?public"
            raise SettingError(f"{shortened(repr(self._port))} names no topic: write {ways}")
        with optional(SettingError, self._port):
            from cyclonedds.core import DDSException, ReadCondition, WaitSet

            from .. import ros
        self._senders = FirstSender()
        number, name = ros.domain(), ros.namespace(found[1])
        try:
            self._domain, participant = ros.join(number, public=bool(found[3]))
            self._reader = ros.reader(participant, name, getattr(ros, found[2] or _TYPES[0]))
            self._waiting = WaitSet(participant)
            self._waiting.attach(ReadCondition(self._reader, _ANY))
        except (DDSException, OSError) as reason:
            raise DeviceError(f"{self._port} cannot be opened in domain {number}: {reason}") from None

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the rows of the messages that arrived."""
        from cyclonedds.core import DDSException

        try:
            self._waiting.wait(timeout=max(1, round(timeout_s * 1e9)))
            return list(self._rows(self._reader.take(N=_MOST)))
        except DDSException as reason:
            raise DeviceError(f"{self._port}: {reason}") from None

    def _rows(self, samples: Sequence[Any]) -> Iterator[Row]:
        valid = [sample for sample in samples if sample.sample_info.valid_data]  # others say that a writer has gone
        senders, time_us = [sample.sample_info.publication_handle for sample in valid], now_us()
        if self._senders.current in senders:  # it was not silent, wherever its messages are among those that waited
            self._senders.admits(self._senders.current, time_us)
        for sample, sender in zip(valid, senders, strict=True):
            if not self._senders.admits(sender, time_us):
                self._counts.foreign += 1
                continue
            if hasattr(sample, "position"):
                names, stamp = tuple(sample.name), sample.header.stamp
                if not names or len(names) != len(sample.position) or len(set(names)) < len(names):
                    self._counts.misfits += 1
                    self.odd = f"a JointState of {len(names)} names and {len(sample.position)} positions"
                    continue
                time_s = stamp.sec + stamp.nanosec / 1e9 if stamp.sec or stamp.nanosec else None
                yield Row(names, tuple(map(finite, sample.position)), time_s)
            else:
                yield Row(None, tuple(finite(float(value)) for value in sample.data))

    def counts(self) -> LineCounts:
        """Return the number of messages that were not rows."""
        return self._counts

    def other_sender(self) -> str:
        """Return a sentence on another publisher."""
        if self._senders.other(now_us()) is None:
            return ""
        return "another publisher sends on this topic, too, and its messages are left out: stop it, or rename its topic"

    def close(self) -> None:
        """Leave the domain."""
        self._reader = self._waiting = None
        self._domain = None


MEMBER = row_kinds(
    "ros",
    "A topic of ROS 2, JointState, UInt8MultiArray or Float32MultiArray: [[stream]] from ros:/TOPIC.",
    lambda port: port.startswith("ros:"),
    lambda wiring: RosReader(wiring.port),
    5,
)
