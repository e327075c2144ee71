"""Random numbers by draw site: a Philox stream for every effect and repetition, so that nothing disturbs another.

key     = hash of (scene seed, effect name)
counter = [0, repetition, hash of (grasp type, object), hash of subject]

An effect that is added or removed, a subject that is put first, a repetition that is made alone: none changes a draw of
any other site. Only Philox' raw 64-bit words come from numpy, which keeps them for good; deviates.py makes numbers of
them.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from .deviates import Numbers, Words

# What stands for "every repetition" (of a subject) and "every subject" (one glove) in a counter.
_ALL = 2**64 - 1


@dataclass(frozen=True, slots=True)
class Site:
    """Whose draws: a subject, a grasp type with an object, and the repetitions (n,) of one batch."""

    subject: str
    grasp: str
    object: str
    repetitions: NDArray[np.int64]


@dataclass(slots=True)
class Draws:
    """How many random numbers each effect has drawn."""

    counts: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True, slots=True)
class Draw:
    """The random numbers of one effect for one batch of n repetitions.

    `per_repetition` draws differ with the repetition; `per_subject` ones are the subject's own in every repetition, and
    `per_type` ones in every repetition of a grasp type; `per_glove` ones are the glove's, the same for everybody.
    Asking twice returns the same numbers.
    """

    seed: int
    effect: str
    site: Site
    draws: Draws

    def per_repetition(self, *shape: int) -> Numbers:
        """Return numbers of shape (n, *shape)."""
        size = int(np.prod(shape))
        condition = _hash(self.site.grasp, self.site.object)
        subject = _hash(self.site.subject)
        rows = self._words(self.site.repetitions.tolist(), condition, subject, size)
        return Numbers(rows.reshape(len(rows), *shape))

    def per_subject(self, *shape: int) -> Numbers:
        """Return numbers of `shape`, the subject's own."""
        return Numbers(self._words([_ALL], _ALL, _hash(self.site.subject), int(np.prod(shape))).reshape(shape))

    def per_type(self, *shape: int) -> Numbers:
        """Return numbers of `shape`, the subject's own for this grasp type."""
        subject = _hash(self.site.subject, self.site.grasp)
        return Numbers(self._words([_ALL], _ALL, subject, int(np.prod(shape))).reshape(shape))

    def per_glove(self, *shape: int) -> Numbers:
        """Return numbers of `shape`, the same for every subject and repetition of the scene."""
        return Numbers(self._words([_ALL], _ALL, _ALL, int(np.prod(shape))).reshape(shape))

    def count(self, what: str, number: int) -> None:
        """Count something of this effect, such as solver steps, for its entry in the ledger."""
        self.draws.counts[what] += number

    def _words(self, repetitions: Sequence[int], condition: int, subject: int, size: int) -> Words:
        """Return `size` words for each of the repetitions."""
        words = np.empty((len(repetitions), size), dtype=np.uint64)
        self.draws.counts[self.effect] += words.size
        counter = np.array([0, 0, condition, subject], dtype=np.uint64)
        source, at = np.random.Philox(key=_key(self.seed, self.effect), counter=counter), 0
        for row, repetition in zip(words, repetitions, strict=True):
            # To move the counter on costs a third of a new source.
            source.advance(((repetition << 64) - at) % (1 << 256))
            row[:] = source.random_raw(size)
            at = (repetition << 64) + -(-size // 4)  # four words to a step of the counter
        return words


def _hash(*names: str) -> int:
    return int.from_bytes(blake2b("\0".join(names).encode(), digest_size=8).digest(), "little")


def _key(seed: int, effect: str) -> Words:
    digest = blake2b(f"{seed}\0{effect}".encode(), digest_size=16).digest()
    return np.frombuffer(digest, dtype="<u8").astype(np.uint64)
