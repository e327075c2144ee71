"""Build folders: compile them, and verify them against the trained model."""

from thenar.runtime.errors import ThenarError


class CompileError(ThenarError, ValueError):
    """A build cannot be made with this input.

    The recordings, the options or the folder do not allow a build, or the recordings do not match an existing one.
    """
