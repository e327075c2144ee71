"""ROS bags as tables: the numbers and texts in the messages of all topics, merged by time.

Read through `rosbags`: ROS 1 (.bag), and rosbag2 as .mcap, as .db3 or as the folder around them. Rows are the messages
of the topic that has most; the other topics give the values that they had last.
"""

from collections.abc import Collection, Iterator
from dataclasses import fields, is_dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from thenar.runtime.files import open_file
from thenar.runtime.names import LONGEST_NAME, list_names, shortened
from thenar.runtime.recording.layout import CHANNELS, WRITER

from ..arrays import AnyArray, measured
from . import TableError
from .cells import natural_key

# The most numbers and texts in a message, which images exceed, and the most forms of message of one topic.
_WIDEST, _FORMS = 4096, 16
# Packages of messages on the system itself, and fields that describe the others of a message.
_SYSTEM = {"rcl_interfaces", "rosgraph_msgs", "tf2_msgs", "tf", "diagnostic_msgs"}
_BESIDE = {"header", "layout"}


def is_folder(path: Path) -> bool:
    """Return whether `path` is the folder of a rosbag2."""
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        return False
    with metadata.open("rb") as file:
        return b"rosbag2" in file.read(1000)


def is_recording(path: Path) -> bool:
    """Return whether `path` is an MCAP, and not one of other programs for ROS."""
    if path.suffix.lower() != ".mcap" or path.is_dir():
        return False
    with open_file(path, TableError) as file:
        header = file.read(64)
    return b"ros" not in header or WRITER.encode() in header


# Messages of one form, which hold numbers and texts of the same names: the nanosecond of each, and these.
_Stream = list[tuple[int, tuple[float | str, ...]]]


def read_bag(path: Path, notes: list[str]) -> dict[str, AnyArray]:
    """Return the columns of a bag, and add to `notes` what was left out. Raises TableError if no topic has any."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    topics: dict[str, dict[tuple[str, ...], _Stream]] = {}
    out: dict[str, str] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        counts = dict.fromkeys(sorted(kinds, key=natural_key), 0)
        if any(topic in counts for topic, _ in CHANNELS.values()):
            raise TableError("it is a recording of thenar, or a copy of one: import the original, without tables")
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
            forms.setdefault(tuple(cells), []).append((time, tuple(cells.values())))
            if why := _left_out(kind, len(cells), forms):
                out[topic] = why
                del topics[topic]
    shown = {topic: f"{shortened(topic)} ({kinds[topic]}, {count} messages" for topic, count in counts.items()}
    left = [f"{shown[topic]}: {why})" for topic, why in out.items()]
    streams = [stream for topic in counts for stream in topics.get(topic, {}).items()]
    numeric = [messages for _, messages in streams if any(isinstance(cell, float) for cell in messages[0][1])]
    if not numeric:
        seen = list_names(left or [f"{topic})" for topic in shown.values()]) or "nothing"
        raise TableError(f"no topic has numbers to read: it holds {seen}")
    if left:
        notes.append(f"topics left out: {list_names(left)}")
    at = np.array([time for time, _ in max(numeric, key=len)])
    columns: dict[str, AnyArray] = {"time_s": at / 1e9}
    for names, messages in streams:
        # From the first row on, so that a double holds each nanosecond.
        row = measured((at - at[0]) / 1e9, (np.array([time for time, _ in messages]) - at[0]) / 1e9)
        for name, column in zip(names, zip(*(cells for _, cells in messages), strict=True), strict=True):
            columns[name] = np.array(column, np.str_ if isinstance(column[0], str) else np.float64)[row]
            columns[name][row < 0] = "" if isinstance(column[0], str) else np.nan
    return columns


def _left_out(kind: str, width: int, forms: Collection[tuple[str, ...]]) -> str:
    """Return why messages of a `kind`, the last with `width` cells, are left out, "" if they are not."""
    if kind.partition("/")[0] in _SYSTEM:
        return "about ROS itself"
    if not 0 < width <= _WIDEST:
        return f"more than {_WIDEST} numbers in a message" if width else "no numbers or short texts"
    differ = sum(map(len, forms)) > len({name for form in forms for name in form})
    return "the lengths of its arrays differ" if differ or len(forms) > _FORMS else ""


def _cells(name: str, value: Any) -> Iterator[tuple[str, float | str]]:
    """Yield the numbers and texts in a field of a message, by their names; a joint's numbers by that of the joint."""
    if is_dataclass(value):
        joints = getattr(value, "name", None)
        # Names of which two are equal tell nothing apart.
        joints = joints if isinstance(joints, list) and len(set(map(str, joints))) == len(joints) else None
        for part in fields(value):
            inner = getattr(value, part.name)
            if part.name in _BESIDE or inner is joints or part.name.startswith("__"):
                continue
            if joints is not None and isinstance(inner, np.ndarray) and len(inner) == len(joints):
                inner = dict(sorted(zip(joints, inner.tolist(), strict=True)))
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
