import os
from pathlib import Path

import msgspec
import pytest

from thenar.stability.cases.platform import AS_IT_IS, Ran, held, plainest, run
from thenar.stability.checks.built_bytes import Built
from thenar.stability.pythons import found, made


@pytest.fixture(scope="module")
def here() -> Built:
    ran = run(AS_IT_IS, full=False)
    assert ran.built is not None, ran.ending
    return ran.built


def test_a_set_and_the_three_files_of_a_build_are_compared(here: Built) -> None:
    assert [name for name, _ in here.files] == ["set.grasps", "build.json", "tables.bin", "ensemble.bin"]


def test_the_settings_do_change_what_plain_exp_and_products_answer(here: Built) -> None:
    there = run(plainest(here), full=False)
    assert there.built is not None, there.ending
    assert there.built.simd == (), "numpy uses instruction sets that were taken away"
    assert all(kernel.endswith(" x1") for kernel in there.built.kernels)
    if not here.simd:
        pytest.skip("this processor has nothing that could be taken away")
    assert there.built.plain != here.plain
    assert there.built.files == here.files


@pytest.mark.parametrize("name", ["set.grasps", "build.json", "tables.bin", "ensemble.bin"])
def test_one_file_that_differs_is_counted_and_named(here: Built, name: str) -> None:
    files = tuple((file, "0" * 64 if file == name else digest) for file, digest in here.files)
    finding = held("", here, [Ran("same", here), Ran("another", msgspec.structs.replace(here, files=files))])
    assert (finding.error, finding.tried, finding.holds) == (1, 8, False)
    assert finding.worst == f"another: {name}"


def test_a_process_that_dies_counts_as_all_of_its_files_and_tells_its_last_words(here: Built, tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho first >&2; echo last words >&2; exit 3\n")
    python.chmod(0o755)
    ran = run(AS_IT_IS._replace(python=python), full=False)
    finding = held("", here, [ran])
    assert finding.error == len(here.files)
    assert finding.worst.endswith("ended with 3 last words")


@pytest.mark.slow
def test_every_other_python_of_this_machine_has_a_thenar() -> None:
    # The full case compares what they build.
    others, have = dict(found()), {python.parts[-3] for python in made()}
    if not others:
        pytest.skip("no other Python on this machine")
    without = [version for version in others if f".venv-{version}" not in have]
    if without:
        required = os.environ.get("THENAR_REQUIRE_ALL") == "1"
        (pytest.fail if required else pytest.skip)(f"no thenar for Python {', '.join(without)} (make pythons)")
