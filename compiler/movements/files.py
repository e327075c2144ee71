"""Segments in files: a table (.csv), an annotation document of ELAN (.eaf), annotations in an MCAP file (.mcap).

An ELAN document (format 3.0, www.mpi.nl/tools/elan/EAFv3.0.xsd) has a tier for each stream, and one for the truth where
it is known; times are milliseconds from the start of the earliest stream. In MCAP the segments are JSON messages on one
topic, with their schema, logged at their start. Files carry no date: equal segments give equal bytes.
"""

import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from thenar.runtime.files import write_atomically

from ..text import cell
from .scores import segments_of
from .timeline import FoundSegment, Timeline

TOPIC = "/thenar/segments"
COLUMNS = FoundSegment.__struct_fields__
_EAF = "3.0"
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_EPOCH = "1970-01-01T00:00:00+00:00"


def write(path: Path, timelines: Sequence[Timeline]) -> None:
    """Write the segments in the format of the suffix of `path`, one of ENDINGS, completely or not at all. Raises
    OSError.
    """
    write_atomically(path, WRITERS[path.suffix.lower()](timelines))


def as_csv(timelines: Sequence[Timeline]) -> bytes:
    """Return a table with one row per segment."""
    import csv

    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for timeline in timelines:
        for one in timeline.segments():
            names = cell(one.type), cell(one.subject), cell(one.session)
            writer.writerow((f"{one.start_s:.6f}", f"{one.end_s:.6f}", names[0], f"{one.confidence:.4f}", *names[1:]))
    return text.getvalue().encode()


def as_eaf(timelines: Sequence[Timeline]) -> bytes:
    """Return an ELAN annotation document."""
    root = ElementTree.Element(
        "ANNOTATION_DOCUMENT",
        {"AUTHOR": "thenar", "DATE": _EPOCH, "FORMAT": _EAF, "VERSION": _EAF, "xmlns:xsi": _XSI}
        | {"xsi:noNamespaceSchemaLocation": f"http://www.mpi.nl/tools/elan/EAFv{_EAF}.xsd"},
    )
    ElementTree.SubElement(root, "HEADER", {"MEDIA_FILE": "", "TIME_UNITS": "milliseconds"})
    order = ElementTree.SubElement(root, "TIME_ORDER")
    first_us = min((timeline.start_us for timeline in timelines), default=0)
    tiers, number = list[ElementTree.Element](), 0
    slots: dict[int, str] = {}

    def slot(timeline: Timeline, tick: int) -> str:
        after_ms = round((timeline.start_us - first_us + tick * timeline.tick_us) / 1000)
        return slots.setdefault(after_ms, f"ts{len(slots) + 1}")

    for place, timeline in enumerate(timelines):
        before = sum(other.name == timeline.name for other in timelines[:place])
        title = f"{timeline.name}, part {before + 1}" if before else timeline.name
        kinds = {title: timeline.states} | ({} if timeline.truth is None else {f"{title}, true": timeline.truth})
        for name, states in kinds.items():
            tiers.append(ElementTree.Element("TIER", {"LINGUISTIC_TYPE_REF": "grasp", "TIER_ID": name}))
            for one in segments_of(states, len(timeline.types)):
                number += 1
                ends = {f"TIME_SLOT_REF{end}": slot(timeline, tick) for end, tick in ((1, one.start), (2, one.end))}
                outer = ElementTree.SubElement(tiers[-1], "ANNOTATION")
                inner = ElementTree.SubElement(outer, "ALIGNABLE_ANNOTATION", {"ANNOTATION_ID": f"a{number}"} | ends)
                ElementTree.SubElement(inner, "ANNOTATION_VALUE").text = timeline.types[one.state]
    for after_ms, name in sorted(slots.items()):
        ElementTree.SubElement(order, "TIME_SLOT", {"TIME_SLOT_ID": name, "TIME_VALUE": str(after_ms)})
    root.extend(tiers)
    kind = {"GRAPHIC_REFERENCES": "false", "LINGUISTIC_TYPE_ID": "grasp", "TIME_ALIGNABLE": "true"}
    ElementTree.SubElement(root, "LINGUISTIC_TYPE", kind)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'.encode()


def as_mcap(timelines: Sequence[Timeline]) -> bytes:
    """Return an MCAP file with a message for each segment on TOPIC."""
    import msgspec
    from mcap.writer import CompressionType, Writer

    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start(profile="", library="thenar")
    _, parts = msgspec.json.schema_components([FoundSegment])
    schema = {"title": "thenar.Segment", **parts["FoundSegment"]}
    known = writer.register_schema("thenar.Segment", "jsonschema", json.dumps(schema, sort_keys=True).encode())
    channel = writer.register_channel(TOPIC, "json", known)
    segments = (
        (timeline.zero_us + round(1e6 * segment.start_s), segment)
        for timeline in timelines
        for segment in timeline.segments()
    )
    for number, (at_us, segment) in enumerate(sorted(segments, key=lambda pair: pair[0])):
        writer.add_message(channel, 1000 * at_us, msgspec.json.encode(segment), 1000 * at_us, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


WRITERS: Mapping[str, Callable[[Sequence[Timeline]], bytes]] = {".csv": as_csv, ".eaf": as_eaf, ".mcap": as_mcap}
ENDINGS = tuple(WRITERS)
