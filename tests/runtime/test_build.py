from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime import Build
from thenar.runtime.build import MANIFEST_NAME, TABLES_NAME
from thenar.runtime.errors import BuildError, ThenarError
from thenar.runtime.manifest_file import manifest_to_bytes
from thenar.runtime.model.integers import MAX_BYTES, IntegerTables, tables_to_bytes

from ..tables import describe
from .conftest import make_tables

MEMBERS = [MANIFEST_NAME, TABLES_NAME]


def test_a_loaded_build_scores_and_classifies_as_the_one_written(build: Build, folder: Path) -> None:
    random, loaded = np.random.default_rng(1), Build.load(folder)
    for _ in range(50):
        bits, codes = random.random(9) < 0.5, random.integers(0, 256, 3)
        scores = loaded.scores(bits, codes)
        assert np.array_equal(scores, build.scores(bits, codes))
        assert loaded.classify(bits, codes) == loaded.grasps[int(scores.argmax())]


def test_a_tie_goes_to_the_lowest_number() -> None:
    none = np.zeros((0, 4), np.int16)
    tables = IntegerTables.of(np.array([1, 5, 5, 2], np.int16), none, (), (), none, none, 1.0)
    assert Build(describe(tables), tables).classify([], []) == "grasp 1"


@pytest.mark.parametrize("member", MEMBERS)
def test_a_missing_file_is_named(folder: Path, member: str) -> None:
    (folder / member).unlink()
    with pytest.raises(BuildError, match=rf"{member} cannot be read: No such file or directory"):
        Build.load(folder)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"is .*nowhere a build"):
        Build.load(tmp_path / "nowhere")


@pytest.mark.parametrize("member", MEMBERS)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(data=st.data())
def test_mutated_files_are_refused_by_name(folder: Path, member: str, data: st.DataObject) -> None:
    path = folder / member
    good = path.read_bytes()
    bad = bytearray(good)
    position = data.draw(st.integers(0, len(bad) - 1))
    bad[position] ^= data.draw(st.integers(1, 255))
    cut = data.draw(st.integers(0, len(bad)))
    path.write_bytes(bytes(bad[:cut]) if data.draw(st.booleans()) else bytes(bad))
    try:
        with pytest.raises(ThenarError, match=member):
            Build.load(folder)
    finally:
        path.write_bytes(good)


def test_tables_of_another_build_are_refused(folder: Path) -> None:
    (folder / TABLES_NAME).write_bytes(tables_to_bytes(make_tables(seed=1)))
    with pytest.raises(BuildError, match=r"not the one that build\.json describes"):
        Build.load(folder)


def test_an_oversized_file_is_not_read_to_its_end(folder: Path) -> None:
    with (folder / TABLES_NAME).open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(BuildError, match=f"larger than {MAX_BYTES} bytes"):
        Build.load(folder)


def test_names_and_tables_must_agree() -> None:
    with pytest.raises(BuildError, match="names 5 grasp types, 9 switches and 3 joints"):
        Build(describe(make_tables()), make_tables(switches=8))


@pytest.mark.parametrize("change", [{"scale": 99.0}, {"bound": 1}])
def test_a_proof_of_other_tables_is_refused(folder: Path, build: Build, change: dict[str, float]) -> None:
    sealed = manifest_to_bytes(replace(build.manifest, proof=replace(build.manifest.proof, **change)))
    (folder / MANIFEST_NAME).write_bytes(sealed)
    with pytest.raises(BuildError, match=r"build\.json has a scale of .* and a bound of .*, but tables\.bin has"):
        Build.load(folder)
