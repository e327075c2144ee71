import os
import socket
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise, product
from pathlib import Path
from random import Random
from time import monotonic, monotonic_ns
from typing import Literal

import pytest

from thenar.drivers.cyberglove import CyberGlove
from thenar.drivers.cyberglove_protocol import MASK_18, MASK_22, SENSORS_18, SENSORS_22, Record, mask_of
from thenar.drivers.emulated.cyberglove import CyberGloveBox, Doubts, EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.serial_line import SerialLine

SOON_S = 10.0
VALUES = {18: bytes(range(60, 78)), 22: bytes(range(80, 102))}
DOUBTS = [Doubts(*choice) for choice in product([False, True], [False, True], [False, True])]


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "glove") as line:
        yield line


def read(glove: CyberGlove, wanted: Callable[[Record], bool] = lambda record: True) -> Record:
    """Return the next record that is wanted."""
    end = monotonic() + SOON_S
    while (left := end - monotonic()) > 0:
        timed = glove.read(left)
        if timed is not None and wanted(timed[1]):
            return timed[1]
    pytest.fail("no such record came")


@pytest.mark.parametrize("sensors", [18, 22])
def test_a_glove_is_found_and_read(line: PtyLine, sensors: int) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(sensors, "CyberGlove 2.4")) as emulated:
        emulated.set(VALUES[sensors])
        glove = CyberGlove(str(line.link))
        info = glove.open()
        assert (info.sensors, info.baud, info.right_hand) == (sensors, 115_200, True)
        assert info.names == {18: SENSORS_18, 22: SENSORS_22}[sensors]
        assert info.text == "CyberGlove 2.4"
        assert info.status
        assert info.notes == ()
        for _ in range(5):
            assert read(glove) == Record(VALUES[sensors], status=0x81)
        assert emulated.box.streaming
        glove.close()


@pytest.mark.parametrize("doubts", DOUBTS, ids=str)
def test_whichever_of_the_doubtful_is_true_the_glove_is_read(line: PtyLine, doubts: Doubts) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(doubts=doubts)) as emulated, CyberGlove(str(line.link)) as glove:
        emulated.set(VALUES[18])
        assert read(glove, lambda record: record.sensors == VALUES[18]).status == 0x81
        assert emulated.box.settings["U"] == b"\1"
        assert glove.counts.wrong_start + glove.counts.wrong_length == 0


def test_the_requested_rate_is_set(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated, CyberGlove(str(line.link), rate_hz=100) as glove:
        assert emulated.box.settings["T"] == b"\x04\x80\x00\x01"
        assert read(glove)
        assert glove.counts.wrong_start + glove.counts.wrong_length == 0


def test_times_are_when_records_came_and_no_later_than_now(line: PtyLine) -> None:
    with EmulatedCyberGlove(line), CyberGlove(str(line.link)) as glove:
        opened_us = monotonic_ns() // 1000
        times: list[int] = []
        while len(times) < 20:
            timed = glove.read(SOON_S)
            assert timed is not None
            assert timed[0] <= monotonic_ns() // 1000
            times.append(timed[0])
    assert times == sorted(times)
    assert times[0] > opened_us - 1_000_000


@pytest.mark.parametrize("count", [60, 180])
def test_records_that_waited_keep_their_age(line: PtyLine, count: int) -> None:
    """180 records are as many bytes as the kernel keeps: they are read in more than one piece."""
    sent, enough = iter(range(1000)), threading.Event()

    def note(message: bytes) -> bytes:
        if next(sent) == count:
            enough.set()
        return message

    with EmulatedCyberGlove(line), CyberGlove(str(line.link), rate_hz=100) as glove:
        read(glove)
        line.damage = note
        assert enough.wait(SOON_S)
        held_up_us = monotonic_ns() // 1000
        times = [timed[0] for _ in range(count) if (timed := glove.read(SOON_S)) is not None]
    assert times[0] < held_up_us - (count - 20) * 10_000
    middle = times[10 : count - 10]
    assert {later - earlier for earlier, later in pairwise(middle)} == {10_000}


def test_a_glove_that_is_unplugged_and_plugged_in_again_says_so(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated, CyberGlove(str(line.link)) as glove:
        emulated.box.plugged = False
        assert read(glove, lambda record: record.fault is not None) == Record(bytes([100] * 18), "unplugged", 0x80)
        emulated.box.plugged = True
        read(glove, lambda record: record.fault is None)
        assert glove.counts.unplugged >= 1


def test_a_rate_that_is_too_fast_is_noted_and_tried(line: PtyLine) -> None:
    with EmulatedCyberGlove(line):
        glove = CyberGlove(str(line.link), rate_hz=400)
        (note,) = glove.open().notes
        assert "400 records a second are requested, and box and line should manage 158" in note
        assert read(glove).fault == "too fast"
        assert glove.counts.too_fast >= 1
        glove.close()
    for rate_hz in (0.0, -5.0, float("nan")):
        with pytest.raises(SettingError):
            CyberGlove("x", rate_hz=rate_hz)


@pytest.mark.parametrize("not_ready", [1, 3])
def test_a_box_that_is_not_ready_yet_is_waited_for(line: PtyLine, not_ready: int) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(not_ready=not_ready)) as emulated:
        emulated.set(VALUES[18])
        glove = CyberGlove(str(line.link))
        assert glove.open().notes == ()
        assert read(glove).sensors == VALUES[18]
        glove.close()


def test_a_box_that_never_is_ready_is_read_with_a_note(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.box.plugged = False
        glove = CyberGlove(str(line.link))
        (note,) = glove.open().notes
        assert "?G returns 1, not 3" in note
        assert read(glove).fault == "unplugged"
        emulated.box.plugged = True
        assert read(glove, lambda record: record.fault is None)
        glove.close()


def test_a_stream_left_on_is_stopped_and_set_up_anew(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.set(VALUES[18])
        with SerialLine(str(line.link), 115_200) as crashed:
            crashed.write(b"D\1S")
            assert crashed.read(SOON_S)
        assert emulated.box.streaming
        with CyberGlove(str(line.link)) as glove:
            assert read(glove).sensors == VALUES[18]
            assert emulated.box.settings["D"] == b"\0"
            assert glove.counts.wrong_start + glove.counts.wrong_length == 0


def altered(line: PtyLine, sent: bytes, heard: bytes) -> list[bytes]:
    """Let the box hear something else, the first time that it is sent this; return what it is sent, as it comes."""
    hear, all_sent = line.receive, list[bytes]()
    assert hear is not None

    def receive(data: bytes) -> None:
        hear(heard if data == sent and data not in all_sent else data)
        all_sent.append(data)

    line.receive = receive
    return all_sent


def test_a_stream_left_on_costs_no_question_twice(line: PtyLine) -> None:
    with EmulatedCyberGlove(line):
        sent = altered(line, b"", b"")
        with SerialLine(str(line.link), 115_200) as crashed:
            crashed.write(b"S")
            assert crashed.read(SOON_S)
        with CyberGlove(str(line.link)) as glove:
            assert read(glove)
        # ?G finds the box, and then tells whether it is ready.
        assert [sent.count(question) for question in (b"?G", b"?N", b"?M", b"?i")] == [2, 1, 1, 1]


@pytest.mark.parametrize(
    ("sent", "heard"), [(b"\x03", b""), (b"?G", b"S"), (b"?N", b"S"), (b"?M", b"?Z"), (b"?N", b"")]
)
def test_what_the_box_mishears_is_sent_again(line: PtyLine, sent: bytes, heard: bytes) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.set(VALUES[18])
        with SerialLine(str(line.link), 115_200) as crashed:
            crashed.write(b"S")
            assert crashed.read(SOON_S)
        altered(line, sent, heard)
        with CyberGlove(str(line.link)) as glove:
            assert read(glove) == Record(VALUES[18], status=0x81)


def test_a_command_left_half_sent_is_overcome(line: PtyLine) -> None:
    with EmulatedCyberGlove(line):
        with SerialLine(str(line.link), 115_200) as crashed:
            crashed.write(b"T\1")
        with CyberGlove(str(line.link)) as glove:
            assert read(glove)


def test_garbage_at_power_up_is_overcome(line: PtyLine) -> None:
    with EmulatedCyberGlove(line):
        line.send(bytes(range(256)) * 2 + b"?G?G\xff\0")
        with CyberGlove(str(line.link)) as glove:
            assert read(glove)
            assert glove.counts.wrong_start + glove.counts.wrong_length == 0


@pytest.mark.parametrize("lost", range(10))
def test_any_answer_may_get_lost_while_it_is_set_up(line: PtyLine, lost: int) -> None:
    """All ten: ?G twice, ?N, ?M, ?R, ?i, T, D, U, ?F."""
    answers = iter(range(1000))
    line.damage = lambda message: b"" if next(answers) == lost else message
    with EmulatedCyberGlove(line, CyberGloveBox(text="CyberGlove 2.4")) as emulated:
        glove = CyberGlove(str(line.link))
        info = glove.open()
        assert (info.names, info.right_hand, info.text, info.status) == (SENSORS_18, True, "CyberGlove 2.4", True)
        assert info.notes == ()
        assert read(glove) == Record(bytes([100] * 18), status=0x81)
        assert emulated.box.streaming
        glove.close()


def test_a_pulled_plug_is_seen_and_the_glove_opened_again_after_it(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.set(VALUES[18])
        glove = CyberGlove(str(line.link))
        glove.open()
        read(glove)
        line.unplug()
        with pytest.raises(DeviceError, match="gone"):
            read(glove, lambda record: False)
        with pytest.raises(DeviceError, match="no such port"):
            glove.open()
        counted = glove.counts.records
        line.replug()
        glove.open()
        assert read(glove).sensors == VALUES[18]
        assert glove.counts.records > counted
        glove.close()


def test_a_silent_glove_without_its_node_was_unplugged(line: PtyLine) -> None:
    emulated = EmulatedCyberGlove(line)
    with CyberGlove(str(line.link)) as glove:
        read(glove)
        line.link.unlink()
        emulated.close()  # it streams no more; the pty stays open
        with pytest.raises(DeviceError, match=r"serial line is gone \(its device node was removed\)"):
            read(glove, lambda _: False)


def test_a_silent_glove_is_dead_after_half_a_second(line: PtyLine) -> None:
    emulated = EmulatedCyberGlove(line)
    with CyberGlove(str(line.link)) as glove:
        read(glove)
        emulated.close()
        began = monotonic()
        with pytest.raises(DeviceError, match=r"no byte for 0.5 s: check its power"):
            read(glove, lambda record: False)
        assert monotonic() - began > 0.4


def test_a_glove_that_sends_only_noise_is_dead_after_a_second(line: PtyLine) -> None:
    with EmulatedCyberGlove(line), CyberGlove(str(line.link)) as glove:
        read(glove)
        line.damage = lambda message: b"\x55" * len(message)
        began = monotonic()
        with pytest.raises(DeviceError, match=r"no record for 1 s: check its power"):
            read(glove, lambda record: False)
        assert monotonic() - began > 0.9


def test_nobody_there_is_told_with_what_to_check(line: PtyLine) -> None:
    with pytest.raises(DeviceError, match=r"no CyberGlove replies to \?G at 115200 baud: check its power"):
        CyberGlove(str(line.link)).open()


def test_somebody_else_who_never_stops_is_no_glove(line: PtyLine) -> None:
    def endless(message: bytes) -> bytes:
        line.send(message)
        return message

    line.damage = endless
    line.send(b"x" * 100)
    with pytest.raises(DeviceError, match="keeps sending after a Ctrl-C at 115200 baud: is it a CyberGlove"):
        CyberGlove(str(line.link)).open()


def at_rate(line: PtyLine, hear: Callable[[bytes], None], speed: int) -> Callable[[bytes], None]:
    """Let only a client of the right baud rate be heard: a pty carries any."""

    def receive(data: bytes) -> None:
        descriptor = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
        try:
            if termios.tcgetattr(descriptor)[4] == speed:
                hear(data)
        finally:
            os.close(descriptor)

    return receive


@pytest.mark.parametrize(("baud", "speed"), [(115_200, termios.B115200), (9600, termios.B9600)])
def test_a_baud_rate_is_set(tmp_path: Path, baud: int, speed: int) -> None:
    with PtyLine(tmp_path / "glove", baud) as line, EmulatedCyberGlove(line):
        assert line.receive is not None
        line.receive = at_rate(line, line.receive, speed)
        glove = CyberGlove(str(line.link), baud=baud)
        assert glove.open().baud == baud
        assert read(glove)
        glove.close()


def test_a_glove_of_another_number_of_sensors_than_said_is_refused(line: PtyLine) -> None:
    with (
        EmulatedCyberGlove(line, sensors=22),
        pytest.raises(SettingError, match="sends 22 sensors, not 18: write `sensors = 22`"),
    ):
        CyberGlove(str(line.link), sensors=18).open()


def test_a_leftover_mask_is_removed_or_the_glove_refused(
    line: PtyLine,
) -> None:
    with EmulatedCyberGlove(line) as emulated:
        with SerialLine(str(line.link), 115_200) as other:
            other.write(b"M\3\0\0")
            assert other.read(SOON_S)
        emulated.set(VALUES[18])
        with CyberGlove(str(line.link)) as glove:
            assert read(glove).sensors == VALUES[18]
    with EmulatedCyberGlove(line, CyberGloveBox(doubts=Doubts(mask="unknown"))) as emulated:
        emulated.box.apply("M", b"\3\0\0")
        with pytest.raises(DeviceError, match="sends 2 sensors, neither 18 nor 22: another program masked some"):
            CyberGlove(str(line.link)).open()


@pytest.mark.parametrize("sensors", [18, 22])
def test_only_requested_sensors_are_sent_until_it_is_closed(line: PtyLine, sensors: int) -> None:
    some, names = (17, 4, 5), {18: SENSORS_18, 22: SENSORS_22}[sensors]
    with EmulatedCyberGlove(line, sensors=sensors) as emulated:
        emulated.set(VALUES[sensors])
        with CyberGlove(str(line.link), only=some) as glove:
            for _ in range(3):
                assert read(glove).sensors == bytes(VALUES[sensors][place] for place in sorted(some))
            assert emulated.box.settings["M"] == mask_of([names[place] for place in some])
            assert glove.counts.wrong_length == 0
        end = monotonic() + SOON_S
        while emulated.box.settings["M"] != {18: MASK_18, 22: MASK_22}[sensors] and monotonic() < end:
            threading.Event().wait(0.01)
        assert emulated.box.settings["N"] == bytes([sensors])


def test_a_masked_record_comes_as_much_sooner_as_the_formula_says(line: PtyLine) -> None:
    with EmulatedCyberGlove(line):
        info = CyberGlove(str(line.link), only=(4, 5, 9)).open()
        assert info.period_us == round(3 * 250 + 6 * 10e6 / 115_200)
        assert (info.places, info.names, info.total) == ((4, 5, 9), tuple(SENSORS_18[n] for n in (4, 5, 9)), 18)


@pytest.mark.parametrize("doubt", ["unknown", "ignored"])
def test_an_unconfirmed_mask_sends_all_sensors_and_is_reported(
    line: PtyLine, doubt: Literal["unknown", "ignored"], caplog: pytest.LogCaptureFixture
) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(doubts=Doubts(mask=doubt))) as emulated:
        emulated.set(VALUES[18])
        glove = CyberGlove(str(line.link), only=(4, 5))
        info = glove.open()
        assert info.places == tuple(range(18))
        assert info.unmasked == "it accepts no sensor mask: all 18 sensors are read, though 2 are requested"
        assert info.unmasked in caplog.text
        assert read(glove).sensors == VALUES[18]
        glove.close()


def test_after_a_feigned_mask_the_box_is_read_whole(line: PtyLine) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(doubts=Doubts(mask="feigned"))) as emulated:
        emulated.set(VALUES[18])
        glove = CyberGlove(str(line.link), only=(4, 5))
        assert glove.open().sensors == 2
        with pytest.raises(DeviceError, match="has sent no record"):
            read(glove)
        info = glove.open()
        assert info.unmasked == "its records do not match its sensor mask: all 18 sensors are read"
        assert read(glove).sensors == VALUES[18]
        glove.close()


@pytest.mark.parametrize("wanted", [False, True])
def test_the_filter_is_set_as_requested_and_slows_records(line: PtyLine, wanted: bool) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.box.apply("F", bytes([not wanted]))
        glove = CyberGlove(str(line.link), filtered=wanted)
        assert glove.open().period_us == round(18 * (375.6 if wanted else 250) + 21 * 10e6 / 115_200)
        assert emulated.box.is_on("F") == wanted
        glove.close()


def answering(line: PtyLine, answers: dict[bytes, bytes]) -> None:
    """Let a box of few words be at the end of the line; what it does not know it answers with an error."""
    line.receive = lambda data: None if data in (b"\x03", b"S") else line.send(answers.get(data, b"e?\0"))


def test_an_old_box_of_few_commands_is_read_without_its_status(line: PtyLine) -> None:
    period = {b"T\0\0\0\0": b"T\0"}
    answering(line, {b"?G": b"?G\3\0", b"?S": b"?S\x12\0", **period})
    glove = CyberGlove(str(line.link))
    info = glove.open()
    assert (info.sensors, info.names) == (18, SENSORS_18)
    assert (info.right_hand, info.text, info.status) == (None, "", False)
    assert "no status byte" in info.notes[0]
    line.send(b"S" + VALUES[18] + b"\0")
    assert read(glove) == Record(VALUES[18])
    glove.close()
    answering(line, {b"?G": b"?G\3\0", **period})
    with pytest.raises(DeviceError, match="does not report its number of sensors"):
        glove.open()
    assert CyberGlove(str(line.link), sensors=22).open().names == SENSORS_22


def test_a_box_that_is_neither_initialised_nor_has_a_glove_is_refused(line: PtyLine) -> None:
    answering(line, {b"?G": b"?G\0\0"})
    with pytest.raises(DeviceError, match="is not initialised and has no glove"):
        CyberGlove(str(line.link)).open()


@pytest.mark.parametrize("seed", range(6))
def test_any_answers_give_a_glove_or_our_error(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    box = CyberGloveBox()

    with PtyLine(tmp_path / "glove", paced=False) as line:

        def garbled(data: bytes) -> None:
            said = b"".join(box.feed(data))
            place = random.randrange(len(said) + 1)
            start, end = said[:place], said[place:]
            line.send(random.choice([said, start, said + said, start + random.randbytes(3) + end]))

        line.receive = garbled
        found = opened(CyberGlove(str(line.link)))
    assert found == "18 sensors" or str(line.link) in found


def opened(glove: CyberGlove) -> str:
    """Return what comes of opening a glove, in words."""
    try:
        return f"{glove.open().sensors} sensors"
    except DeviceError as told:
        return str(told)
    finally:
        glove.close()


def test_a_flood_that_never_ends_is_given_up() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(SOON_S)
        flooding = threading.Thread(target=lambda: flooded(server))
        flooding.start()
        with pytest.raises(DeviceError):
            CyberGlove(f"socket://127.0.0.1:{server.getsockname()[1]}").open()
        flooding.join(SOON_S)
    assert not flooding.is_alive()


def flooded(server: socket.socket) -> None:
    """Send NULs to the first client until it goes."""
    client, _ = server.accept()
    with client, suppress(OSError):
        client.settimeout(SOON_S)
        while True:
            client.sendall(bytes(100_000))


def test_a_closed_glove_says_so_and_streams_no_more(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated:
        glove = CyberGlove(str(line.link))
        glove.open()
        read(glove)
        glove.close()
        glove.close()
        with pytest.raises(DeviceError, match="not open"):
            glove.read(0.0)
        with SerialLine(str(line.link), 115_200) as after:
            after.drain(0.1)
            assert after.read(0.05) == b""
        assert not emulated.box.streaming
