"""`try_html`: a build to try out in a browser, its tables, its hand and some of its rows in one file."""

import base64
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.drivers.extras import optional
from thenar.runtime.hand import HandDrawing
from thenar.runtime.manifest import Calibration, Manifest, Threshold
from thenar.runtime.scores import none_leads

from ..facts import SensorCount
from ..pictures import embedded, policy_hash, templates
from ..samples import Samples

with optional():
    from jinja2 import Environment
    from markupsafe import Markup

MOST_BYTES = 500_000
_MOST_ROWS = 400
# To keep the page small with its rows.
_ROWS_BYTES = 200_000
# In dependency order: a module comes after those that it imports.
_MODULES = ("tables.js", "rows.js", "try.js")
_EXPORT = re.compile(r"^export (?:function|class) (\w+)", re.MULTILINE)

Json = Mapping[str, object]


def try_html(manifest: Manifest, tables: bytes, hand: HandDrawing, samples: Samples) -> bytes | None:
    """Return the page in UTF-8, at most MOST_BYTES; None where tables and hand alone are larger.

    Parameters
    ----------
    manifest, tables, hand : Manifest, bytes, HandDrawing
        The contents of `build.json`, `tables.bin` and `hand.json`.
    samples : Samples
        The training rows, as the build reads them; some of each grasp type go into the page.
    """
    codes, labels, rejection = samples.codes, samples.labels, manifest.rejection
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
    }
    bare = _rendered(manifest, {**data, "rows": []})
    some: list[object] = []
    left = min(MOST_BYTES - len(bare), _ROWS_BYTES)
    if left < 0:
        return None
    for row in sample(labels, len(manifest.grasps)):
        # A digit for every four switches, the first of them in its lowest bit.
        padded = np.append(samples.switches[row], np.zeros(-samples.n_switches % 4, np.bool_)).reshape(-1, 4)
        closed = "".join(f"{digit:x}" for digit in (padded @ np.array([1, 2, 4, 8])).tolist())
        each = [int(labels[row]), closed, codes[row].tolist()]
        left -= len(msgspec.json.encode(each)) + 1
        if left < 0:
            break
        some.append(each)
    return _rendered(manifest, {**data, "rows": some})


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
    low, middle, high = np.percentile(codes, (0, 50, 100), method="lower").tolist() if len(codes) else (0, 0, 1)
    return {**_line(joint), "range": [int(low), max(int(high), int(low) + 1)], "typical": int(middle)}


def _rendered(manifest: Manifest, data: Json) -> bytes:
    style, script = _style(), _script()
    levels = sum(switch.threshold is not None for switch in manifest.switches)
    # What the page's first state is, too.
    open_all = ["All switches open"] if manifest.switches else []
    neutral = ", ".join([*open_all, *(["joints at the medians of the rows"] if manifest.joints else [])])
    page = (
        _environment()
        .get_template("try.html.j2")
        .render(
            style=Markup(style),
            style_sha256=policy_hash(style),
            script=Markup(script),
            script_sha256=policy_hash(script),
            sentence=f"It distinguishes {len(manifest.classes)} classes by {SensorCount.of_build(manifest)}.",
            levels=levels,
            neutral=neutral[:1].upper() + neutral[1:],
            knows_none=manifest.knows_none,
            checksum=manifest.checksum[:16],
            version=manifest.thenar,
            data=embedded(data),
        )
    )
    return page.encode()


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return templates(__package__, "templates")


def _own(name: str) -> str:
    return files(__package__).joinpath("templates", name).read_text(encoding="utf-8")


def _shared(name: str) -> str:
    return files("thenar.runtime").joinpath("web", "pages", name).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _style() -> str:
    return f"{_shared('hand.css')}{_own('try.css')}"


@lru_cache(maxsize=1)
def _script() -> str:
    """Return all modules as one script, each in a separate scope from which its exports are taken."""
    return "".join(map(scoped, (_shared("hand.js"), *map(_own, _MODULES))))


def scoped(module: str) -> str:
    """Return a module's text as a statement that declares its exports."""
    names, body = _EXPORT.findall(module), _EXPORT.sub(lambda found: found[0].removeprefix("export "), module)
    taken = f"const {{ {', '.join(names)} }} = " if names else ""
    given = f"return {{ {', '.join(names)} }};\n" if names else ""
    return f"{taken}(() => {{\n{body}{given}}})();\n"
