"""Where a build comes from, and the commands that make it again. No date, no host."""

import shlex
from dataclasses import dataclass

import msgspec

from thenar.runtime.manifest import Manifest, Options

from ..text import counted
from ..trainers.base import TRAINERS

Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Provenance:
    """Names and values; commands."""

    facts: Pairs
    options: Pairs
    commands: tuple[str, ...]


def provenance(manifest: Manifest, scan: bool) -> Provenance:
    """Return what build.json says of its origin; with a `scan` map, a harness was given."""
    source = manifest.source
    facts = [
        ("Made by", f"thenar {manifest.thenar}"),
        ("Recordings, SHA-256", source.fingerprint),
        ("Rows and taxonomy", f"{counted(source.rows, 'row')}, {source.taxonomy}"),
        ("Simulated by", source.simulated),
        ("build.json, its checksum", manifest.checksum),
        ("tables.bin, SHA-256", manifest.tables_sha256),
        ("ensemble.bin, SHA-256", manifest.ensemble_sha256),
        ("scan.json, SHA-256", manifest.scan_sha256 or ""),
    ]
    glove = " --glove glove.toml" if scan else ""
    return Provenance(
        facts=tuple((name, value) for name, value in facts if value),
        options=_options(manifest.options),
        commands=(
            f"thenar compile SET.grasps -o build/{_flags(manifest.options)}{glove}",
            "thenar verify build/ SET.grasps",
        ),
    )


def _options(options: Options) -> Pairs:
    """Return every option that is set, by the name that `thenar compile` gives it."""
    names = {trainer.name: {setting.name for setting in trainer.settings} for trainer in TRAINERS.values()}
    foreign = set().union(*names.values()) - names.get(options.trainer, set()) | {"settings"}
    fields = [field.name for field in msgspec.structs.fields(options) if field.name not in foreign]
    values = {name: getattr(options, name) for name in fields} | options.settings
    return tuple((f"--{name.replace('_', '-')}", _plain(value)) for name, value in values.items() if value is not None)


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _flags(options: Options) -> str:
    return "".join(f" {name} {shlex.quote(value)}" for name, value in _options(options))
