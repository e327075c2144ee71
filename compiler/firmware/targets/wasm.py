"""WebAssembly: the C in a .wasm, with a JavaScript module around it that needs only WebAssembly from its runtime."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..tools import WASM_COMPILER, WASM_LINKER, WASM_RUNTIME, call, find, lacking, workshop
from .base import Target

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

_MAKE = (("make",), "make")


@dataclass(frozen=True, kw_only=True)
class Wasm(Target):
    """Browsers, node, and any other WebAssembly runtime."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, the JavaScript module with its types, and the sources of the .wasm."""
        from thenar.firmware_templates.rendering import render
        from thenar.runtime.code_line import FARTHEST

        from ..segments import decoder_values
        from ..words import answers_of, inputs_in_words, none_of

        name, names, files = library.name, library.names, library.whole
        inputs = inputs_in_words(len(names.switches), len(names.joints))
        sentence = f"Recognises {len(names.grasps)} grasp types from {inputs} of a glove."
        values = {
            "name": name,
            "opening": f"thenar_{name}: {sentence} From the tables {names.tables_sha256[:16]}.",
            "sentence": sentence,
            "classes": len(names.grasps),
            "switches": len(names.switches),
            "joints": len(names.joints),
            "rejection": names.rejection is not None,
            "nothing_held": none_of(names),
            "segments": None if names.segments is None else decoder_values(names.segments),
            "highest_code": (1 << library.layout.code_bits) - 1,
            "grasps": _array(names.grasps),
            "names": _array(answers_of(names)),
            "switch_names": _array(switch.name for switch in names.switches),
            "joint_names": _array(joint.name for joint in names.joints),
            "sensors": len(library.sensors.every),
            "sensor_names": _array(sensor.name for sensor in library.sensors.every),
            "sorts": library.sensors.sorts,
            "farthest": FARTHEST,
            "sources": [*(path for path in files if path.endswith(".c")), f"thenar_{name}_wasm.c"],
            "headers": [path for path in files if path.endswith(".h")],
        }
        own = [f"thenar_NAME{ending}" for ending in ("_wasm.c", ".js", ".d.ts")]
        return {
            **files,
            **{
                of.replace("NAME", name): render(f"wasm/{of}.j2", **values) for of in (*own, "Makefile", "package.json")
            },
        }

    def sources(self, library: "Library") -> dict[str, str]:
        """Return all files, since `run` runs the JavaScript module."""
        return self.files(library)

    def missing(self) -> str | None:
        """Return which of compiler, linker and node is missing, and how to install it; None if none is."""
        return lacking(WASM_COMPILER, WASM_LINKER, WASM_RUNTIME, _MAKE)

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
    ) -> "Predictions":
        """Return the JavaScript module's predictions for frames (n, F), as in the base class, in node."""
        from thenar.firmware_templates.rendering import render

        from ..probes import answers_in, check_frames, record_values, with_lost

        check_frames(frames, layout)
        make, node = find(_MAKE), find(WASM_RUNTIME)
        values = record_values(name, layout, "update" if incremental else "classify", lost=lost is not None)
        values["places"] = json.dumps(values["places"])
        main = render("checking/record.mjs.j2", **values)
        with workshop({**files, "main.mjs": main, "frames": with_lost(frames, lost).tobytes()}) as folder:
            call([make, "CFLAGS=-O2 -Werror"], folder)
            call([node, "main.mjs"], folder)
            return answers_in((folder / "predictions").read_bytes(), frames, layout)


def _array(texts: Iterable[str]) -> str:
    """Return a frozen JavaScript array of strings."""
    return f"Object.freeze({json.dumps(list(texts), indent=4)})"


MEMBER = Wasm(
    name="wasm",
    part="wasm",
    title="WebAssembly",
    help="a module for browsers and node: WebAssembly, a JavaScript wrapper and its types",
    next_step="`make -C {folder}` compiles it",
    rank=41,
    own_layout=False,
    kind="wasm",
)
