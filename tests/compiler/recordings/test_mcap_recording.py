import os
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.mcap_recording import _Grasp, _Part, _taxel, import_recordings
from thenar.compiler.recordings.taxonomy import published
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.calibration import CodeTables, Meaning, numbers_of
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.manifest import Calibration, Threshold
from thenar.runtime.recording.guide import read_journal
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.taxels import LiveTaxel, TaxelCalibration, count_limit

from ...gloves import pad_line

SENSORS = ("thumb_mpj", "index_mpj", "wrist_pitch", "wrist_yaw")
CALIBRATION = GloveCalibration(
    subject="A",
    sensors=tuple(SensorCalibration(name, 50, 0.0, 150, 61.3) for name in SENSORS),
)
COLLECTION = Collection(
    "A",
    "kamakura14",
    published("kamakura14").types,
    (CollectionTask("PoS", ("jar",)), CollectionTask("Tip", ("pin",))),
    repetitions=3,
    seed=0,
)
SESSION = Session(thenar="1", switches=("s1", "s2", "s3"), sensors=SENSORS, collection=COLLECTION)

Write = Callable[..., Path]


def do(
    recorder: Recorder, time_us: int, what: str, trial: int, closed: int = 0, sensors: bytes = b"\x01\x02\x03\x04"
) -> None:
    """One event of a trial; a capture after the frames that it is of, and before others."""
    subject = recorder.session.collection.subject  # type: ignore[union-attr]
    grasp, thing = ("PoS", "jar") if trial % 2 else ("Tip", "pin")
    if what == "captured":
        if recorder.session.switches:
            recorder.frame(SwitchFrame(time_us, closed))
        if recorder.session.sensors:
            recorder.frame(GloveFrame(time_us, sensors))
    recorder.label(Label(time_us, what, trial, grasp, subject, thing))  # type: ignore[arg-type]
    if recorder.session.switches:
        recorder.frame(SwitchFrame(time_us, 0b111))


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def make(name: str = "a.mcap", session: Session = SESSION, trials: Sequence[int] = (1, 2, 3)) -> Path:
        with Recorder(tmp_path / name, session) as recorder:
            for trial in trials:
                do(recorder, trial, "captured", trial, closed=trial, sensors=bytes((100 + trial, 200, 1, 255)))
                do(recorder, trial, "accepted", trial)
        return recorder.path

    return make


def test_every_accepted_trial_is_a_row_of_what_was_captured(write: Write) -> None:
    grasp_set, report = import_recordings([write()])
    assert grasp_set.switches.tolist() == [[1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert grasp_set.codes.tolist() == [[101, 200], [102, 200], [103, 200]]
    assert grasp_set.grasps.tolist() == ["PoS", "Tip", "PoS"]
    assert grasp_set.objects.tolist() == ["jar", "pin", "jar"]
    assert grasp_set.subjects.tolist() == ["A"] * 3
    assert grasp_set.trials.tolist() == [1, 2, 3]
    assert grasp_set.taxonomy == published("kamakura14")
    assert grasp_set.joints == tuple(Joint(name, "raw", 1, 1.0, 255, 255.0) for name in SENSORS[:2])
    assert (report.table, report.frames, report.joints) == ("a.mcap", 3, 2)


def test_what_was_redone_or_never_judged_is_no_row(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        do(recorder, 1, "captured", 1, closed=1)
        do(recorder, 2, "redone", 1)
        do(recorder, 3, "captured", 1, closed=2)
        do(recorder, 4, "accepted", 1)
        do(recorder, 5, "captured", 2)
        do(recorder, 6, "captured", 3, closed=1)
        do(recorder, 7, "accepted", 3)
        do(recorder, 8, "accepted", 3)
        do(recorder, 9, "captured", 4)
        do(recorder, 10, "accepted", 5)
    grasp_set, _ = import_recordings([recorder.path])
    assert grasp_set.trials.tolist() == [1, 3]
    assert grasp_set.switches.tolist() == [[0, 1, 0], [1, 0, 0]]


def test_what_was_skipped_or_undone_is_no_row(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        for trial in (1, 2):
            do(recorder, 2 * trial, "captured", trial, closed=trial)
            do(recorder, 2 * trial + 1, "accepted", trial)
        do(recorder, 6, "captured", 3, closed=1)
        do(recorder, 7, "redone", 3)
        do(recorder, 8, "undone", 2)
        do(recorder, 9, "captured", 2, closed=4)
        do(recorder, 10, "accepted", 2)
        do(recorder, 11, "captured", 3, closed=3)
        do(recorder, 12, "skipped", 3)
        do(recorder, 13, "captured", 4, closed=1)
        do(recorder, 14, "accepted", 4)
        do(recorder, 15, "undone", 4)
    grasp_set, _ = import_recordings([recorder.path])
    assert grasp_set.trials.tolist() == [1, 2]
    assert grasp_set.switches.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert read_journal(recorder.path).accepted == (1, 2)


def test_a_trial_of_an_earlier_session_may_be_undone_and_only_there(write: Write) -> None:
    path = write()
    other = write("b.mcap")
    with Recorder(path, SESSION, tail=read_journal(path).tail) as recorder:
        do(recorder, 1, "undone", 3)
        do(recorder, 2, "captured", 3, closed=0b100)
        do(recorder, 3, "accepted", 3)
        do(recorder, 4, "undone", 3)
        do(recorder, 5, "undone", 2)
        do(recorder, 6, "captured", 2, closed=0b101)
        do(recorder, 7, "accepted", 2)
    grasp_set, _ = import_recordings([path])
    assert grasp_set.trials.tolist() == [1, 2]
    assert grasp_set.switches.tolist() == [[1, 0, 0], [1, 0, 1]]
    # Of a set that another recording goes into as well, nothing else is undone.
    both, _ = import_recordings([other, path])
    assert both.trials.tolist() == [1, 2, 3, 1, 2]
    with Recorder(path, SESSION, tail=read_journal(path).tail) as recorder:
        do(recorder, 1, "undone", 2)
        do(recorder, 2, "undone", 1)
    with pytest.raises(TableError, match="no trial was accepted"):
        import_recordings([path])


def test_a_collection_that_was_resumed_is_one_set(write: Write) -> None:
    path = write()
    os.truncate(path, path.stat().st_size - 7)
    with Recorder(path, SESSION, tail=read_journal(path).tail) as recorder:
        do(recorder, 1, "accepted", 5)
        do(recorder, 2, "captured", 4, closed=0b100)
        do(recorder, 3, "accepted", 4)
    grasp_set, report = import_recordings([path])
    assert grasp_set.trials.tolist() == [1, 2, 3, 4]
    assert not [warning for warning in report.warnings if "cut" in warning.kind]


def test_nothing_of_one_session_is_captured_in_the_next(write: Write) -> None:
    path = write()
    with Recorder(path, SESSION, tail=read_journal(path).tail) as recorder:
        recorder.label(Label(1, "captured", 4, "Tip", "A", "pin"))
        recorder.label(Label(1, "accepted", 4, "Tip", "A", "pin"))
    grasp_set, report = import_recordings([path])
    assert grasp_set.trials.tolist() == [1, 2, 3]
    assert "dropped rows" in [warning.kind for warning in report.warnings]


# Of 56 counts for 90 degrees, the half degrees of every seventh byte lie midway between two codes.
HALVES = GloveCalibration(sensors=tuple(SensorCalibration(name, 40, 0.0, 96, 90.0) for name in SENSORS))


@given(st.lists(st.integers(1, 255), min_size=2, max_size=20), st.sampled_from([CALIBRATION, HALVES]))
@example([40 + 7 * n for n in range(-5, 16)], HALVES)
def test_a_calibrated_glove_has_the_codes_that_the_live_recogniser_gives_it(
    tmp_path_factory: pytest.TempPathFactory, raws: list[int], calibration: GloveCalibration
) -> None:
    session = replace(SESSION, calibration=calibration)
    with Recorder(tmp_path_factory.mktemp("mcap") / "a.mcap", session) as recorder:
        for trial, raw in enumerate(raws, start=1):
            do(recorder, trial, "captured", trial, sensors=bytes((raw, raw, 1, 1)))
            do(recorder, trial, "accepted", trial)
    grasp_set, report = import_recordings([recorder.path])
    joints = [
        Calibration(number, joint.name, joint.unit, joint.code_a, joint.value_a, joint.code_b, joint.value_b)
        for number, joint in enumerate(grasp_set.joints)
    ]
    live = CodeTables(joints, SENSORS, calibration)
    assert grasp_set.codes.tolist() == [live.codes(bytes((raw, raw, 1, 1))) for raw in raws]
    assert {(joint.unit, joint.step) for joint in grasp_set.joints} == {("deg", 0.5)}
    assert all(cost.largest_error <= 0.25 + 1e-9 for cost in report.coding)


def test_subjects_of_their_own_recordings_become_one_set(write: Write) -> None:
    ben = replace(SESSION, collection=replace(COLLECTION, subject="ben"))
    grasp_set, report = import_recordings([write(), write("b.mcap", ben, trials=(1, 2))])
    assert grasp_set.subjects.tolist() == ["A", "A", "A", "ben", "ben"]
    assert (report.table, report.subjects) == ("a.mcap, b.mcap", 2)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (replace(SESSION, switches=("s1", "s2", "s9")), "differ in switches"),
        (replace(SESSION, sensors=("a", *SENSORS[1:])), "differ in sensors"),
        (replace(SESSION, calibration=CALIBRATION), "differ in unit of the joints"),
        (replace(SESSION, taxels=("p",)), "differ in taxels"),
        (
            replace(SESSION, collection=replace(COLLECTION, taxonomy="own", types=("PoS", "Tip"))),
            "differ in taxonomy",
        ),
    ],
)
def test_recordings_of_different_gloves_are_not_mixed(write: Write, other: Session, said: str) -> None:
    with pytest.raises(TableError, match=rf"b\.mcap and a\.mcap {said}"):
        import_recordings([write(), write("b.mcap", other)])


def test_a_row_that_misses_a_switch_is_left_out_and_told(tmp_path: Path, write: Write) -> None:
    with Recorder(tmp_path / "lost.mcap", SESSION) as recorder:
        recorder.frame(SwitchFrame(1, 0, lost=0b100))
        recorder.frame(GloveFrame(1, b"1234"))
        recorder.label(Label(1, "captured", 7, "PoS", "A", "jar"))
        recorder.label(Label(1, "accepted", 7, "PoS", "A", "jar"))
        do(recorder, 2, "captured", 8)
        do(recorder, 2, "accepted", 8)
    grasp_set, report = import_recordings([recorder.path])
    assert grasp_set.trials.tolist() == [8]
    assert [warning.message for warning in report.warnings if warning.kind == "dropped rows"] == [
        "1 trials in which not everything was read were left out: row 7"
    ]


@pytest.mark.parametrize("bare", [replace(SESSION, switches=()), replace(SESSION, sensors=())])
def test_switches_alone_and_a_glove_alone_are_sets_too(write: Write, bare: Session) -> None:
    grasp_set, _ = import_recordings([write(session=bare)])
    assert len(grasp_set) == 3
    assert grasp_set.switch_names == bare.switches
    assert grasp_set.joint_names == bare.sensors[:2]


def test_a_cut_recording_is_imported_up_to_its_last_whole_message(write: Write) -> None:
    path = write()
    size = path.stat().st_size
    end = path.read_bytes().rindex(b'"accepted"')
    os.truncate(path, end)
    grasp_set, report = import_recordings([path])
    assert grasp_set.trials.tolist() == [1, 2]
    [told] = [warning for warning in report.warnings if warning.kind == "cut recordings"]
    assert told.message.startswith("a.mcap is whole up to byte ")
    assert f" of {end}, the rest was left out: a record claims " in told.message
    assert size > end


def test_what_is_passed_over_is_told_with_its_place(write: Write) -> None:
    path = write()
    data = bytearray(path.read_bytes())
    place = data.index(b'"time_us":3,"event":"captured"') - 40
    assert data[place] == 5
    data[place] ^= 0x80
    path.write_bytes(data)
    _, report = import_recordings([path])
    messages = {warning.kind: warning.message for warning in report.warnings}
    assert messages["records passed over"] == (
        f"a.mcap holds records that thenar skips: record of unknown kind 0x85 at byte {place}"
    )
    assert messages["altered recordings"] == "a.mcap is altered: the checksum of its data does not match"


def test_a_recording_without_trials_says_what_makes_some(write: Write) -> None:
    for session, trials in ((replace(SESSION, collection=None), ()), (SESSION, ())):
        path = write(f"{len(str(session))}.mcap", session, trials)
        with pytest.raises(TableError, match="no trial was accepted; `thenar record` makes"):
            import_recordings([path])


def test_a_calibration_that_lacks_a_sensor_is_named(write: Write) -> None:
    lacking = GloveCalibration(sensors=CALIBRATION.sensors[:1])
    with pytest.raises(TableError, match=r"a\.mcap: its calibration has no sensor 'index_mpj'"):
        import_recordings([write(session=replace(SESSION, calibration=lacking))])


PADS = TaxelCalibration(unit="N", sensors=(pad_line("p", 100, 900, 2.0), pad_line("q", 900, 100)))
ANALOG = replace(SESSION, switches=("s1",), sensors=(), taxels=("p", "q"), taxel_calibration=PADS)


def pressed(path: Path, session: Session, *trials: tuple[int | None, ...] | None) -> Path:
    with Recorder(path, session) as recorder:
        for trial, codes in enumerate(trials, start=1):
            time_us = trial * 1000
            recorder.frame(SwitchFrame(time_us, 1, taxels=codes))
            for what in ("captured", "accepted"):
                recorder.label(Label(time_us, what, trial, "PoS", "A", "jar"))
            recorder.frame(SwitchFrame(time_us + 1, 1, taxels=(7, 7)))
    return path


def test_taxels_are_imported_with_their_calibration(tmp_path: Path) -> None:
    grasp_set, _ = import_recordings([pressed(tmp_path / "a.mcap", ANALOG, (120, 800), (900, 0))])
    assert grasp_set.taxels.tolist() == [[120, 800], [900, 0]]
    assert grasp_set.taxel_columns == (Joint("p", "N", 100, 0.0, 900, 2.0), Joint("q", "N", 900, 0.0, 100, 1.0))
    plain = replace(ANALOG, taxel_calibration=None)
    grasp_set, _ = import_recordings([pressed(tmp_path / "b.mcap", plain, (120, 800))])
    assert grasp_set.taxel_columns == (Joint("p", "counts", 0, 0.0, 1, 1.0), Joint("q", "counts", 0, 0.0, 1, 1.0))


def test_trials_with_unread_taxels_are_left_out_and_reported(tmp_path: Path) -> None:
    path = pressed(tmp_path / "a.mcap", ANALOG, (120, 800), (120, None), None)
    grasp_set, report = import_recordings([path])
    assert grasp_set.trials.tolist() == [1]
    assert "2 trials in which not everything was read were left out" in " ".join(w.message for w in report.warnings)


@given(st.integers(0, 65534), st.integers(0, 65535), st.booleans())
def test_codes_of_another_calibration_are_those_that_the_live_recogniser_gives_it(
    raw: int, code: int, of_build: bool
) -> None:
    own = pad_line("p", 800, 300, 1.7)
    first = PADS.sensors[0]
    coded = Calibration(0, "p", "N", first.raw_a, 0.0, first.raw_b, first.value_b)
    limit = count_limit(Threshold(code, 0.0, coded), TaxelCalibration(unit="N", sensors=(own,)))
    closed, _ = LiveTaxel("p", [(limit, 0)]).read(raw)
    grasps = [
        (
            _Part("", replace(ANALOG, taxel_calibration=TaxelCalibration(unit="N", sensors=(line,))), COLLECTION, ()),
            grasp,
        )
        for line, grasp in (
            (first, _Grasp(Label(0, "captured", 1, "PoS", "A", "jar"), None, None, (100,))),
            (own, _Grasp(Label(0, "captured", 1, "PoS", "A", "jar"), None, None, (raw,))),
        )
    ]
    # In the coding of the first session, or in that of a build, for which a single session is enough.
    codes, taxel = _taxel(0, grasps[of_build:], {"p": coded} if of_build else {})
    assert (codes[-1] > code) == bool(closed)
    assert taxel == Joint("p", "N", first.raw_a, 0.0, first.raw_b, first.value_b)


@given(
    st.tuples(st.integers(1, 255), st.integers(1, 255)).filter(lambda ends: ends[0] != ends[1]),
    st.tuples(*(st.integers(0, 65535),) * 2).filter(lambda ends: ends[0] != ends[1]),
    st.sampled_from([(-250.0, 250.0), (-20.0, 80.5), (100.0, 0.0)]),
    st.booleans(),
)
def test_a_recording_for_a_build_has_the_codes_that_it_gets_live(
    ends: tuple[int, int], codes: tuple[int, int], values: tuple[float, float], calibrated: bool
) -> None:
    coded = Calibration(0, "index_mpj", "deg", codes[0], values[0], codes[1], values[1])
    line = SensorCalibration("index_mpj", ends[0], 5.0, ends[1], 70.0)
    meaning: Meaning = GloveCalibration(sensors=(line,))
    harness = ""
    if not calibrated:
        harness = '[[stream]]\nport = "udp://127.0.0.1:9"\njoints = { index_mpj = [5.0, 70.0] }\n'
        meaning = numbers_of({"index_mpj": (5.0, 70.0)})
    session = replace(
        SESSION, switches=(), sensors=("index_mpj",), harness=harness, calibration=meaning if calibrated else None
    )
    with TemporaryDirectory() as folder:
        with Recorder(Path(folder, "a.mcap"), session) as recorder:
            for trial in range(1, 256):
                do(recorder, trial, "captured", trial, sensors=bytes((trial,)))
                do(recorder, trial, "accepted", trial)
        grasp_set, _ = import_recordings([recorder.path], codings={"index_mpj": coded})
    live = CodeTables([coded], ["index_mpj"], meaning)
    assert grasp_set.codes.ravel().tolist() == [live.codes(bytes((byte,)))[0] for byte in range(1, 256)]
    assert grasp_set.joints == (Joint("index_mpj", "deg", codes[0], values[0], codes[1], values[1]),)
