"""What a build's page is driven by: its data (hand, tables, some rows), and its script."""

import base64
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.hand import HandDrawing
from thenar.runtime.manifest import Calibration, Manifest, Threshold
from thenar.runtime.scores import none_leads

# Of the data, without and with rows: an e-mail takes a page of this size.
MOST_BYTES, _ROWS_BYTES = 500_000, 200_000
_MOST_ROWS = 400
# In dependency order: a module comes after those that it imports.
_PAGE, _TRY = ("page.js",), ("tables.js", "rows.js", "try.js")
_EXPORT = re.compile(r"^export (?:function|class) (\w+)", re.MULTILINE)

Json = Mapping[str, object]


def page_data(
    manifest: Manifest,
    tables: bytes,
    hand: HandDrawing,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
) -> Json:
    """Return the data, at most MOST_BYTES of JSON; the hand alone if tables and hand are larger.

    Parameters
    ----------
    manifest, tables, hand : Manifest, bytes, HandDrawing
        The contents of `build.json`, `tables.bin` and `hand.json`.
    bits, codes : array, shape (n, s) and (n, j)
        Rows as the build reads them, such as those trained on; some of each grasp type are in the data.
    labels : array of int, shape (n,)
        The grasp type of each row, which indexes those of the manifest.
    """
    rejection = manifest.rejection
    data = {
        "classes": manifest.classes,
        "tables": base64.b64encode(tables).decode(),
        "refusal": None
        if rejection is None
        else {
            "least": rejection.least_scores,
            "closed": rejection.closed,
            "ranges": rejection.ranges,
            "outside": rejection.outside,
            "leads": none_leads(rejection, manifest.proof.scale),
        },
        "switches": [_switch(switch.name, switch.threshold) for switch in manifest.switches],
        "joints": [_joint(joint, codes[:, number]) for number, joint in enumerate(manifest.joints)],
        "hand": hand,
        "rows": [],
    }
    left = MOST_BYTES - len(msgspec.json.encode(data))
    if left < 0:
        return {"hand": hand}
    left = min(left, _ROWS_BYTES)
    rows: list[object] = []
    for row in sample(labels, len(manifest.grasps)):
        # A digit for every four switches, the first of them in its lowest bit.
        padded = np.append(bits[row], np.zeros(-bits.shape[1] % 4, np.bool_)).reshape(-1, 4)
        closed = "".join(f"{digit:x}" for digit in (padded @ np.array([1, 2, 4, 8])).tolist())
        rows.append([int(labels[row]), closed, codes[row].tolist()])
        left -= len(msgspec.json.encode(rows[-1])) + 1
        if left < 0:
            rows.pop()
            break
    return {**data, "rows": rows}


def sample(labels: NDArray[np.intp], classes: int) -> list[int]:
    """Return row numbers: equally many of each grasp type, evenly spaced in its rows, one type after the other."""
    each = max(1, _MOST_ROWS // classes)
    found = []
    for label in range(classes):
        mine = np.flatnonzero(labels == label)
        found.append(mine[np.unique(np.linspace(0, len(mine) - 1, each).astype(int))].tolist() if len(mine) else [])
    # If there is room for only a few, they cover all types.
    turns = max(map(len, found), default=0)
    return [mine[turn] for turn in range(turns) for mine in found if turn < len(mine)]


def _line(joint: Calibration) -> dict[str, object]:
    given = msgspec.structs.asdict(joint)
    return {name: given[name] for name in ("name", "unit", "code_a", "value_a", "code_b", "value_b")}


def _switch(name: str, threshold: Threshold | None) -> Json:
    if threshold is None:
        return {"name": name}
    return {"name": name, "code": threshold.code, "taxel": _line(threshold.taxel)}


def _joint(joint: Calibration, codes: NDArray[np.uint16]) -> Json:
    low, high = sorted((joint.code_a, joint.code_b))
    middle = (low + high) // 2
    if len(codes):
        low, middle, high = np.percentile(codes, (0, 50, 100), method="lower").astype(int).tolist()
    return {**_line(joint), "range": [low, max(high, low + 1)], "typical": middle}


def shared(name: str) -> str:
    """Return a file that live pages have, too."""
    return files("thenar.runtime").joinpath("web", "pages", name).read_text(encoding="utf-8")


@lru_cache(maxsize=2)
def script(tries: bool) -> str:
    """Return all modules as one script, each in a separate scope from which its exports are taken; `tries` says whether
    the page has tables to try.
    """
    names = (*_PAGE, *(_TRY if tries else ()))
    own = (files(__package__).joinpath("templates", name).read_text(encoding="utf-8") for name in names)
    return "".join(map(scoped, (shared("hand.js"), *own)))


def scoped(module: str) -> str:
    """Return a module's text as a statement that declares its exports."""
    names, body = _EXPORT.findall(module), _EXPORT.sub(lambda found: found[0].removeprefix("export "), module)
    taken = f"const {{ {', '.join(names)} }} = " if names else ""
    given = f"return {{ {', '.join(names)} }};\n" if names else ""
    return f"{taken}(() => {{\n{body}{given}}})();\n"
