"""The sections of a report, but for that on the frontier: the build itself, its accuracy, and its provenance."""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Manifest
from thenar.runtime.model.terms.bit import Bit
from thenar.runtime.recipe import AUTO
from thenar.runtime.scanning.timing import port_us, reading_of

from ..evaluation.rates import RecipeWords, placement_words
from ..facts import recognises
from ..movements.transitions import Transitions
from ..placement.gain import entropy_bits
from ..placement.methods.base import METHODS
from ..placement.tree import Tree
from ..text import NBSP, counted, duration, microseconds, percent, sentence
from ..trainers.base import TRAINERS
from .content import PlainTable, ReportContent

Pairs = tuple[tuple[str, str], ...]
# Wider matrices are illegible; the list of the most frequent mistakes is not.
WIDEST = 40
_MOST = 5
_SHADES = 9
# Of a large tree, these lines are shown.
MOST_LINES = 1000


def headline(content: ReportContent) -> str:
    """Return the build in one sentence, with its accuracy, the interval, and what the choice of a point added to it."""
    manifest = content.manifest
    said = f"This build recognises {recognises(manifest)}"
    rate = manifest.headline
    if rate is None:
        return f"{said}; the accuracy on new grasps was not measured."
    known = f"{rate.title}: {_rate_in_words(rate.rate, rate.low, rate.high)} of {rate.unit}"
    if content.frontier is None or content.point is None:
        return f"{said}; {known}. No tested row took part in a choice, so no luck of choosing is in this rate."
    tried, point = content.frontier.combinations, content.frontier.point(content.point)
    right = _rate_in_words(point.rate.mean, point.rate.low, point.rate.high)
    return (
        f"{said}; {known}, and {right} ({point.rate.what}) when corrected for luck: this point was picked as one of "
        f"the best of {tried:,} combinations by its rate, which is therefore expected to be {100 * point.luck:.1f} "
        "points too high."
    )


def headline_rate(manifest: Manifest) -> str:
    """Return the accuracy of a build in short, with its interval: "86.1 % [42.9, 98.1]"; "" without one."""
    rate = manifest.headline
    if rate is None:
        return ""
    ends = "" if rate.low is None or rate.high is None else f" [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"
    return f"{percent(rate.rate, NBSP)}{ends}"


def frame_time(content: ReportContent) -> Sequence[tuple[str, str]]:
    """Return the time of a frame, in words, as the frontier tells it of the build's point; nothing without a point."""
    if content.frontier is None or content.point is None:
        return []
    frame = content.frontier.point(content.point).frame
    return [("Frame time", f"{duration(frame.us)} {frame.how}, on {content.frontier.machine}")]


def neutral(manifest: Manifest) -> str:
    """Return the first state of what one tries, in words."""
    states = ["all switches open"] * bool(manifest.switches) + ["joints in the middle"] * bool(manifest.joints)
    return sentence(", ".join(states)).removesuffix(".")


def _rate_in_words(rate: float, low: float | None, high: float | None) -> str:
    ends = "" if low is None or high is None else f" (95{NBSP}% interval {100 * low:.1f} to {100 * high:.1f})"
    return f"{percent(rate, NBSP)}{ends}"


def recipe(manifest: Manifest) -> RecipeWords:
    """Return the recipe of a build."""
    method = placement_words(manifest.options) if manifest.switches else "none, joints alone"
    return RecipeWords(method, str(manifest.fit))


def kept_table(content: ReportContent) -> PlainTable:
    """Return the kept switches in order, with the information that each contributed.

    Where a tree chose them, also the share of the grasp types' entropy explained by each and those before it.
    """
    switches, tree, hand = content.manifest.switches, content.tree, content.hand
    entropy = 0.0 if tree is None else entropy_bits(list(tree.nodes[0].counts))
    taxels = any(switch.threshold is not None for switch in switches)
    rows: list[tuple[str, ...]] = []
    for order, (switch, gain) in enumerate(zip(switches, accumulate(each.gain for each in switches), strict=True), 1):
        part = "" if hand is None else hand.part_names[hand.parts[hand.numbers_of([switch.name])[0]]]
        together = () if tree is None else (percent(gain / entropy, NBSP) if entropy else "",)
        rows.append((str(order), switch.name, part, str(switch.column), f"{switch.gain:.3f}", *together))
        if taxels:
            rows[-1] += (switch.closed,)
    columns = (
        "Order",
        "Element" if taxels else "Switch",
        "Part",
        "Column",
        "Bits",
        *(() if tree is None else ("Together",)),
    )
    columns += ("Level",) * taxels
    what = "switches and levels of pads" if taxels else "switches"
    caption = f"Kept {what}, in the order in which they were chosen: placement: {recipe(content.manifest).method}"
    return PlainTable(caption, columns, tuple(rows), words=(1, 2, *((len(columns) - 1,) * taxels)), head=1)


def placement_sentences(content: ReportContent) -> tuple[str, str]:
    """Return the placement method, and how to read the switches' table."""
    method = content.manifest.options.placement
    how = METHODS[method].help if method in METHODS else "Chosen by another version of thenar"
    if content.tree is not None:
        bits = "contributed to the tree; together is the share of their entropy explained by it and those before it"
    else:
        bits = "provides alone, without the others"
    return (
        f"{how} (--method {method}).",
        f"Columns count from 0 in the recordings. Bits are the information on the grasp type that each {bits}.",
    )


def fit_table(manifest: Manifest) -> PlainTable | None:
    """Return the best fit of each trainer in the inner folds, and the chosen one; None where nothing was chosen."""
    rows = []
    for each in manifest.fit.compared:
        shares = (f"{100 * share:.1f}" for share in (each.rate, each.error, each.behind, each.behind_error))
        rows.append((each.name, *shares, f"{each.loss:.3f}", f"{each.rows:.0f}"))
    columns = (
        "Fit",
        "Recognised, %",
        "Standard error",
        "Behind the best",
        "Standard error",
        "Log-loss",
        "Rows of tables",
    )
    caption = f"Fits in the inner folds, trials (placement: {recipe(manifest).method})"
    return PlainTable(caption, columns, tuple(rows)) if rows else None


def tree_text(tree: Tree | None, manifest: Manifest) -> tuple[str, str]:
    """Return the tree that chose a build's switches, a line for each node, or "" without one; and a sentence on it."""
    if not manifest.switches:
        return "", "No tree: no switches were chosen."
    if tree is None:
        return "", f"No tree: the switches were chosen by {manifest.options.placement}."
    # The kept elements are the inputs of the tree, in the order of its nodes.
    kept = dict(zip(tree.inputs, (switch.name for switch in manifest.switches), strict=True))
    names = [kept.get(number, f"switch {number}") for number in range(tree.n_inputs)]
    *lines, summary = tree.text(names, [manifest.grasps[int(label)] for label in tree.classes]).split("\n")
    said = sentence(f"{summary}; 0 leads to where the switch is open, 1 to where it is closed")
    if len(lines) > MOST_LINES:
        said += f" The first {MOST_LINES:,} nodes are shown; thenar place --tree prints all of them."
    return "\n".join(lines[:MOST_LINES]), said


def worst_sentence(content: ReportContent) -> str:
    """Return the guarantee of the worst-case analysis; "" without one."""
    rows, worst = content.manifest.source.rows, content.worst
    if worst is None:
        return ""
    share = f" ({percent(worst.covered / rows, NBSP)})" if rows else ""
    return (
        f"In the worst case over all possible frames, recorded or not, {worst.leader} loses {worst.loss:.3f} steps "
        f"of its lead over {worst.competitor}. By this exact analysis, ties included, a lead of more than "
        f"{worst.safe_margin:.3f} steps is safe: {worst.covered:,} of {rows:,}{share} training rows have it."
    )


def guarantee_table(content: ReportContent) -> PlainTable | None:
    """Return the differences and their bounds; None without a worst-case analysis."""
    found, worst = content.comparison, content.worst
    if found is None or worst is None:
        return None
    most, integer_bound = 2 ** (content.manifest.proof.width - 1) - 1, found.integer_bound + found.slack
    float_difference, float_bound = f"{found.collapse_difference:.3g}", f"{found.collapse_bound:.3g}"
    rows = (
        ("Ensemble vs. float tables, units of score", float_difference, float_bound),
        ("Float tables vs. integers, steps", f"{found.integer_difference:.3f}", f"{integer_bound:.3f}"),
        ("Largest loss of a lead, steps, all frames", f"{worst.loss:.3f}", f"{worst.bound:.3f}"),
        ("Largest magnitude of a sum, steps", f"{worst.reach:,}", f"{most:,}"),
    )
    caption = f"Differences and their bounds ({recipe(content.manifest)})"
    return PlainTable(caption, ("What", "Found", "Bound"), rows)


def fault_table(content: ReportContent) -> PlainTable | None:
    """Return the accuracy with each input lost or stuck at its worst value, the worst first."""
    found = content.faults
    if found is None:
        return None
    names = (*content.switch_names, *(joint.name for joint in content.manifest.joints))
    rows = []
    for one in sorted(range(len(found.lost)), key=found.lost.__getitem__):
        left, value = min(zip(found.stuck[one], found.values[one], strict=True), key=lambda pair: pair[0])
        rates = (f"{100 * count / found.total:.1f}" for count in (found.lost[one], left))
        less = f"{100 * (found.correct - found.lost[one]) / found.total:.1f}"
        lost, stuck = rates
        rows.append((names[one], lost, less, stuck, value))
    caption = (
        f"Accuracy with one input lost or stuck, % of {counted(found.total, 'trial')} trained on "
        f"({recipe(content.manifest)})"
    )
    return PlainTable(caption, ("Input", "Lost", "Points less", "Stuck", "At"), tuple(rows), words=(0, 4))


def term_bars(content: ReportContent) -> tuple[tuple[str, float], ...]:
    """Return each term of the model, the weightiest first: what it reads and by how much it can move a score, as a text
    and as a share of the largest.
    """
    joints = [joint.name for joint in content.manifest.joints]
    rows = []
    for term in content.tables.core_terms:
        names = content.switch_names if isinstance(term, Bit) else joints
        span = int(np.subtract(*term.ends, dtype=np.int64).max())
        rows.append((span, f"{' and '.join(names[one] for one in term.inputs)}, {term.name}"))
    rows = sorted((row for row in rows if row[0]), key=lambda row: (-row[0], row[1]))
    return tuple((f"{text} {span / content.tables.scale:.2f}", span / rows[0][0]) for span, text in rows)


def scan_table(content: ReportContent) -> PlainTable | None:
    """Return the transactions that read the kept switches, in order; None without a scan map or transactions."""
    scan, harness, names = content.scan, content.harness, content.switch_names
    if scan is None or harness is None or not scan.ports:
        return None
    rows = []
    for order, port in enumerate(scan.ports, 1):
        bus = harness.wires[port.bus]
        chip = bus.chips[port.chip]
        where = (f"{bus.device} at {bus.clock_hz / 1000:g} kHz", chip.place, port.reading)
        switches = ", ".join(names[switch] for switch in port.elements)
        us = microseconds(port_us(reading_of(port, harness), bus.clock_hz))
        rows.append((str(order), *where, switches, us))
    caption = "Transactions, in the order in which they are made; times on the wire, by arithmetic"
    columns = ("Order", "Bus", "Chip", "Reads", "Switches", "µs")
    return PlainTable(caption, columns, tuple(rows), words=(1, 2, 3, 4))


def provenance(manifest: Manifest) -> Pairs:
    """Return the origin of the build from build.json, without date or host."""
    source = manifest.source
    pairs = (
        ("Made by", f"thenar {manifest.thenar}"),
        ("Recordings, SHA-256", source.fingerprint),
        ("Rows and taxonomy", f"{counted(source.rows, 'row')}, {source.taxonomy}"),
        ("Simulated by", source.simulated),
        ("Checksum of build.json", manifest.checksum),
        ("tables.bin, SHA-256", manifest.tables_sha256),
        ("ensemble.bin, SHA-256", manifest.ensemble_sha256),
        ("scan.json, SHA-256", manifest.scan_sha256 or ""),
        ("hand.json, SHA-256", manifest.hand_sha256 or ""),
    )
    return tuple((name, value) for name, value in pairs if value)


def options_set(manifest: Manifest) -> Pairs:
    """Return every option that is set, by its name for `thenar compile`, with options of the chosen trainer only."""
    options = manifest.options
    names = {trainer.name: {setting.name for setting in trainer.settings} for trainer in TRAINERS.values()}
    every = set().union(*names.values())
    foreign = every - names.get(options.trainer, every if options.trainer == AUTO else set()) | {"settings"}
    fields = [field.name for field in msgspec.structs.fields(options) if field.name not in foreign]
    values = {name: getattr(options, name) for name in fields} | options.settings
    called = {name: "method" if name == "placement" else name.replace("_", "-") for name in values}
    called["at_most_taxels"] = "at-most"
    return tuple(
        (f"--{called[name]}", _plain(value) + " taxels" * (name == "at_most_taxels"))
        for name, value in values.items()
        if value is not None and value is not False and value != ()
    )


def commands(content: ReportContent) -> tuple[str, str]:
    """Return the commands that reproduce the build and verify it."""
    pairs = options_set(content.manifest)
    words = (value if name == "--at-most" else value and shlex.quote(value) for name, value in pairs)
    flags = "".join(f" {name} {value}".rstrip() for (name, _), value in zip(pairs, words, strict=True))
    glove = "" if content.scan is None else " --glove glove.toml"
    return f"thenar compile SET.grasps -o build/{flags}{glove}", "thenar verify build/ SET.grasps"


def _plain(value: object) -> str:
    if value is True:
        return ""
    if isinstance(value, tuple):
        return ",".join(value)
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def transition_table(found: Transitions) -> PlainTable:
    """Return the changes from type to type, the most frequent first."""
    counts, shares = found.counts, found.probabilities
    changes = sorted(np.argwhere(counts).tolist(), key=lambda each: (-counts[tuple(each)], each))
    rows = tuple(
        (found.types[a], found.types[b], str(counts[a, b]), percent(float(shares[a, b]), NBSP)) for a, b in changes
    )
    return PlainTable("Changes of grasp type", ("From", "To", "Count", "Of its changes"), rows, words=(0, 1))


@dataclass(frozen=True, slots=True)
class ConfusionView:
    """Counts as a table: their source, the grasp types, a row for each of these, and the most frequent mistakes.

    rows  grasp type; its counts, each with its shading class ("hit1" to "miss9", "" for none); its number of rows; the
          share of them predicted correctly. Empty where the table would be too wide.
    """

    title: str
    grasps: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[str, str], ...], str, str], ...]
    mistaken: tuple[str, ...]


def confusion_view(title: str, grasps: Sequence[str], counts: NDArray[np.intp]) -> ConfusionView:
    """Return the table of `counts` (K, K), row: true, column: predicted; a shade is a share of its row."""
    rows = []
    for number, (grasp, line) in enumerate(zip(grasps, counts.tolist(), strict=True)):
        total = sum(line)
        cells = tuple(_shaded(count, total, column == number) for column, count in enumerate(line))
        rows.append((grasp, cells, f"{total:,}", percent(line[number] / total, NBSP) if total else ""))
    shown = tuple(rows) if len(grasps) <= WIDEST else ()
    return ConfusionView(title, tuple(grasps), shown, tuple(_mistaken(grasps, counts)))


def confusion_of(content: ReportContent) -> ConfusionView | None:
    """Return the build's matrix; None if it was compiled without folds."""
    if content.confusion is None:
        return None
    rate = content.manifest.headline
    folds = "" if rate is None else f", {rate.title}, {counted(rate.folds, 'nested fold')}"
    title = f"This build's recipe ({recipe(content.manifest)}){folds}"
    return confusion_view(title, content.manifest.classes[: len(content.confusion)], content.confusion)


def _shaded(count: int, total: int, hit: bool) -> tuple[str, str]:
    if not count:
        return "·", ""
    return f"{count:,}", f"{'hit' if hit else 'miss'}{1 + (_SHADES - 1) * count // total}"


def _mistaken(grasps: Sequence[str], counts: NDArray[np.intp]) -> Iterator[str]:
    """Yield sentences on the most frequent mistakes; ties are in the order of the table."""
    wrong = counts.copy()
    np.fill_diagonal(wrong, 0)
    for place in np.argsort(-wrong, axis=None, kind="stable")[:_MOST].tolist():
        true, found = divmod(place, len(grasps))
        if wrong[true, found]:
            total = int(counts[true].sum())
            yield f"{grasps[true]} mistaken for {grasps[found]}: {wrong[true, found]:,} of {total:,} rows"
