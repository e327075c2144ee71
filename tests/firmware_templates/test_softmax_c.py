"""Probabilities and margins of the C library are those of Python."""

import ctypes
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.softmax import Softmax
from thenar.compiler.firmware.words import numbered
from thenar.runtime.model.integers import IntegerTables

SharedLibrary = Callable[..., ctypes.CDLL]


@pytest.mark.parametrize("scale", [0.7, 3.0, 97.3, 897.0, 6500.0])
def test_probability_and_margin_are_pythons_in_c(shared_library: SharedLibrary, scale: float) -> None:
    classes, random = 14, np.random.default_rng(5)
    rows = random.integers(-9, 10, (3, classes)).astype(np.int16)
    tables = IntegerTables.of(rows[0], rows[1:], (), (), rows[1:], np.zeros((0, classes), np.int16), 1.0)
    tables = replace(tables, scale=scale)
    library = shared_library(Library("hand", numbered(tables), Layout(tables)).files)
    hand, memory = (ctypes.c_void_p * 64)(), (ctypes.c_int16 * 512)()
    library.thenar_init(hand, ctypes.byref(ctypes.c_char.in_dll(library, "thenar_hand_model")), memory)
    first = Layout(tables).frame_size // 2  # scores follow the inputs
    softmax = Softmax(scale)
    for reach in (0, 3, 40, 900, 9000, 32767):
        for _ in range(60):
            scores = np.clip(random.normal(0, reach, classes), -32767, 32767).astype(int).tolist()
            memory[first : first + classes] = scores
            found = [library.thenar_probability(hand, k) & 0xFFFF for k in range(classes + 1)]
            assert found == [*softmax.probabilities(scores), 0]
            second, best = sorted(scores)[-2:]
            assert library.thenar_margin(hand) & 0xFFFF == best - second
