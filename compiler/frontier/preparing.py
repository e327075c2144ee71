"""From files to a frontier and back: what a study needs is loaded, what it finds is written."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness

from ..placement.methods.base import METHODS, usual
from ..placement.ports import ports_of_whole_glove
from ..publication import check_folder, entries, publish_folder
from ..recordings.graspset import GraspSet
from .calibrating import equipment_for
from .drawing.pictures import PICTURES, pictures
from .drawing.table import csv_bytes
from .foreseeing import foreseen
from .material import Cuts, Material
from .own_build import own_build
from .points import Frontier, FrontierError, frontier_to_bytes
from .settings import Search
from .storing.asking import Desk
from .storing.resuming import Effort
from .storing.store import Store
from .streaming.movements import holds_movements
from .streaming.stream import Stream
from .streaming.streams import stream_of
from .study import Study, Wanted, find_frontier
from .timing.wirings import wirings

FRONTIER_NAME, TABLE_NAME, STORE_NAME = "frontier.json", "frontier.csv", "store.jsonl"
_DOCUMENTS = frozenset({FRONTIER_NAME, TABLE_NAME, *(f"{name}.svg" for name in PICTURES)})
# Answers of another version are not mixed with these: raise it where a method changes what it answers.
_VERSION = 1


@dataclass(frozen=True, slots=True)
class Request:
    """What `thenar frontier` is asked for; None of methods or rivals: the usual ones."""

    recordings: Path
    output: Path
    glove: Path | None
    target: str
    wanted: Wanted
    build: Path | None
    stream: Path | None
    methods: tuple[str, ...] | None
    rivals: tuple[str, ...] | None
    rounds: int
    repeats: int
    finalists: int
    max_bins: int | None
    seed: int
    jobs: int
    cluster: str | None


def run_frontier(request: Request, report: Callable[[int, int], None]) -> Frontier:
    """Compute the frontier, write it into the folder asked for, and return it. Raises ThenarError."""
    grasp_set = GraspSet.load(request.recordings)
    harness = None if request.glove is None else load_harness(request.glove)
    search, lacking = _search(request)
    request.output.parent.mkdir(parents=True, exist_ok=True)
    check_folder(request.output, _kept, FrontierError)
    request.output.mkdir(exist_ok=True)
    with Store(request.output / STORE_NAME, _scope(grasp_set)) as store:
        effort = Effort(report)
        desk = Desk(store, effort, request.jobs, request.cluster)
        study = _study(request, grasp_set, harness, search, desk)
        effort.foresee(foreseen(search, study.material, study.cuts, study.equipment.model.part is not None))
        found = find_frontier(replace(study, skipped=lacking), desk)
        # The store goes into the new folder as the same file, and nobody else may have it meanwhile.
        publish_folder(_documents(found), request.output, _kept, FrontierError)
    return found


def _scope(grasp_set: GraspSet) -> str:
    return f"frontier {_VERSION} of thenar {version('thenar')} {grasp_set.fingerprint()}"


def _search(request: Request) -> tuple[Search, tuple[str, ...]]:
    """Return what is tried, and a sentence on each rival that is not installed."""
    rivals = usual(ours=False) if request.rivals is None else request.rivals
    missing = [name for name in rivals if name in METHODS and not METHODS[name].installed]
    there = tuple(name for name in rivals if name not in missing)
    search = Search(
        methods=request.methods or usual(ours=True, wired=request.glove is not None),
        rivals=there,
        rounds=request.rounds,
        repeats=request.repeats,
        finalists=request.finalists,
        max_bins=request.max_bins,
        seed=request.seed,
    )
    return search, tuple(
        f"{name} was left out: it needs {METHODS[name].install}, which is not installed" for name in missing
    )


def _study(request: Request, grasp_set: GraspSet, harness: Harness | None, search: Search, desk: Desk) -> Study:
    if holds_movements(grasp_set):
        raise FrontierError(
            f"{request.recordings.name} holds whole movements, every frame a row: rows of one would be trained on and "
            "tested; give a set of single trials, and this one with --stream"
        )
    material = Material.of(grasp_set, ports_of_whole_glove(harness, grasp_set.switch_names))
    cuts = Cuts.of(material, search)
    equipment = equipment_for(request.target, wirings(harness, request.target), desk)
    return Study(
        source=request.recordings.name,
        material=material,
        cuts=cuts,
        search=search,
        equipment=equipment,
        stream=_stream(request, grasp_set, material, cuts),
        wanted=request.wanted,
        own=None if request.build is None else own_build(request.build, grasp_set, equipment),
    )


def _stream(request: Request, grasp_set: GraspSet, material: Material, cuts: Cuts) -> Stream:
    """Return the test rows of the first fold as a stream, or the recordings named for it."""
    if request.stream is None:
        return stream_of(grasp_set, material.labels, cuts.screening[0].test, seed=request.seed)
    played = GraspSet.load(request.stream)
    if played.fingerprint() == grasp_set.fingerprint():
        raise FrontierError(
            f"{request.stream.name} is what is trained on: name other recordings with --stream, or leave it out, and "
            "rows that are set aside are used"
        )
    if (played.switch_names, played.joints) != (grasp_set.switch_names, grasp_set.joints):
        raise FrontierError(f"{request.stream.name} has other switches or joints than {request.recordings.name}")
    number = {grasp: label for label, grasp in enumerate(material.grasps)}
    strange = sorted({str(grasp) for grasp in played.grasps} - set(number))
    if strange:
        raise FrontierError(f"{request.stream.name} holds {strange[0]!r}, which {request.recordings.name} does not")
    labels = np.array([number[str(grasp)] for grasp in played.grasps], dtype=np.intp)
    return stream_of(played, labels, seed=request.seed)


def _documents(found: Frontier) -> dict[str, bytes]:
    drawn = {f"{name}.svg": data for name, data in pictures(found, "svg").items()}
    return {FRONTIER_NAME: frontier_to_bytes(found), TABLE_NAME: csv_bytes(found), **drawn}


def _kept(folder: Path) -> list[str]:
    """Return the entries of a frontier's folder that are kept: the store and the user's files."""
    there = entries(folder)
    if there and not {FRONTIER_NAME, STORE_NAME} & set(there):
        raise FrontierError(f"{folder} is not empty and holds no frontier: name another folder")
    return [path for path in there if path not in _DOCUMENTS]
