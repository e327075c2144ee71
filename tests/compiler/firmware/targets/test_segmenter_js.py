"""The decoder of segments in JavaScript, run in node: the same states as Python's, tick by tick."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.segments import LAG_US
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.tools import WASM_RUNTIME, call, find, workshop
from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest
from thenar.runtime.published import NONE
from thenar.runtime.segmenting.decoder import Decoder
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

# Two gloves at once, each with a decoder; the second is given back and made anew before the stream.
PROGRAM = """
import { readFileSync, writeFileSync } from "node:fs";
import { load } from "./thenar_hand.js";
const { Glove, Segmenter } = await load(readFileSync("thenar_hand.wasm"));
const { frames, refused } = JSON.parse(readFileSync("frames.json"));
const old = new Segmenter();
old.push(new Glove(), 1);
old.free();
const gloves = [new Glove(), new Glove()];
const segmenters = [new Segmenter(), new Segmenter()];
const states = [[], []];
for (let tick = 0; tick < frames[0].length; tick++) {
    gloves.forEach((glove, which) => {
        const { bits, codes } = frames[which][tick];
        bits.forEach((closed, number) => glove.setSwitch(number, closed));
        codes.forEach((code, joint) => glove.setCode(joint, code));
        states[which].push(segmenters[which].push(glove, glove.update(), refused[which][tick]));
    });
}
writeFileSync("states.json", JSON.stringify(states));
"""


@pytest.mark.parametrize("knows_none", [True, False], ids=["with a class none", "with refusals"])
def test_every_state_of_two_streams_is_python_s(
    tool: Callable[[str], str],
    make_tables: Callable[..., IntegerTables],
    describe: Callable[[IntegerTables], Manifest],
    knows_none: bool,
) -> None:
    target = TARGETS["wasm"]
    if missing := target.missing():
        tool(missing.split()[0])
    tables = make_tables(seed=4, classes=6, reach=60)
    model = SegmentModel.usual(tables.n_classes - knows_none, knows_none, tables.scale)
    manifest = replace(describe(tables), segments=model)
    if knows_none:
        manifest = replace(manifest, grasps=(*manifest.grasps[:-1], NONE))
    random = np.random.default_rng(8)
    ticks = 1200
    # A hand that holds still for a while, and trembles.
    bits = np.repeat(random.random((2, ticks // 40, tables.n_switches)) < 0.4, 40, axis=1)
    bits ^= random.random(bits.shape) < 0.02
    codes = np.repeat(random.integers(0, 256, (2, ticks // 40, tables.n_joints)), 40, axis=1)
    refused = (random.random((2, ticks)) < 0.3) & (not knows_none)
    frames = [
        [{"bits": one.tolist(), "codes": other.tolist()} for one, other in zip(*stream, strict=True)]
        for stream in zip(bits, codes, strict=True)
    ]
    files = target.sources(Library("hand", manifest, arrange(tables), avr=False))
    given = {"frames.json": json.dumps({"frames": frames, "refused": refused.tolist()}), "main.mjs": PROGRAM}
    with workshop({**files, **given}) as folder:
        call([find((("make",), "make"))], folder)
        call([find(WASM_RUNTIME), "main.mjs"], folder)
        states = json.loads(Path(folder, "states.json").read_text())

    build = Build(manifest, tables)
    for which in range(2):
        decoder = Decoder(model, LAG_US // model.tick_us)
        expected = []
        for tick in range(ticks):
            scores = build.scores(bits[which, tick], codes[which, tick].astype(np.uint16))
            expected.append(decoder.push(scores.tolist(), refused=bool(refused[which, tick])).state)
        assert len(set(expected)) > 3
        assert states[which] == expected
