"""What can be wrong with recordings on their way in or out."""

from thenar.runtime.errors import ThenarError

__all__ = ["ColumnsError", "RecordingError", "TableError"]


class RecordingError(ThenarError, ValueError):
    """A set of grasps contradicts itself, or a label is not in its taxonomy."""


class TableError(ThenarError, ValueError):
    """A table cannot be read, or holds something that its columns.toml does not allow."""


class ColumnsError(ThenarError, ValueError):
    """A columns.toml cannot be read, or does not fit its table."""
