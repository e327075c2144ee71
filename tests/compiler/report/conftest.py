"""Small builds with everything that a report can tell of, and the made-up frontier."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.frontier.points import Frontier
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.hand import HandShape
from thenar.compiler.model.compare import worst_case
from thenar.compiler.placement.tree import grow_id3
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.tryout import page_data
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.model.integers import tables_to_bytes

from ...sets import grasp_set_of

TYPES = ("cup", "pen", "plate", "rod")
# What a name in a recording may hold, and a page must not run, close or break.
NASTY = (
    "</script><script>document.title='owned'</script>",
    "<img src=x onerror=\"document.title='owned'\">",
    "\"quotes\" & 'more' ${x} {{ 7 * 7 }} %{y}",
    "Griff ✊ 握り \u200d <!-- <script> \\u003c",
)


@pytest.fixture(scope="session")
def frontier(examples: Any, hand: HandShape) -> Frontier:
    """Return the made-up frontier, its switches called as the hand's are."""
    made: Frontier = examples.example_frontier()
    called = dict(zip(examples.SWITCHES, hand.names, strict=True))
    points = tuple(
        msgspec.structs.replace(point, switches=tuple(called[name] for name in point.switches)) for point in made.points
    )
    return msgspec.structs.replace(made, points=points)


def _make_set(switch_names: tuple[str, ...], types: tuple[str, ...], joint_names: tuple[str, ...]) -> GraspSet:
    random, rows = np.random.default_rng(7), 120
    labels = np.arange(rows) % len(types)
    closed = random.random((len(types), len(switch_names))) < 0.4
    centres = random.integers(40, 200, (len(types), len(joint_names)))
    return grasp_set_of(
        types,
        labels,
        switches=closed[labels] ^ (random.random((rows, len(switch_names))) < 0.15),
        switch_names=switch_names,
        codes=np.clip(centres[labels] + random.normal(0, 30, (rows, len(joint_names))), 0, 255),
        joints=tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in joint_names),
        subjects=np.where(np.arange(rows) % 8 < 4, "A", "B"),
    )


def _content(grasp_set: GraspSet, folder: Path, hand: HandShape | None) -> ReportContent:
    """Return what a caller that knows everything would hand over, without a frontier."""
    tree = grow_id3(grasp_set.switches, grasp_set.labels, min_samples=8)
    names = [grasp_set.switch_names[number] for number in tree.inputs]
    # Of a joint that the driver does not know, the glove must be told the name.
    joints = grasp_set.joint_names
    sensors = SENSORS_18 if set(joints) <= set(SENSORS_18) else (*joints, *SENSORS_18[len(joints) :])
    glove = GloveWiring(port="/dev/ttyUSB0", joints=sensors) if joints else None
    harness = propose_harness(names, cyberglove=glove)
    made = compile_build(grasp_set, folder, prune=8, rounds=4, folds=2, harness=harness, hand=hand)
    rows = made.recogniser.read(made.recogniser.samples)
    return ReportContent(
        manifest=made.manifest,
        tables=made.tables,
        facts=made.facts,
        data=page_data(
            made.manifest, tables_to_bytes(made.tables), made.drawing, rows.switches, rows.codes, rows.labels
        ),
        warnings=made.warnings,
        tree=tree,
        confusion=made.confusion,
        hand=hand,
        scan=made.scan,
        harness=harness,
        comparison=made.comparison,
        worst=worst_case(made.recogniser.model, made.tables, made.comparison, made.manifest.grasps, names),
    )


@pytest.fixture(scope="session")
def bare(tmp_path_factory: pytest.TempPathFactory, hand: HandShape) -> ReportContent:
    """Return a build of the glove that thenar draws, without a frontier."""
    grasp_set = _make_set(hand.names, TYPES, ("thumb_mpj", "index_mpj"))
    return _content(grasp_set, tmp_path_factory.mktemp("bare") / "build", hand)


@pytest.fixture(scope="session")
def whole(bare: ReportContent, frontier: Frontier) -> ReportContent:
    """Return the same build with a frontier."""
    return replace(bare, frontier=frontier)


@pytest.fixture(scope="session")
def nasty(tmp_path_factory: pytest.TempPathFactory, examples: Any) -> ReportContent:
    """Return a build whose names of grasps, switches, joints and marks are HTML, scripts and worse."""
    switches = tuple(f"{name} {number}" for number, name in enumerate(NASTY * 3))
    grasp_set = _make_set(switches, NASTY, (f"joint {NASTY[0]}",))
    content = _content(grasp_set, tmp_path_factory.mktemp("nasty") / "build", None)
    made: Frontier = examples.example_frontier(source=f"{NASTY[0]}.grasps")
    point = msgspec.structs.replace(made.points[0], switches=switches[:6])
    marks = (msgspec.structs.replace(made.marks[0], name=NASTY[1]), *made.marks[1:])
    points = (point, *made.points[1:])
    return replace(
        content,
        frontier=msgspec.structs.replace(made, points=points, marks=marks, skipped=(*NASTY, "\u2028")),
    )


@pytest.fixture(scope="session")
def write(tmp_path_factory: pytest.TempPathFactory) -> Callable[[bytes], Path]:
    """Return a function that writes a page to a file of its own."""

    def writing(page: bytes) -> Path:
        path = tmp_path_factory.mktemp("page") / "report.html"
        path.write_bytes(page)
        return path

    return writing
