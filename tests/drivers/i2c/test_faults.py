"""Each fault is injected into a running bus, over the real ioctl path; nothing false may ever be read."""

import errno
from collections.abc import Callable
from typing import Any

import pytest

# Most of them wait for a bus that is tried again once a second.
pytestmark = pytest.mark.slow

MakeRig = Callable[..., Any]
RECOVERY_S = 10.0  # a second until the next try, and what a loaded machine adds

TWO = [("mcp23017", 0x20), ("pca9555", 0x21)]
LEVELS = [0xA57E | 0x8080, 0x9B2D]
BOTH = [(0, "AB"), (1, "01")]
MUXED = [("mcp23017", 0x20, 0x70, 2), ("mcp23017", 0x20, 0x70, 5)]
MUXED_LEVELS = [0xA57E | 0x8080, 0x93EC | 0x8080]


def running(rig: MakeRig, chips: list[tuple[Any, ...]] = TWO, levels: list[int] = LEVELS, **how: Any) -> Any:
    glove = rig(*chips, **how)
    glove.emulated.set_all([levels])
    glove.client.ask("prepare", BOTH if chips is TWO else [(n, "AB") for n in range(len(chips))])
    assert glove.client.ask("read") == levels
    return glove


def begun(rig: MakeRig, *fault: Any, **how: Any) -> Any:
    """Open and prepare a bus that has a fault by then."""
    glove = rig(*TWO, opened=False, **how)
    glove.emulated.set_all([LEVELS])
    glove.emulated.fault(0, *fault)
    glove.client.ask("open")
    glove.client.ask("prepare", BOTH)
    return glove


def recovers(glove: Any, levels: list[int], *, by_way_of: list[list[int | None]]) -> None:
    """The right answer comes back, and before it only answers out of `by_way_of`."""
    met = glove.client.ask("read_until", levels, RECOVERY_S)
    assert met[-1] == levels
    assert all(answer in by_way_of for answer in met[:-1])


@pytest.mark.parametrize("adapter", ["any", "i2c-gpio", "designware", "bcm2835"])
def test_a_chip_that_stops_acknowledging_is_lost_alone_and_comes_back(rig: MakeRig, adapter: str) -> None:
    glove = running(rig, adapter=adapter)
    glove.emulated.fault(0, "remove", 0)
    assert glove.client.ask("read") == [None, LEVELS[1]]
    gone, other = glove.client.state().chips
    assert (gone.present, other.present) == (False, True)
    assert "/dev/i2c-7: the mcp23017 at 0x20 does not reply: check its supply, its wires" in gone.last_error
    assert not other.errors
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, LEVELS[1]]])


def test_a_nak_is_known_by_every_errno_that_adapters_give_it(rig: MakeRig) -> None:
    codes = (errno.EREMOTEIO, errno.ENXIO, errno.ENODEV)
    glove = rig(*(("mcp23017", 0x20 + n) for n in range(4)))
    glove.client.ask("prepare", [(n, "A") for n in range(4)])
    for number, code in enumerate(codes):
        glove.emulated.fault(0, "fail", code, address=0x20 + number)
    assert glove.client.ask("read") == [None, None, None, 0xFF]
    for code, chip in zip(codes, glove.client.state().chips, strict=False):
        assert f"does not reply: check its supply, its wires and its address pins (errno {code})" in chip.last_error


@pytest.mark.parametrize("code", [errno.EIO, errno.ETIMEDOUT, errno.EAGAIN, errno.EREMOTEIO, errno.EBUSY])
def test_a_transfer_that_fails_twice_is_retried_within_the_scan(rig: MakeRig, code: int) -> None:
    glove = running(rig)
    glove.emulated.fault(0, "fail", code, address=0x21, times=3)  # the batch, and twice alone
    assert glove.client.ask("read") == LEVELS
    assert [chip.errors for chip in glove.client.state().chips] == [0, 2]


@pytest.mark.parametrize("code", [errno.EIO, errno.ETIMEDOUT, errno.EAGAIN, errno.EBUSY])
def test_a_failing_chip_is_given_up_and_tried_once_a_second(rig: MakeRig, code: int) -> None:
    glove = running(rig, check_every_s=3600.0)
    glove.emulated.fault(0, "fail", code, address=0x20)
    before = glove.client.state()
    assert glove.client.ask("read") == [None, LEVELS[1]]
    state = glove.client.state()
    assert state.chips[0].errors - before.chips[0].errors == 3
    assert f"(errno {code})" in state.chips[0].last_error
    assert glove.client.ask("read_until", [], 2.5) == [[None, LEVELS[1]]]
    assert glove.client.state().chips[0].errors - state.chips[0].errors in (1, 2)
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, LEVELS[1]]])


@pytest.mark.parametrize("code", [errno.EOPNOTSUPP, errno.EINVAL])
def test_an_adapter_that_refuses_batches_while_running_is_asked_for_less(rig: MakeRig, code: int) -> None:
    glove = running(rig)
    assert glove.client.state().way.startswith("all ports between")
    glove.emulated.fault(0, "fail", code, batches=True)
    assert [glove.client.ask("read") for _ in range(3)] == [LEVELS] * 3
    state = glove.client.state()
    assert state.way == "all ports of a chip in one transfer"
    assert not any(chip.errors for chip in state.chips)


def test_an_address_claimed_by_a_kernel_driver_is_left_alone(rig: MakeRig) -> None:
    glove = begun(rig, "claim", 0x20)
    assert glove.client.ask("read") == [None, LEVELS[1]]
    assert "a kernel driver has the address" in glove.client.state().chips[0].last_error
    assert not any(place[0] == 0x20 for place in glove.traffic())
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, LEVELS[1]]])


@pytest.mark.parametrize("adapter", ["i2c-gpio", "designware", "bcm2835"])
def test_a_line_held_low_gives_no_answers_advice_and_recovers(rig: MakeRig, adapter: str) -> None:
    """i2c-gpio notices nothing: there every byte reads 0, as if every switch were closed."""
    glove = running(rig, adapter=adapter)
    glove.emulated.fault(0, "hold_sda")
    assert glove.client.ask("read") == [None, None]
    assert "/dev/i2c-7 is stuck" in glove.client.state().fault_message
    assert "clock SCL nine times" in glove.client.state().fault_message
    before = glove.client.state().transfers
    assert glove.client.ask("read_until", [], 2.5) == [[None, None]]
    assert glove.client.state().transfers - before <= 4  # tried once a second, not in every scan
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, None], [LEVELS[0], None], [None, LEVELS[1]]])
    assert glove.client.state().fault_message == ""


def test_zeros_from_a_line_held_low_are_no_closed_switches(rig: MakeRig) -> None:
    """A PCA9555 has no pin that must read 1: the zeros themselves are looked into."""
    chips = [("pca9555", 0x20), ("pca9555", 0x21)]
    glove = rig(*chips, adapter="i2c-gpio", check_every_s=3600.0)
    glove.client.ask("prepare", [(0, "0"), (1, "01")])
    assert glove.client.ask("read") == [0xFF, 0xFFFF]
    glove.emulated.fault(0, "hold_sda")
    assert glove.client.ask("read") == [None, None]


@pytest.mark.parametrize("adapter", ["bcm2835", "i2c-gpio"])
def test_a_chip_that_waits_amid_a_byte_is_clocked_free(rig: MakeRig, adapter: str) -> None:
    glove = running(rig, adapter=adapter)
    glove.emulated.fault(0, "hold_sda", transfers=4)
    recovers(glove, LEVELS, by_way_of=[[None, None], [LEVELS[0], None], [None, LEVELS[1]]])


@pytest.mark.parametrize("adapter", ["any", "i2c-gpio"])
def test_a_line_held_low_at_open_is_reported_without_error(rig: MakeRig, adapter: str) -> None:
    glove = begun(rig, "hold_sda", adapter=adapter)
    assert glove.client.ask("read") == [None, None]
    assert "is stuck" in glove.client.state().fault_message
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, None], [LEVELS[0], None], [None, LEVELS[1]]])


def test_eight_closed_switches_are_believed_on_a_line_that_is_free(rig: MakeRig) -> None:
    glove = running(rig, check_every_s=3600.0)
    glove.emulated.set_levels(0, 1, 0x0000)
    assert glove.client.ask("read") == [LEVELS[0], 0]
    before = glove.client.state().transfers
    assert glove.client.ask("read") == [LEVELS[0], 0]
    assert glove.client.state().transfers - before == 1  # looked into once


@pytest.mark.parametrize(
    ("said", "there"),
    [("mcp23017", "pcf8574"), ("mcp23017", "mcp23008"), ("pca9555", "mcp23017"), ("pcf8574", "pca9555")],
)
def test_another_chip_than_the_harness_says_is_found_out_and_named(rig: MakeRig, said: str, there: str) -> None:
    glove = rig((said, 0x20), ("mcp23017", 0x21), opened=False)
    glove.emulated.replace(0, 0, there)
    glove.client.ask("open")
    glove.client.ask(
        "prepare", [(0, "P" if said == "pcf8574" else {"mcp23017": "AB", "pca9555": "01"}[said]), (1, "AB")]
    )
    assert glove.client.ask("read") == [None, 0xFFFF]
    state = glove.client.state().chips[0]
    assert not state.present
    assert (
        f"/dev/i2c-7: the {said} at 0x20 is not there, but something that behaves like a {there}: check the harness"
        in state.last_error
    )


def test_a_chip_swapped_while_running_is_found_out_and_soon_tried_again(rig: MakeRig) -> None:
    """What seems another chip may be a contact that came and went while the chip was set up."""
    glove = running(rig, check_every_s=0.05)
    glove.emulated.replace(0, 0, "pcf8574")
    assert glove.client.ask("read_until", [None, LEVELS[1]], RECOVERY_S) == [[None, LEVELS[1]]]
    assert "behaves like a pcf8574" in glove.client.state().chips[0].last_error
    glove.emulated.replace(0, 0, "mcp23017")
    glove.emulated.set_all([LEVELS])
    assert glove.client.ask("read_until", LEVELS, RECOVERY_S / 2)[-1] == LEVELS


def test_a_mux_that_was_reset_is_selected_again_within_the_scan(rig: MakeRig) -> None:
    glove = running(rig, [MUXED[0]], MUXED_LEVELS[:1], check_every_s=3600.0)
    glove.emulated.fault(0, "poke_mux", 0x70, 0)
    assert glove.client.ask("read") == MUXED_LEVELS[:1]
    assert not glove.client.state().chips[0].errors


def test_a_mux_reset_during_absence_is_selected_for_the_return(rig: MakeRig) -> None:
    glove = running(rig, [MUXED[0]], MUXED_LEVELS[:1])
    glove.emulated.fault(0, "remove", 0)
    assert glove.client.ask("read") == [None]
    glove.emulated.fault(0, "poke_mux", 0x70, 0)
    glove.emulated.fault(0, "heal")
    recovers(glove, MUXED_LEVELS[:1], by_way_of=[[None]])


def test_a_mux_that_another_program_switched_is_noticed_by_its_register(rig: MakeRig) -> None:
    glove = running(rig, [MUXED[0], ("mcp23017", 0x21, 0x70, 2)], MUXED_LEVELS, check_every_s=0.05)
    glove.emulated.fault(0, "poke_mux", 0x70, 0x04 | 0x80)
    recovers(glove, MUXED_LEVELS, by_way_of=[])
    glove.client.ask("read_until", [], 0.3)
    assert any("tca9548a at 0x70 had lost its channel" in chip.last_error for chip in glove.client.state().chips)


def test_a_mux_that_is_gone_is_named_and_comes_back(rig: MakeRig) -> None:
    glove = running(rig, [*MUXED, ("mcp23017", 0x21)], [*MUXED_LEVELS, 0xFFF0])
    glove.emulated.fault(0, "remove_mux", 0x70)
    assert glove.client.ask("read") == [None, None, 0xFFF0]
    assert "the tca9548a at 0x70 does not reply" in glove.client.state().chips[0].last_error
    glove.emulated.fault(0, "heal")
    recovers(
        glove,
        [*MUXED_LEVELS, 0xFFF0],
        by_way_of=[[None, None, 0xFFF0], [MUXED_LEVELS[0], None, 0xFFF0], [None, MUXED_LEVELS[1], 0xFFF0]],
    )


TWO_MUXES = [("mcp23017", 0x20, 0x70, 3), ("mcp23017", 0x20, 0x71, 3)]
THEIR_LEVELS = [0x80F1, 0x9F80]  # both at once would read as 0x8080


@pytest.mark.parametrize("code", [errno.EIO, errno.EREMOTEIO, errno.EAGAIN])
def test_a_mux_that_stays_connected_is_asked_again_before_another(rig: MakeRig, code: int) -> None:
    glove = running(rig, TWO_MUXES, THEIR_LEVELS, check_every_s=3600.0)
    glove.client.ask("prepare", [(0, "AB")])
    assert glove.client.ask("read") == THEIR_LEVELS[:1]
    glove.client.ask("prepare", [(1, "AB")])
    glove.emulated.fault(0, "fail", code, address=0x70, times=1)
    assert glove.client.ask("read") == THEIR_LEVELS[1:]


def test_a_mux_that_stays_connected_blocks_others_and_is_named(rig: MakeRig) -> None:
    glove = running(rig, TWO_MUXES, THEIR_LEVELS, check_every_s=3600.0)
    glove.client.ask("prepare", [(0, "AB")])
    assert glove.client.ask("read") == THEIR_LEVELS[:1]
    glove.client.ask("prepare", [(1, "AB")])
    glove.emulated.fault(0, "fail", errno.EIO, address=0x70)
    assert glove.client.ask("read") == [None]
    assert "the tca9548a at 0x70 does not work" in glove.client.state().chips[1].last_error
    glove.emulated.fault(0, "heal")
    recovers(glove, THEIR_LEVELS[1:], by_way_of=[[None]])


def test_a_mux_that_is_gone_keeps_no_other_from_being_read(rig: MakeRig) -> None:
    glove = running(rig, TWO_MUXES, THEIR_LEVELS, check_every_s=3600.0)
    glove.emulated.fault(0, "remove_mux", 0x70)
    assert glove.client.ask("read") == [None, THEIR_LEVELS[1]]


def test_an_unusual_errno_for_a_nak_is_no_stuck_bus(rig: MakeRig) -> None:
    glove = rig(*TWO, opened=False, check_every_s=3600.0)
    glove.emulated.set_all([LEVELS])
    glove.emulated.fault(0, "fail", errno.EIO, address=0x7F)
    glove.client.ask("open")
    assert glove.client.state().fault_message == ""
    glove.client.ask("prepare", BOTH)
    glove.emulated.fault(0, "fail", errno.EIO, address=0x20)
    assert glove.client.ask("read") == [None, LEVELS[1]]
    assert glove.client.state().fault_message == ""


@pytest.mark.parametrize("leftover", [0x80, 0xA0, 0x20])
def test_a_chip_that_a_crash_left_in_another_bank_is_read_rightly(rig: MakeRig, leftover: int) -> None:
    glove = begun(rig, "poke", 0, 0x0A, leftover)
    assert glove.client.ask("read") == LEVELS


def test_a_chip_absent_at_open_is_used_once_it_comes(rig: MakeRig) -> None:
    glove = begun(rig, "remove", 0)
    assert glove.client.ask("read") == [None, LEVELS[1]]
    glove.emulated.fault(0, "heal")
    recovers(glove, LEVELS, by_way_of=[[None, LEVELS[1]]])


def test_a_chip_without_pull_ups_is_set_up_before_false_reads(rig: MakeRig) -> None:
    glove = running(rig, check_every_s=3600.0)
    glove.emulated.fault(0, "reset", 0)  # its open inputs float now, and read 0
    assert glove.client.ask("read") == LEVELS
    assert "had lost its registers" in glove.client.state().chips[0].last_error


def test_half_lost_pull_ups_show_at_the_unused_pin(rig: MakeRig) -> None:
    glove = running(rig, check_every_s=3600.0)
    glove.emulated.set_levels(0, 0, 0xFFFF)
    glove.emulated.fault(0, "poke", 0, 0x0C, 0x0F)
    assert glove.client.ask("read") == [0xFFFF, LEVELS[1]]


def test_a_reset_that_shows_in_no_port_is_noticed_within_a_check(rig: MakeRig) -> None:
    glove = running(rig, check_every_s=0.05)
    glove.emulated.fault(0, "reset", 1)
    assert glove.client.ask("read_until", [], 0.5) == [LEVELS]
    assert "had lost its registers" in glove.client.state().chips[1].last_error


def test_an_unplugged_adapter_is_an_error_until_it_is_back(rig: MakeRig) -> None:
    glove = running(rig)
    glove.emulated.unplug(0)
    assert glove.client.fails("read").startswith("DeviceError: /dev/i2c-7 cannot be opened: there is no such bus")
    assert "DeviceError" in glove.client.fails("open")
    assert "is not open" in glove.client.fails("read")
    glove.emulated.replug(0)
    glove.client.ask("open")
    assert glove.client.ask("read") == LEVELS


def test_an_adapter_that_was_away_between_two_scans_is_opened_anew(rig: MakeRig) -> None:
    glove = running(rig)
    glove.emulated.unplug(0)
    glove.emulated.replug(0)
    recovers(glove, LEVELS, by_way_of=[[None, None], [None, LEVELS[1]], [LEVELS[0], None]])


def test_a_killed_client_leaves_usable_chips(rig: MakeRig) -> None:
    glove = running(rig, MUXED, MUXED_LEVELS)
    glove.client.kill()
    glove.client = glove.another_client()
    glove.client.ask("open")
    glove.client.ask("prepare", [(0, "AB"), (1, "AB")])
    assert glove.client.ask("read") == MUXED_LEVELS
