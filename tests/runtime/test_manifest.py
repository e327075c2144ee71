import json
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime.errors import BuildError
from thenar.runtime.manifest import Adapted, Compared, Fitting, Manifest, Recognised
from thenar.runtime.manifest_file import MAX_BYTES, manifest_from_bytes, manifest_to_bytes
from thenar.runtime.published import NONE
from thenar.runtime.recipe import Recipe
from thenar.runtime.segmenting.model import SegmentModel

from ..tables import describe
from .conftest import make_tables


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return describe(make_tables())


def test_what_was_written_is_read_again(manifest: Manifest) -> None:
    data = manifest_to_bytes(manifest)
    read = manifest_from_bytes(data)
    assert replace(read, checksum="") == manifest
    assert manifest_to_bytes(read) == data


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (Recipe(rounds=50, shrinkage=1.0), "logitboost, rounds 50, shrinkage 1"),
        (
            Recipe(rounds=50, shrinkage=0.5, trainer="logitboost", max_bins=8),
            "logitboost, rounds 50, shrinkage 0.5, max-bins 8",
        ),
        (Recipe(rounds=100, shrinkage=1.0, trainer="bayes", settings={"smoothing": 2.0}), "bayes, smoothing 2"),
    ],
)
def test_builds_that_chose_nothing_say_by_their_options_what_trained_them(
    manifest: Manifest, options: Recipe, said: str
) -> None:
    """Older versions wrote LogitBoost's rounds and shrinkage whatever the trainer, and no trainer of LogitBoost."""
    read = manifest_from_bytes(manifest_to_bytes(replace(manifest, options=options)))
    assert (str(read.fit), read.fit.compared) == (said, ())


COMPARED = Compared("logit", {"penalty": 1.0, "max_bins": None}, 98, 100, 0.014, 0.1, 0.01, 0.02, 90.5)


def test_a_choice_is_kept_with_what_it_was_chosen_from(manifest: Manifest) -> None:
    fitting = Fitting("logit", {"penalty": 1.0}, "new subject", 4, 12, (COMPARED,), "it is")
    read = manifest_from_bytes(manifest_to_bytes(replace(manifest, fitting=fitting)))
    assert read.fit == fitting
    assert str(COMPARED) == "logit, penalty 1: 98.0 +- 1.4 %, 1.0 +- 2.0 behind the best; tables of 90 rows"
    for wrong in (replace(COMPARED, correct=101), replace(COMPARED, trainer="a\nb"), replace(COMPARED, behind=2.0)):
        with pytest.raises(BuildError):
            manifest_from_bytes(manifest_to_bytes(replace(manifest, fitting=replace(fitting, compared=(wrong,)))))


def test_a_rate_says_what_it_is_of_its_interval_and_its_unit() -> None:
    rate = Recognised("nested", 7, 1, 1230, 1680, "new subject", "trials", 0.6012, 0.834)
    assert str(rate) == "new subject: 73.2 % [60.1, 83.4], 1,230 of 1,680 trials in 7 nested folds"
    assert str(Recognised("training", 0, 1, 4, 5)) == "rows trained on: 80.0 %, 4 of 5 frames"


@given(data=st.data())
def test_any_changed_byte_is_refused(manifest: Manifest, data: st.DataObject) -> None:
    document = bytearray(manifest_to_bytes(manifest))
    position = data.draw(st.integers(0, len(document) - 1))
    document[position] = data.draw(st.integers(0, 255).filter(lambda byte: byte != document[position]))
    with pytest.raises(BuildError):
        manifest_from_bytes(bytes(document))


def test_another_schema_is_refused_by_its_number_whatever_else_it_holds() -> None:
    with pytest.raises(BuildError, match="schema 2, this thenar reads 1: compile the build again"):
        manifest_from_bytes(b'{"schema": 2, "something": "new"}')


def test_a_field_that_is_unknown_is_refused(manifest: Manifest) -> None:
    document = json.loads(manifest_to_bytes(manifest)) | {"extra": 1}
    with pytest.raises(BuildError, match="unknown field `extra`"):
        manifest_from_bytes(json.dumps(document).encode())


def test_a_document_written_otherwise_is_refused(manifest: Manifest) -> None:
    document = json.loads(manifest_to_bytes(manifest))
    with pytest.raises(BuildError, match="altered"):
        manifest_from_bytes(json.dumps(document).encode())


def test_two_switches_of_one_name_are_refused(manifest: Manifest) -> None:
    twice = replace(manifest, switches=(manifest.switches[0], manifest.switches[0]))
    with pytest.raises(BuildError, match="names two switches alike"):
        manifest_from_bytes(manifest_to_bytes(twice))


def test_an_oversized_document_is_refused() -> None:
    with pytest.raises(BuildError, match="at most"):
        manifest_from_bytes(b" " * (MAX_BYTES + 1))


@pytest.mark.parametrize(
    "name", ["\x1b]0;owned\x07", "two\nlines", "a\u202eb", "\u2028", " a", "?", "x" * 201, "\x9b31m"]
)
@pytest.mark.parametrize(
    "where", ["grasps", "switches", "joints", "unit", "thenar", "taxonomy", "placement", "simulated"]
)
def test_a_sealed_build_whose_names_would_deceive_is_refused(manifest: Manifest, where: str, name: str) -> None:
    source, options, (joint, *joints) = manifest.source, manifest.options, manifest.joints
    changes: dict[str, dict[str, object]] = {
        "grasps": {"grasps": (name, *manifest.grasps[1:])},
        "switches": {"switches": (replace(manifest.switches[0], name=name), *manifest.switches[1:])},
        "joints": {"joints": (replace(joint, name=name), *joints)},
        "unit": {"joints": (replace(joint, unit=name), *joints)},
        "thenar": {"thenar": name},
        "taxonomy": {"source": replace(source, taxonomy=name)},
        "placement": {"options": replace(options, placement=name)},
        "simulated": {"source": replace(source, simulated=name * (1 + len(name) // 200))},
    }
    sealed = manifest_to_bytes(replace(manifest, **changes[where]))
    with pytest.raises(BuildError, match=r"one of its .*: compile the build again") as refused:
        manifest_from_bytes(sealed)
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 250


_WRONG: list[Callable[[Manifest], Manifest]] = [
    lambda m: replace(m, switches=(replace(m.switches[0], column=m.source.switches), *m.switches[1:])),
    lambda m: replace(m, switches=(replace(m.switches[0], column=m.switches[1].column), *m.switches[1:])),
    lambda m: replace(m, joints=(replace(m.joints[0], column=m.joints[1].column), *m.joints[1:])),
    lambda m: replace(m, joints=(replace(m.joints[0], column=m.source.joints), *m.joints[1:])),
    lambda m: replace(m, joints=(replace(m.joints[0], code_b=m.joints[0].code_a), *m.joints[1:])),
    lambda m: replace(m, joints=(replace(m.joints[0], code_b=65536), *m.joints[1:])),
    lambda m: replace(m, joints=(replace(m.joints[0], value_b=1e301), *m.joints[1:])),
    lambda m: replace(m, switches=(replace(m.switches[0], gain=1e308), *m.switches[1:])),
    lambda m: replace(m, proof=replace(m.proof, width=m.options.width - 1)),
    lambda m: replace(m, proof=replace(m.proof, covered=m.source.rows + 1)),
    lambda m: replace(m, proof=replace(m.proof, error=1e308)),
    lambda m: replace(m, rates=(replace(m.rates[0], total=0, correct=0),)),
    lambda m: replace(m, rates=(replace(m.rates[0], correct=m.rates[0].total + 1),)),
    lambda m: replace(m, stopped_after=101),
    lambda m: replace(m, options=replace(m.options, rounds=0)),
    lambda m: replace(m, options=replace(m.options, shrinkage=1e308)),
    lambda m: replace(m, adapted=Adapted("0" * 64, m.source, (1,) * (len(m.grasps) - 1))),
    lambda m: replace(m, adapted=Adapted("0" * 64, m.source, (1,) * len(m.grasps), ("unknown",))),
]


@pytest.mark.parametrize("change", _WRONG)
def test_what_cannot_all_be_true_is_refused_whoever_sealed_it(
    manifest: Manifest, change: Callable[[Manifest], Manifest]
) -> None:
    with pytest.raises(BuildError):
        manifest_from_bytes(manifest_to_bytes(change(manifest)))


@pytest.mark.parametrize("part", [b"[" * 200_000, b"9" * 10_000, b"1e999", b'"\xff"', b'{"a":' * 100_000])
def test_json_that_is_deep_or_long_is_refused(part: bytes) -> None:
    with pytest.raises(BuildError, match=r"build\.json is not a build's"):
        manifest_from_bytes(b'{"schema": ' + part)
    with pytest.raises(BuildError, match=r"build\.json is not a build's"):
        manifest_from_bytes(b'{"schema": 1, "checksum": ' + part)


def test_costs_of_segments_are_read_again_and_are_of_the_tables_classes(manifest: Manifest) -> None:
    n_types, scale = len(manifest.grasps), manifest.proof.scale
    usual = SegmentModel.usual(n_types, False, scale)
    assert manifest.segmenting == usual
    learnt = replace(usual, least=(3,) * n_types + (2,))
    read = manifest_from_bytes(manifest_to_bytes(replace(manifest, segments=learnt)))
    assert read.segments == read.segmenting == learnt
    detecting = replace(manifest, grasps=(*manifest.grasps[:-1], NONE))
    assert detecting.segmenting == SegmentModel.usual(n_types - 1, True, scale)
    for wrong in (replace(manifest, segments=detecting.segmenting), replace(detecting, segments=learnt)):
        with pytest.raises(BuildError, match="has costs of segments of other classes than its tables"):
            manifest_from_bytes(manifest_to_bytes(wrong))
    beyond = manifest_to_bytes(replace(manifest, segments=learnt)).replace(b'"most": 48', b'"most": 255')
    with pytest.raises(BuildError, match="most"):
        manifest_from_bytes(beyond)
