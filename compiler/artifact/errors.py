"""What can be wrong with what a build is to be made of, or held against."""

from thenar.runtime.errors import ThenarError


class CompileError(ThenarError, ValueError):
    """The recordings, the options or the folder do not allow a build, or the recordings do not fit it."""
