import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings import RecordingError, TableError
from thenar.compiler.recordings.taxonomy import Taxonomy, collected, own, published, published_for
from thenar.runtime.recording.session import CollectionTask

PUBLISHED = [published("kamakura14"), published("cutkosky16"), published("feix33")]


@pytest.mark.parametrize("taxonomy", PUBLISHED, ids=lambda taxonomy: taxonomy.name)
def test_types_are_found_by_any_spelling_or_number(taxonomy: Taxonomy) -> None:
    for number, (name, full) in enumerate(zip(taxonomy.types, taxonomy.full_names, strict=True), start=1):
        for spelling in (
            name,
            full,
            full.upper(),
            full.replace(" ", "_"),
            str(number),
            f"{number:02}",
            f" {name.lower()}",
        ):
            assert taxonomy.find(spelling) == name
    assert taxonomy.find("0") is None
    assert taxonomy.find(str(len(taxonomy.types) + 1)) is None


def test_labels_of_recordings_are_read_as_feix_wrote_them() -> None:
    assert published("feix33").find("Adduction_Grip") == "Adduction Grip"
    assert published("feix33").find("Sphere_4_finger") == "Sphere 4 Finger"
    assert published("cutkosky16").find("disk power") == "Disk (power)"
    assert published("kamakura14").find("Power grip standard type") == "PoS"
    assert {published("feix33").find(label) for label in ("ExtensionType", "extension-type", "EXTENSION_TYPE")} == {
        "Extension Type"
    }


def test_labels_that_one_published_taxonomy_alone_names_are_its_types() -> None:
    assert published_for({"Adduction_Grip", "ExtensionType", "Lateral"}) == "feix33"
    assert published_for({"PoS", "lat"}) == "kamakura14"
    assert published_for({"Large diameter"}) is None  # Cutkosky's and Feix's
    assert published_for({"1", "2"}) is None
    assert published_for({"PoS", "mug"}) is None
    assert published_for(set()) is None


def test_an_unknown_label_is_answered_with_the_nearest_types() -> None:
    said = published("feix33").unknown("Adducted Grip")
    assert re.fullmatch(r"'Adducted Grip' is not a grasp type of feix33 .*'Adduction Grip'.*", said)
    assert "its types: PoS, PoH, PoI, PoE, PoD, ..." in published("kamakura14").unknown("zzzz")


def test_numbers_mean_nothing_in_a_taxonomy_of_ones_own() -> None:
    assert own(["mug", "7"]).find("1") is None
    assert own(["mug", "7"]).find("7") == "7"
    assert own(["mug", "7"]).find("MUG") == "mug"


def test_a_spelling_that_two_types_share_means_only_the_exact_one() -> None:
    taxonomy = own(["a b", "a_b"])
    assert [taxonomy.find(label) for label in ("a b", "a_b", "A B")] == ["a b", "a_b", None]


@given(st.lists(st.text("abc 1?_-", min_size=1, max_size=4), min_size=1, max_size=6))
def test_every_type_is_found_as_itself(types: list[str]) -> None:
    try:
        taxonomy = own(types)
    except RecordingError:
        return
    assert [taxonomy.find(name) for name in types] == types


def test_types_that_cannot_be_told_apart_or_read_are_refused() -> None:
    with pytest.raises(RecordingError, match="grasp type 'x' occurs twice"):
        own(["x", "y", "x"])
    with pytest.raises(RecordingError, match="grasp type '' is empty"):
        own([""])
    with pytest.raises(RecordingError, match="taxonomy feix33 has 33 published types"):
        Taxonomy("feix33", ("x",))
    with pytest.raises(RecordingError, match="no taxonomy is called 'feix'"):
        published("feix")


def test_labels_of_many_digits_are_compared_and_shown_short() -> None:
    assert published("feix33").find("0" * 5000 + "7") == published("feix33").types[6]
    said = published("feix33").unknown("9" * 5000)
    assert said.startswith(f"'{'9' * 79}... is not a grasp type of feix33")
    assert len(said) < 300


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "objects.toml"


def test_without_a_list_every_type_is_collected_with_any_object() -> None:
    taxonomy, tasks = collected("kamakura14", None)
    assert taxonomy == published("kamakura14")
    assert tasks == tuple(CollectionTask(grasp, ("any",)) for grasp in published("kamakura14").types)


def test_a_list_says_which_types_and_with_what(file: Path) -> None:
    file.write_text('pos = ["bottle", "jar"]\n"tip grip" = ["pin"]\n')
    taxonomy, tasks = collected("kamakura14", file)
    assert taxonomy == published("kamakura14")
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
    with pytest.raises(TableError, match=said):
        collected("kamakura14", file)


def test_a_taxonomy_that_is_not_there_is_named() -> None:
    with pytest.raises(RecordingError, match="no taxonomy is called 'kamakura15'"):
        collected("kamakura15", None)
