import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.serial_line import Outgoing

BYTE_S = 0.001
GAPS = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), min_size=1, max_size=20)


def drained(outgoing: Outgoing, now: float) -> bytes:
    """Take all that has arrived by `now`, message by message."""
    taken = b""
    while arrived := outgoing.arrived(now):
        outgoing.take(len(arrived))
        taken += arrived
    return taken


@given(GAPS, st.integers(1, 50))
def test_a_byte_arrives_when_the_line_has_had_the_time_for_it_and_no_wake_up_shifts_the_schedule(
    messages: list[tuple[int, int]], every: int
) -> None:
    """Times in milliseconds, a byte taking one; whoever looks, how often, makes no difference."""
    outgoing, queued, free, ends = Outgoing(BYTE_S, 10_000), 0, 0, []
    for gap, length in messages:
        queued += gap
        free = max(queued, free) + length
        ends += [free - length + byte + 1 for byte in range(length)]
        outgoing.put(queued / 1000, b"x" * length)
    came = 0
    for now in range(0, free + every, every):
        came += len(drained(outgoing, now / 1000))
        assert came == sum(end <= now for end in ends)
    assert came == len(ends)


@given(GAPS, st.integers(10, 100))
def test_of_what_waits_the_oldest_goes_whole_when_there_is_too_much(messages: list[tuple[int, int]], most: int) -> None:
    outgoing = Outgoing(0.0, most)
    sent = [bytes([number]) * length for number, (_, length) in enumerate(messages)]
    for message in sent:
        outgoing.put(0.0, message)
    kept = drained(outgoing, 0.0)
    newest = sent[outgoing.dropped :]
    assert kept == b"".join(newest)
    assert newest
    assert len(kept) <= most or len(newest) == 1
    assert not outgoing.dropped or sum(map(len, sent[outgoing.dropped - 1 :])) > most


def test_it_says_when_the_next_bytes_are_in() -> None:
    outgoing = Outgoing(BYTE_S, 100)
    assert outgoing.next_at(10) is None
    outgoing.put(1.0, b"x" * 15)
    assert outgoing.next_at(10) == pytest.approx(1.010)
    outgoing.take(10)
    assert outgoing.next_at(10) == pytest.approx(1.015)


def test_damage_changes_what_goes_out_and_how_long_it_takes() -> None:
    outgoing = Outgoing(BYTE_S, 100)
    outgoing.damage = lambda message: b"" if message == b"gone" else message + b"!!"
    for message in (b"gone", b"here", b"gone", b"too"):
        outgoing.put(0.0, message)
    assert drained(outgoing, 0.006) == b"here!!"
    assert drained(outgoing, 0.011) == b"too!!"


def test_what_nobody_took_is_not_made_up_for_in_a_burst() -> None:
    outgoing = Outgoing(BYTE_S, 100)
    outgoing.put(0.0, b"a" * 10)
    outgoing.put(0.0, b"b" * 10)
    assert len(outgoing.arrived(0.005)) == 5
    outgoing.hold(3.0)
    assert drained(outgoing, 3.0) == b"a" * 10
    assert drained(outgoing, 3.004) == b"b" * 4
