"""The build folder: compiled, and verified against what was trained."""

from thenar.runtime.errors import ThenarError


class CompileError(ThenarError, ValueError):
    """The recordings, the options or the folder do not allow a build, or the recordings do not fit it."""
