"""The ledger adds up what was entered, in however many ledgers it was."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.running.pipeline import Ledger
from thenar.simulator.running.report import step_reports
from thenar.simulator.streams import Draws

CALLS = st.lists(
    st.tuples(
        st.sampled_from(["glove.sense", "joint.noise", "wire.lost_bytes"]),
        st.integers(1, 3),
        st.integers(1, 64),
        st.integers(0, 10**6),
        st.integers(0, 500),
        st.integers(0, 9),
    ),
    max_size=12,
)


def entered(calls: list[tuple[str, int, int, int, int, int]]) -> Ledger:
    ledger = Ledger()
    for name, batches, grasps, nanoseconds, drawn, sent in calls:
        counts = Counter({name: drawn}) if drawn else Counter()
        draws = Draws(counts + Counter({"bytes": sent}))
        ledger.enter(name, name.startswith("glove."), batches, grasps, nanoseconds, draws)
    return ledger


@given(CALLS)
def test_an_entry_holds_the_sums_of_its_calls(calls: list[tuple[str, int, int, int, int, int]]) -> None:
    ledger = entered(calls)
    assert set(ledger.entries) == {name for name, *_ in calls}
    for name, entry in ledger.entries.items():
        own = [numbers for step, *numbers in calls if step == name]
        assert entry.own == (name == "glove.sense")
        sums = [entry.calls, entry.grasps, entry.nanoseconds, entry.draws, entry.counters["bytes"]]
        assert sums == [sum(column) for column in zip(*own, strict=True)]
        assert set(entry.counters) <= {"bytes"}
    assert ledger.nanoseconds == sum(call[3] for call in calls)


@given(CALLS, st.integers(0, 12))
def test_two_workers_ledgers_merge_into_the_one_of_a_single_worker(
    calls: list[tuple[str, int, int, int, int, int]], cut: int
) -> None:
    merged = entered(calls[:cut])
    other = entered(calls[cut:])
    merged.merge(other)
    assert merged == entered(calls)
    assert other == entered(calls[cut:])


@given(CALLS)
def test_shares_make_one_wherever_any_time_passed(calls: list[tuple[str, int, int, int, int, int]]) -> None:
    ledger = entered(calls)
    total = sum(report.share for report in step_reports(ledger))
    assert abs(total - (1.0 if ledger.nanoseconds else 0.0)) < 1e-12


def test_a_merged_entry_is_a_copy() -> None:
    first, second = Ledger(), entered([("joint.noise", 1, 1, 1, 1, 1)])
    first.merge(second)
    first.merge(second)
    assert second.entries["joint.noise"].counters == Counter({"bytes": 1})
    assert first.entries["joint.noise"].calls == 2


def test_what_is_entered_stays_as_it_was() -> None:
    draws = Draws(Counter({"joint.noise": 3, "bytes": 4}))
    Ledger().enter("joint.noise", False, 1, 1, 1, draws)
    assert draws == Draws(Counter({"joint.noise": 3, "bytes": 4}))
