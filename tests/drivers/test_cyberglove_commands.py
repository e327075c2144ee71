import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import ANSWERED, INFORMATION, SET, Answer, find_answer, query, setting
from thenar.drivers.errors import SettingError

LETTERS = sorted(ANSWERED)
# Rests of a stream end in a NUL and hold no echo; a Ctrl-C may be answered; NULs may stray.
RESTS = st.lists(st.sampled_from([b"\0", b"\x03\0", b"SabcPQ\0", b"\x90\x91\0"])).map(b"".join)
ERRORS = st.sampled_from([b"?", b"n", b"y", b"g", b"s"])


@st.composite
def queries_and_answers(draw: st.DrawFn) -> tuple[str, bytes]:
    letter = draw(st.sampled_from(LETTERS))
    size = ANSWERED[letter]
    return letter, draw(st.binary(min_size=size, max_size=size))


@given(queries_and_answers(), RESTS, st.binary(max_size=5))
def test_values_are_found_whatever_they_are_and_whatever_came_before(
    asked: tuple[str, bytes], rests: bytes, behind: bytes
) -> None:
    letter, values = asked
    wire = b"?" + letter.encode() + values + b"\0"
    assert find_answer(query(letter), rests + wire + behind) == Answer(values)


@given(queries_and_answers(), st.integers(0, 8))
def test_an_answer_is_waited_for_until_it_is_whole(asked: tuple[str, bytes], missing: int) -> None:
    letter, values = asked
    wire = b"?" + letter.encode() + values + b"\0"
    assert find_answer(query(letter), wire[: -1 - missing % len(wire)]) is None


@given(st.sampled_from(LETTERS), ERRORS, RESTS, st.booleans())
def test_an_error_is_understood_with_its_echo_and_without(letter: str, kind: bytes, rests: bytes, echo: bool) -> None:
    wire = rests + (b"?" + letter.encode()) * echo + b"e" + kind + b"\0"
    answer = find_answer(query(letter), wire, last=True)
    assert answer is not None
    assert answer.error is not None
    if not echo or ANSWERED[letter] < 3:  # nothing it could be the beginning of
        assert find_answer(query(letter), wire) == answer


def test_values_that_read_like_an_error_are_values() -> None:
    assert find_answer(query("M"), b"?Me?\0\0") == Answer(b"e?\0")
    assert find_answer(query("T"), b"?Teg\0e\0") == Answer(b"eg\0e")
    assert find_answer(query("T"), b"?T\0e?\0") is None
    assert find_answer(query("T"), b"?T\0e?\0\0") == Answer(b"\0e?\0")


@given(st.sampled_from(sorted(SET)), RESTS, ERRORS)
def test_a_setting_is_answered_by_its_letter_or_an_error(letter: str, rests: bytes, kind: bytes) -> None:
    command = setting(letter, bytes(SET[letter]))
    assert command.request == letter.encode() + bytes(SET[letter])
    assert find_answer(command, rests + letter.encode() + b"\0") == Answer(b"")
    for error in (b"e" + kind + b"\0", letter.encode() + b"e" + kind + b"\0"):
        answer = find_answer(command, rests + error)
        assert answer is not None
        assert answer.error is not None


def test_text_ends_with_cr_lf_nul() -> None:
    assert find_answer(INFORMATION, b"\0?iCyberGlove\r\nRight\r\n\0\0") == Answer(b"CyberGlove\r\nRight")
    assert find_answer(INFORMATION, b"?iCyberGlove\r\n") is None


@given(st.sampled_from(LETTERS), st.binary(max_size=40), st.booleans())
def test_no_bytes_are_too_odd(letter: str, received: bytes, last: bool) -> None:
    for command in (query(letter), INFORMATION, setting("T", bytes(4))):
        answer = find_answer(command, received, last=last)
        assert answer is None or answer.error is not None or command.echo in received


def test_what_the_box_does_not_have_is_refused_before_it_is_asked() -> None:
    with pytest.raises(SettingError, match=r"no query \?Z: it has \?A, \?B"):
        query("Z")
    with pytest.raises(SettingError, match=r"T cannot be set to 3 bytes: .*T \(4\)"):
        setting("T", b"123")
    with pytest.raises(SettingError, match="S cannot be set"):
        setting("S", b"1")
