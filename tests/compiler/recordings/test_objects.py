from pathlib import Path

import pytest

from thenar.compiler.recordings import ColumnsError, RecordingError
from thenar.compiler.recordings.taxonomy import KAMAKURA_14, collected
from thenar.runtime.recording.session import CollectionTask


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "objects.toml"


def test_without_a_list_every_type_is_collected_with_any_object() -> None:
    taxonomy, tasks = collected("kamakura14", None)
    assert taxonomy == KAMAKURA_14
    assert tasks == tuple(CollectionTask(grasp, ("any",)) for grasp in KAMAKURA_14.types)


def test_a_list_says_which_types_and_with_what(file: Path) -> None:
    file.write_text('pos = ["bottle", "jar"]\n"tip grip" = ["pin"]\n')
    taxonomy, tasks = collected("kamakura14", file)
    assert taxonomy == KAMAKURA_14
    assert tasks == (CollectionTask("PoS", ("bottle", "jar")), CollectionTask("Tip", ("pin",)))


def test_a_taxonomy_of_ones_own_is_what_the_list_names(file: Path) -> None:
    file.write_text('pinch = ["pin"]\n"big fist" = ["jar"]\n')
    taxonomy, tasks = collected("own", file)
    assert (taxonomy.name, taxonomy.types) == ("own", ("pinch", "big fist"))
    assert [task.grasp for task in tasks] == ["pinch", "big fist"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            'PoS = ["a"]\nPoX = ["b"]\n',
            r"objects\.toml, line 2: PoX: 'PoX' is not a grasp type of kamakura14 \(did you",
        ),
        ('PoS = "bottle"\nTip = ["a"]\n', r"objects\.toml, line 1: PoS: must be a list of the names"),
        ('PoS = [1]\nTip = ["a"]\n', r"objects\.toml, line 1: PoS: must be a list of the names"),
        (
            'PoS = []\nTip = ["a"]\n',
            r"objects\.toml, line 1: PoS: must be a list of the names of objects, at least one",
        ),
        ('PoS = ["a", "a"]\nTip = ["a"]\n', r"objects\.toml, line 1: PoS: object 'a' occurs twice"),
        ('PoS = ["a"]\nTip = ["\\u0000"]\n', r"objects\.toml, line 2: Tip: object .* holds a control character"),
        ('PoS = ["a"]\n1 = ["b"]\n', r"objects\.toml, line 2: 1: is PoS, which is listed already"),
        ('PoS = ["a"]\n', "names 1 grasp types: a collection takes two at least"),
        ("", "names 0 grasp types"),
        ("PoS = [", "is not valid TOML"),
    ],
)
def test_a_list_that_is_wrong_is_named_with_line_and_key(file: Path, text: str, said: str) -> None:
    file.write_text(text)
    with pytest.raises(ColumnsError, match=said):
        collected("kamakura14", file)


def test_a_taxonomy_that_is_not_there_is_named() -> None:
    with pytest.raises(RecordingError, match="no taxonomy is called 'kamakura15'"):
        collected("kamakura15", None)
