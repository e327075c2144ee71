from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.runtime.calibration import load_lines
from thenar.runtime.code_line import code_line
from thenar.runtime.manifest import Calibration, Switch, Threshold
from thenar.runtime.scanning.scanmap import Port, ScanMap, StreamRead
from thenar.runtime.taxels import (
    LiveTaxel,
    TaxelCalibration,
    TaxelLine,
    count_limit,
    in_counts,
    learnt_lines,
)

from ..gloves import pad_line

COUNTS = Calibration(0, "pad", "counts", 0, 0.0, 1, 1.0)
NEWTONS = Calibration(0, "pad", "N", 10, 0.0, 210, 2.0)
RISING = pad_line("pad", 100, 900)

counts = st.integers(0, 65535)


def lines(name: str = "pad") -> st.SearchStrategy[TaxelLine]:
    ends = st.tuples(counts, counts).filter(lambda both: both[0] != both[1])
    return st.builds(
        lambda both, value: pad_line(name, both[0], both[1], value), ends, st.floats(0.01, 100, allow_nan=False)
    )


def taxel(line: TaxelLine | None, *limits: int) -> LiveTaxel:
    calibration = None if line is None else TaxelCalibration(sensors=(line,))
    levels = [(limit, number) for number, limit in enumerate(limits)]
    return LiveTaxel("pad", levels, calibration, highest=1023)


def closes(limit: int, raw: int) -> bool:
    return taxel(None, limit).read(raw)[0] == 1


@given(
    line=lines(),
    points=st.tuples(counts, counts).filter(lambda both: both[0] != both[1]),
    value=st.floats(-50, 50).filter(lambda number: abs(number) > 0.01),
    code=counts,
    tried=st.lists(counts, max_size=20),
)
def test_a_level_is_decided_as_the_build_codes_values(
    line: TaxelLine, points: tuple[int, int], value: float, code: int, tried: list[int]
) -> None:
    coded = Calibration(0, "pad", "N", points[0], 0.0, points[1], value)
    try:
        codes = code_line(coded, line)
    except SettingError:
        assume(False)
    limit = count_limit(Threshold(code, 0.0, coded), TaxelCalibration(unit="N", sensors=(line,)))
    edge = limit if limit >= 0 else ~limit
    for raw in {*tried, *(near for near in (edge - 1, edge, edge + 1, 0, 65535) if 0 <= near < 65536)}:
        assert closes(limit, raw) == (codes.code(raw) > code)


@given(counts, counts)
def test_without_a_calibration_counts_are_codes(code: int, raw: int) -> None:
    assert closes(count_limit(Threshold(code, 0.0, COUNTS), None), raw) == (raw > code)


def test_codes_that_are_no_counts_need_a_calibration() -> None:
    threshold = Threshold(100, 0.9, NEWTONS)
    with pytest.raises(SettingError, match=r"coded in 'N', not in counts.*thenar calibrate --taxels"):
        count_limit(threshold, None)
    with pytest.raises(SettingError, match="calibration lacks it"):
        count_limit(threshold, TaxelCalibration(unit="N", sensors=(pad_line("other", 1, 2),)))
    with pytest.raises(SettingError, match="calibrated in 'press', but 'pad' of the build is in 'N'"):
        count_limit(threshold, TaxelCalibration(sensors=(RISING,)))


@pytest.mark.parametrize(
    ("rest", "press", "raw", "found"),
    [
        (400, 900, 0, "open wire"),
        (400, 900, 1, "open wire"),
        (400, 900, 2, ""),
        (400, 900, 1022, "saturated"),
        (400, 900, 1021, ""),
        (600, 100, 1023, "open wire"),
        (600, 100, 0, "saturated"),
        (5, 900, 0, ""),  # a pad that rests at the converter's end cannot be told from an open wire
        (400, 1015, 1023, ""),  # nor can one be saturated that reached the end when it was calibrated
    ],
)
def test_ends_of_the_converter(rest: int, press: int, raw: int, found: str) -> None:
    pad = taxel(pad_line("pad", rest, press), 500)
    closed, lost = pad.read(raw)
    assert (pad.fault, lost) == (found, 1 if found else 0)
    assert not closed & lost


def test_what_could_not_be_read_is_lost_and_the_rest_is_not() -> None:
    one, two = LiveTaxel("one", [(10, 0), (20, 2)]), LiveTaxel("two", [(10, 1)])
    assert (one.owned, two.owned) == (0b101, 0b010)
    assert (one.read(None), two.read(11)) == ((0, 0b101), (0b010, 0))
    assert (one.fault, two.fault) == ("silent", "")
    assert (one.read(15), two.read(None)) == ((0b001, 0), (0, 0b010))


def test_a_calibration_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = TaxelCalibration(subject="anna", unit="N", sensors=(pad_line("a", 3, 800, 2.5), pad_line("b", 900, 80)))
    file = tmp_path / "anna.toml"
    file.write_text(written.to_toml())
    assert load_lines(file, TaxelCalibration) == written


@pytest.mark.parametrize(
    ("sensor", "said"),
    [
        ({"raw_b": "5"}, "raw_a and raw_b are both 5, which makes no line"),
        ({"value_b": "0.0"}, "a press must be above that of rest"),
        ({"value_b": "-2.0"}, "a press must be above that of rest"),
        ({"value_a": "3.0"}, "a press must be above that of rest"),
        ({"value_a": "-1e300", "value_b": "1e300"}, "a press must be above that of rest"),
        ({"raw_b": "70000"}, "raw_b"),
    ],
)
def test_a_wrong_calibration_is_refused(tmp_path: Path, sensor: dict[str, str], said: str) -> None:
    file, usual = (
        tmp_path / "wrong.toml",
        {"name": "'a'", "raw_a": "5", "value_a": "0.0", "raw_b": "9", "value_b": "1.0"},
    )
    file.write_text(f"sensor = [{{{', '.join(f'{key} = {value}' for key, value in (usual | sensor).items())}}}]")
    with pytest.raises(SettingError, match=said):
        load_lines(file, TaxelCalibration)


@given(
    rest=st.integers(0, 1000),
    noise=st.integers(0, 5),
    press=st.integers(0, 1000),
    glitches=st.lists(st.integers(0, 1023), max_size=2),
)
def test_rest_and_press_are_learnt_though_there_are_glitches(
    rest: int, noise: int, press: int, glitches: list[int]
) -> None:
    rested = [(rest - noise,), (rest,), (rest,), (rest + noise,), (rest,), (None,)]
    pressed = [(code,) for code in (*[rest] * 9, *glitches, *[rest] * 9, *[press] * 9, *[rest] * 9)]
    moved = abs(press - rest) >= max(10, 6 * noise)
    assert learnt_lines(["pad"], rested, pressed, 2.0) == ((pad_line("pad", rest, press, 2.0),) if moved else ())


def test_a_taxel_that_was_never_read_is_not_learnt() -> None:
    assert learnt_lines(["a", "b"], [(None, 5)], [(None, 500)] * 9, 1.0) == (pad_line("b", 5, 500),)


def test_a_scan_map_is_turned_into_counts() -> None:
    switches = [Switch(0, "s", 0.0), Switch(1, "pad>60", 0.0, Threshold(60, 0.5, NEWTONS))]
    port = Port(0, 0, "CH3", (), True, ((60, 1),))
    ports = (port, Port(0, 1, "A", ((0, 0),), False))
    scan = ScanMap(1, ports, (StreamRead((), ((3, 60, 1),)),))
    counted = in_counts(scan, switches, TaxelCalibration(unit="N", sensors=(pad_line("pad", 100, 900, 2.0),)))
    # Above 0.5 N by half a code of 0.01 N, of 400 counts a newton.
    assert counted.ports[0].levels == ((302, 1),)
    assert counted.streams == (StreamRead((), ((3, 302, 1),)),)
    assert counted.ports[1] == scan.ports[1]
