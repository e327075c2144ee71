"""A loaded build folder: `build.json` describes the tables, `tables.bin` holds them."""

from os import PathLike
from typing import TYPE_CHECKING, Self

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from . import manifest_file
from .errors import BuildError
from .files import read_file
from .manifest import Manifest
from .manifest_file import manifest_from_bytes
from .model import integers as tables_file
from .model.integers import IntegerTables, tables_from_bytes
from .published import NONE
from .scores import LANE_OFFSET, Scorer, softmax
from .sealed import sha256

if TYPE_CHECKING:
    from pathlib import Path

MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME = "build.json", "tables.bin", "ensemble.bin"


class Recognition(Struct, frozen=True):
    """The prediction for a frame, and its confidence.

    probability is the published softmax of the scores of all classes, including nothing held if the build may refuse a
    frame; a board's probability is in integers, and of the grasp types only. margin is the lead over the second best in
    integer steps; degraded says that a switch or a joint was missing and its mean contribution was added instead.
    """

    grasp: str
    probability: float
    margin: int
    degraded: bool


class Build:
    """A recogniser for single frames, integer arithmetic only.

    A frame is `bits` (s,), the kept switches in the order of `manifest.switches`, and `codes` (j,), the joints in the
    order of `manifest.joints`. Of equal scores the first grasp type wins. `scorer` is shared by all users of the
    scores, and may refuse frames. `none` is the class of frames in which nothing is held, None if no training row
    showed that.
    """

    __slots__ = ("classes", "grasps", "manifest", "none", "scorer", "tables")

    def __init__(self, manifest: Manifest, tables: IntegerTables) -> None:
        """Combine the parts of a build. Raises BuildError if they describe different builds."""
        named = len(manifest.grasps), len(manifest.switches), len(manifest.joints)
        held = tables.n_classes, tables.n_switches, tables.n_joints
        if named != held:
            raise BuildError(
                f"{MANIFEST_NAME} names {named[0]} grasp types, {named[1]} switches and {named[2]} joints, but "
                f"{TABLES_NAME} holds {held[0]}, {held[1]} and {held[2]}: compile the build again"
            )
        self.manifest = manifest
        self.tables = tables
        self.grasps, self.classes = manifest.grasps, manifest.classes
        self.scorer = Scorer(tables, manifest.rejection)
        self.none = len(self.grasps) - 1 if self.grasps[-1] == NONE else None

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> Self:
        """Return the build in `folder`.

        Raises BuildError or FormatError, naming the file, if one is missing, damaged, truncated, oversized, from
        another build, or newer than this thenar.
        """
        from pathlib import Path  # of Python 3.11, it takes longer to load than this package

        where = Path(folder)
        manifest = load_manifest(where)
        path = where / TABLES_NAME
        data = read_member(path, tables_file.MAX_BYTES, manifest.tables_sha256)
        tables = tables_from_bytes(data, str(path))
        proved = manifest.proof.scale, manifest.proof.bound
        if proved != (tables.scale, tables.bound):
            raise BuildError(
                f"{where / MANIFEST_NAME} has a scale of {proved[0]!r} and a bound of {proved[1]}, but {TABLES_NAME} "
                f"has {tables.scale!r} and {tables.bound}: compile the build again"
            )
        return cls(manifest, tables)

    def scores(self, bits: ArrayLike, codes: ArrayLike) -> NDArray[np.int64]:
        """Return the scores of one frame, (K,) in steps of 1 / `tables.scale`. Raises FrameError."""
        return np.array(self.scorer.biased_scores(bits, codes)) - LANE_OFFSET

    def classify(self, bits: ArrayLike, codes: ArrayLike) -> str:
        """Return the grasp type of one frame, "none" if nothing is held. Raises FrameError."""
        state = self.scorer.state(bits, codes)
        scores, _ = self.scorer.with_none(self.scorer.state_scores(*state), *state)
        return self.classes[scores.index(max(scores))]

    def recognise(
        self,
        bits: ArrayLike,
        codes: ArrayLike,
        lost_switches: ArrayLike | None = None,
        lost_joints: ArrayLike | None = None,
    ) -> Recognition:
        """Return the prediction for a single frame, and its confidence.

        Parameters
        ----------
        bits : array of bool, shape (s,)
            The kept switches, closed or not.
        codes : array of int, shape (j,)
            The joints' codes, 0 to 65535.
        lost_switches : array of bool, shape (s,), optional
            The switches that could not be read; their mean contribution is added, whatever `bits` says.
        lost_joints : array of bool, shape (j,), optional
            The same for joints.

        Raises
        ------
        FrameError
            If the frame does not fit the build.
        """
        state = self.scorer.state(bits, codes, lost_switches, lost_joints)
        biased_scores, _ = self.scorer.with_none(self.scorer.state_scores(*state), *state)
        second, best = sorted(biased_scores)[-2:]
        winner = biased_scores.index(best)
        probability = softmax(biased_scores, self.tables.scale)[winner]
        return Recognition(self.classes[winner], probability, best - second, bool(state[1] or state[3]))


def load_manifest(folder: "Path") -> Manifest:
    """Return the content of the `build.json` in `folder`. Raises BuildError."""
    path = folder / MANIFEST_NAME
    return manifest_from_bytes(read_member(path, manifest_file.MAX_BYTES), str(path))


def read_member(path: "Path", largest: int, checksum: str | None = None) -> bytes:
    """Return the bytes of one file of a build, at most `largest` of them, whose SHA-256 must be `checksum` if given."""
    try:
        data = read_file(path, largest, BuildError)
    except OSError as wrong:
        raise BuildError(f"{path} cannot be read: {wrong.strerror}; is {path.parent} a build?") from None
    if checksum is not None and sha256(data).hex() != checksum:
        raise BuildError(f"{path} is not the one that {MANIFEST_NAME} describes: damaged, or from another build")
    return data
