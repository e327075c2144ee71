"""Random numbers of a scene: streams of random words by draw site, and their conversion to numbers.

key     = hash of (scene seed, effect name)
counter = [0, repetition, hash of (grasp type, object), hash of subject]

Adding or removing an effect, putting a subject first, or making a single repetition changes no draw of any other site.
Only Philox' raw 64-bit words come from numpy, which guarantees them; deviates.py converts them to numbers.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, log, polynomial
from thenar.runtime.published import NONE

Words = NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class RandomWords:
    """Raw 64-bit words of any shape, and their conversions."""

    words: Words

    def uniform(self) -> Floats:
        """Return numbers strictly between 0 and 1: the middles of 2^52 equal steps."""
        return ((self.words >> np.uint64(12)).astype(np.float64) + 0.5) * 2.0**-52

    def normal(self) -> Floats:
        """Return standard normal numbers, by the inverse of their distribution (Wichura 1988, AS 241, PPND16)."""
        return _quantile(self.uniform())


_A = (
    3.3871328727963666080e0,
    1.3314166789178437745e2,
    1.9715909503065514427e3,
    1.3731693765509461125e4,
    4.5921953931549871457e4,
    6.7265770927008700853e4,
    3.3430575583588128105e4,
    2.5090809287301226727e3,
)
_B = (
    1.0,
    4.2313330701600911252e1,
    6.8718700749205790830e2,
    5.3941960214247511077e3,
    2.1213794301586595867e4,
    3.9307895800092710610e4,
    2.8729085735721942674e4,
    5.2264952788528545610e3,
)
_C = (
    1.42343711074968357734e0,
    4.63033784615654529590e0,
    5.76949722146069140550e0,
    3.64784832476320460504e0,
    1.27045825245236838258e0,
    2.41780725177450611770e-1,
    2.27238449892691845833e-2,
    7.74545014278341407640e-4,
)
_D = (
    1.0,
    2.05319162663775882187e0,
    1.67638483018380384940e0,
    6.89767334985100004550e-1,
    1.48103976427480074590e-1,
    1.51986665636164571966e-2,
    5.47593808499534494600e-4,
    1.05075007164441684324e-9,
)
_E = (
    6.65790464350110377720e0,
    5.46378491116411436990e0,
    1.78482653991729133580e0,
    2.96560571828504891230e-1,
    2.65321895265761230930e-2,
    1.24266094738807843860e-3,
    2.71155556874348757815e-5,
    2.01033439929228813265e-7,
)
_F = (
    1.0,
    5.99832206555887937690e-1,
    1.36929880922735805310e-1,
    1.48753612908506148525e-2,
    7.86869131145613259100e-4,
    1.84631831751005468180e-5,
    1.42151175831644588870e-7,
    2.04426310338993978564e-15,
)


def _quantile(p: Floats) -> Floats:
    centred = p - 0.5
    inner = 0.180625 - centred * centred
    central = centred * _ratio(inner, _A, _B)
    tail = np.sqrt(-log(np.minimum(p, 1.0 - p)))
    near, far = _ratio(tail - 1.6, _C, _D), _ratio(tail - 5.0, _E, _F)
    outer = np.copysign(np.where(tail <= 5.0, near, far), centred)
    return np.where(inner >= 0.0, central, outer)


def _ratio(x: Floats, above: tuple[float, ...], below: tuple[float, ...]) -> Floats:
    return polynomial(x, above) / polynomial(x, below)


# The counter values for "every repetition" (of a subject) and "every subject" (one glove).
_ALL = 2**64 - 1


@dataclass(frozen=True, slots=True)
class Site:
    """The site of draws: a subject, a grasp type with an object, and the repetitions (n,) of one batch."""

    subject: str
    grasp: str
    object: str
    repetitions: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Draw:
    """The random numbers of one effect for one batch of n repetitions.

    `per_repetition` draws differ by repetition; `per_subject` draws are constant over all repetitions of a subject,
    `per_type` draws over those of a grasp type; `per_glove` draws are the same for all subjects.
    The same call returns the same numbers again. `draws` counts them, by the name of the effect.
    """

    seed: int
    effect: str
    site: Site
    draws: Counter[str]

    def at_rest(self, numbers: NDArray[np.int64]) -> "Draw":
        """Return the draws for the same subject's rests (n,): the rest before trial t has the number t."""
        return replace(self, site=Site(self.site.subject, NONE, "", numbers))

    def per_repetition(self, *shape: int) -> RandomWords:
        """Return numbers of shape (n, *shape)."""
        site, size = self.site, int(np.prod(shape))
        rows = self._words(site.repetitions.tolist(), _hash(site.grasp, site.object), _hash(site.subject), size)
        return RandomWords(rows.reshape(len(rows), *shape))

    def per_subject(self, *shape: int) -> RandomWords:
        """Return numbers of `shape`, specific to the subject."""
        return self._common(_hash(self.site.subject), shape)

    def per_type(self, *shape: int) -> RandomWords:
        """Return numbers of `shape`, specific to the subject and this grasp type."""
        return self._common(_hash(self.site.subject, self.site.grasp), shape)

    def per_glove(self, *shape: int) -> RandomWords:
        """Return numbers of `shape`, the same for every subject and repetition of the scene."""
        return self._common(_ALL, shape)

    def _common(self, subject: int, shape: tuple[int, ...]) -> RandomWords:
        return RandomWords(self._words([_ALL], _ALL, subject, int(np.prod(shape))).reshape(shape))

    def count(self, what: str, number: int) -> None:
        """Count something of this effect, such as solver steps, for its entry in the ledger."""
        self.draws[what] += number

    def _words(self, repetitions: Sequence[int], condition: int, subject: int, size: int) -> Words:
        """Return `size` words for each of the repetitions."""
        words = np.empty((len(repetitions), size), dtype=np.uint64)
        self.draws[self.effect] += words.size
        counter = np.array([0, 0, condition, subject], dtype=np.uint64)
        source, at = np.random.Philox(key=_key(self.seed, self.effect), counter=counter), 0
        for row, repetition in zip(words, repetitions, strict=True):
            # Advancing the counter costs a third of a new source.
            source.advance(((repetition << 64) - at) % (1 << 256))
            row[:] = source.random_raw(size)
            at = (repetition << 64) + -(-size // 4)  # four words to a step of the counter
        return words


def _hash(*names: str) -> int:
    return int.from_bytes(blake2b("\0".join(names).encode(), digest_size=8).digest(), "little")


def _key(seed: int, effect: str) -> Words:
    digest = blake2b(f"{seed}\0{effect}".encode(), digest_size=16).digest()
    return np.frombuffer(digest, dtype="<u8").astype(np.uint64)
