"""Which hard cases there are, in their order. A case is loaded when it is run."""

from collections.abc import Iterator
from importlib import import_module
from typing import Protocol, cast

from .finding import Case, Finding

NAMES = (
    "elementary",
    "information",
    "targets",
    "stumpfits",
    "scoretables",
    "invariances",
    "separable",
    "degenerate",
    "columns",
    "codes",
    "contradictions",
    "weights",
    "quantisation",
    "missing",
    "contact",
    "statistics",
    "platform",
)


class CaseModule(Protocol):
    """A module of `cases`."""

    CASE: Case

    @staticmethod
    def findings(full: bool) -> Iterator[Finding]:
        """Run the case, quickly or in full, and yield what it finds, in an order that does not vary."""


def load(name: str) -> CaseModule:
    """Return the module of case `name`, one of NAMES."""
    return cast("CaseModule", import_module(f".cases.{name}", __package__))
