import json

import pytest
from msgspec.structs import replace

from thenar.runtime.errors import FormatError
from thenar.runtime.recording.session import Session, from_metadata, to_metadata

PLAN = (
    '{"subject":"A","taxonomy":"own","types":["cup"],"tasks":[{"grasp":"cup","objects":["mug","jar"]}],'
    '"repetitions":3,"seed":7}'
)


def test_a_session_comes_back_from_its_texts(session: Session) -> None:
    assert from_metadata(to_metadata(session)) == session
    bare = Session(thenar="1", switches=(), sensors=())
    assert from_metadata(to_metadata(bare)) == bare


def test_texts_are_readable_as_they_are(session: Session) -> None:
    texts = to_metadata(session)
    assert texts["version"] == "1"
    assert texts["harness"] == 'name = "bänk"\n'
    assert texts["sensors"] == '["thumb","index"]'
    assert all(isinstance(text, str) for text in texts.values())


def test_keys_of_a_later_thenar_are_passed_over(session: Session) -> None:
    assert from_metadata({**to_metadata(session), "weather": "rain"}) == session


def test_what_has_a_default_may_be_missing(session: Session) -> None:
    texts = to_metadata(replace(session, build="", harness="", calibration=None, collection=None, clock_ns=0))
    needed = {key: texts[key] for key in ("version", "thenar", "switches", "sensors")}
    assert from_metadata(needed) == from_metadata(texts)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": "4"}, "of version 4, this thenar reads 1: use the thenar that recorded it"),
        ({"version": "9" * 5000}, "not a number"),
        ({"version": "x"}, "its version is 'x', not a number"),
        ({"version": "²"}, "not a number"),
        ({"switches": "s1"}, "its metadata 'switches' cannot be read"),
        ({"switches": "[" * 100_000}, "its metadata 'switches' cannot be read"),
        (
            {"calibration": '{"sensor": [{"name": "a", "raw_a": 1, "raw_b": 1, "value_a": 0, "value_b": 1}]}'},
            "calibration",
        ),
        ({"clock_ns": "1e400"}, "clock_ns"),
        ({"clock_ns": "9" * 30}, "clock_ns"),
        ({"switches": "[" + ",".join(['"s"'] * 65_537) + "]"}, "of length <= 65536"),
        ({"sensors": "[" + ",".join(['"s"'] * 256) + "]"}, "of length <= 255"),
        ({"collection": PLAN.replace('["mug","jar"]', "[]")}, "of length >= 1 - at `\\$.tasks"),
        ({"collection": PLAN.replace('"repetitions":3', '"repetitions":1000000000000')}, "<= 1000000"),
        ({"collection": PLAN.replace('"repetitions":3', '"repetitions":0')}, ">= 1"),
        ({"collection": PLAN.replace('"seed":7', '"seed":-1')}, ">= 0"),
        ({"version": "\x1b[2J"}, r"its version is '\\x1b\[2J'"),
    ],
)
def test_a_session_that_cannot_be_read_is_refused_by_its_key(
    session: Session, change: dict[str, str], said: str
) -> None:
    with pytest.raises(FormatError, match=said):
        from_metadata({**to_metadata(session), **change})


@pytest.mark.parametrize(
    ("key", "good", "name"),
    [
        *(
            (key, good, "\x1b[2J")
            for key, good in [("switches", "s007"), ("sensors", "index"), ("calibration", "thumb")]
        ),
        *(("collection", good, name) for good in ("A", "cup", "jar", "own") for name in ("a\u202eb", "x" * 201)),
    ],
)
def test_a_name_in_a_session_that_would_deceive_is_refused(session: Session, key: str, good: str, name: str) -> None:
    texts = to_metadata(session)
    assert f'"{good}"' in texts[key]
    with pytest.raises(FormatError, match=r"holds a control character|at most 200"):
        from_metadata({**texts, key: texts[key].replace(f'"{good}"', json.dumps(name))})


@pytest.mark.parametrize("key", ["version", "thenar", "switches", "sensors"])
def test_what_is_needed_is_missed(session: Session, key: str) -> None:
    texts = to_metadata(session)
    del texts[key]
    with pytest.raises(FormatError, match=key):
        from_metadata(texts)
