"""The record of a build: its sources, its options, its model, its accuracies and its verified bounds.

`build.json` holds its fields in the order of the structs below: see manifest_file.py.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from msgspec import Meta, Struct

from .names import list_names
from .published import NONE
from .recipe import AUTO, PAPERS_TRAINER, Count, Name, Positive, Recipe, Share, Value
from .segmenting.model import SegmentModel

SCHEMA = 1

Of = Literal["pooled", "within subject", "new subject", "new subject after adaptation", "new object", "new session"]
Protocol = Literal["training", "nested"]
Unit = Literal["trials", "frames"]
Code = Annotated[int, Meta(ge=0, le=65535)]
# Bounds of errors and margins in steps, and of gains in bits and the values of joints.
Amount = Annotated[float, Meta(ge=0.0, le=1e9)]
Digest = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
# A byte for each grasp type.
Bytes = Annotated[str, Meta(pattern="^([0-9a-f]{2})*$")]


class Origin(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The recordings: SHA-256 of their content, number of rows, taxonomy, number of switches to choose from; the
    simulation that made them, absent for recordings; and whether each row is stated to be a separate trial.

    taxels, joints  the numbers of those to choose from
    trials          the first 32 bits of the digest of each trial, ascending: those of most trials, if there are many
    """

    fingerprint: Digest
    rows: Count
    taxonomy: str
    switches: Count
    simulated: str = ""
    independent: bool = False
    taxels: Count = 0
    joints: Count = 0
    trials: Annotated[str, Meta(pattern="^([0-9a-f]{8})*$")] = ""


class Compared(Struct, frozen=True, forbid_unknown_fields=True):
    """A trainer with its settings, as evaluated on inner folds of the training rows.

    correct  trials predicted correctly, of `total` tested ones
    error    the accuracy's standard error
    loss     mean of -ln P(true type) over the trials, of scores times their best factor
    behind   difference from the best accuracy; behind_error: the standard error of that difference
    rows     rows of its score tables, on average
    """

    trainer: Name
    settings: dict[Name, Value | None]
    correct: Count
    total: Positive
    error: Share
    loss: Annotated[float, Meta(ge=0.0)]
    behind: Share
    behind_error: Share
    rows: Amount

    @property
    def rate(self) -> float:
        """Correctly predicted trials as a share of all."""
        return self.correct / self.total

    @property
    def name(self) -> str:
        """The trainer and its settings: "logit, penalty 1, smoothness 10"."""
        return fit_name(self.trainer, self.settings)

    def __str__(self) -> str:
        """Return "logit, penalty 1: 98.1 +- 0.5 %, 0.6 +- 0.3 behind the best; tables of 158 rows"."""
        behind = f", {100 * self.behind:.1f} +- {100 * self.behind_error:.1f} behind the best" if self.behind else ""
        return f"{self.name}: {100 * self.rate:.1f} +- {100 * self.error:.1f} %{behind}; tables of {self.rows:.0f} rows"


def in_words(name: str, value: float) -> str:
    """Return a setting in words: "max-bins 16"."""
    return f"{name.replace('_', '-')} {value:g}"


def fit_name(trainer: str, settings: Mapping[str, float | None]) -> str:
    """Return a trainer and its settings in words: "logit, penalty 1, smoothness 10"."""
    values = (in_words(name, value) for name, value in settings.items() if value is not None)
    return ", ".join([trainer, *values])


class Fitting(Struct, frozen=True, forbid_unknown_fields=True):
    """The trainer of the model, values for all its settings, and how they were chosen.

    of        what the accuracies of the inner folds measure; folds: their number
    tried     number of candidates that were compared
    compared  the best of each trainer, and the chosen one; empty if there was nothing to choose
    why       a sentence
    """

    trainer: Name
    settings: dict[Name, Value | None]
    of: Of = "within subject"
    folds: Count = 0
    tried: Count = 1
    compared: tuple[Compared, ...] = ()
    why: str = ""

    def number(self, name: str) -> float:
        """Return a setting that is a number; 0 if there is none of this name."""
        value = self.settings.get(name)
        return 0.0 if value is None else value

    def __str__(self) -> str:
        """Return the trainer and its settings."""
        return fit_name(self.trainer, self.settings)


class Calibration(Struct, frozen=True, forbid_unknown_fields=True):
    """A joint: its column among the recordings' joints, from 0, its name, and two points from code to value."""

    column: Count
    name: Name
    unit: str
    code_a: Code
    value_a: Value
    code_b: Code
    value_b: Value

    def value(self, code: int) -> float:
        """Return the value of a code."""
        return self.value_a + (code - self.code_a) * ((self.value_b - self.value_a) / (self.code_b - self.code_a))


class Threshold(Struct, frozen=True, forbid_unknown_fields=True):
    """A level of a taxel, which makes it a switch: closed at codes above `code`. `value`, in the unit of `taxel`, is
    midway to the next code.
    """

    code: Code
    value: Value
    taxel: Calibration


class Switch(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A kept switch: its column in the recordings, from 0, its name, and the information (bits) that it brought: to
    ID3's tree, or alone if another method chose it; for a taxel, which follow the switches, also the threshold. A taxel
    may have several, each a switch with a separate name.

    closed_least, closed_most  for each grasp type, in 255ths, the share of a subject's trials in which it is closed, of
                               the subject with the least and the most; "" if unknown
    closed_share  the share of all rows in which it is closed; None if unknown
    """

    column: Count
    name: Name
    gain: Value
    threshold: Threshold | None = None
    closed_least: Bytes = ""
    closed_most: Bytes = ""
    closed_share: Share | None = None

    @property
    def source(self) -> str:
        """The name of the column and of the glove's input: its own, or that of the taxel whose level it is."""
        return self.name if self.threshold is None else self.threshold.taxel.name

    @property
    def closed(self) -> str:
        """When a taxel is closed, in words: "closed above 0.41 N (codes above 83)"; for a switch ""."""
        if self.threshold is None:
            return ""
        taxel, code = self.threshold.taxel, self.threshold.code
        above = "above" if (taxel.value_b > taxel.value_a) == (taxel.code_b > taxel.code_a) else "below"
        return f"closed {above} {self.threshold.value:g} {taxel.unit} (codes above {code})"


class Proof(Struct, frozen=True, forbid_unknown_fields=True):
    """The verified bounds of the integers: no sum beyond `bound`, no score off by more than `error` steps, and
    therefore no other grasp type if the ensemble's margin exceeds `safe_margin` steps: true for `covered` of the
    training rows; `changed` of them get another grasp type than from the ensemble.
    """

    width: Annotated[int, Meta(ge=4, le=16)]
    scale: Annotated[float, Meta(gt=0.0)]
    bound: Count
    error: Amount
    safe_margin: Amount
    covered: Count
    changed: Count


class Recognised(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An accuracy as counts, of trials (the majority of a trial's frames) or of frames.

    protocol  "training": on the training rows; "nested": on folds, with the placement chosen anew in each
    folds     their number; seed: of those that are cut at random
    of        what is new in the tested rows
    low, high the 95 % interval; None if unknown
    """

    protocol: Protocol
    folds: Count
    seed: int
    correct: Count
    total: Positive
    of: Of = "pooled"
    unit: Unit = "frames"
    low: Share | None = None
    high: Share | None = None

    @property
    def rate(self) -> float:
        """Correct rows as a share of all."""
        return self.correct / self.total

    @property
    def title(self) -> str:
        """Its subject: "new subject", "pooled", or "rows trained on"."""
        return "rows trained on" if self.protocol == "training" else self.of

    @property
    def basis(self) -> str:
        """Its interval in percent, its counts, and its folds: "[60.1, 83.4], 123 of 168 trials in 7 nested folds"."""
        ends = "" if self.low is None or self.high is None else f"[{100 * self.low:.1f}, {100 * self.high:.1f}], "
        folds = f" in {self.folds} nested folds" if self.folds else ""
        return f"{ends}{self.correct:,} of {self.total:,} {self.unit}{folds}"

    def __str__(self) -> str:
        """Return "new subject: 73.2 % [60.1, 83.4], 123 of 168 trials in 7 nested folds"."""
        return f"{self.title}: {100 * self.rate:.1f} %{',' if self.low is None else ''} {self.basis}"


class Detected(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How well a build detects whether something is held: the share of trials or frames of grasps detected as such,
    `held`, and the share of those of nothing held detected as such; None if the recordings have no such rows.
    """

    held: Recognised
    none: Recognised | None = None

    def __str__(self) -> str:
        """Return "new subject: 98.1 % of grasps detected as one (...); 97.0 % of nothing held as none (...)"."""
        parts = [(self.held, "of grasps detected as one")]
        parts += [] if self.none is None else [(self.none, "of nothing held as none")]
        shares = (f"{100 * rate.rate:.1f} % {words} ({rate.basis})" for rate, words in parts)
        return f"{self.held.title}: {'; '.join(shares)}"


class Rejection(Struct, frozen=True, forbid_unknown_fields=True):
    """The rejection rules of a build that was trained on grasps only: see scores.py.

    share         the requested share of new grasps that may be refused
    least_scores  for each grasp type the least score of a candidate, in steps
    closed        for each type the least and the most closed switches
    ranges        for each type, the lowest and the highest code of each joint in nearly all training rows
    outside       the number of joints that may lie outside their ranges
    """

    share: Share
    least_scores: tuple[Annotated[int, Meta(ge=-32768, le=32767)], ...]
    closed: tuple[tuple[Count, Count], ...]
    ranges: tuple[tuple[tuple[Code, Code], ...], ...]
    outside: Count


class Faulty(Struct, frozen=True, forbid_unknown_fields=True):
    """A fault: its kind ("lost", "stuck closed", "stuck at codes 0 to 40", "lost with chip 1 of bus 1"), the names of
    the affected inputs, and the number of trials that are still predicted correctly.
    """

    what: Name
    elements: tuple[Name, ...]
    correct: Count


class Faults(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The worst fault of each kind on the training rows, in trials: of `total`, `correct` are right without a fault.

    lost   one input lost and replaced by its mean row; stuck: one input stuck at a value
    dead   all levels of a taxel lost, all on a port, a chip or a stream, if a wiring is known, or all joints
    pair   two inputs lost; None for one input, and for so large a number that pairs were not evaluated
    """

    total: Positive
    correct: Count
    lost: Faulty | None = None
    stuck: Faulty | None = None
    dead: Faulty | None = None
    pair: Faulty | None = None

    @property
    def worst(self) -> tuple[Faulty, ...]:
        """The worst of each kind."""
        return tuple(each for each in (self.lost, self.stuck, self.dead, self.pair) if each is not None)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The worst of each kind in words: "thumb_distal_3 lost: 91.2 % of trials, 3.1 points less"."""
        return tuple(
            f"{list_names(each.elements)} {each.what}: {100 * each.correct / self.total:.1f} % of trials, "
            f"{100 * (self.correct - each.correct) / self.total:.1f} points less"
            for each in self.worst
        )


class Wearing(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How the build is adapted to a person: see compiler/wearer.py.

    strength  the pull towards the build, chosen on people left out
    related   correlations of the joints in the training rows, in thousandths, row by row below the diagonal; left out
              where no joint adds in proportion to its code
    """

    strength: Annotated[float, Meta(gt=0.0)]
    related: tuple[Annotated[int, Meta(ge=-1000, le=1000)], ...] = ()


class Adapted(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The checksum of the build that this one is an adaptation of, and its wearer's recordings, with the number of
    trials of each grasp type; `added` are the types that the other build does not have.
    """

    build: Digest
    source: Origin
    counts: tuple[Count, ...]
    added: tuple[Name, ...] = ()


class Manifest(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """The content of `build.json`.

    stopped_after    rounds after which the tolerance ended the training; left out if it did not
    zero_gain_nodes  decisions of the placement's tree at which no switch alone gained anything; left out if there are
                     none
    scan_sha256      of scan.json; left out if the build was compiled for no harness
    hand_sha256      of hand.json
    fitting          how the fit was chosen; left out if the options leave no choice
    faults           accuracy under faults of inputs, on the training rows
    detection        how well the build detects whether something is held, on the training rows and on folds
    rejection        the rejection rules; None if NONE is one of the grasps, or nothing is refused
    segments         costs of segments learnt from streams; None: there were none to learn from
    wearing          how it is adapted to a person; None: with the usual strength
    adapted          the wearer's trials, of which proof and rates are; None: it is not adapted
    """

    schema: int
    checksum: str
    thenar: str
    tables_sha256: Digest
    ensemble_sha256: Digest
    source: Origin
    options: Recipe
    grasps: Annotated[tuple[Name, ...], Meta(min_length=2)]
    switches: tuple[Switch, ...]
    joints: tuple[Calibration, ...]
    proof: Proof
    rates: tuple[Recognised, ...]
    stopped_after: Count = 0
    zero_gain_nodes: Count = 0
    scan_sha256: Digest | None = None
    fitting: Fitting | None = None
    faults: Faults | None = None
    detection: tuple[Detected, ...] = ()
    rejection: Rejection | None = None
    segments: SegmentModel | None = None
    hand_sha256: Digest | None = None
    wearing: Wearing | None = None
    adapted: Adapted | None = None

    @property
    def proved_rows(self) -> int:
        """The number of rows on which the integers were compared with the model."""
        return self.source.rows if self.adapted is None else self.adapted.source.rows

    @property
    def knows_none(self) -> bool:
        """Whether rows in which nothing is held were trained on."""
        return self.grasps[-1] == NONE

    def grasps_with(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the grasp types with further ones, and NONE last if it is one."""
        place = len(self.grasps) - self.knows_none
        return (*self.grasps[:place], *names, *self.grasps[place:])

    @property
    def classes(self) -> tuple[str, ...]:
        """The possible predictions for a frame: the grasps, and NONE if that is possible and not among them."""
        return self.grasps if self.rejection is None else (*self.grasps, NONE)

    @property
    def codings(self) -> dict[str, Calibration]:
        """The joints and taxels that are read, by name."""
        taxels = (switch.threshold.taxel for switch in self.switches if switch.threshold is not None)
        return {coded.name: coded for coded in (*self.joints, *taxels)}

    @property
    def segmenting(self) -> SegmentModel:
        """The costs of segments: the learnt ones, or the usual ones."""
        has_none = self.grasps[-1] == NONE
        return self.segments or SegmentModel.usual(len(self.grasps) - has_none, has_none, self.proof.scale)

    @property
    def fit(self) -> Fitting:
        """The trainer and its settings, as chosen or given."""
        if self.fitting is not None:
            return self.fitting
        asked = self.options
        given: dict[Name, Value | None] = {"max_bins": asked.max_bins, **asked.settings}
        if asked.trainer not in (AUTO, PAPERS_TRAINER):
            return Fitting(asked.trainer, given)
        boosted = {name: getattr(asked, name) for name in ("rounds", "shrinkage", "tolerance")}
        return Fitting(PAPERS_TRAINER, boosted | given)

    @property
    def headline(self) -> Recognised | None:
        """The accuracy to expect on new grasps; None if none was measured."""
        return next((rate for rate in self.rates if rate.protocol != "training"), None)

    @property
    def detected(self) -> Detected | None:
        """How well it detects on new grasps whether something is held; None if that was not measured."""
        return next((each for each in self.detection if each.held.protocol != "training"), None)
