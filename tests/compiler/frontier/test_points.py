from typing import Any

import msgspec
import pytest

from thenar.compiler.frontier.points import FrontierError, frontier_from_bytes, frontier_to_bytes


@pytest.mark.parametrize("name", ["\x1b]0;owned\x07", "two\nlines", "a\u202eb", "?", "x" * 201])
def test_a_frontier_whose_names_would_deceive_is_refused(examples: Any, name: str) -> None:
    made = examples.example_frontier()
    point = msgspec.structs.replace(made.points[0], switches=(name,))
    for changed in ({"grasps": (name, *made.grasps)}, {"points": (point, *made.points[1:])}):
        with pytest.raises(FrontierError, match=r"holds a control|at most 200|missing value") as refused:
            frontier_from_bytes(frontier_to_bytes(msgspec.structs.replace(made, **changed)))
        assert str(refused.value).isprintable()
