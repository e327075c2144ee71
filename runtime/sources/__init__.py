"""The sources of frames: one file per kind, found by the registry `SOURCES`."""

from .base import SOURCES, Source, SourceKind

__all__ = ["SOURCES", "Source", "SourceKind"]
