from collections.abc import Sequence
from io import StringIO
from typing import get_args

import pytest
from msgspec.structs import replace

from thenar.cli.consoles import Console
from thenar.cli.run_command import LiveView, drawn
from thenar.runtime.published import DeviceHealth, Health, HealthReport, LiveGrasp, OutputTrouble, Quarantined


def grasp(name: str) -> LiveGrasp:
    return LiveGrasp(0, 0, 0, name, name, 0.9, 12, "ok", 900, None, 310)


def nobody() -> tuple[DeviceHealth, ...]:
    return ()


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def picture(grasp: LiveGrasp, devices: Sequence[DeviceHealth] = ()) -> list[str]:
    """Return the lines of what is drawn, with one blank between the words."""
    file = StringIO()
    Console(file, width=80).print(drawn(grasp, devices))
    return [" ".join(line.split()) for line in file.getvalue().splitlines()]


def test_the_picture_says_which_segment_it_is_and_since_when() -> None:
    held = replace(grasp("Tripod"), time_us=3_000_000, state="held", segment=7, segment_type="Tripod")
    assert "segment 7, Tripod: held, 1.5 s" in picture(replace(held, segment_us=1_500_000))


def test_the_view_shows_grasp_certainty_and_state_of_every_device() -> None:
    devices = DeviceHealth("glove", False, "no such port"), DeviceHealth("bus 1", True, "")
    assert picture(grasp("Tripod"), devices) == [
        "grasp Tripod",
        "█" * 27 + "░" * 3 + " 90.0%",
        "this frame Tripod, ahead by 12 steps",
        "segment none, 0 so far",
        "health ok",
        "age switches 0.9 ms, glove none yet",
        "frame 0",
        "glove no such port",
        "bus 1 connected",
    ]


def test_every_health_can_be_drawn() -> None:
    for health in get_args(Health):
        assert f"health {health}" in picture(replace(grasp("Tripod"), health=health))


def test_what_is_missing_is_named_six_of_it_at_most() -> None:
    for count, said in (
        (1, "missing s0"),
        (6, "missing s0, s1, s2, s3, s4, s5"),
        (8, "missing s0, s1, s2, s3, s4, s5 and 2 more"),
    ):
        lost = tuple(f"s{number}" for number in range(count))
        assert said in picture(replace(grasp("Tripod"), health="degraded", lost=lost))
    assert not any(line.startswith("missing") for line in picture(grasp("Tripod")))


def test_quarantined_switches_and_stalled_sinks_are_drawn_with_their_reason() -> None:
    wrong = (Quarantined("palm", "stuck closed"), Quarantined("tip", "chattering", used=True))
    terminal = Terminal()
    health = HealthReport(0, 100.0, 90.0, 120, 0, 0, 0, quarantined=wrong)
    health = replace(health, outputs=(OutputTrouble("recording", "the disk is full"),))
    with LiveView(Console(terminal, width=80)) as view:
        view.show(grasp("first"), nobody, health)
        for said in ("palm", "stuck closed, treated as lost", "chattering, still used", "the disk is full"):
            assert said in terminal.getvalue()


def test_the_newest_grasp_is_drawn_ten_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 7.0
    monkeypatch.setattr("thenar.cli.run_command.monotonic", lambda: now_s)
    terminal = Terminal()
    health = HealthReport(0, 100.0, 90.0, 120, 0, 0, 0)
    with LiveView(Console(terminal, width=80)) as view:
        view.show(grasp("first"), nobody)
        now_s += 0.099
        view.show(grasp("between"), nobody)
        now_s += 0.002
        view.show(grasp("second"), lambda: (DeviceHealth("glove", False, "no such port"),), health)
    for said in ("first", "second", "no such port"):
        assert said in terminal.getvalue()
    assert "between" not in terminal.getvalue()
