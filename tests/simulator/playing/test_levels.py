from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.harness.wiring import ChipWiring
from thenar.simulator.playing.bench import levels_of

NAMES = ("a", "b", "c")


def chip(closed: str) -> ChipWiring:
    return ChipWiring(kind="pcf8574", address=0x20, pins={"P0": "a", "P3": "b", "P7": "elsewhere"}, closed=closed)  # type: ignore[arg-type]


@given(st.lists(st.booleans(), min_size=3, max_size=3))
def test_closed_switches_pull_their_pins_to_the_level_of_closed(closed: list[bool]) -> None:
    numbers = {name: number for number, name in enumerate(NAMES)}
    shut = closed[0] << 0 | closed[1] << 3
    assert levels_of(chip("high"), closed, numbers) & 0xFF == shut
    assert ~levels_of(chip("low"), closed, numbers) & 0xFF == shut
