from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.effects.port_dead import MEMBER, prepare
from thenar.simulator.errors import SceneError

from ..small import make_batch, make_condition, make_draw, make_setting


def read(parameters: dict[str, Any], seed: int = 7, condition: Condition | None = None) -> np.ndarray:
    """Return how many switches of each port read closed where all are."""
    batch = make_batch(range(2), condition)
    batch.bits = np.ones((2, 3, 160), dtype=np.bool_)
    prepare(make_setting(), **parameters)(batch, make_draw("port.dead", batch, seed))
    by_port = np.add.reduceat(batch.bits, np.arange(0, 160, 16), axis=2, dtype=np.int64)
    assert (by_port == by_port[0, 0]).all()
    closed: np.ndarray = by_port[0, 0]
    return closed


def test_the_ports_that_are_named_read_open_and_no_others() -> None:
    assert read({"ports": (0, 3)}).tolist() == [0, 16, 16, 0, 16, 16, 16, 16, 16, 16]


@pytest.mark.parametrize("count", [1, 4, 10])
def test_so_many_ports_are_drawn_for_the_glove(count: int) -> None:
    dead = read({"count": count}) == 0
    assert dead.sum() == count
    assert np.array_equal(read({"count": count}) == 0, dead)


def test_other_gloves_have_other_dead_ports_and_one_by_default() -> None:
    first = {int(np.flatnonzero(read({}, seed=seed) == 0)[0]) for seed in range(40)}
    assert len(first) > 5


def test_the_same_ports_are_dead_for_every_subject() -> None:
    dead = [read({"count": 3}, condition=make_condition(subject=subject)).tolist() for subject in "ABC"]
    assert dead == [dead[0]] * 3


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"ports": (1, 10)}, r"effects\.port\.dead\.ports: the glove has no port 10: they go from 0 to 9"),
        ({"count": 11}, r"effects\.port\.dead\.count: 11 ports cannot be dead: the glove has 10"),
    ],
)
def test_ports_that_are_not_there_are_refused_before_anything_is_simulated(
    parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        prepare(make_setting(), **parameters)


@pytest.mark.parametrize("wrong", [{"ports": []}, {"ports": [-1]}, {"count": 0}])
def test_no_ports_and_negative_ones_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(wrong, MEMBER.parameters())
