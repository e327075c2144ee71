"""A sink of the user's own that breaks its promises takes no other with it."""

import io
from collections.abc import Callable

import pytest

from thenar.runtime.published import HealthReport, LiveGrasp, Preshape
from thenar.runtime.sinks import Fanout, JointAngles, JsonLines, Sink, SinkReport

MakeGrasp = Callable[..., LiveGrasp]


class Faulty(Sink):
    """Raises from the frame `fails_at` on, and at its end."""

    def __init__(self, fails_at: int) -> None:
        self.fails_at = fails_at
        self.numbers: list[int] = []

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        self.numbers.append(grasp.number)
        if grasp.number >= self.fails_at:
            raise KeyError("own fault")

    def health(self, report: HealthReport) -> None:
        raise ValueError("no health")

    def report(self) -> SinkReport:
        return SinkReport("own", 1, len(self.numbers), 0)

    def close(self) -> None:
        raise RuntimeError("and that, too")


FAULTY = f"{__name__}.Faulty"


def test_one_that_raises_is_left_out_and_the_others_go_on(
    make_grasp: MakeGrasp, caplog: pytest.LogCaptureFixture
) -> None:
    file, faulty = io.BytesIO(), Faulty(2)
    fanout = Fanout([faulty, JsonLines(file)])
    for number in range(5):
        fanout.publish(make_grasp(number), None, None)
    assert faulty.numbers == [0, 1, 2]
    assert file.getvalue().count(b"\n") == 5
    (logged,) = caplog.records
    assert (logged.name, logged.getMessage()) == ("thenar", f"sink {FAULTY}: a bug in the program")
    assert logged.exc_info is not None
    assert logged.exc_info[0] is KeyError
    own, lines = fanout.reports()
    assert own == SinkReport(FAULTY, None, 0, 3, "KeyError: 'own fault'")
    assert (lines.sent, lines.lost, lines.error) == (5, 0, "")


def test_closing_closes_every_one(make_grasp: MakeGrasp) -> None:
    file = io.BytesIO()
    lines = JsonLines(file, owned=True)
    fanout = Fanout([Faulty(9), lines])
    fanout.close()
    assert file.closed
    assert fanout.reports()[0].error == "RuntimeError: and that, too"


def test_one_that_works_reports_for_itself(make_grasp: MakeGrasp) -> None:
    fanout = Fanout([Faulty(9)])
    fanout.publish(make_grasp(0), None, None)
    assert fanout.reports() == (SinkReport("own", 1, 1, 0),)


def test_a_report_of_health_reaches_those_that_work(make_grasp: MakeGrasp, health: HealthReport) -> None:
    file = io.BytesIO()
    fanout = Fanout([Faulty(9), JsonLines(file)])
    fanout.health(health)
    fanout.publish(make_grasp(0), None, None)
    assert file.getvalue().count(b"\n") == 2
    assert fanout.reports()[0] == SinkReport(FAULTY, None, 0, 2, "ValueError: no health")
