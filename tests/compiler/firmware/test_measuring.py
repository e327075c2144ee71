from collections.abc import Callable
from dataclasses import replace

import pytest
from msgspec import structs

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.measuring import Measured, measure
from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

# Compilers and simulators of whole programs: minutes, together.
pytestmark = pytest.mark.slow

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Tool = Callable[[str], str]


@pytest.fixture
def build(make_tables: MakeTables, describe: Describe) -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


def measured(build: Build, platform: str) -> Measured:
    firmware = Firmware(build.tables, build.manifest, platform)
    return measure(firmware.library(), firmware.fit)


@pytest.mark.parametrize("platform", ["avr328p", "avr2560"])
def test_on_an_avr_nothing_is_beyond_its_bound_and_all_that_is_static_is_counted(
    build: Build, platform: str, tool: Tool
) -> None:
    tool("avr-gcc")
    found = measured(build, platform)
    assert (found.holds, found.unit) == (True, "cycles")
    assert found.most_time * 0.9 < found.time <= found.most_time
    # Scores, and the input at least: groups and codes.
    assert found.ram >= 2 * 5 + 3 + 2
    assert found.stack
    assert found.most_update_time * 0.9 < found.update_time <= found.most_update_time
    assert f"at most {found.time} cycles a frame (bound {found.most_time}), " in found.note
    assert f"{found.update_time} by update() (bound {found.most_update_time}); " in found.note
    assert f"{found.flash} bytes of flash (bound {found.most_flash}), {found.flash_classify} where " in found.note
    assert f"{found.ram} bytes of RAM and {found.stack} of stack (bound {found.most_ram})." in found.note


def test_a_program_that_only_classifies_has_no_update(build: Build, tool: Tool) -> None:
    tool("avr-gcc")
    found = measured(build, "avr328p")
    assert found.flash - found.flash_classify > 80
    assert found.flash_classify <= found.most_flash_classify < found.most_flash


def test_a_bound_that_is_broken_does_not_hold(build: Build, tool: Tool) -> None:
    tool("avr-gcc")
    found = measured(build, "avr328p")
    assert found.stack is not None
    assert not replace(found, most_time=found.time - 1).holds
    assert not replace(found, most_update_time=found.update_time - 1).holds
    assert not replace(found, most_flash=found.flash - 1).holds
    assert not replace(found, most_flash_classify=found.flash_classify - 1).holds
    assert not replace(found, most_ram=found.ram + found.stack - 1).holds
    assert replace(found, most_time=found.time, most_flash=found.flash, most_ram=found.ram + found.stack).holds


def test_the_bound_of_flash_grows_with_long_names(make_tables: MakeTables, describe: Describe, tool: Tool) -> None:
    tool("avr-gcc")
    tables = make_tables()
    build = Build(describe(tables), tables)
    names = structs.replace(
        build.manifest,
        grasps=tuple(
            f"a grasp with a name of such a length that no bound has room, number {n}, {40 * '.'}" for n in range(5)
        ),
    )
    firmware = Firmware(tables, names, "avr328p")
    found = measure(firmware.library(), firmware.fit)
    assert found.holds
    assert found.flash > firmware.fit.choice.cost.flash


def test_on_this_machine_nothing_is_counted(build: Build) -> None:
    firmware = Firmware(build.tables, build.manifest, "host")
    with pytest.raises(FirmwareError, match="nothing can be measured"):
        measure(firmware.library(), firmware.fit)


def test_without_the_tools_it_says_what_to_install(build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(FirmwareError, match=r"atmega328p cannot be measured here: .*apt-get install"):
        measured(build, "avr328p")
