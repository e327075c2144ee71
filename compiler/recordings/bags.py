"""ROS bags as tables: the numbers and texts in the messages of all topics, merged by time.

Read through `rosbags`: ROS 1 (.bag), and rosbag2 as .mcap, as .db3 or as the folder around them. Rows are the messages
of the topic that has most; the other topics give the values that they had last.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.files import open_file
from thenar.runtime.names import LONGEST_NAME, list_names, shortened
from thenar.runtime.recording.layout import CHANNELS, WRITER

from ..arrays import AnyArray, latest
from . import TableError
from .cells import natural_key

# The most numbers and texts in a message, which images exceed, and the most forms of message of one topic.
_WIDEST, _FORMS = 4096, 16
# Packages of messages on the system itself, and fields that describe the others of a message.
_SYSTEM = {"rcl_interfaces", "rosgraph_msgs", "tf2_msgs", "tf", "diagnostic_msgs"}
_BESIDE = {"header", "layout"}
# The bytes at either end of an MCAP in which it names its writer and its topics.
_ENDS = 1 << 16


def is_folder(path: Path) -> bool:
    """Return whether `path` is the folder of a rosbag2."""
    return (path / "metadata.yaml").is_file()


def is_recording(path: Path) -> bool:
    """Return whether `path` is an MCAP, and not one of other programs for ROS."""
    if path.suffix.lower() != ".mcap" or path.is_dir():
        return False
    with open_file(path, TableError) as file:
        content = file.read(_ENDS)
        file.seek(max(0, os.fstat(file.fileno()).st_size - _ENDS))
        content += file.read()
    ours = (WRITER, *(topic for topic, _ in CHANNELS.values()))
    return b"ros" not in content[:32] or any(name.encode() in content for name in ours)


@dataclass(slots=True)
class _Stream:
    """The messages of one form: which numbers and texts they hold, and of each its nanosecond and these."""

    numbers: list[str]
    texts: list[str]
    times: list[int] = field(default_factory=list)
    values: list[NDArray[np.float64]] = field(default_factory=list)
    said: list[tuple[str, ...]] = field(default_factory=list)

    @classmethod
    def of(cls, cells: Mapping[str, float | str]) -> "_Stream":
        """Return the stream of messages with such cells, without any."""
        texts = [name for name, cell in cells.items() if isinstance(cell, str)]
        return cls([name for name in cells if name not in texts], texts)

    def add(self, time: int, cells: Mapping[str, float | str]) -> None:
        """Add a message."""
        self.times.append(time)
        self.values.append(np.array([cells[name] for name in self.numbers], np.float64))
        self.said.append(tuple(str(cells[name]) for name in self.texts))


def read_bag(path: Path, notes: list[str]) -> dict[str, AnyArray]:
    """Return the columns of a bag, and add to `notes` what was left out. Raises TableError if no topic has any."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    if is_recording(path):
        raise TableError("it is a recording of thenar: import it with others of its kind alone, without a pattern")
    topics: dict[str, dict[frozenset[str], _Stream]] = {}
    out: dict[str, str] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        counts = dict.fromkeys(sorted(kinds, key=natural_key), 0)
        for connection, time, content in reader.messages():
            topic, kind = connection.topic, connection.msgtype
            counts[topic] += 1
            if topic in out:
                continue
            if kind not in reader.typestore.fielddefs:
                out[topic] = "its type is not defined in the bag"
                continue
            message = reader.deserialize(content, kind)
            cells = dict(islice(_cells(topic.strip("/"), message), _WIDEST + 1))
            forms = topics.setdefault(topic, {})
            forms.setdefault(frozenset(cells), _Stream.of(cells)).add(time, cells)
            if why := _left_out(kind, len(cells), forms):
                out[topic] = why
                del topics[topic]
    shown = {topic: f"{shortened(topic)} ({kinds[topic]}, {count} messages" for topic, count in counts.items()}
    left = [f"{shown[topic]}: {why})" for topic, why in out.items()]
    streams = [stream for topic in counts for stream in topics.get(topic, {}).values()]
    if not any(stream.numbers for stream in streams):
        seen = list_names(left or [f"{topic})" for topic in shown.values()]) or "nothing"
        raise TableError(f"no topic has numbers to read: it holds {seen}")
    if left:
        notes.append(f"topics left out: {list_names(left)}")
    return _merged(streams)


def _left_out(kind: str, width: int, forms: Mapping[frozenset[str], _Stream]) -> str:
    """Return why messages of a `kind`, the last with so many cells, are left out, "" if they are not."""
    if kind.partition("/")[0] in _SYSTEM:
        return "on the system itself"
    if not 0 < width <= _WIDEST:
        return f"more than {_WIDEST} numbers in a message" if width else "no numbers or short texts"
    differ = len(forms) > 1 and sum(map(len, forms)) > len(frozenset().union(*forms))
    return "the lengths of its arrays differ" if differ or len(forms) > _FORMS else ""


def _cells(name: str, value: Any) -> Iterator[tuple[str, float | str]]:
    """Yield the numbers and texts in a field of a message, by their names; a joint's numbers by that of the joint."""
    if is_dataclass(value):
        joints = getattr(value, "name", None)
        for part in fields(value):
            inner = getattr(value, part.name)
            if part.name in _BESIDE or (inner is joints and isinstance(joints, list)) or part.name.startswith("__"):
                continue
            if isinstance(joints, list) and isinstance(inner, np.ndarray) and len(inner) == len(joints):
                inner = dict(zip(joints, inner.tolist(), strict=True))
            yield from _cells(name if part.name == "data" else f"{name}.{part.name}", inner)
    elif isinstance(value, dict):
        yield from ((f"{name}.{joint}", number) for joint, number in value.items())
    elif isinstance(value, (list, np.ndarray)):
        for number, each in enumerate(value):
            yield from _cells(f"{name}.{number}", each)
    elif not isinstance(value, str):
        yield name, float(value)
    elif len(value) <= LONGEST_NAME:
        yield name, value


def _merged(streams: list[_Stream]) -> dict[str, AnyArray]:
    """Return the columns of all streams, in rows at the times of the one that has most."""
    longest = max((stream for stream in streams if stream.numbers), key=lambda stream: len(stream.times))
    at = np.sort(np.array(longest.times, np.int64))
    columns: dict[str, AnyArray] = {"time_s": at / 1e9}
    for stream in streams:
        order = np.argsort(times := np.array(stream.times, np.int64), kind="stable")
        row = latest(times[order] / 1e9, at / 1e9)
        values = np.stack(stream.values)[order[row]]
        values[row < 0] = np.nan
        columns |= dict(zip(stream.numbers, values.T, strict=True))
        said = np.array(stream.said, np.str_)[order[row]]
        said[row < 0] = ""
        columns |= dict(zip(stream.texts, said.T, strict=True))
    return columns
