from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.choose import Choice, Option, choose, flash_shares, frontier
from thenar.compiler.firmware.costs import Cost
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.probes import extreme_frames, joined, random_frames
from thenar.compiler.firmware.targets import TARGETS, Target
from thenar.compiler.tables.quantise import integer_scores
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
SMALL = TARGETS["avr328p"]


@pytest.fixture(scope="module")
def tables(make_tables: MakeTables) -> IntegerTables:
    return make_tables(1, classes=14, switches=33, joints=16, bins=16, reach=12)


@pytest.fixture(scope="module")
def wide_tables(make_tables: MakeTables) -> IntegerTables:
    return make_tables(1, classes=14, switches=33, joints=16, bins=16, reach=300)


@pytest.fixture(scope="module")
def small(tables: IntegerTables) -> Choice:
    return choose(tables, SMALL)


def _scaled(target: Target, flash: int) -> Target:
    return replace(target, flash=flash)


@pytest.mark.parametrize("part", list(TARGETS))
def test_what_is_chosen_is_the_fastest_that_fits_and_costs_what_it_says(tables: IntegerTables, part: str) -> None:
    target = TARGETS[part]
    found = choose(tables, target)
    assert found.cost == target.cost(found.layout)
    assert found.layout.tables is tables
    fitting = [cost for _, cost in found.frontier if cost.flash <= flash_shares(target)[0]]
    assert found.cost == min(fitting, key=lambda cost: cost.cycles)


def test_the_frontier_runs_from_fast_and_large_to_slow_and_small(small: Choice) -> None:
    costs = [cost for _, cost in small.frontier]
    assert len(costs) > 4
    assert [cost.cycles for cost in costs] == sorted({cost.cycles for cost in costs})
    assert [cost.flash for cost in costs] == sorted({cost.flash for cost in costs}, reverse=True)


@given(st.lists(st.tuples(st.integers(1, 30), st.integers(1, 30)), min_size=1, max_size=40))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_nothing_is_both_faster_and_smaller_than_what_is_on_the_frontier(
    tables: IntegerTables, pairs: list[tuple[int, int]]
) -> None:
    layout = arrange(tables)
    options: list[Option] = [(layout, Cost(cycles, cycles, flash, flash, 1)) for cycles, flash in pairs]
    kept = {(cost.cycles, cost.flash) for _, cost in frontier(options)}
    for pair in pairs:
        beaten = any(other != pair and other[0] <= pair[0] and other[1] <= pair[1] for other in pairs)
        assert (pair in kept) == (not beaten)


def test_less_flash_makes_it_slower_until_nothing_fits(tables: IntegerTables, small: Choice) -> None:
    best = small.frontier
    assert best[0][1].flash > SMALL.flash
    roomy = _scaled(SMALL, 64 << 10)
    for _, cost in (best[0], best[2], best[-1]):
        assert choose(tables, roomy, flash=cost.flash).cost == cost
    with pytest.raises(FirmwareError, match=r"smallest layout for atmega328p takes .* bytes of flash") as refused:
        choose(tables, SMALL, flash=best[-1][1].flash - 1)
    assert "--table-bits 8" in str(refused.value)


def test_half_of_the_flash_is_taken_or_three_quarters_where_less_will_not_do(
    tables: IntegerTables, small: Choice
) -> None:
    smallest = small.frontier[-1][1].flash
    assert flash_shares(SMALL) == (16 << 10, 24 << 10)
    assert flash_shares(TARGETS["avr2560"]) == (48 << 10, 48 << 10)
    assert choose(tables, _scaled(SMALL, 2 * smallest)).cost.flash == smallest
    tight = _scaled(SMALL, 2 * smallest - 2)
    assert smallest <= choose(tables, tight).cost.flash <= flash_shares(tight)[1]
    with pytest.raises(FirmwareError, match="larger part"):
        choose(tables, _scaled(SMALL, 4 * smallest // 3 - 2))


def test_too_little_ram_is_refused(tables: IntegerTables) -> None:
    with pytest.raises(FirmwareError, match="of RAM"):
        choose(tables, replace(SMALL, ram=60))


def test_narrow_entries_are_chosen_where_the_tables_allow_them_and_they_are_allowed(
    tables: IntegerTables, wide_tables: IntegerTables, small: Choice
) -> None:
    assert small.layout.entry_bits == 8
    assert choose(tables, SMALL, flash=30000, entry_bits=16).layout.entry_bits == 16
    assert choose(wide_tables, SMALL, flash=30000).layout.entry_bits == 16
    with pytest.raises(FirmwareError, match="an 8-bit entry holds 255"):
        choose(wide_tables, SMALL, entry_bits=8)


# Parts whose compilers make the portable C, which adds words of 16-bit sums.
IN_WORDS = pytest.mark.parametrize("part", ["cortex-m0plus", "cortex-m4", "rv32imac", "host"])


@IN_WORDS
def test_narrow_entries_are_chosen_where_many_rows_are_added_before_they_are_taken_apart(
    tables: IntegerTables, part: str
) -> None:
    """Four 8-bit entries share a word."""
    target, (wide, narrow) = TARGETS[part], (arrange(tables, entry_bits=bits) for bits in (16, 8))
    assert narrow.sum_bits == 16
    assert len(narrow.batches) < len(narrow.lookups) / 4
    slower, faster = target.cost(wide), target.cost(narrow)
    assert faster.cycles < slower.cycles
    assert faster.flash < slower.flash
    assert choose(tables, target).layout.entry_bits == 8


@IN_WORDS
def test_where_few_rows_fill_a_byte_narrow_entries_are_slower_and_chosen_for_flash_alone(
    make_tables: MakeTables, part: str
) -> None:
    tables, target = make_tables(1, classes=14, switches=33, joints=16, bins=16, reach=40), TARGETS[part]
    wide, narrow = (arrange(tables, group_size=3, entry_bits=bits) for bits in (16, 8))
    assert len(narrow.batches) > len(narrow.lookups) / 4
    faster, slower = target.cost(wide), target.cost(narrow)
    assert faster.cycles < slower.cycles
    assert faster.flash > slower.flash
    found = choose(tables, target)
    assert found.layout.entry_bits == 16
    assert choose(tables, target, flash=found.frontier[-1][1].flash).layout.entry_bits == 8


@pytest.mark.parametrize("part", list(TARGETS))
def test_scores_are_the_proved_ones_however_wide_the_entries_chosen_are(
    tables: IntegerTables, wide_tables: IntegerTables, part: str
) -> None:
    """Rows of a build that was compiled with 16 table bits may fit in bytes, and are exact there too."""
    for each, width in ((tables, 8), (wide_tables, 16)):
        layout = choose(each, TARGETS[part], flash=min(TARGETS[part].flash, 64 << 10)).layout
        assert layout.entry_bits == width
        frames = joined(extreme_frames(each), random_frames(each, 200, 1))
        scores = integer_scores(each, frames.bits, frames.codes)
        assert np.abs(scores).max() > 127
        assert np.array_equal(layout.scores(frames.bits, frames.codes), scores)


def test_builds_of_both_widths_share_a_frontier(
    tables: IntegerTables, wide_tables: IntegerTables, small: Choice
) -> None:
    both = frontier([*small.frontier, *choose(wide_tables, SMALL, flash=30000).frontier])
    assert {layout.tables is tables for layout, _ in both} == {True}
    assert [cost for _, cost in both] == [cost for _, cost in small.frontier]


def test_why_is_said_in_a_sentence(tables: IntegerTables, small: Choice) -> None:
    found = small
    assert found.why.startswith("8-bit entries, up to ")
    assert " switches per lookup, codes " in found.why
    times = f"{found.cost.cycles} cycles ({found.cost.update_cycles} by update())"
    assert found.why.endswith(f"bytes of flash, at most {times} and {found.cost.flash} bytes")
    found = choose(tables, TARGETS["cortex-m4"])
    times = f"{found.cost.cycles} instructions ({found.cost.update_cycles} by update())"
    assert found.why.endswith(f"bytes of flash, about {times} and {found.cost.flash} bytes")


def test_no_more_flash_is_allowed_than_the_part_has(tables: IntegerTables) -> None:
    assert choose(tables, SMALL, flash=32768).cost.flash <= 32768
    with pytest.raises(FirmwareError, match=r"allowed 32769 bytes of flash: an atmega328p has 32768 bytes$"):
        choose(tables, SMALL, flash=32769)


@pytest.mark.parametrize(("switches", "joints"), [(0, 3), (5, 0), (1, 0)])
def test_builds_that_lack_a_kind_of_input_have_layouts_too(make_tables: MakeTables, switches: int, joints: int) -> None:
    tables = make_tables(1, switches=switches, joints=joints)
    frames = np.ones((1, switches), bool), np.full((1, joints), 7, np.uint16)
    for target in TARGETS.values():
        found = choose(tables, target)
        assert np.array_equal(found.layout.scores(*frames), arrange(tables).scores(*frames))
        assert ("switches per lookup" in found.why, "codes" in found.why) == (switches > 0, joints > 0)


def test_tables_without_inputs_are_refused(make_tables: MakeTables) -> None:
    with pytest.raises(FirmwareError, match="no switch and no joint"):
        choose(make_tables(1, switches=0, joints=0), SMALL)


def test_no_layout_for_an_avr_has_more_rows_than_its_compiler_makes_in_an_array(
    make_tables: MakeTables,
) -> None:
    """Of 47 switches and 15 types, groups of eight need 45 KB; an ATmega2560 has the flash."""
    many = make_tables(1, classes=15, switches=47, joints=0, reach=300)
    for layout, _ in choose(many, TARGETS["avr2560"]).frontier:
        assert layout.n_rows * layout.parts.width * len(layout.parts.firsts) * layout.entry_bits // 8 <= 32767
