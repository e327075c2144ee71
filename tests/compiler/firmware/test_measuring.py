import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.costs import Measured, fit_for, measure
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build

from ...conftest import tool

# Compilers and simulators of whole programs: minutes, together.
pytestmark = pytest.mark.slow


def measured(build: Build, platform: str) -> Measured:
    fit = fit_for(TARGETS[platform], build.tables)
    return measure(Library("glove", build.manifest, fit.layout), fit)


@pytest.mark.parametrize("platform", ["avr328p", "avr2560"])
def test_all_that_is_static_is_counted_and_said(build: Build, platform: str) -> None:
    tool("avr-gcc")
    found = measured(build, platform)
    assert found.unit == "cycles"
    # Scores, and the input at least: groups and codes.
    assert found.ram >= 2 * 5 + 3 + 2
    assert found.stack
    assert f"at most {found.time} cycles a frame; {found.flash} bytes of flash; " in found.note
    assert f"{found.ram} bytes of RAM and {found.stack} of stack." in found.note


def test_on_this_machine_nothing_is_counted(build: Build) -> None:
    with pytest.raises(FirmwareError, match="nothing was counted on host"):
        measured(build, "host")


def test_without_the_tools_it_says_what_to_install(build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(FirmwareError, match=r"atmega328p cannot be measured here: .*apt-get install"):
        measured(build, "avr328p")
