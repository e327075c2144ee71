"""Which type follows which: counted, written, listed in the report."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.movements.transitions import FREQUENT, Transitions
from thenar.runtime.errors import FormatError

from .conftest import make_movements

TYPES = tuple(f"type {number}" for number in range(14))
SEQUENCES = st.lists(st.lists(st.sampled_from(TYPES), max_size=12), max_size=6)


@given(SEQUENCES)
def test_changes_count_once_and_shares_are_per_type(sequences: list[list[str]]) -> None:
    found = Transitions.of(sequences, TYPES)
    assert found.counts.sum() == sum(max(len(each) - 1, 0) for each in sequences)
    sums = found.probabilities.sum(axis=1)
    assert np.allclose(sums[found.counts.sum(axis=1) > 0], 1)
    assert not sums[found.counts.sum(axis=1) == 0].any()
    for place, name in enumerate(TYPES):
        frequent = found.frequent(name)
        shares = [found.probabilities[place, TYPES.index(each)] for each in frequent]
        assert shares == sorted(shares, reverse=True)
        assert all(share >= FREQUENT for share in shares)


def test_nothing_held_is_passed_over_and_what_is_written_is_read(tmp_path: Path) -> None:
    grasp_set = make_movements("A", 2)
    found = Transitions.of_set(grasp_set)
    starts = np.flatnonzero(grasp_set.grasps[1:] != grasp_set.grasps[:-1]) + 1
    held = [grasp_set.grasps[rows[0]] for rows in np.split(np.arange(len(grasp_set)), starts)]
    held = [name for name in held if name != "none"]
    assert found.counts.sum() == len(held) - 1 == 5
    for one, other in pairwise(held):
        assert found.counts[found.types.index(one), found.types.index(other)]
    path = tmp_path / "graph.json"
    path.write_bytes(found.to_json())
    again = Transitions.load(path)
    assert (again.types, again.counts.tolist()) == (found.types, found.counts.tolist())
    for wrong in (b"{}", b'{"types":["a"],"counts":[[1,2]],"probabilities":[[1]]}', b"\xff"):
        path.write_bytes(wrong)
        with pytest.raises(FormatError, match=r"graph\.json is not a transitions file"):
            Transitions.load(path)


def test_a_report_lists_changes_where_the_recordings_are_whole_movements(tmp_path: Path) -> None:
    grasp_set = make_movements("AB", 2)
    apart = replace(grasp_set, trials=np.arange(len(grasp_set)))
    for number, (rows, listed) in enumerate(((grasp_set.without_none(), False), (apart, False), (grasp_set, True))):
        folder = compile_build(rows, tmp_path / f"{number}", rounds=3, folds=0, documents=Documents()).folder
        page = (folder / "report.html").read_text()
        assert ("Transitions between grasp types" in page) == listed
    _, _, section = page.partition("<caption>Changes of grasp type</caption>")
    found = Transitions.of_set(grasp_set)
    assert section.partition("</table>")[0].count("<tr>") == 1 + np.count_nonzero(found.counts)
