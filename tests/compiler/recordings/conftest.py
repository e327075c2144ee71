"""Any set of grasps at all, for properties."""

import hypothesis.strategies as st
import numpy as np
import pytest

from thenar.compiler.recordings import RecordingError, check_names
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import Taxonomy, own, published


def _is_name(text: str) -> bool:
    try:
        check_names("name", [text])
    except RecordingError:
        return False
    return True


NAMES = st.one_of(
    st.sampled_from(["grasp", "trial", "a[1]", "it's", '50 % "x"', "a, b", "\\n", "ä*", "{0}"]),
    st.text(max_size=6),
    st.text("'=+-@a1", max_size=4),
)
NAMES = NAMES.map(str.strip).filter(_is_name)
VALUES = st.floats(-1e6, 1e6)


@st.composite
def _joints(draw: st.DrawFn, name: str) -> Joint:
    code_a, code_b = draw(st.lists(st.integers(0, 65535), min_size=2, max_size=2, unique=True))
    try:
        return Joint(name, draw(NAMES), code_a, draw(VALUES), code_b, draw(VALUES))
    except RecordingError:
        return Joint(name, "deg", code_a, 0.0, code_b, 1.0)


@st.composite
def grasp_sets(draw: st.DrawFn) -> GraspSet:
    rows = draw(st.integers(1, 12))
    columns = draw(st.lists(NAMES, min_size=1, max_size=20, unique=True))
    split, end = sorted(draw(st.tuples(*[st.integers(0, len(columns))] * 2)))
    taxels, joints = (tuple(draw(_joints(name)) for name in names) for names in (columns[split:end], columns[end:]))
    types = st.lists(NAMES, min_size=1, max_size=5, unique=True).flatmap(
        lambda names: st.sampled_from([own(names), Taxonomy("the lab's", tuple(names))])
    )
    taxonomies = st.sampled_from(["kamakura14", "cutkosky16", "feix33"]).map(published)
    taxonomy: Taxonomy = draw(st.one_of(taxonomies, types))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    names = draw(st.sampled_from([taxonomy.types, taxonomy.names]))
    times = draw(st.sampled_from([0, 10_000, 2**40])) * np.cumsum(random.integers(0, 9, rows))
    people, things, visits = (draw(st.lists(NAMES, min_size=1, max_size=3)) for _ in range(3))
    return GraspSet(
        switches=random.random((rows, split)) < 0.5,
        switch_names=tuple(columns[:split]),
        codes=random.integers(0, 65536, (rows, len(joints)), dtype=np.uint16),
        joints=joints,
        grasps=random.choice(names, rows),
        taxonomy=taxonomy,
        subjects=random.choice(people, rows),
        objects=random.choice(things, rows),
        trials=random.integers(-(2**53), 2**53, rows),
        simulated=draw(st.one_of(st.just(""), NAMES)),
        sessions=random.choice(draw(st.sampled_from([visits, ["1"]])), rows),
        independent=draw(st.booleans()),
        taxels=random.integers(0, 65536, (rows, len(taxels)), dtype=np.uint16),
        taxel_columns=taxels,
        times_us=times if times.any() else np.empty(0, np.int64),
    )


@pytest.fixture
def small() -> GraspSet:
    """Six rows: rows 0 and 3 hold one frame of two subjects, rows 1 and 2 one frame of two grasp types."""
    switches = [[0, 0, 1, 1], [0, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 1, 1, 1], [0, 0, 0, 0]]
    return GraspSet(
        switches=np.array(switches),
        switch_names=("dead", "thumb", "palm", "palm copy"),
        codes=np.array([[1, 7], [2, 7], [2, 7], [1, 7], [3, 7], [4, 7]]),
        joints=(Joint("index", "deg", 0, -10.0, 100, 40.0), Joint("wrist", "deg", 0, 0.0, 1, 0.5)),
        grasps=np.array(["PoS", "PoH", "Tip", "PoS", "Tip", "PoH"]),
        taxonomy=published("kamakura14"),
        subjects=np.array(["A", "A", "A", "B", "B", "A"]),
        objects=np.array(["mug"] * 6),
        trials=np.arange(6),
    )
