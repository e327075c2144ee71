"""Where frames come from: one file for each kind of source, found by the registry `SOURCES`."""

from .base import SOURCES, Source, SourceKind

__all__ = ["SOURCES", "Source", "SourceKind"]
