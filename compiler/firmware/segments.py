"""The decoder of segments: the core's files and the costs of a build in C, and the values for other languages."""

from typing import Any

from thenar.firmware_templates.rendering import file_text, render
from thenar.runtime.segmenting.model import SegmentModel

from . import FirmwareError

LAG_US = 150_000
_MOST_STATES = 255  # which a byte numbers
_NO_CHANGE = {"enter": 0, "direct": 0, "leave": 0}


SEGMENT_FILES = ("thenar_segments.h", "thenar_segments.c")
"""The decoder itself, which is the same for every build."""


def segment_files(name: str, model: SegmentModel) -> dict[str, str]:
    """Return the texts of the decoder, and of the costs thenar_`name`_segments.h and .c.

    Raises FirmwareError if there are too many states.
    """
    values = decoder_values(model)
    limit = -(-model.most * 256 // model.gain) << model.shift
    clipped = model.most if limit <= 65535 else min((65535 >> model.shift) * model.gain >> 8, model.most)
    values |= {
        "name": name,
        "upper": name.upper(),
        "limit": min(limit, 65535),
        "clipped": clipped,
        "one_leave": len(set(model.leave)) == 1,
    }
    costs = {
        f"thenar_{name}_segments{ending}": render(f"tables/thenar_NAME_segments{ending}.j2", **values)
        for ending in (".h", ".c")
    }
    return {path: file_text(f"core/{path}") for path in SEGMENT_FILES} | costs


def decoder_values(model: SegmentModel) -> dict[str, Any]:
    """Return the values for a template of the decoder in any language. Raises FirmwareError for too many states."""
    if model.n_types >= _MOST_STATES:
        raise FirmwareError(f"{model.n_types} grasp types: the segment decoder takes at most {_MOST_STATES - 1}")
    states, rings = _laid_out(model)
    return {
        "model": model,
        "types": model.n_types,
        "refusal": model.refusal,
        "lag": lag_of(model),
        "states": states,
        "groups": rings,
        "waiting": rings[-1]["end"] if rings else 0,
        "mask_bytes": -(-len(states) // 8),
    }


def lag_of(model: SegmentModel) -> int:
    """Return the ticks until a tick's state is known."""
    return min(max(LAG_US // model.tick_us, 1), 250)


def times_of(model: SegmentModel) -> dict[str, str]:
    """Return the time of a tick, and that until its state is known, in ms: values for texts."""
    return {"tick_ms": f"{model.tick_us / 1000:g}", "lag_ms": f"{model.tick_us * lag_of(model) / 1000:g}"}


def _laid_out(model: SegmentModel) -> tuple[list[dict[str, int]], list[dict[str, int]]]:
    """Return the costs of each state, and its ring and place in it; and the rings in which states wait until they have
    lasted long enough, one for each shortest duration: from `begin` to `end`, `width` a row.
    """
    numbers: dict[int, int] = {}
    rings: list[dict[str, int]] = []
    end, K = 0, model.n_types
    for least in sorted({each for each in model.least if each > 1}, key=model.least.index):
        width, begin = model.least.count(least), end
        end = begin + width * (least - 1)
        numbers[least] = len(rings)
        rings.append({"begin": begin, "end": end, "width": width})
    usual = max(model.stay, key=model.stay.count)
    states = []
    for k, least in enumerate(model.least):
        change = {"enter": model.enter[k], "direct": model.direct[k], "leave": model.leave[k]} if k < K else _NO_CHANGE
        # Only differences between states matter, so the usual cost is subtracted; smaller ones wrap modulo 2^16.
        stay = (model.stay[k] - usual) % 65536
        place = {"ring": numbers.get(least, 0), "place": model.least[:k].count(least)}
        states.append({**change, "stay": stay, "least": least, **place})
    return states, rings
