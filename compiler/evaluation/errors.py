"""What can stand in the way of an evaluation."""

from thenar.drivers.errors import ThenarError


class EvaluationError(ThenarError, ValueError):
    """The set cannot be cut or compared as asked: too few rows, subjects, objects or blocks, or an unknown name."""
