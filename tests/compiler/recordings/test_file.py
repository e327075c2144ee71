import re
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings

from thenar.compiler.recordings.arrays import pack, unpack
from thenar.compiler.recordings.graspset import KIND, VERSION, GraspSet
from thenar.runtime.errors import SealError
from thenar.runtime.sealed import seal, unseal


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("grasps")


@given(data=st.data())
@settings(deadline=None)
def test_any_set_survives_its_file(data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet], folder: Path) -> None:
    grasp_set = data.draw(grasp_sets)
    grasp_set.save(folder / "a.grasps")
    loaded = GraspSet.load(folder / "a.grasps")
    assert loaded.fingerprint() == grasp_set.fingerprint()
    assert (loaded.switch_names, loaded.joints, loaded.taxonomy) == (
        grasp_set.switch_names,
        grasp_set.joints,
        grasp_set.taxonomy,
    )
    loaded.save(folder / "b.grasps")
    assert (folder / "a.grasps").read_bytes() == (folder / "b.grasps").read_bytes()


def test_a_set_without_rows_survives_its_file(small: GraspSet, tmp_path: Path) -> None:
    small.rows([]).save(tmp_path / "a.grasps")
    assert len(GraspSet.load(tmp_path / "a.grasps")) == 0


@pytest.fixture
def good(small: GraspSet, tmp_path: Path) -> bytes:
    small.save(tmp_path / "a.grasps")
    return (tmp_path / "a.grasps").read_bytes()


def refusal(data: bytes, folder: Path) -> str:
    path = folder / "set.grasps"
    path.write_bytes(data)
    with pytest.raises(SealError) as refused:
        GraspSet.load(path)
    assert "set.grasps" in str(refused.value)
    return str(refused.value)


def test_a_truncated_file_is_refused_with_the_reason(good: bytes, tmp_path: Path) -> None:
    assert "is truncated" in refusal(good[:-1], tmp_path)
    assert "is truncated" in refusal(good[:20], tmp_path)


def test_an_altered_file_is_refused_with_the_reason(good: bytes, tmp_path: Path) -> None:
    assert "is altered" in refusal(good[:-1] + bytes([good[-1] ^ 1]), tmp_path)
    assert "is altered" in refusal(good + b"x", tmp_path)


def test_a_foreign_file_is_refused_with_the_reason(tmp_path: Path) -> None:
    assert "is not a thenar THNRGRSP file" in refusal(b"PK\x03\x04 something else", tmp_path)
    assert "is not a thenar THNRGRSP file" in refusal(b"", tmp_path)


def test_a_newer_file_is_refused_with_the_reason(good: bytes, tmp_path: Path) -> None:
    payload = unseal(good, KIND, VERSION, "good")[1]
    assert "update thenar" in refusal(seal(KIND, VERSION + 1, payload), tmp_path)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"rows": 7}, r"is uint8 \(6, 1\), not u1 \(7, 1\)"),
        ({"rows": "6"}, "Expected `int`"),
        ({"more": 1}, "unknown field `more`"),
        ({"subjects": ["A"]}, "subjects refers to name 1 of 1"),
        ({"objects": []}, "objects refers to name 0 of 0"),
        ({"objects": [" mug"]}, "begins or ends with a blank"),
        ({"switches": ["a", "b", "c", "c"]}, "occurs twice"),
        ({"joints": []}, r"codes is uint16 \(6, 2\), not <u2 \(6, 0\)"),
        ({"taxonomy": {"name": "kamakura14", "types": ["PoS"]}}, "14 published types"),
        ({"taxonomy": {"name": "own", "types": ["PoS"]}}, "grasps refers to name 11 of 2"),
    ],
)
def test_a_sealed_header_that_contradicts_its_arrays_is_refused(
    good: bytes, tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    header, arrays = unpack(unseal(good, KIND, VERSION, "good")[1])
    changed = msgspec.json.encode(msgspec.json.decode(header) | changes)
    message = refusal(seal(KIND, VERSION, pack(changed, arrays)), tmp_path)
    assert message.startswith("set.grasps is inconsistent: ")
    assert re.search(reason, message)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"codes": np.zeros((6, 2), "<f4")}, "codes is float32"),
        ({"trials": np.zeros(5, "<i8")}, "trials is int64 (5,)"),
        ({"grasps": np.full(6, 15, "<u4")}, "grasps refers to name 15 of 15"),
        ({"more": np.zeros(6)}, "it holds the arrays"),
    ],
)
def test_sealed_arrays_that_contradict_the_header_are_refused(
    good: bytes, tmp_path: Path, changes: dict[str, np.ndarray], reason: str
) -> None:
    header, arrays = unpack(unseal(good, KIND, VERSION, "good")[1])
    assert reason in refusal(seal(KIND, VERSION, pack(header, arrays | changes)), tmp_path)


@given(data=st.data())
@settings(deadline=None)
def test_sealed_mutations_are_read_or_refused_and_never_crash(
    data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet], folder: Path
) -> None:
    path = folder / "mutated.grasps"
    data.draw(grasp_sets).save(path)
    payload = bytearray(unseal(path.read_bytes(), KIND, VERSION, "good")[1])
    for _ in range(data.draw(st.integers(1, 5))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(seal(KIND, VERSION, bytes(payload)))
    try:
        loaded = GraspSet.load(path)
    except SealError:
        return
    assert len(loaded.labels) == len(loaded)


@given(data=st.data())
@settings(deadline=None)
def test_mutated_headers_with_a_right_seal_are_read_or_refused(
    data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet], folder: Path
) -> None:
    path = folder / "header.grasps"
    data.draw(grasp_sets).save(path)
    header, arrays = unpack(unseal(path.read_bytes(), KIND, VERSION, "good")[1])
    mutated = bytearray(header)
    mutated[data.draw(st.integers(0, len(mutated) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(seal(KIND, VERSION, pack(bytes(mutated), arrays)))
    try:
        loaded = GraspSet.load(path)
    except SealError:
        return
    assert len(loaded.labels) == len(loaded)
