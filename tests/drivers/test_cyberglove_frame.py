from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import OVERHEAD, SENSORS, Record, RecordCounts, RecordDecoder, encode

VALUES = st.lists(st.integers(1, 255), min_size=SENSORS, max_size=SENSORS).map(bytes)
RECORDS = st.builds(Record, VALUES, st.booleans(), st.sampled_from([None, None, "too fast", "unplugged"]))
OPEN_HAND = Record(bytes(range(60, 78)))


def chunked(stream: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted({0, len(stream), *(cut % (len(stream) + 1) for cut in cuts)})
    return [stream[start:end] for start, end in pairwise(ends)]


def test_a_record_of_18_sensors_is_20_bytes() -> None:
    assert encode(OPEN_HAND) == b"S" + bytes(range(60, 78)) + b"\0"
    assert encode(Record(OPEN_HAND.sensors, streamed=False))[:1] == b"G"
    assert len(encode(OPEN_HAND)) == SENSORS + OVERHEAD == 20


@given(RECORDS)
def test_what_is_encoded_is_decoded(record: Record) -> None:
    decoder = RecordDecoder()
    assert decoder.feed(encode(record)) == [record]
    fault = record.fault
    assert decoder.counts == RecordCounts(
        records=1, too_fast=int(fault == "too fast"), unplugged=int(fault == "unplugged")
    )


@given(st.lists(st.integers(1, 255), min_size=22, max_size=22).map(bytes))
def test_a_glove_of_22_sensors_is_decoded_as_such(values: bytes) -> None:
    assert RecordDecoder(22).feed(encode(Record(values))) == [Record(values)]
    assert RecordDecoder(18).feed(encode(Record(values))) == []


@given(st.lists(st.one_of(RECORDS.map(encode), st.binary(max_size=60))), st.lists(st.integers(0, 10_000)))
def test_any_chunks_give_the_same_records_and_the_same_counts(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    at_once, in_chunks = RecordDecoder(), RecordDecoder()
    expected = at_once.feed(stream)
    assert [record for chunk in chunked(stream, cuts) for record in in_chunks.feed(chunk)] == expected
    assert in_chunks.counts == at_once.counts


@given(st.binary(max_size=1000), RECORDS)
def test_after_garbage_and_a_nul_the_next_record_is_found(garbage: bytes, record: Record) -> None:
    assert RecordDecoder().feed(garbage + b"\0" + encode(record))[-1] == record


@given(RECORDS, st.integers(1, 30))
def test_a_stream_that_is_opened_in_the_middle_is_in_step_with_its_next_record(record: Record, cut: int) -> None:
    encoded = encode(record)
    assert RecordDecoder().feed(encoded[cut:] + encoded + encoded)[-2:] == [record, record]


@given(VALUES, st.integers(0, 18))
def test_a_lost_byte_costs_one_record(values: bytes, place: int) -> None:
    encoded = encode(Record(values))
    decoder = RecordDecoder()
    assert decoder.feed(encoded[:place] + encoded[place + 1 :] + encode(OPEN_HAND)) == [OPEN_HAND]
    assert decoder.counts.wrong_start + decoder.counts.wrong_length == decoder.counts.resyncs == 1


@given(VALUES)
def test_a_lost_nul_costs_both_records_and_no_more(values: bytes) -> None:
    encoded = encode(Record(values))
    assert RecordDecoder().feed(encoded[:-1] + encoded + encoded) == [Record(values)]


@pytest.mark.parametrize("ending", [b"es", b"eg"])
def test_e_s_and_g_are_sensor_values_unless_there_are_two_bytes_too_many(ending: bytes) -> None:
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
def test_whoever_expects_a_status_byte_takes_no_record_without_one_nor_the_other_way(values: bytes, on: int) -> None:
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
