from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

import pytest

from thenar.drivers.emulated.scanner import EmulatedScanner, ScannerBoard
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.errors import SettingError
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.wiring import Debounce, Harness, ScannerWiring
from thenar.runtime.live.checkup import Finding, check_up
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.sources.base import slowest_us
from thenar.runtime.sources.scanner import ScannerDevice
from thenar.runtime.taxels import TaxelCalibration, TaxelLine, TaxelSettings

LONG_S = 10.0
CODES = (100, 7, 600, 900)
NAMES = ("s0", "p0>400", "p2>500", "p2>300")
PADS = TaxelCalibration(taxels=(TaxelLine("p0", 300, 700), TaxelLine("p2", 300, 700)))


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "board", 1_000_000) as line:
        yield line


@pytest.fixture
def harness(line: PtyLine) -> Harness:
    scanner = ScannerWiring(port=str(line.link), switches=("s0", "s1"), taxels=("p0", "", "p2", "p3"))
    return Harness(name="pads", scanners=(scanner,), debounce=Debounce(enabled=False))


@pytest.fixture
def board(line: PtyLine) -> Iterator[EmulatedScanner]:
    with EmulatedScanner(line, 2, board=ScannerBoard(1, 2, channels=4)) as board:
        board.press(CODES)
        yield board


@pytest.fixture
def opened(harness: Harness) -> Iterator[Callable[..., ScannerDevice]]:
    with ExitStack() as stack:

        def open_(scan: ScanMap, changed: Harness | None = None) -> ScannerDevice:
            device = ScannerDevice(changed or harness, 0, NAMES, scan)
            stack.callback(device.close)
            device.open()
            return device

        yield open_


def until(device: ScannerDevice, wanted: Callable[[SwitchFrame], bool]) -> SwitchFrame:
    end, last = monotonic() + LONG_S, None
    while monotonic() < end:
        frame = device.read(0.5)
        last = frame or last
        if frame is not None and wanted(frame):
            return frame
    raise AssertionError(f"it never came, at last {last}")


def test_levels_are_bits_beside_the_keys(
    harness: Harness, board: EmulatedScanner, opened: Callable[..., ScannerDevice]
) -> None:
    device = opened(whole_scan(harness, NAMES))
    assert device.owned == 0b1111
    frame = until(device, lambda frame: not frame.lost)
    assert frame.closed == 0b1100
    # p3 has no level, so it is not asked for.
    assert frame.taxels == (100, 600, None)
    board.set(0b1)
    board.press((401, 0, 400, 0))
    until(device, lambda frame: frame.closed == 0b1011)
    board.press((400, 0, 300, 0))
    until(device, lambda frame: frame.closed == 0b0001)


def test_without_levels_all_taxels_are_read(
    harness: Harness, board: EmulatedScanner, opened: Callable[..., ScannerDevice]
) -> None:
    device = opened(whole_scan(harness, ("s0",)))
    assert until(device, lambda frame: frame.taxels is not None).taxels == (100, 600, 900)


def test_a_saturated_taxel_and_one_that_is_not_there_are_lost(
    harness: Harness, line: PtyLine, tmp_path: Path, opened: Callable[..., ScannerDevice]
) -> None:
    (tmp_path / "pads.toml").write_text(PADS.to_toml())
    calibrated = Harness(
        name="pads",
        scanners=harness.scanners,
        debounce=harness.debounce,
        taxel_settings=TaxelSettings(calibration=str(tmp_path / "pads.toml")),
    )
    with EmulatedScanner(line, 2, board=ScannerBoard(1, 2, channels=2)) as board:  # p2 is beyond its channels
        board.press((1023,))
        device = opened(whole_scan(harness, NAMES), calibrated)
        frame = until(device, lambda frame: frame.taxels is not None)
        assert (frame.closed, frame.lost, frame.taxels) == (0, 0b1110, (1023, None, None))
        assert device.trouble() == "taxels with faults: p0: saturated, p2: silent"
        board.press((500,))
        assert until(device, lambda frame: not frame.lost & 0b10).closed == 0b10
        assert device.trouble() == "taxels with faults: p2: silent"


def test_codes_of_long_ago_are_none(
    harness: Harness, board: EmulatedScanner, opened: Callable[..., ScannerDevice]
) -> None:
    """The board goes on telling of its keys, and no more of its channels, though it was asked to."""
    device = opened(whole_scan(harness, NAMES))
    until(device, lambda frame: not frame.lost)
    board.board.analog = ScannerBoard(1, 2, channels=4).analog
    frame = until(device, lambda frame: bool(frame.lost))
    assert (frame.closed, frame.lost, frame.taxels) == (0, 0b1110, None)


def test_a_board_without_channels_cannot_serve_a_glove_with_taxels(
    harness: Harness, line: PtyLine, opened: Callable[..., ScannerDevice]
) -> None:
    with (
        EmulatedScanner(line, 2),
        pytest.raises(SettingError, match="no analog channels, its firmware speaks version 1"),
    ):
        opened(whole_scan(harness, NAMES))


def test_a_board_of_levels_alone_is_heard_of(harness: Harness) -> None:
    assert slowest_us(harness, whole_scan(harness, ("p0>400",)), "switches") is not None
    assert slowest_us(harness, whole_scan(harness, ()), "switches") is None


def looked_at(harness: Harness) -> list[Finding]:
    return [finding for look in check_up(harness, whole_scan(harness, harness.switches)) for finding in look()]


def test_a_checkup_shows_counts_noise_and_faults_of_taxels(
    harness: Harness, board: EmulatedScanner, tmp_path: Path
) -> None:
    found = {finding.part: finding for finding in looked_at(harness)}
    assert "2 keys, 4 channels of 10 bits" in next(iter(found))
    assert found["taxel p0"].remarks == ("100 counts, noise 0.0, 0 from end to end",)
    board.press((0, 0, 1023, 500))
    found = {finding.part: finding for finding in looked_at(harness)}
    assert "at the end of the converter" in found["taxel p0"].remarks[1]
    assert all(finding.present for finding in found.values())
    (tmp_path / "pads.toml").write_text(PADS.to_toml())
    settings = TaxelSettings(calibration=str(tmp_path / "pads.toml"))
    calibrated = Harness(name="pads", scanners=harness.scanners, taxel_settings=settings)
    found = {finding.part: finding for finding in looked_at(calibrated)}
    assert (found["taxel p0"].present, found["taxel p0"].remarks[1]) == (False, "open wire")
    assert (found["taxel p2"].present, found["taxel p2"].remarks[1]) == (True, "saturated")
