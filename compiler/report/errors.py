"""What can be wrong with what a report is to be made of."""

from thenar.runtime.errors import ThenarError


class ReportError(ThenarError, ValueError):
    """The parts of a report do not belong together, or what draws its charts is not installed."""
