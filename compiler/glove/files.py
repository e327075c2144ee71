"""The files of a spec: what a person needs to cut, sew, solder and run the reduced glove; and their folder."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap

from ..hand import HandShape
from ..publication import check_folder, entries, publish_folder
from .drawings import dxf_of, svg_of
from .layout import BoardPins
from .lists import materials_csv, readme_of, switches_csv, wiring_csv
from .netlist import netlist_of
from .spec import GloveSpec, SpecError, glove_spec

# All that a spec may hold.
NAMES = frozenset(
    {
        *("README.txt", "bom.csv", "glove.net", "glove.toml", "spec.json", "switches.csv", "wiring.csv"),
        *("cutting.dxf", "cutting.svg"),
    }
)
_MARK = "spec.json"


def spec_files(
    manifest: Manifest,
    scan: ScanMap | None = None,
    harness: Harness | None = None,
    hand: HandShape | None = None,
    boards: Sequence[BoardPins | None] = (),
) -> Mapping[str, bytes]:
    """Return name -> content of the files of a build's spec; the same arguments give the same bytes.

    Arguments and errors are those of `glove_spec`.
    """
    return files_of(glove_spec(manifest, scan, harness, hand, boards))


def files_of(spec: GloveSpec) -> Mapping[str, bytes]:
    """Return name -> content of a spec's files: no pattern to cut where nobody knows where the switches lie."""
    summary = spec.summary
    files = {
        "README.txt": readme_of(summary).encode(),
        "bom.csv": materials_csv(summary.materials),
        "glove.net": netlist_of(spec.circuit, summary.glove),
        "glove.toml": harness_to_toml(spec.harness).encode(),
        "spec.json": msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n",
        "switches.csv": switches_csv(summary),
        "wiring.csv": wiring_csv(summary),
    }
    if spec.pattern is None:
        return files
    return {**files, "cutting.dxf": dxf_of(spec.pattern), "cutting.svg": svg_of(spec.pattern)}


def check_output(folder: Path) -> None:
    """Raise SpecError unless a spec may be put there: a new or empty folder, or one that holds a spec."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    check_folder(folder, users_files, SpecError)


def write_spec(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a spec as `folder`, in place of an older spec. Raises SpecError as `check_output` does."""
    publish_folder(files, folder, users_files, SpecError)


def users_files(folder: Path) -> list[str]:
    """Return the user's entries of the folder of a spec. Raises SpecError if it holds no spec."""
    if any(folder.iterdir()) and not (folder / _MARK).is_file():
        raise SpecError(f"{folder} is there already and is no spec: name another folder")
    return [path for path in entries(folder) if path not in NAMES]
