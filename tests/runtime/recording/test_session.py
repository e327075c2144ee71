import json
from typing import Any

import pytest

from thenar.runtime.errors import FormatError
from thenar.runtime.recording.session import Session, from_metadata, to_metadata

PLAN = {
    "subject": "A",
    "taxonomy": "own",
    "types": ["cup"],
    "tasks": [{"grasp": "cup", "objects": ["mug", "jar"]}],
    "repetitions": 3,
    "seed": 7,
}
SENSOR = {"name": "a", "raw_a": 1, "raw_b": 1, "value_a": 0, "value_b": 1}


def changed(session: Session, **fields: Any) -> dict[str, str]:
    """Return the texts of a session with other fields."""
    texts = to_metadata(session)
    return {**texts, "session": json.dumps(json.loads(texts["session"]) | fields)}


def test_a_session_comes_back_from_its_texts(session: Session) -> None:
    assert from_metadata(to_metadata(session)) == session
    bare = Session(thenar="1", switches=(), sensors=())
    assert from_metadata(to_metadata(bare)) == bare
    assert to_metadata(bare) == {"version": "2", "session": '{"thenar":"1","switches":[],"sensors":[]}'}


def test_what_a_later_thenar_adds_is_passed_over(session: Session) -> None:
    assert from_metadata({**changed(session, weather="rain"), "weather": "rain"}) == session


@pytest.mark.parametrize(
    ("version", "said"),
    [
        ("4", "of version 4, this thenar reads 2: use the thenar that recorded it"),
        ("9" * 5000, "of version 9{20}"),
        ("", r"of version \?, this"),
        ("\x1b[2J", r"of version \\x1b\[2J"),
    ],
)
def test_a_session_of_another_version_is_refused(session: Session, version: str, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        from_metadata({**to_metadata(session), "version": version})


@pytest.mark.parametrize("text", ["", "s1", "[" * 100_000, '{"switches":' + "[" * 100_000])
def test_what_is_no_session_is_refused(session: Session, text: str) -> None:
    with pytest.raises(FormatError, match="its session cannot be read"):
        from_metadata({**to_metadata(session), "session": text})
    with pytest.raises(FormatError, match="its session cannot be read"):
        from_metadata({"version": "2"})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"switches": "s1"}, r"its session cannot be read: .*\$\.switches"),
        ({"calibration": {"sensor": [SENSOR]}}, "calibration"),
        ({"clock_ns": 1e300}, "clock_ns"),
        ({"clock_ns": int("9" * 30)}, "clock_ns"),
        ({"switches": ["s"] * 65_537}, r"of length <= 65536 - at `\$\.switches"),
        ({"sensors": ["s"] * 256}, r"of length <= 255 - at `\$\.sensors"),
        (
            {"collection": PLAN | {"tasks": [{"grasp": "cup", "objects": []}]}},
            r"of length >= 1 - at `\$\.coll",
        ),
        ({"collection": PLAN | {"repetitions": 1_000_000_000_000}}, "<= 1000000"),
        ({"collection": PLAN | {"repetitions": 0}}, ">= 1"),
        ({"collection": PLAN | {"seed": -1}}, ">= 0"),
    ],
)
def test_a_session_that_cannot_be_read_is_refused_by_its_key(
    session: Session, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(FormatError, match=said):
        from_metadata(changed(session, **change))


@pytest.mark.parametrize(
    ("good", "name"),
    [
        *((good, "\x1b[2J") for good in ("s007", "index", "thumb")),
        *((good, name) for good in ("A", "cup", "jar", "own") for name in ("a\u202eb", "x" * 201)),
    ],
)
def test_a_name_in_a_session_that_would_deceive_is_refused(session: Session, good: str, name: str) -> None:
    texts = to_metadata(session)
    assert f'"{good}"' in texts["session"]
    with pytest.raises(FormatError, match=r"holds a control character|at most 200"):
        from_metadata({**texts, "session": texts["session"].replace(f'"{good}"', json.dumps(name))})


@pytest.mark.parametrize("key", ["thenar", "switches", "sensors"])
def test_what_is_needed_is_missed(session: Session, key: str) -> None:
    texts = to_metadata(session)
    fields = json.loads(texts["session"])
    del fields[key]
    with pytest.raises(FormatError, match=key):
        from_metadata({**texts, "session": json.dumps(fields)})
