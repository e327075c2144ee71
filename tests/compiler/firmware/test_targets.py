import pytest

from thenar.compiler.firmware.errors import FirmwareError
from thenar.compiler.firmware.targets import TARGETS, Target, target_of


def test_every_target_is_found_by_its_part() -> None:
    assert {part: target.part for part, target in TARGETS.items()} == {part: part for part in TARGETS}
    assert [target_of(part) for part in TARGETS] == list(TARGETS.values())
    assert {target.kind for target in TARGETS.values()} == {"host", "avr", "cortex-m"}


def test_an_atmega328p_has_32_kib_of_flash_and_2_of_ram() -> None:
    assert target_of("atmega328p") == Target("avr", "atmega328p", 32768, 2048, 16_000_000)


def test_a_part_that_is_none_is_refused_with_those_that_are() -> None:
    with pytest.raises(FirmwareError, match="no target 'attiny85': choose one of host, atmega328p, atmega2560"):
        target_of("attiny85")
