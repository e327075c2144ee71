"""The build in one sentence, and in the few numbers that one asks for first."""

from dataclasses import dataclass

from thenar.runtime.manifest import Recognised

from ..text import NBSP, counted, percent, sentence
from .content import ReportContent


@dataclass(frozen=True, slots=True)
class Fact:
    """A number that one asks for: what it is, itself in large, and what it is out of."""

    name: str
    value: str
    of: str


@dataclass(frozen=True, slots=True)
class Overview:
    """What the build is, facts on it, what its firmware is for, and what to beware of."""

    sentence: str
    facts: tuple[Fact, ...]
    firmware: str
    warnings: tuple[str, ...]


def overview(content: ReportContent) -> Overview:
    """Return what the first screen of the report says."""
    firmware = sentence(content.firmware) if content.firmware else ""
    return Overview(_sentence(content), tuple(_facts(content)), firmware, tuple(_warnings(content)))


def honest_rate(content: ReportContent) -> Recognised | None:
    """Return the rate to expect of new grasps, if it was measured."""
    return next((rate for rate in content.manifest.rates if rate.protocol == "honest"), None)


def _sentence(content: ReportContent) -> str:
    manifest = content.manifest
    inputs = []
    if manifest.switches:
        inputs.append(f"{len(manifest.switches)} of {counted(manifest.source.switches, 'switch', 'switches')}")
    if manifest.joints:
        inputs.append(counted(len(manifest.joints), "joint"))
    said = f"This build recognises {len(manifest.grasps)} grasp types from {' and '.join(inputs)}"
    rate = honest_rate(content)
    if rate is None:
        return f"{said}; what to expect of new grasps was not measured."
    return f"{said}: {percent(rate.rate, NBSP)} of grasps that it was not trained on."


def _facts(content: ReportContent) -> list[Fact]:
    manifest, proof = content.manifest, content.manifest.proof
    rates = [
        Fact(
            "Recognised, honest folds" if rate.protocol == "honest" else "Recognised, rows trained on",
            percent(rate.rate, NBSP),
            f"{rate.correct:,} of {rate.total:,} rows" + (f", {rate.folds} folds" if rate.folds else ""),
        )
        for rate in sorted(manifest.rates, key=lambda rate: rate.protocol)
    ]
    return [
        *rates,
        Fact("Switches kept", f"{len(manifest.switches)}", f"of {manifest.source.switches}"),
        Fact("Joints", f"{len(manifest.joints)}", "of the CyberGlove" if manifest.joints else "none are used"),
        Fact("Rounds", f"{content.rounds}", _rounds(content)),
        Fact("Tables", f"{content.tables_bytes:,}", "bytes of tables.bin"),
        Fact("Changed by rounding", f"{proof.changed}", f"of {counted(manifest.source.rows, 'row')}"),
    ]


def _rounds(content: ReportContent) -> str:
    wanted = content.manifest.options.rounds
    return f"of {wanted}: the tolerance ended the training" if content.manifest.stopped_after else "of boosting"


def _warnings(content: ReportContent) -> list[str]:
    manifest, warnings = content.manifest, []
    if content.only_answer is not None:
        warnings.append(
            f"Every row is recognised as {content.only_answer}: no input tells grasp types apart by itself, and stumps "
            "look at one at a time."
        )
    if manifest.zero_gain_nodes:
        nodes = counted(manifest.zero_gain_nodes, "decision")
        warnings.append(f"At {nodes} of the placement no switch gains anything alone: the lowest-numbered was taken.")
    if manifest.source.simulated:
        warnings.append(f"The recordings are simulated ({manifest.source.simulated}).")
    return warnings
