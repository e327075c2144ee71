import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.switch_ghosting import joined, prepare
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import SceneGlove

from ..small import make_batch, make_draw, make_scene, make_setting


def searched(bits: np.ndarray) -> np.ndarray:
    """Return what the matrix reads, by walking from each row along closed switches: the oracle."""
    closed = {divmod(int(switch), 16) for switch in np.flatnonzero(bits)}
    reads = np.zeros_like(bits)
    for row in {row for row, _ in closed}:
        rows, columns = {row}, set[int]()
        while True:
            wider = columns | {column for r, column in closed if r in rows}
            more = rows | {r for r, column in closed if column in wider}
            if (more, wider) == (rows, columns):
                break
            rows, columns = more, wider
        for column in columns:
            if 16 * row + column < len(bits):
                reads[16 * row + column] = True
    return reads


@given(st.integers(1, 160), st.integers(0, 2**32), st.floats(0.0, 0.25))
def test_the_matrix_reads_what_a_walk_through_it_finds(switches: int, seed: int, share: float) -> None:
    bits = np.random.default_rng(seed).random((4, switches)) < share
    assert np.array_equal(joined(bits), [searched(one) for one in bits])


@pytest.mark.parametrize("shape", [(2, 3, 160), (1, 1, 5)])
def test_every_frame_is_a_matrix_of_its_own(shape: tuple[int, ...]) -> None:
    batch = make_batch(range(shape[0]))
    batch.bits = bits = np.random.default_rng(2).random(shape) < 0.1
    draw = make_draw("switch.ghosting", batch)
    prepare(make_setting())(batch, draw)
    assert batch.bits.shape == shape
    for place in np.ndindex(*shape[:2]):
        assert np.array_equal(batch.bits[place], searched(bits[place]))
    assert not draw.draws


@pytest.mark.parametrize(
    ("others", "reads"),
    [
        ([], []),
        ([("switch.stuck_closed", {"switches": (18, 23, 82)})], [18, 23, 82, 87]),
        # What is stuck open reads closed by way of the others; a dead port reads open, but its wires still join.
        (
            [
                ("switch.stuck_open", {"switches": (87,)}),
                ("switch.stuck_closed", {"switches": (18, 23, 82)}),
                ("port.dead", {"ports": (1,)}),
            ],
            [82, 87],
        ),
    ],
)
def test_current_flows_through_stuck_switches_and_dead_ports(others: list, reads: list[int]) -> None:
    """Row 1, columns 2 and 7, and row 5, column 2; the threshold is so high that the hand closes nothing."""
    batch, effects = make_batch(range(1)), ["switch.ghosting", *others]
    glove = SceneGlove(threshold_n=20.0)
    compile_pipeline(make_scene(effects, glove=glove)).run([batch], Ledger())
    assert np.flatnonzero(batch.bits[0, 0]).tolist() == reads
