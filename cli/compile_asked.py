"""What the user asks of `thenar compile`, and what of it does not go together."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .common import keep_apart

if TYPE_CHECKING:
    from thenar.runtime.manifest import Inputs, TableBits

TABLE_BITS: "dict[str, TableBits]" = {"16": 16, "8": 8}
# What a point of a frontier says.
_SETTLED = ("prune", "rounds", "inputs", "table_bits", "max_bins", "placement", "keep", "width")
_TRAINING = (*_SETTLED, "shrinkage", "tolerance", "folds", "seed")


@dataclass(frozen=True, slots=True)
class Asked:
    """The options of the command line."""

    recordings: Path
    output: Path
    prune: int
    rounds: int
    inputs: "Inputs"
    shrinkage: float
    tolerance: float | None
    folds: int
    seed: int
    table_bits: str
    max_bins: int | None
    placement: str
    keep: int | None
    width: int
    from_frontier: Path | None
    point: int | None
    report: bool
    hand_length: float | None
    glove: Path | None
    propose: Path | None
    chip: str | None
    overwrite: bool
    as_json: bool

    @property
    def training(self) -> dict[str, Any]:
        """What `compile_build` is told of placement, training and tables."""
        options = {name: getattr(self, name) for name in _TRAINING}
        return options | {"table_bits": TABLE_BITS[self.table_bits]}

    def check(self, context: click.Context) -> None:
        """Raise UsageError for what does not go together: before the training, not after it."""
        self._check_proposal()
        self._check_point(context)
        if self.hand_length is not None and not self.report:
            raise click.UsageError(
                "--hand-length is of the hand in spec/, which --no-report leaves out: give one of them."
            )
        keep_apart(self.recordings, self.glove, self.propose, self.from_frontier)

    def check_hand(self, switches: Sequence[str]) -> None:
        """Raise UsageError if a hand is to be drawn whose `switches` nobody knows the places of."""
        from thenar.simulator.handmaps.handmap import hand_map

        if self.hand_length is not None and hand_map().fitted(switches) is None:
            raise click.UsageError(
                "--hand-length: the switches of these recordings are not those of murakami160, and where they lie is "
                "not known."
            )

    def _check_proposal(self) -> None:
        if self.propose is None:
            if self.chip is not None or self.overwrite:
                raise click.UsageError("--chip and --overwrite say how to --propose a harness: name the file to write.")
            return
        if self.glove is not None:
            raise click.UsageError("--glove reads a wiring, --propose writes a new one: give one of them.")
        if self.propose.exists() and not self.overwrite:
            raise click.UsageError(f"{self.propose} is there already: name another file, or add --overwrite.")

    def _check_point(self, context: click.Context) -> None:
        if self.from_frontier is None:
            if self.point is not None:
                raise click.UsageError("--point is one of a frontier: name its file with --from.")
            return
        for name in _SETTLED:
            if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
                raise click.UsageError(
                    f"--{name.replace('_', '-')} is settled by the point that --from names: leave it out."
                )
