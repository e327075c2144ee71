"""What reading switches costs, port by port, and on a glove as it is wired."""

from math import fsum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.compiler.placement.ports import PortCosts, port_costs, ports_of_whole_glove
from thenar.compiler.samples import TrainingError
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

from ..conftest import names_of

sizes = st.integers(1, 200)


def test_a_port_that_is_read_anyway_costs_nothing_further() -> None:
    ports = PortCosts((0, 0, 1, 2), (10.0, 20.0, 40.0))
    assert (ports.marginal_costs(()) - 70_000).tolist() == [30_000, 30_000, 60_000, 120_000]
    assert (ports.marginal_costs((1, 3)) - 70_000).tolist() == [0, 0, 60_000, 0]


def test_a_port_is_shared_out_over_those_kept_on_it() -> None:
    ports = PortCosts((0, 0, 1, 1), (10.0, 30.0))
    assert ports.shares([0, 1, 3]).tolist() == [0.25, 0.25, 1.5]
    assert PortCosts((0,), (0.0,)).shares([0]).tolist() == [0.0]


@pytest.mark.parametrize(("port_of", "us"), [((1,), (1.0,)), ((-1,), (1.0,)), ((0,), (-1.0,)), ((0,), (float("nan"),))])
def test_ports_must_be_there_and_take_some_time(port_of: tuple[int, ...], us: tuple[float, ...]) -> None:
    with pytest.raises(TrainingError):
        PortCosts(port_of, us)


@given(sizes, st.sampled_from(["mcp23017", "pca9555", "tca6424a", "pcf8575"]))
def test_all_ports_together_cost_what_a_whole_scan_takes(size: int, kind: str) -> None:
    harness = propose_harness(names_of(size), kind)
    costs = port_costs(harness, names_of(size))
    assert fsum(costs.us) == pytest.approx(scan_us(whole_scan(harness, harness.switches), harness).us)
    assert sorted(set(costs.port_of)) == list(range(len(costs.us)))


def test_ports_behind_a_channel_share_its_selection() -> None:
    harness = propose_harness(names_of(130))
    costs = port_costs(harness, names_of(130))
    channels = [chip.mux and chip.mux.channel for chip in harness.buses[0].chips]
    assert set(channels) == {None, 0, 1}
    for port, channel in enumerate(channels[:-1]):
        share = 0 if channel is None else (20 * 2.5 + 1.3) / channels.count(channel)
        assert costs.us[port] == pytest.approx(48 * 2.5 + 1.3 + share)


def test_a_stream_is_one_port_that_costs_its_period() -> None:
    harness = propose_board([*names_of(50), "t0>4", "t0>7"])
    assert port_costs(harness, ["s3", "s40"]) == port_costs(harness, ["s40", "s3"])
    costs = port_costs(harness, ["s3", "t0>7", "t0>4"])
    assert (costs.port_of, costs.us) == ((0, 0, 0), (float(harness.streams[0].period_us),))


def test_a_switch_that_is_wired_to_nothing_is_named() -> None:
    with pytest.raises(HarnessError, match="'thumb'"):
        port_costs(propose_harness(["index"]), ["index", "thumb"])


def test_a_taxel_costs_a_conversion_on_its_or_a_new_converter() -> None:
    """An ADS1115 takes 38 and 48 SCL periods at 400 kHz and 1317 us between them; an ADS7828 48."""
    chips = (
        ChipWiring(kind="ads1115", address=0x48, pins={"AIN0": "t0", "AIN3": "t1"}),
        ChipWiring(kind="mcp23008", address=0x20, pins={"GP0": "s0"}),
    )
    harness = Harness(name="x", buses=(BusWiring(device="d", clock_hz=400_000, chips=chips),))
    own = ports_of_whole_glove(harness, ["s0", "t0", "t1"], 2)
    assert own is not None
    assert [own.us[port] for port in own.port_of] == pytest.approx([98.8, 96.3 + 1317 + 121.3, 96.3 + 1317 + 121.3])
    assert len(set(own.port_of)) == 3
    assert own == ports_of_whole_glove(harness, ["s0", "t0>7", "t1>9"])
    new = ports_of_whole_glove(None, ["s0", "t0", "t1"], 2)
    assert new is not None
    assert [new.us[port] for port in new.port_of] == pytest.approx([98.8, 121.3, 121.3])
    assert ports_of_whole_glove(harness, ["s0", "t2"], 1) is None
