import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given

from thenar.compiler.arrays import pack, unpack
from thenar.compiler.recordings.graspset import KIND, VERSION, GraspSet
from thenar.runtime.errors import FormatError
from thenar.runtime.sealed import seal, unseal

from .conftest import grasp_sets


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("grasps")


@given(grasp_set=grasp_sets())
def test_any_set_survives_its_file(grasp_set: GraspSet, folder: Path) -> None:
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
    with pytest.raises(FormatError) as refused:
        GraspSet.load(path)
    assert "set.grasps" in str(refused.value)
    return str(refused.value)


def test_cut_altered_foreign_or_newer_files_are_refused_with_reason(good: bytes, tmp_path: Path) -> None:
    payload = unseal(good, KIND, VERSION, "good")[1]
    for data, reason in (
        (good[:-1], "is truncated"),
        (good[:20], "is truncated"),
        (good[:-1] + bytes([good[-1] ^ 1]), "is altered"),
        (good + b"x", "is altered"),
        (b"PK\x03\x04 something else", "is not a thenar THNRGRSP file"),
        (b"", "is not a thenar THNRGRSP file"),
        (seal(KIND, VERSION + 1, payload), "update thenar"),
    ):
        assert reason in refusal(data, tmp_path)


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
