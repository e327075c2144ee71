from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import (
    INFORMATION,
    MASK_18,
    MASK_22,
    OVERHEAD,
    REPLY_BYTES,
    SENSORS,
    SENSORS_18,
    SENSORS_22,
    SET,
    Record,
    RecordCounts,
    RecordDecoder,
    Reply,
    digitising_us,
    encode,
    find_reply,
    period_us,
    period_words,
    query,
    setting,
    shortest_us,
)
from thenar.drivers.errors import SettingError
from thenar.drivers.serial_line import sending_us

# As Shadow (22) and toon (18) list them, under our names.
OF_22 = """thumb_rotation thumb_mpj thumb_ij thumb_abduction index_mpj index_pij index_dij middle_mpj middle_pij
middle_dij middle_index_abduction ring_mpj ring_pij ring_dij ring_middle_abduction little_mpj little_pij little_dij
little_ring_abduction palm_arch wrist_pitch wrist_yaw"""
OF_18 = """thumb_rotation thumb_mpj thumb_ij thumb_abduction index_mpj index_pij middle_mpj middle_pij
middle_index_abduction ring_mpj ring_pij ring_middle_abduction little_mpj little_pij little_ring_abduction palm_arch
wrist_pitch wrist_yaw"""


def test_the_sensors_stand_in_the_order_in_which_they_are_sent() -> None:
    assert tuple(OF_18.split()) == SENSORS_18
    assert tuple(OF_22.split()) == SENSORS_22


def test_the_masks_are_those_that_public_drivers_print() -> None:
    assert int.from_bytes(MASK_18, "little") == 0x7BBB3F
    assert int.from_bytes(MASK_22, "little") == 0x7FFF7F


LETTERS = sorted(REPLY_BYTES)
# Rests of a stream end in a NUL and hold no echo; a Ctrl-C may be answered; NULs may stray.
RESTS = st.lists(st.sampled_from([b"\0", b"\x03\0", b"SabcPQ\0", b"\x90\x91\0"])).map(b"".join)
ERRORS = st.sampled_from([b"?", b"n", b"y", b"g", b"s"])


@st.composite
def queries_and_answers(draw: st.DrawFn) -> tuple[str, bytes]:
    letter = draw(st.sampled_from(LETTERS))
    size = REPLY_BYTES[letter]
    return letter, draw(st.binary(min_size=size, max_size=size))


@given(queries_and_answers(), st.integers(0, 8))
def test_an_answer_is_waited_for_until_it_is_whole(asked: tuple[str, bytes], missing: int) -> None:
    letter, values = asked
    wire = b"?" + letter.encode() + values + b"\0"
    assert find_reply(query(letter), wire[: -1 - missing % len(wire)]) is None


@given(st.sampled_from(LETTERS), ERRORS, RESTS, st.booleans())
def test_an_error_is_understood_with_its_echo_and_without(letter: str, kind: bytes, rests: bytes, echo: bool) -> None:
    wire = rests + (b"?" + letter.encode()) * echo + b"e" + kind + b"\0"
    answer = find_reply(query(letter), wire, last=True)
    assert answer is not None
    assert answer.error is not None
    if not echo or REPLY_BYTES[letter] < 3:  # nothing it could be the beginning of
        assert find_reply(query(letter), wire) == answer


def test_values_that_read_like_an_error_are_values() -> None:
    assert find_reply(query("M"), b"?Me?\0\0") == Reply(b"e?\0")
    assert find_reply(query("T"), b"?Teg\0e\0") == Reply(b"eg\0e")
    assert find_reply(query("T"), b"?T\0e?\0") is None
    assert find_reply(query("T"), b"?T\0e?\0\0") == Reply(b"\0e?\0")


@given(st.sampled_from(sorted(SET)), RESTS, ERRORS)
def test_a_setting_is_answered_by_its_letter_or_an_error(letter: str, rests: bytes, kind: bytes) -> None:
    command = setting(letter, bytes(SET[letter]))
    assert command.request == letter.encode() + bytes(SET[letter])
    assert find_reply(command, rests + letter.encode() + b"\0") == Reply(b"")
    for error in (b"e" + kind + b"\0", letter.encode() + b"e" + kind + b"\0"):
        answer = find_reply(command, rests + error)
        assert answer is not None
        assert answer.error is not None


def test_text_ends_with_cr_lf_nul() -> None:
    assert find_reply(INFORMATION, b"\0?iCyberGlove\r\nRight\r\n\0\0") == Reply(b"CyberGlove\r\nRight")
    assert find_reply(INFORMATION, b"?iCyberGlove\r\n") is None


def test_what_the_box_does_not_have_is_refused_before_it_is_asked() -> None:
    with pytest.raises(SettingError, match=r"no query \?Z: it has \?D, \?F"):
        query("Z")
    with pytest.raises(SettingError, match=r"T cannot be set to 3 bytes: .*T \(4\)"):
        setting("T", b"123")
    with pytest.raises(SettingError, match="S cannot be set"):
        setting("S", b"1")


@pytest.mark.parametrize(
    ("rate_hz", "words"),
    [
        (1, (57600, 2)),
        (2, (57600, 1)),
        (10, (11520, 1)),
        (30, (3840, 1)),
        (45, (2560, 1)),
        (60, (1920, 1)),
        (75, (1536, 1)),
        (100, (1152, 1)),
        (None, (0, 0)),
    ],
)
def test_the_usual_rates_are_told_as_two_public_drivers_tell_them(
    rate_hz: float | None, words: tuple[int, int]
) -> None:
    assert period_words(rate_hz) == words


@given(st.floats(0.001, 115_200.0))
def test_the_sent_period_is_the_nearest_two_words_allow(rate_hz: float) -> None:
    words = period_words(rate_hz)
    assert all(0 < word <= 0xFFFF for word in words)
    # Half a tick in the product of the words, and half a tick in each of its factors' multiples.
    assert abs(period_us(words) * 0.1152 - 115_200 / rate_hz) <= 0.5 + words[1] / 2


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, nan, inf, 1e-9])
def test_no_glove_can_be_told_an_impossible_rate(rate_hz: float) -> None:
    with pytest.raises(SettingError, match="records a second"):
        period_words(rate_hz)


@pytest.mark.parametrize(
    ("sensors", "baud", "filtered", "rate_hz"),
    [
        (18, 115_200, False, 160),
        (18, 115_200, True, 118),
        (22, 115_200, False, 132),
        (22, 115_200, True, 97),
    ],
)
def test_the_highest_rates_are_those_that_the_vendors_formula_gives(
    sensors: int, baud: int, filtered: bool, rate_hz: int
) -> None:
    assert round(1e6 / shortest_us(sensors, baud, filtered=filtered)) == rate_hz


def test_a_record_is_digitised_then_sent_its_status_byte_too() -> None:
    assert digitising_us(18) == 4500.0
    assert sending_us(20, 9600) == 20 * 10 * 1e6 / 9600
    assert shortest_us(18, 9600, status=True) == digitising_us(18) + sending_us(21, 9600)


VALUES = st.lists(st.integers(1, 255), min_size=SENSORS, max_size=SENSORS).map(bytes)
RECORDS = st.builds(Record, VALUES, st.sampled_from([None, None, "too fast", "unplugged"]))
OPEN_HAND = Record(bytes(range(60, 78)))


def test_a_record_of_18_sensors_is_20_bytes() -> None:
    assert encode(OPEN_HAND) == b"S" + bytes(range(60, 78)) + b"\0"
    assert RecordDecoder().feed(b"G" + OPEN_HAND.sensors + b"\0") == [OPEN_HAND]
    assert len(encode(OPEN_HAND)) == SENSORS + OVERHEAD == 20


@given(RECORDS)
def test_what_is_encoded_is_decoded(record: Record) -> None:
    decoder = RecordDecoder()
    assert decoder.feed(encode(record)) == [record]
    fault = record.fault
    assert decoder.counts == RecordCounts(
        records=1, too_fast=int(fault == "too fast"), unplugged=int(fault == "unplugged")
    )


@given(VALUES, st.integers(0, 18))
def test_a_lost_byte_costs_one_record(values: bytes, place: int) -> None:
    encoded = encode(Record(values))
    decoder = RecordDecoder()
    assert decoder.feed(encoded[:place] + encoded[place + 1 :] + encode(OPEN_HAND)) == [OPEN_HAND]
    assert decoder.counts.wrong_start + decoder.counts.wrong_length == 1


@pytest.mark.parametrize("ending", [b"es", b"eg"])
def test_fault_letters_are_values_unless_two_bytes_are_extra(ending: bytes) -> None:
    values = b"S" * (SENSORS - 2) + ending
    assert RecordDecoder().feed(encode(Record(values))) == [Record(values)]
    (record,) = RecordDecoder().feed(b"S" + values + ending + b"\0")
    assert record.sensors == values
    assert record.fault == ("too fast" if ending == b"es" else "unplugged")


@pytest.mark.parametrize("ending", [b"e", b"en", b"xs", b"ese"])
def test_any_other_surplus_is_no_record(ending: bytes) -> None:
    decoder = RecordDecoder()
    assert decoder.feed(b"S" + OPEN_HAND.sensors + ending + b"\0") == []
    assert decoder.counts == RecordCounts(wrong_length=1)


def test_what_is_no_record_is_counted_by_what_was_wrong() -> None:
    decoder = RecordDecoder()
    assert decoder.feed(b"\0\0\x03\0Sab\0" + b"S" * 4000 + b"\0" + encode(OPEN_HAND)) == [OPEN_HAND]
    assert decoder.counts == RecordCounts(records=1, wrong_start=1, wrong_length=2)


def test_a_zero_among_the_sensors_is_refused() -> None:
    with pytest.raises(ValueError, match="sensor 2 is 0"):
        encode(Record(bytes([7, 7, 0, 7])))


@given(RECORDS, st.integers(128, 255))
def test_a_status_byte_comes_behind_the_sensors_and_before_a_fault(record: Record, status: int) -> None:
    with_status = replace(record, status=status)
    wire = encode(with_status)
    assert wire[SENSORS + 1] == status
    assert wire[: SENSORS + 1] + wire[SENSORS + 2 :] == encode(record)
    assert RecordDecoder(status=True).feed(wire) == [with_status]


@given(VALUES, st.integers(128, 255))
def test_records_need_a_status_byte_exactly_where_expected(values: bytes, on: int) -> None:
    without, with_it = Record(values), Record(values, status=on)
    expecting, plain = RecordDecoder(status=True), RecordDecoder()
    assert expecting.feed(encode(without)) == plain.feed(encode(with_it)) == []
    assert expecting.counts == plain.counts == RecordCounts(wrong_length=1)


@given(st.lists(st.one_of(RECORDS.map(encode), st.binary(max_size=60))), st.sampled_from([18, 22]), st.booleans())
def test_no_record_is_longer_or_shorter_than_the_glove_has_sensors(
    parts: list[bytes], sensors: int, status: bool
) -> None:
    decoder = RecordDecoder(sensors, status=status)
    for record in decoder.feed(b"".join(parts)):
        assert len(record.sensors) == sensors
        assert (record.status is not None) == status
        assert encode(record) in b"".join(parts)


def test_a_status_of_nought_is_refused() -> None:
    with pytest.raises(ValueError, match="status byte of 0"):
        encode(Record(bytes([7]), status=0))
