"""Sixteen switches to a port."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.pipeline.parts import port_count, port_of


@given(st.integers(1, 500))
def test_switches_fill_one_port_after_the_other(switches: int) -> None:
    found = port_of(switches)
    assert found.tolist() == [switch // 16 for switch in range(switches)]
    assert port_count(switches) == len(np.unique(found))
