"""Build folders, their members one by one, and what the commands read of a frontier and of a placement.

A member that was changed comes with a `build.json` that holds its checksum and its own, so that it is read to its end.
"""

import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random

import msgspec
import numpy as np
from example_frontier import example_frontier
from material import GRASPS, SWITCHES, Format, build_files, grasp_set, harness, make_folder
from mutating import Mutate, altered, json_file, npz_file, sealed

from thenar.cli.kept import kept_names
from thenar.compiler.artifact.verify import verify
from thenar.compiler.firmware.generate import firmware_files, sums, write_folder
from thenar.compiler.frontier.cache import Store
from thenar.compiler.frontier.picked import picked
from thenar.compiler.frontier.points import frontier_to_bytes
from thenar.compiler.frontier.words import csv_bytes
from thenar.compiler.glove.files import spec_files
from thenar.compiler.placement.placement import place
from thenar.compiler.report.frontier import marks_table, notes, points_table
from thenar.compiler.scan_file import SCAN_NAME, load_scan
from thenar.drivers.errors import ThenarError
from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME, Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.hand import HAND_NAME, load_hand
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import scan_us

_SEAL = 10  # bytes that say what a file is, and its format
_DIGESTS = {TABLES_NAME: "tables_sha256", ENSEMBLE_NAME: "ensemble_sha256"}
_DIGESTS |= {SCAN_NAME: "scan_sha256", HAND_NAME: "hand_sha256"}


def _canonical(data: bytes, kind: type[msgspec.Struct]) -> bytes:
    """Return a JSON document as thenar itself would write it, where it can be one; else as it is."""
    try:
        return msgspec.json.format(msgspec.json.encode(msgspec.json.decode(data, type=kind)), indent=2) + b"\n"
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return data


def _resealed(data: bytes) -> bytes:
    """Return a `build.json` with its own checksum, where it has a place for one."""
    canonical = _canonical(data, Manifest)
    try:
        document = json.loads(canonical)
        said = json.dumps(document["checksum"], ensure_ascii=False).encode("utf-8", "replace")
    except (ValueError, RecursionError, KeyError, TypeError):
        return data
    empty = canonical.replace(b'"checksum": ' + said, b'"checksum": ""', 1)
    return empty.replace(b'"checksum": ""', b'"checksum": "%s"' % hashlib.sha256(empty).hexdigest().encode(), 1)


def _described(files: dict[str, bytes]) -> dict[str, bytes]:
    """Return the files of a build with a `build.json` that holds their checksums."""
    try:
        document = json.loads(files[MANIFEST_NAME])
        document |= {key: hashlib.sha256(files[name]).hexdigest() for name, key in _DIGESTS.items() if name in files}
        return {**files, MANIFEST_NAME: _resealed(json.dumps(document).encode())}
    except (ValueError, RecursionError, KeyError, TypeError):
        return files


def _use_build(folder: Path) -> None:
    """Do what the commands do with a build: classify, verify, scan, lay out firmware, tell its spec."""
    build = Build.load(folder)
    switches, joints = build.tables.n_switches, build.tables.n_joints
    closed, codes = np.ones(switches, np.bool_), np.full(joints, 65535, np.uint16)
    build.classify(closed, codes)
    load_hand(folder, build.manifest)
    build.recognise(closed, codes, closed, np.zeros(joints, np.bool_))
    for step in (_live, _verified, _spec, _firmware):
        _allowed(step, build, folder)


def _allowed(step: Callable[[Build, Path], object], build: Build, folder: Path) -> None:
    """Take a step that may refuse the build, though others do not."""
    try:
        step(build, folder)
    except (ThenarError, OSError) as refusal:
        if isinstance(refusal.__cause__, MemoryError) or isinstance(refusal.__context__, MemoryError):
            raise


def _live(build: Build, _folder: Path) -> None:
    system = LiveSystem.of(build, harness())
    glove = GloveFrame(0, bytes(range(100, 118)), None)
    frame = SwitchFrame(0, closed=5, lost=2)
    system.recognizer().step(0, 0, frame, glove)
    scan_us(system.scan, harness())
    system.sources()


def _verified(_build: Build, folder: Path) -> None:
    verify(folder, grasp_set())


def _spec(build: Build, folder: Path) -> None:
    spec_files(build.manifest, load_scan(folder, build.manifest), harness())


def _firmware(build: Build, _folder: Path) -> None:
    firmware_files(build.tables, build.manifest, "host")


def _member(name: str, mutate: Mutate, sealed_again: Callable[[bytes], bytes]) -> Format:
    """Return the format of one member of a build, read in the middle of the others."""

    def changed(data: bytes, random: Random) -> bytes:
        return sealed_again(mutate(data, random))

    def read(data: bytes, folder: Path) -> None:
        # Of a build with linear joints, whose tables and ensemble are of other formats, which their first bytes say.
        linear = data[:_SEAL] != build_files()[name][:_SEAL] and name != MANIFEST_NAME
        files = {**build_files(linear), name: data}
        _use_build(make_folder(files if name == MANIFEST_NAME else _described(files), folder / "build"))

    def seeds() -> list[bytes]:
        # A build.json names the checksums of the others, which are those of one build.
        return [build_files()[name], *([] if name == MANIFEST_NAME else [build_files(linear=True)[name]])]

    return Format(name, seeds, changed, read)


def _mixed(data: bytes, random: Random) -> bytes:
    """Change a build folder, packed as msgpack: take members away, exchange or damage them."""
    try:
        files = msgspec.msgpack.decode(data, type=dict[str, bytes])
    except (msgspec.MsgspecError, UnicodeError):
        return _packed_build()
    name = random.choice([*files, MANIFEST_NAME])
    match random.randrange(5):
        case 0:
            files.pop(name, None)
        case 1:
            files[name] = files.get(random.choice([*files, name]), b"")
        case 2:
            files[random.choice(("report.html", "x.part", "notes.txt", ".build.old"))] = files.get(name, b"")
        case 3:
            files = {**files, name: altered(files.get(name, b""), random)}
        case _:
            files = _described({**files, name: altered(files.get(name, b""), random)})
    return msgspec.msgpack.encode(files)


@cache
def _packed_build() -> bytes:
    return msgspec.msgpack.encode(build_files())


def _folder(data: bytes, folder: Path) -> None:
    try:
        files = msgspec.msgpack.decode(data, type=dict[str, bytes])
    except (msgspec.MsgspecError, UnicodeError):
        return
    known = {*build_files(), "report.html", "x.part", "notes.txt", ".build.old"}
    _use_build(make_folder({name: data for name, data in files.items() if name in known}, folder / "build"))


def _frontier() -> list[bytes]:
    """Return the made-up frontier with three of its points, of as many wirings, over the switches here."""
    made, replace = example_frontier(), msgspec.structs.replace
    points = tuple(
        replace(made.point(known), number=number, switches=SWITCHES[: number + 1])
        for number, known in enumerate((1, 9, 10), 1)
    )
    few = {"points": points, "tried": made.tried[:1], "marks": made.marks[:1], "picked": 1}
    return [frontier_to_bytes(replace(made, fingerprint=grasp_set().fingerprint(), **few))]


def _compile_from(data: bytes, folder: Path) -> None:
    """Read a frontier as `compile --from` does until it trains, and as the report shows it."""
    path = folder / "frontier.json"
    path.write_bytes(data)
    for number in (1, 2):
        chosen = picked(path, number, grasp_set())
        _ = chosen.options
        wired = chosen.wired(harness())
        if callable(wired):
            wired(chosen.point.switches)
    csv_bytes(chosen.frontier)
    points_table(chosen.frontier)
    marks_table(chosen.frontier)
    list(notes(chosen.frontier, chosen.point.number))


class _Answer(msgspec.Struct, frozen=True):
    rate: float
    names: tuple[str, ...]


@cache
def _store() -> bytes:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "store.sqlite"
        with Store(path, "scope") as store:
            for number in range(4):
                store.put(b"%d" % number, _Answer(number / 4, GRASPS))
        return path.read_bytes()


def _resume(data: bytes, folder: Path) -> None:
    path = folder / "store.sqlite"
    path.write_bytes(data)
    with Store(path, "scope") as store:
        for number in range(4):
            store.get(b"%d" % number, _Answer)


def _placements() -> list[bytes]:
    placement = place(grasp_set())
    return [msgspec.json.encode(placement.document()), msgspec.json.encode(SWITCHES), "\n".join(SWITCHES).encode()]


def _kept(data: bytes, folder: Path) -> None:
    path = folder / "kept"
    path.write_bytes(data)
    kept_names(path)


_FIRMWARE = {"thenar.c": "int x;\n", "src/thenar.h": "/* */\n"}


def _sums(data: bytes, folder: Path) -> None:
    """Write firmware over a folder whose record is `data`."""
    target = folder / "firmware"
    write_folder(_FIRMWARE, target, overwrite=True) if not target.exists() else None
    (target / "SHA256SUMS").write_bytes(data)
    try:
        write_folder(_FIRMWARE, target, overwrite=True)
    finally:
        (target / "SHA256SUMS").write_text(sums(_FIRMWARE))


FORMATS = (
    _member(MANIFEST_NAME, json_file, _resealed),
    _member(TABLES_NAME, sealed(altered), bytes),
    _member(ENSEMBLE_NAME, sealed(npz_file), bytes),
    _member(SCAN_NAME, json_file, lambda data: _canonical(data, ScanMap)),
    _member(HAND_NAME, json_file, bytes),
    Format("build", lambda: [_packed_build()], _mixed, _folder),
    Format("frontier.json", _frontier, json_file, _compile_from),
    Format("store.sqlite", lambda: [_store()], altered, _resume),
    Format("placement.json", _placements, json_file, _kept),
    Format("SHA256SUMS", lambda: [sums(_FIRMWARE).encode()], altered, _sums),
)
