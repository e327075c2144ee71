"""The facts of a build, one text for each, which the command line, the report and the spec print; and its sensors, as
they are bought, counted.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Self

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.system import own_joints
from thenar.runtime.manifest import Manifest
from thenar.runtime.published import NONE
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us, scan_us

from .glove.propose import propose_cyberglove
from .text import INDEPENDENT, counted, listed, microseconds, percent

Topic = Literal[
    "kept", "inputs", "fit", "compared", "accuracy", "caution", "integers", "firmware", "faults", "scan", "wiring"
]


@dataclass(frozen=True, slots=True)
class Fact:
    """A fact of a build: what it is about, a label such as "accuracy, new subject", and the fact in words."""

    topic: Topic
    label: str
    text: str

    def __str__(self) -> str:
        return f"{self.label}: {self.text}"


def facts(
    manifest: Manifest,
    scan: ScanMap | None = None,
    harness: Harness | None = None,
    *,
    tables_bytes: int | None = None,
    firmware: str = "",
) -> tuple[Fact, ...]:
    """Return the facts of a build in the order in which they are printed; the first one sums up what is kept.

    scan, harness  how its switches are read, if that is known
    tables_bytes   the size of `tables.bin`; firmware: what the firmware is laid out for, in words
    """
    tables = "" if tables_bytes is None else f"; tables of {tables_bytes} bytes"
    return (
        Fact("kept", "build", f"{recognises(manifest)}{tables}"),
        *_inputs(manifest),
        *_fit(manifest),
        *_accuracy(manifest),
        *_cautions(manifest, harness),
        _integers(manifest),
        *([Fact("firmware", "firmware", firmware)] if firmware else []),
        *(
            Fact("faults", "at worst, on training rows", sentence)
            for sentence in (() if manifest.faults is None else manifest.faults.sentences)
        ),
        *_scan(manifest, scan, harness),
    )


def recognises(manifest: Manifest) -> str:
    """Return "14 grasp types from 31 of 160 switches and 16 of 16 joints"."""
    types = len(manifest.grasps) - manifest.knows_none
    return f"{types} grasp types from {SensorCount.of_build(manifest)}"


def _inputs(manifest: Manifest) -> Iterator[Fact]:
    levels = [switch for switch in manifest.switches if switch.threshold is not None]
    if manifest.switches:
        label = "switches and levels of pads" if levels else "switches"
        yield Fact("inputs", label, ", ".join(switch.name for switch in manifest.switches))
    for level in levels:
        yield Fact("inputs", level.name, f"{level.closed}, learnt")
    if manifest.options.keep_joints is not None:
        yield Fact("inputs", "joints", ", ".join(joint.name for joint in manifest.joints))


def _fit(manifest: Manifest) -> Iterator[Fact]:
    fit = manifest.fit
    if fit.compared:
        how = f"because {fit.why}: {counted(fit.tried, 'fit')} in {counted(fit.folds, 'fold')} of the training rows"
        yield Fact("fit", "trainer", f"{fit}, {how} ({fit.of})")
    else:
        yield Fact("fit", "trainer", f"{fit}, as given")
    for each in fit.compared:
        yield Fact("compared", "compared", str(each))
    if manifest.stopped_after:
        yield Fact(
            "fit",
            "rounds",
            f"stopped after {manifest.stopped_after} of {fit.settings['rounds']:g} rounds: the last changed the mean "
            f"loss by less than {manifest.options.tolerance:g}",
        )


def _accuracy(manifest: Manifest) -> Iterator[Fact]:
    for rate in sorted(manifest.rates, key=lambda rate: rate.protocol == "training"):
        yield Fact("accuracy", f"accuracy, {rate.title}", str(rate).removeprefix(f"{rate.title}: "))
    if manifest.adapted is not None:
        counts = [count for count in manifest.adapted.counts if count]
        added = f"; added: {listed(manifest.adapted.added)}" if manifest.adapted.added else ""
        to = f"to {counted(sum(counts), 'trial')} of {counted(len(counts), 'type')}{added}"
        yield Fact("accuracy", "adapted", to)
    if manifest.grasps[-1] == NONE:
        yield Fact("accuracy", "nothing held", "a class of the tables")
    elif manifest.rejection is not None:
        levels = [switch.threshold is not None for switch in manifest.switches]
        kinds = {"closed switches": not all(levels), "pressed pads": any(levels), "joints": bool(manifest.joints)}
        yield Fact(
            "accuracy",
            "nothing held",
            f"refused by {listed(['score', *(kind for kind, read in kinds.items() if read)])}, with at most "
            f"{100 * manifest.rejection.share:g} % of the grasps of inner folds; no row shows an empty hand, so how "
            "many of those are refused is not known",
        )
    else:
        yield Fact(
            "caution",
            "nothing held",
            "never predicted: no row shows an empty hand, so every frame is one of the grasp types, also where nothing "
            "is held",
        )
    for each in manifest.detection:
        if each.held.protocol != "training":
            title = each.held.title
            yield Fact("accuracy", f"nothing held, {title}", str(each).removeprefix(f"{title}: "))


def _cautions(manifest: Manifest, harness: Harness | None) -> Iterator[Fact]:
    """Yield what limits the worth of a build."""
    if manifest.zero_gain_nodes:
        yield Fact(
            "caution",
            "placement",
            f"at {counted(manifest.zero_gain_nodes, 'decision')} no switch alone gains anything: the lowest-numbered "
            "one that varies was taken",
        )
    if manifest.source.independent:
        yield Fact("caution", "trials", INDEPENDENT)
    if manifest.source.simulated:
        yield Fact("caution", "simulated", manifest.source.simulated)
    wired = harness is not None and harness.joint_device is not None
    if not wired and (joints := own_joints([joint.name for joint in manifest.joints])):
        yield Fact("wiring", "wiring", joints)


def _integers(manifest: Manifest) -> Fact:
    proof, rows = manifest.proof, manifest.proved_rows
    return Fact(
        "integers",
        "integers",
        f"{proof.scale:.1f} steps a unit, no sum above {proof.bound} of {2 ** (proof.width - 1) - 1}, also with inputs "
        f"missing, and no score off by more than {proof.error:g} steps; {proof.covered} of {rows} rows are safe, by a "
        f"lead of more than {proof.safe_margin:g} steps, and {proof.changed} change class",
    )


def _scan(manifest: Manifest, scan: ScanMap | None, harness: Harness | None) -> Iterator[Fact]:
    """Yield the times on the wires; those of a CyberGlove also without a harness, by the names of the joints."""
    if scan is not None and harness is not None:
        if scan.ports:
            time = scan_us(scan, harness)
            wired = sum(len(chip.pins) for chip in harness.chips)
            muxes = f" ({counted(time.selects, 'write')} to muxes)" if time.selects else ""
            yield Fact(
                "scan",
                "a whole scan",
                f"{counted(len(scan.ports) + time.selects, 'transaction')}{muxes}, {time.us:.1f} µs on the wire, "
                f"{percent(time.share)} of the {time.full_us:.1f} µs for all {wired} wired "
                f"{'sensors' if harness.taxel_names else 'switches'}",
            )
        for stream, read in zip(harness.streams, scan.streams, strict=True):
            switches = counted(len(read.switches), "kept switch", "kept switches")
            levels = f" and {counted(len(read.levels), 'level')} of taxels" if read.levels else ""
            yield Fact("scan", f"stream {stream.port}", f"{switches}{levels}, a row every {stream.period_us} µs")
    names = [joint.name for joint in manifest.joints]
    glove = propose_cyberglove(names) if harness is None else harness.cyberglove
    if names and glove is not None:
        us = microseconds(glove_us(glove, len(names)))
        yield Fact(
            "scan",
            "CyberGlove",
            f"a record of {counted(len(names), 'sensor')} takes {us} µs at best, by the vendor's formula",
        )


@dataclass(frozen=True, slots=True)
class SensorCount:
    """How many sensors of each kind are kept, and how many there are to choose from.

    switches, pads, joints  (kept, all)
    levels                  thresholds of the kept pads: a placement may choose several of one pad
    """

    switches: tuple[int, int] = (0, 0)
    pads: tuple[int, int] = (0, 0)
    joints: tuple[int, int] = (0, 0)
    levels: int = 0

    @classmethod
    def of_build(cls, manifest: Manifest) -> Self:
        """Return the sensors that a build keeps."""
        levels = [switch.source for switch in manifest.switches if switch.threshold is not None]
        source = manifest.source
        return cls(
            switches=(len(manifest.switches) - len(levels), source.switches),
            pads=(len(set(levels)), source.taxels),
            joints=(len(manifest.joints), source.joints),
            levels=len(levels),
        )

    def __str__(self) -> str:
        """Return "3 of 8 switches, 6 of 24 pads (14 levels) and 5 of 5 joints", without kinds that the set lacks."""
        levels = f" ({counted(self.levels, 'level')})" if self.levels else ""
        kinds = (
            (self.switches, "switch", "switches", ""),
            (self.pads, "pad", "pads", levels),
            (self.joints, "joint", "joints", ""),
        )
        return listed([f"{kept} of {counted(total, *names)}{more}" for (kept, total), *names, more in kinds if total])
