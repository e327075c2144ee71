"""The recipe of a classifier: every choice of `thenar compile`, with its type, range, default and help.

The options of the commands, the fields of build.json and the candidates of a frontier are made of the fields of
`Recipe`, and so is the table in the reference.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

from msgspec import Meta, Struct, field
from msgspec.structs import replace

AUTO, PAPERS_TRAINER = "auto", "logitboost"  # trainers: automatic choice, and the paper's

Inputs = Literal["both", "switches", "joints"]
TableBits = Literal[16, 8]
By = Literal["trial", "subject", "object", "session"]
Count = Annotated[int, Meta(ge=0, le=2**53)]
Positive = Annotated[int, Meta(ge=1, le=2**53)]
Value = Annotated[float, Meta(ge=-1e300, le=1e300)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Name = Annotated[str, Meta(min_length=1)]
# What a choice changes, and all that comes after it: the elements, the model, the integer tables, or only what is
# measured.
Part = Literal["placement", "limits", "training", "tables", "rates"]
_T = TypeVar("_T")


def _written(default: _T) -> _T:
    """Return a field that has a default and is still written."""
    made: _T = field(default_factory=lambda: default)
    return made


def _choice(part: Part, text: str, **more: Any) -> Meta:
    """Return the description of a choice; `more` is the rest of what the command line says of it."""
    return Meta(description=text, extra={"part": part, **more})


class Recipe(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Every choice of `thenar compile`, with its default; defaults from `tolerance` on are left out of build.json.

    The metadata of a field describes it for the command line. `rounds`, `shrinkage`, `tolerance` and `max_bins` are
    settings that trainers share; `settings` are those of a single trainer, by name. None means: chosen, or the
    trainer's default. If `trainer` is "auto", inner folds choose among the trainers that have all the given settings;
    with `rounds` that is LogitBoost.
    """

    prune: Annotated[
        Count,
        _choice("placement", "Prune ID3's tree: nodes with fewer than S rows are not split.", metavar="S"),
    ] = _written(0)
    rounds: Annotated[Positive | None, _choice("training", "Rounds of boosting.")] = _written(None)
    inputs: Annotated[Inputs, _choice("placement", "Inputs that the build reads.")] = _written("both")
    shrinkage: Annotated[
        Annotated[float, Meta(gt=0.0, le=1.0)] | None, _choice("training", "Share of each round that is kept.")
    ] = _written(None)
    folds: Annotated[Count, _choice("rates", "Folds of the pooled accuracy; 0: measure no accuracy.")] = _written(4)
    seed: Annotated[int, _choice("rates", "Seed of the folds.", least=0)] = _written(1)
    tolerance: Annotated[
        Annotated[float, Meta(ge=0.0)] | None,
        _choice("training", "A round that changes the mean loss by less is the last."),
    ] = None
    table_bits: Annotated[
        TableBits,
        _choice("tables", "Bits per entry of tables with lines: with 8, entries are multiples of 256 steps."),
    ] = 16
    max_bins: Annotated[
        Annotated[int, Meta(ge=2, le=2**53)] | None, _choice("training", "The most bins of a joint.")
    ] = None
    placement: Annotated[
        Name, _choice("placement", "How switches are chosen: see below.", option="method", metavar="NAME")
    ] = "id3"
    keep: Annotated[
        Positive | None,
        _choice("placement", "Number of switches to keep, for methods that take it.", metavar="M"),
    ] = None
    width: Annotated[Annotated[int, Meta(ge=4, le=16)], _choice("tables", "Bits that every sum of scores fits.")] = 16
    trainer: Annotated[Name, _choice("training", "What trains the model.")] = AUTO
    settings: Annotated[dict[Name, Value], _choice("training", "Settings of the trainer, by name.")] = {}
    by: Annotated[
        By | None,
        _choice(
            "rates",
            "What the folds of the first accuracy leave out.",
            default="subject if there are several, otherwise trial",
        ),
    ] = None
    levels: Annotated[
        Annotated[int, Meta(ge=1, le=65535)] | None,
        _choice("placement", "Choose from L levels of each taxel.", metavar="L", default="7"),
    ] = None
    keep_joints: Annotated[
        Positive | None,
        _choice("placement", "Keep the best N joints.", metavar="N", default="all"),
    ] = None
    robust: Annotated[
        bool,
        _choice("training", "Choose elements that minimise the worst single loss; train on rows with lost inputs."),
    ] = False
    have: Annotated[
        tuple[Name, ...], _choice("limits", "Always keep these inputs, by name: a,b.", metavar="NAMES")
    ] = ()
    never: Annotated[
        tuple[Name, ...], _choice("limits", "Never keep these inputs, by name: a,b.", metavar="NAMES")
    ] = ()
    apart_mm: Annotated[
        Annotated[float, Meta(gt=0.0, le=1e6)] | None,
        _choice("limits", "Keep elements at least this far apart.", metavar="MM"),
    ] = None
    at_most_taxels: Annotated[
        Count | None,
        _choice("limits", "Keep at most N taxels, each with any number of levels.", option="at_most", unit="taxels"),
    ] = None
    budget_us: Annotated[
        Annotated[float, Meta(ge=0.0, le=1e12)] | None,
        _choice(
            "limits", "Limit the scan time of the kept elements, and the record time of the kept joints.", metavar="US"
        ),
    ] = None
    sensors: Annotated[
        Positive | None,
        _choice("placement", "Keep the best N sensors: switches, pads and joints in one pool.", metavar="N"),
    ] = None
    price: Annotated[
        Annotated[float, Meta(ge=0.0, le=1e12)] | None,
        _choice("limits", "Keep the best sensors that a price pays for, by a list of prices.", metavar="PRICE"),
    ] = None
    refuse: Annotated[
        Share,
        _choice(
            "training",
            "Share of grasps that may be refused as nothing held, if no row of the set has nothing held; 0: refuse "
            "none.",
            metavar="SHARE",
            most=0.5,
        ),
    ] = 0.01

    def __hash__(self) -> int:
        # Only what a search varies: settings are a dict, which has no hash.
        chosen = self.placement, self.prune, self.keep, self.inputs, self.levels, self.keep_joints, self.trainer
        return hash((*chosen, self.sensors, self.rounds, self.width, self.table_bits))


def changed(recipe: Recipe, changes: Mapping[str, Any]) -> Recipe:
    """Return a recipe with other choices, by name; names that are not fields are settings of the trainer."""
    chosen = {name: value for name, value in changes.items() if name in Recipe.__struct_fields__}
    settings = {name: value for name, value in changes.items() if name not in chosen}
    made = replace(recipe, **chosen)
    return replace(made, settings={**made.settings, **settings}) if settings else made
