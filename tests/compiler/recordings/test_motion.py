"""ROS bags, C3D, cells of MATLAB and files of OpenSim, as the writer of each library makes them."""

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import c3d
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.table import Table, read_table

EPOCH = 1_700_000_000_000_000_000
JOINTS = ("index", "thumb")
ARM = ("elbow",)


def bag(path: Path, write: Callable[[Callable[..., None], Any], None], plugin: StoragePlugin | None = None) -> Path:
    """Write a bag: ROS 1 without a `plugin`; `write` takes a function that sends a message, and the types."""
    store: Any = get_typestore(Stores.ROS2_JAZZY if plugin else Stores.ROS1_NOETIC)
    with Writer2(path, version=9, storage_plugin=plugin) if plugin else Writer1(path) as writer:
        topics: dict[str, Any] = {}
        serialize = store.serialize_cdr if plugin else store.serialize_ros1

        def send(topic: str, time_ns: int, kind: str, **fields: Any) -> None:
            made = store.types[kind]
            if "header" in made.__dataclass_fields__:
                head = {"stamp": store.types["builtin_interfaces/msg/Time"](0, 0), "frame_id": ""}
                fields["header"] = store.types["std_msgs/msg/Header"](**head, **({} if plugin else {"seq": 0}))
            if "layout" in made.__dataclass_fields__:
                fields["layout"] = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], EPOCH + time_ns, serialize(made(**fields), kind))

        write(send, store.types)
    return path


def state(send: Callable[..., None], time_ns: int, names: tuple[str, ...], values: list[float]) -> None:
    none = np.array([])
    kind = "sensor_msgs/msg/JointState"
    send("/joint_states", time_ns, kind, name=[*names], position=np.array(values), velocity=none, effort=none)


def hand(send: Callable[..., None], _types: Any) -> None:
    """Send joints every 10 ms, in any order, with those of an arm; pads every 20 ms; a text once; pictures; the log."""
    send("/label", 0, "std_msgs/msg/String", data="power")
    picture = {"height": 99, "width": 99, "encoding": "mono8", "is_bigendian": 0, "step": 99}
    send("/camera", 0, "sensor_msgs/msg/Image", data=np.zeros(9801, np.uint8), **picture)
    for number in range(9):
        order = JOINTS[:: 1 - 2 * (number % 2)]
        state(send, number * 10_000_000, order, [number / 8 - 4 * (name == "thumb") for name in order])
        if number % 3 == 1:
            state(send, number * 10_000_000 + 1, ARM, [number / 3])
        if number % 2 == 1:
            data = np.array([number, number / 4], np.float32)
            send("/hand/tactile", number * 10_000_000, "std_msgs/msg/Float32MultiArray", data=data)


@pytest.mark.parametrize("form", ["bag", "mcap", "db3", "mcap in its folder", "db3 in its folder"])
def test_a_bag_is_the_joints_pads_and_texts_of_its_topics(form: str, tmp_path: Path) -> None:
    plugins = {"mcap": StoragePlugin.MCAP, "db3": StoragePlugin.SQLITE3}
    path = bag(tmp_path / ("t.bag" if form == "bag" else "t.1"), hand, plugins.get(form.split()[0]))
    if form in plugins:
        (path,) = path.glob(f"*.{form}")
    table = read_table(path)
    columns = {name: np.asarray(column).tolist() for name, column in table.columns.items()}
    assert np.allclose(columns.pop("time_s"), EPOCH / 1e9 + np.arange(9) / 100, 0, 1e-6)
    pads, arm = [None, 1, 1, 3, 3, 5, 5, 7, 7], [None, None, 1, 1, 1, 4, 4, 4, 7]
    nan = float("nan")
    expected: dict[str, Any] = {
        "hand/tactile.0": [nan if pad is None else float(pad) for pad in pads],
        "hand/tactile.1": [nan if pad is None else pad / 4 for pad in pads],
        "joint_states.position.elbow": [nan if bend is None else bend / 3 for bend in arm],
        "joint_states.position.index": [number / 8 for number in range(9)],
        "joint_states.position.thumb": [number / 8 - 4 for number in range(9)],
        "label": ["power"] * 9,
    }
    assert columns.keys() == expected.keys()
    for name, column in expected.items():
        assert column == columns[name] if name == "label" else np.array_equal(column, columns[name], equal_nan=True)
    (left,) = table.notes
    assert left.startswith("topics left out: /camera (sensor_msgs/msg/Image, 1 messages: more than 4096 numbers")


def test_joints_of_one_name_keep_their_order(tmp_path: Path) -> None:
    def hands(send: Callable[..., None], _types: Any) -> None:
        state(send, 1, ("flex", "flex"), [1.0, 2.0])
        state(send, 2, ("flex", "flex"), [3.0, 4.0])

    columns = read_table(bag(tmp_path / "b.bag", hands)).columns
    joints = {name: list(column) for name, column in columns.items() if "position" in name}
    assert list(joints.values()) == [[1.0, 3.0], [2.0, 4.0]]


def test_a_value_is_of_use_for_half_a_second_and_ten_intervals(tmp_path: Path) -> None:
    """What a topic said once holds on; a sensor that stopped is missing."""

    def write(send: Callable[..., None], _types: Any) -> None:
        for number in range(20):
            state(send, number * 100_000_000, JOINTS, [number, number])
            if number < 3:
                send("/fsr", number * 1_000_000, "std_msgs/msg/Int32", data=number)
        send("/mode", 700_000_000, "std_msgs/msg/Bool", data=True)

    columns = read_table(bag(tmp_path / "t.bag", write)).columns
    assert np.isnan(np.asarray(columns["fsr"], float)).tolist() == [False] * 6 + [True] * 14
    assert np.isnan(np.asarray(columns["mode"], float)).tolist() == [True] * 7 + [False] * 13


def refused(path: Path) -> str:
    with pytest.raises(TableError) as found:
        read_table(path)
    assert 0 < len(str(found.value)) < 1000
    assert "Traceback" not in str(found.value)
    return str(found.value)


def test_a_bag_without_numbers_names_its_topics(tmp_path: Path) -> None:
    def write(send: Callable[..., None], types: Any) -> None:
        lengths = [np.zeros(1 + number, np.float32) for number in range(3)]
        for number, data in enumerate(lengths):
            send("/points", number, "std_msgs/msg/Float32MultiArray", data=data)
            send("/said", number, "std_msgs/msg/String", data="word")

    path = bag(tmp_path / "t.bag", write)
    assert (
        "t.bag: no topic has numbers to read: it holds /points (std_msgs/msg/Float32MultiArray, 3 messages: the "
        in (refused(path))
    )
    os.truncate(path, path.stat().st_size // 2)
    assert "t.bag: cannot be read as a ROS bag: " in refused(path)
    folder = bag(tmp_path / "t", hand, StoragePlugin.SQLITE3)
    (stored,) = folder.glob("*.db3")
    stored.rename(tmp_path / "secret.db3")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace(stored.name, "../secret.db3"))
    assert "Some database files are missing" in refused(folder)


def points_and_channels(path: Path, points: np.ndarray[Any, Any], channels: np.ndarray[Any, Any], *labels: str) -> Path:
    """Write points (n, p, 3), NaN where they were not seen, and channels (n, c, k) as a C3D."""
    writer = c3d.Writer(point_rate=100.0, analog_rate=100.0 * channels.shape[2])
    for seen, sampled in zip(points, channels, strict=True):
        gone = np.isnan(seen[:, :1])
        writer.add_frames([(np.hstack([np.nan_to_num(seen), -1.0 * gone, 0.0 * gone]), sampled)])
    names = [*labels, *[""] * len(labels)]
    if points.shape[1]:
        writer.set_point_labels(names[: points.shape[1]])
    if channels.shape[1]:
        writer.set_analog_labels([f"F{number}" for number in range(channels.shape[1])])
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what points or channels there are not
        writer.write(file)
    return path


@pytest.mark.parametrize(("markers", "channels", "rate"), [(2, 3, 2), (2, 0, 0), (0, 3, 4), (3, 1, 1)])
def test_c3d_is_read(markers: int, channels: int, rate: int, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    points = random.normal(0, 100, (6, markers, 3)).astype(np.float32)
    points[2, :1] = np.nan
    sampled = random.integers(-999, 999, (6, channels, rate)).astype(float)
    table = read_table(points_and_channels(tmp_path / "t.c3d", points, sampled, *("TH", "IN", "")[:markers]))
    columns = {name: np.asarray(column) for name, column in table.columns.items()}
    rows = 6 if markers else 6 * rate
    assert np.allclose(columns.pop("time_s"), np.arange(rows) / (100 if markers else 100 * rate))
    for number, name in enumerate(("TH", "IN", "point 3")[:markers]):
        for axis in range(3):
            assert np.array_equal(columns.pop(f"{name}.{'xyz'[axis]}"), points[:, number, axis], equal_nan=True)
    for number in range(channels):
        samples = sampled[:, number, -1] if markers else sampled[:, number].ravel()
        assert np.array_equal(columns.pop(f"F{number}"), samples)
    assert not columns


def test_a_cut_c3d_is_refused(tmp_path: Path) -> None:
    path = points_and_channels(tmp_path / "t.c3d", np.zeros((500, 2, 3)), np.zeros((500, 1, 1)), "TH", "IN")
    os.truncate(path, path.stat().st_size - 2048)
    assert "t.c3d: cannot be read as C3D: reached end of file" in refused(path)


def cells(shape: tuple[int, ...], values: list[Any]) -> np.ndarray[Any, Any]:
    made = np.empty(len(values), object)
    made[:] = values
    return made.reshape(shape)


def matlab(path: Path, **variables: Any) -> Table:
    savemat(path, variables)
    return read_table(path)


@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize("form", ["cells", "column of cells", "structures"])
def test_cells_of_unequal_lengths_are_trials(upright: bool, form: str, tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    lengths, labels = [4, 0, 7, 1, 5], ["power", "hook", "tip", "hook", "power"]
    frames = [random.normal(0, 9, (length, 3)) for length in lengths]
    bits = [random.integers(0, 2, (1, length)) for length in lengths]
    written = [part if upright else part.T for part in frames]
    if form == "structures":
        kinds = [("flex", object), ("touch", object), ("grasp", object)]
        table = matlab(tmp_path / "t.mat", trials=np.array(list(zip(written, bits, labels, strict=True)), kinds))
    else:
        shape = (5, 1) if "column" in form else (1, 5)
        words, numbers = cells(shape, labels), np.array([[3, 1, 4, 1, 5]])
        made = {"flex": cells(shape, written), "touch": cells(shape, bits), "grasp": words, "subject": numbers}
        table = matlab(tmp_path / "t.mat", **made, rate=50.0, about="five trials")
        assert np.array_equal(table.columns["subject"], np.repeat([3, 1, 4, 1, 5], lengths))
        assert np.array_equal(table.columns["rate"], np.full(17, 50.0))
    assert np.array_equal(table.columns["trial"], np.repeat([1, 2, 3, 4, 5], lengths))
    assert list(table.columns["grasp"]) == np.repeat(labels, lengths).tolist()
    for number in range(3):
        assert np.array_equal(table.columns[f"flex.{number}"], np.concatenate(frames)[:, number])
    assert np.array_equal(table.columns["touch"], np.concatenate(bits, axis=1)[0])


def test_cells_that_are_no_trials_are_named_with_their_shapes(tmp_path: Path) -> None:
    path, wide = tmp_path / "t.mat", cells((1, 2), [np.zeros((2, 3)), np.zeros((4, 5))])
    savemat(path, {"data": wide})
    said = "its cells are not trials with columns of equal length: it holds "
    assert said + "data (1x2: 2x3, 4x5)" in refused(path)
    x, y = (cells((1, 2), [np.zeros((length, 3)), np.zeros((4, 3))]) for length in (2, 6))
    savemat(path, {"x": x, "y": y})
    assert said + "x (1x2: 2x3, 4x3), y (1x2: 6x3, 4x3)" in refused(path)
    savemat(path, {"x": x, "y": cells((1, 3), [np.zeros((3, 3))] * 3)})
    assert said + "x (1x2: 2x3, 4x3), y (1x3: 3x3, 3x3, 3x3)" in refused(path)
    savemat(path, {"a": [1, 2], "b": [1, 2, 3]})
    assert "its arrays have unequal lengths, 2, 3: it holds a (1x2), b (1x3)" in refused(path)
    savemat(path, {"model": {}})
    assert "it holds no arrays of numbers or text: it holds model (struct 1x1)" in refused(path)
    assert matlab(path, x=x, note=np.zeros((3, 3))).notes == (
        "variable left out, of another size than the cells: note (3x3)",
    )


MOTION = "Coordinates\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\n\nendheader\ntime\tthumb flexion\tq\n"
TRC = (
    "PathFileType\t4\t(X/Y/Z)\tt.trc\nDataRate\tNumMarkers\tUnits\n100\t2\tmm\n"
    "Frame#\tTime\tTH\t\t\tindex tip\t\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t\n{blank}\n"
    "1\t0.00\t1.5\t2\t3\t\t\t\t\n2\t0.01\t1.25\t2\t3\t4\t5\t6\n"
)


@pytest.mark.parametrize("suffix", ["mot", "sto", "MOT"])
def test_tables_of_opensim_are_read_below_their_header(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    path.write_text(MOTION + "0\t1.5\t1,0,0.5\n0.01\t-2e1\t0.25,1,0\n")
    table = read_table(path)
    assert table.rows.tolist() == [9, 10]
    columns = {name: list(map(str, column)) for name, column in table.columns.items()}
    vector = {"q.0": ["1.0", "0.25"], "q.1": ["0.0", "1.0"], "q.2": ["0.5", "0.0"]}
    assert columns == {"time": ["0", "0.01"], "thumb flexion": ["1.5", "-2e1"], **vector}


@pytest.mark.parametrize("blank", ["", "\t" * 8])
def test_markers_of_a_trc_have_their_names(blank: str, tmp_path: Path) -> None:
    path = tmp_path / "t.trc"
    path.write_text(TRC.format(blank=blank))
    table = read_table(path)
    assert table.rows.tolist() == [7, 8]
    columns = {name: list(map(str, column)) for name, column in table.columns.items()}
    assert list(columns) == ["Frame#", "Time", *(f"{name}.{axis}" for name in ("TH", "index tip") for axis in "xyz")]
    assert (columns["TH.x"], columns["index tip.z"]) == (["1.5", "1.25"], ["", "6"])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        (
            "t.mot",
            "time\ta\n0\t1\n",
            "t.mot has no PathFileType or endheader, as files of OpenSim have: it begins with",
        ),
        ("t.trc", MOTION, "t.trc has no PathFileType or endheader, as files of OpenSim have: it begins with 'Coord"),
        ("t.trc", "PathFileType\n", "t.trc has no rows"),
        ("t.sto", "", "t.sto has no PathFileType or endheader"),
        ("t.sto", MOTION + "0\t1\n", "t.sto row 9 has 2 cells, its header 3"),
        (
            "t.trc",
            TRC.replace("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t\n{blank}\n", ""),
            "t.trc row 5 names no coordinates: it begins",
        ),
        ("t.trc", TRC.format(blank="") + "3\t0.02\n", "t.trc row 9 has 2 cells, its header 8"),
    ],
)
def test_what_is_no_file_of_opensim_is_said(name: str, content: str, said: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(content)
    assert refused(tmp_path / name).startswith(said)
