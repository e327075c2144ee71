"""`build.json`: the bytes of a manifest, and the checks of one that is read.

Its bytes are canonical: fields in the order of the manifest's structs, indented by two, one newline at the end; no
date, no path, no host. `checksum` is the SHA-256 of those bytes with that field empty.
"""

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from .errors import BuildError
from .json_document import decode_document, encode_document
from .manifest import SCHEMA, Calibration, Manifest
from .names import LONGEST_NAME, fault, shortened
from .published import NONE
from .sealed import sha256

MAX_BYTES = 16 << 20


def manifest_to_bytes(manifest: Manifest) -> bytes:
    """Return the content of `build.json`, its checksum filled in."""
    return encode_document(replace(manifest, checksum=_checksum(manifest)))


def manifest_from_bytes(data: bytes, what: str = "build.json") -> Manifest:
    """Return the manifest in a `build.json`, whose name in messages is `what`.

    Raises BuildError if it is oversized, no such document, of another schema, or altered.
    """
    manifest = decode_document(data, Manifest, what, "a build", MAX_BYTES, SCHEMA)
    if data != encode_document(manifest) or manifest.checksum != _checksum(manifest):
        raise BuildError(f"{what} is altered: its checksum does not match; compile the build again")
    for wrong in _contradictions(manifest):
        raise BuildError(f"{what} {wrong}: compile the build again")
    return manifest


def _checksum(manifest: Manifest) -> str:
    return sha256(encode_document(replace(manifest, checksum=""))).hex()


def _contradictions(manifest: Manifest) -> Iterator[str]:
    """Yield the contradictions within the manifest."""
    taxels = [switch.threshold.taxel for switch in manifest.switches if switch.threshold is not None]
    yield from _wrong_inputs(manifest, taxels)
    yield from _wrong_faults(manifest)
    yield from _wrong_texts(manifest)
    yield from _wrong_columns(manifest)
    yield from _wrong_rejection(manifest)
    for joint in (*manifest.joints, *taxels):
        if joint.code_a == joint.code_b or joint.value_a == joint.value_b:
            yield "gives a joint two points that make no line"
    proof = manifest.proof
    if proof.width != manifest.options.width or max(proof.covered, proof.changed) > manifest.proved_rows:
        yield "proves something of other tables than it describes"
    yield from _wrong_counts(manifest)
    segments, has_none = manifest.segments, manifest.grasps[-1] == NONE
    if segments and (segments.n_lanes, segments.refusal is None) != (len(manifest.grasps), has_none):
        yield "has costs of segments of other classes than its tables"
    wearing, adapted, joints = manifest.wearing, manifest.adapted, len(manifest.joints)
    if wearing is not None and len(wearing.related) not in (0, joints * (joints - 1) // 2):
        yield "relates other joints than it has"
    if adapted and (len(adapted.counts) != len(manifest.grasps) or not {*adapted.added} <= {*manifest.grasps}):
        yield "was adapted to trials of other grasp types than it has"


def _wrong_inputs(manifest: Manifest, taxels: Iterable[Calibration]) -> Iterator[str]:
    for kind, names in (
        ("grasp types", manifest.grasps),
        ("switches", tuple(switch.name for switch in manifest.switches)),
        ("joints", tuple(joint.name for joint in manifest.joints)),
    ):
        if len(set(names)) < len(names):
            yield f"names two {kind} alike"
        yield from _wrong_names(kind, names)
    yield from _wrong_names("units", (each.unit for each in (*manifest.joints, *taxels)))
    yield from _wrong_names("taxels", (taxel.name for taxel in taxels))


def _wrong_faults(manifest: Manifest) -> Iterator[str]:
    known = {*(switch.name for switch in manifest.switches), *(joint.name for joint in manifest.joints)}
    worst = () if manifest.faults is None else manifest.faults.worst
    yield from _wrong_names("texts", (each.what for each in worst), 2 * LONGEST_NAME)
    if not all(known.issuperset(each.elements) for each in worst):
        yield "counts faults of an input that it does not have"


def _wrong_texts(manifest: Manifest) -> Iterator[str]:
    source, options, fit = manifest.source, manifest.options, manifest.fit
    texts = [manifest.thenar, source.taxonomy, options.placement, options.trainer, *options.settings]
    texts += [*options.have, *options.never]
    texts += [fit.trainer, *fit.settings]
    texts += [text for each in fit.compared for text in (each.trainer, *each.settings)]
    yield from _wrong_names("texts", texts)
    yield from _wrong_names("texts", filter(None, [source.simulated]), 2 * LONGEST_NAME)


def _wrong_counts(manifest: Manifest) -> Iterator[str]:
    fit, faults = manifest.fit, manifest.faults
    shares = [rate for each in manifest.detection for rate in (each.held, each.none) if rate is not None]
    counted = [(rate.correct, rate.total) for rate in (*manifest.rates, *shares)]
    counted += [(each.correct, each.total) for each in fit.compared]
    if faults is not None:
        counted += [(count, faults.total) for count in (faults.correct, *(each.correct for each in faults.worst))]
    if any(correct > total for correct, total in counted) or manifest.stopped_after > fit.number("rounds"):
        yield "counts more than there is"


def _wrong_columns(manifest: Manifest) -> Iterator[str]:
    shares = {len(text) for switch in manifest.switches for text in (switch.closed_least, switch.closed_most)}
    if len(shares) > 1 or not shares <= {0, 2 * len(manifest.grasps)}:
        yield "says of other grasp types how often switches are closed"
    levels = [(switch.column, switch.threshold and switch.threshold.code) for switch in manifest.switches]
    joints = [joint.column for joint in manifest.joints]
    for columns in (levels, joints):
        if len(set(columns)) < len(columns):
            yield "takes two inputs from one column"
    source = manifest.source
    if max((column for column, _ in levels), default=-1) >= source.switches + source.taxels:
        yield "keeps a switch that the recordings do not have"
    if max(joints, default=-1) >= source.joints:
        yield "keeps a joint that the recordings do not have"


def _wrong_rejection(manifest: Manifest) -> Iterator[str]:
    held = manifest.rejection
    if held is None:
        return
    lists: list[tuple[object, ...]] = [held.least_scores, held.closed, held.ranges]
    if {*map(len, lists)} != {len(manifest.grasps)} or {*map(len, held.ranges)} != {len(manifest.joints)}:
        yield "refuses frames of other grasp types or joints than it has"
    if NONE in manifest.grasps:
        yield "refuses frames, and has a class for them"


def _wrong_names(kind: str, names: Iterable[str], longest: int = LONGEST_NAME) -> Iterator[str]:
    for name in names:
        if reason := fault(name, longest):
            yield f"has {shortened(repr(name))}, one of its {kind}, which {reason}"
