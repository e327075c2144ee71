"""Transitions between grasp types: counts of changes from segment to segment.

Nothing held between two grasps is skipped: PoS, nothing, PMF is a change from PoS to PMF.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.errors import FormatError
from thenar.runtime.files import read_file

from ..recordings.graspset import GraspSet
from .segments import segments_of
from .streams import streams_of

# Rarer transitions are not admissible.
FREQUENT = 0.1
_LARGEST = 1 << 24


class TransitionFile(Struct, frozen=True, forbid_unknown_fields=True):
    """The JSON form: counts[i][j] segments of types[i] were followed by one of types[j].

    `probabilities` are the counts divided by the sum of their row, 0 where that is 0.
    """

    types: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]
    probabilities: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Transitions:
    """Changes between types: `counts` (K, K), from the row's type to the column's."""

    types: tuple[str, ...]
    counts: NDArray[np.intp]

    @classmethod
    def of(cls, sequences: Iterable[Sequence[str]], types: Sequence[str]) -> "Transitions":
        """Count the changes in sequences of types."""
        counts, place = np.zeros((len(types), len(types)), np.intp), {name: at for at, name in enumerate(types)}
        for sequence in sequences:
            for one, other in pairwise(sequence):
                counts[place[one], place[other]] += 1
        return cls(tuple(types), counts)

    @classmethod
    def of_set(cls, grasp_set: GraspSet) -> "Transitions":
        """Count the changes in the true segments of a set. Raises RecordingError if rows are not movements."""
        names, labels = grasp_set.taxonomy.types, grasp_set.labels
        types = sorted(set(labels[~grasp_set.is_none].tolist()))
        streams = [segments_of(labels[stream.rows], len(names)) for stream in streams_of(grasp_set)]
        return cls.of(([names[one.state] for one in stream] for stream in streams), [names[one] for one in types])

    @classmethod
    def load(cls, path: Path) -> "Transitions":
        """Load a file written by `save`. Raises FormatError that names the file, OSError."""
        try:
            file = msgspec.json.decode(read_file(path, _LARGEST, FormatError), type=TransitionFile)
            counts = np.array(file.counts, np.intp).reshape(len(file.types), len(file.types))
        except (msgspec.DecodeError, UnicodeDecodeError, ValueError, OverflowError) as wrong:
            raise FormatError(f"{path} is not a transitions file: {wrong}") from None
        return cls(file.types, counts)

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """The share of each successor type among the changes of a type, (K, K); zero rows for types without changes."""
        counts = self.counts.astype(np.float64)
        return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1))

    def frequent(self, grasp: str) -> tuple[str, ...]:
        """Return the types that follow `grasp` in at least FREQUENT of its changes, the most frequent first."""
        if grasp not in self.types:
            return ()
        row = self.probabilities[self.types.index(grasp)]
        return tuple(self.types[at] for at in np.argsort(-row, kind="stable").tolist() if row[at] >= FREQUENT)

    def to_json(self) -> bytes:
        """Return the content of its file."""
        rounded = self.probabilities.round(6).tolist()
        file = TransitionFile(self.types, tuple(map(tuple, self.counts.tolist())), tuple(map(tuple, rounded)))
        return msgspec.json.encode(file) + b"\n"
