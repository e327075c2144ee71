"""What users write by hand, or let thenar write for them: gloves, calibrations, preshapes, scenes, postures."""

from pathlib import Path

from material import GLOVE_TOML, GRASPS, SENSORS, Format, harness, loaded_build
from mutating import toml_file

from thenar.compiler.firmware.rows import rows_files
from thenar.compiler.glove.files import spec_files
from thenar.compiler.placement.ports import ports_of_whole_glove
from thenar.compiler.recordings.taxonomy import collected, published
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.calibration import AngleReader, codes_of_bytes, load_calibration
from thenar.runtime.harness.loading import load_harness, parse_harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.sources import Sources
from thenar.runtime.manifest import Calibration
from thenar.runtime.preshape import SHIPPED, load_preshapes
from thenar.runtime.recording.guide import planned
from thenar.runtime.recording.session import Collection
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us
from thenar.simulator.pipeline.scene_file import load_catalogue, load_scene
from thenar.simulator.pipeline.simulation import conditions_of
from thenar.simulator.pipeline.steps import compile_pipeline
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes import shipped


def _kept() -> list[str]:
    return [switch.name for switch in loaded_build().manifest.switches]


def _gloves() -> list[bytes]:
    return [GLOVE_TOML.encode(), harness_to_toml(harness()).encode(), _BOARD.encode()]


def _glove(data: bytes, folder: Path) -> None:
    """Plan, time and write a wiring, the sketches of its boards, and make its devices, none of which is opened."""
    path = folder / "glove.toml"
    path.write_bytes(data)
    found = load_harness(path)
    parse_harness(harness_to_toml(found), "written.toml")
    if any(stream.board for stream in found.streams):
        rows_files("board", loaded_build().manifest, found)
    ports_of_whole_glove(found, found.switches)
    Sources(found, found.switches, whole_scan(found, found.switches))
    scan = plan_scan(_kept(), found)
    scan_us(scan, found)
    spec_files(loaded_build().manifest, None, found)


_FINGERS = [f"finger_{number}" for number in range(6)]
_BOARD = f"""\
name = "board"
[[stream]]
port = "/dev/ttyACM0"
rate_hz = 200
switches = {_FINGERS}
joints = {{ {SENSORS[0]} = [0, 1023], {SENSORS[1]} = [0, 1023], {SENSORS[2]} = [0, 1023] }}
[stream.board]
pins = {{ finger_0 = "2", {SENSORS[0]} = "A0", {SENSORS[1]} = "A1.3", {SENSORS[2]} = "A1.4" }}
select = ["4", "5", "6", "7"]
matrix = {{ rows = ["8", "9"], columns = ["10"], keys = [["finger_1"], ["finger_2"]], diodes = true }}
[[stream.board.chip]]
kind = "mcp23017"
address = 0x20
pins = {{ GPA0 = "finger_3", GPB0 = "finger_4", GPA2 = "finger_5" }}
"""


def _calibrations() -> list[bytes]:
    lines = tuple(SensorCalibration(name, 40 + number, 0.0, 200, 90.0) for number, name in enumerate(SENSORS_18))
    text = GloveCalibration(subject="anna", sensors=lines).to_toml()
    inline = "".join(
        f'    {{ name = "{name}", raw_a = 40, value_a = 0.0, raw_b = 200, value_b = 90.0 }},\n' for name in SENSORS
    )
    return [text.encode(), f'subject = "bert"\nunit = "deg"\nsensor = [\n{inline}]\n'.encode()]


def _calibration(data: bytes, folder: Path) -> None:
    path = folder / "anna.toml"
    path.write_bytes(data)
    calibration = load_calibration(path)
    (folder / "again.toml").write_text(calibration.to_toml())
    load_calibration(folder / "again.toml")
    AngleReader(SENSORS_18, calibration).angles(bytes(18))
    codes_of_bytes(Calibration(0, SENSORS[0], "deg", 0, -250.0, 1000, 250.0), calibration)


def _preshape_tables() -> list[bytes]:
    from importlib.resources import files

    return [files("thenar.runtime.preshape").joinpath("tables", f"{name}.toml").read_bytes() for name in SHIPPED]


def _preshapes(data: bytes, folder: Path) -> None:
    path = folder / "hand.toml"
    path.write_bytes(data)
    table = load_preshapes(path)
    table.check(("PoS", *GRASPS))


def _scenes() -> list[bytes]:
    objects = "".join(
        f'[[objects]]\nname = "thing {number}"\ngrasp = "{grasp}"\nshape = "cylinder"\ndiameter_mm = 32.0\n'
        f"length_mm = 260.0\nmass_g = 200.0\n"
        for number, grasp in enumerate(_kamakura(), 1)
    )
    subjects = '[[subjects]]\nname = "A"\nhand_length_mm = 188\nhand_breadth_mm = 84\n'
    own = f'seed = 1\ntaxonomy = "kamakura14"\nrepetitions = 2\n{subjects}{objects}'
    return [own.encode(), *(file.read_bytes() for file in shipped().values())]


def _kamakura() -> tuple[str, ...]:

    return published("kamakura14").types


def _scene(data: bytes, folder: Path) -> None:
    """Read a scene as far as the first grasp."""
    path = folder / "scene.toml"
    path.write_bytes(data)
    scene = load_scene(path)
    compile_pipeline(scene)
    conditions_of(scene, scene.subjects[0], Postures.shipped(scene.taxonomy))


def _catalogues() -> list[bytes]:
    scene = _scenes()[0].decode()
    return [f'taxonomy = "kamakura14"\n{scene[scene.index("[[objects]]") :]}'.encode()]


def _catalogue(data: bytes, folder: Path) -> None:
    path = folder / "catalogue.toml"
    path.write_bytes(data)
    load_catalogue(path)


_OBJECTS = '"PoS" = ["bottle", "broom"]\n"Tip" = ["pin", "bead"]\nLat = ["key"]\n'


def _objects(data: bytes, folder: Path) -> None:
    """Read what is to be collected, and plan it."""
    path = folder / "objects.toml"
    path.write_bytes(data)
    for taxonomy in ("kamakura14", "own"):
        types, tasks = collected(taxonomy, path)
        planned(Collection("anna", types.name, types.types, tasks, 2, 1))


FORMATS = (
    Format("glove.toml", _gloves, toml_file, _glove),
    Format("calibration.toml", _calibrations, toml_file, _calibration),
    Format("preshapes.toml", _preshape_tables, toml_file, _preshapes),
    Format("scene.toml", _scenes, toml_file, _scene),
    Format("objects.toml", lambda: [_OBJECTS.encode()], toml_file, _objects),
    Format("catalogue.toml", _catalogues, toml_file, _catalogue),
)
