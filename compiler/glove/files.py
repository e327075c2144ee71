"""The files of a spec: what a person needs to cut, sew, solder and run the reduced glove."""

from collections.abc import Mapping, Sequence

import msgspec

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap

from ..hand import HandShape
from .dxf import dxf_of
from .ends import BoardPins
from .glove_spec import GloveSpec, glove_spec
from .lists import materials_csv, switches_csv, wiring_csv
from .netlist import netlist_of
from .reading import readme_of
from .svg import svg_of

# All that a spec may hold.
NAMES = frozenset(
    {
        *("README.txt", "bom.csv", "glove.net", "glove.toml", "spec.json", "switches.csv", "wiring.csv"),
        *("cutting.dxf", "cutting.svg"),
    }
)


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
