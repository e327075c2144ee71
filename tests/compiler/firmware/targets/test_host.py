from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets.host import MEMBER as HOST

from ....tables import describe
from ..conftest import make_tables


@pytest.fixture
def files() -> Callable[[Layout], dict[str, str]]:
    """Return what writes the classifier "hand" of a layout."""
    return lambda layout: Library("hand", describe(layout.tables), layout).files


Files = Callable[[Layout], dict[str, str]]


def test_no_frames_have_no_answers(files: Files) -> None:
    layout = Layout(make_tables())
    answers = HOST.run(files(layout), "hand", layout, np.zeros((0, 8), np.uint8))
    assert answers.scores.shape == (0, 5)
    assert answers.classes.shape == (0,)


OTHERS: dict[str, np.ndarray] = {
    "size": np.zeros((3, 7), np.uint8),
    "type": np.zeros((3, 8), np.int16),
    "one_frame": np.zeros(8, np.uint8),
}


@pytest.mark.parametrize("other", list(OTHERS))
def test_frames_of_another_layout_are_refused(other: str) -> None:
    layout = Layout(make_tables())
    with pytest.raises(FirmwareError, match=r"this layout takes uint8 \(n, 8\)"):
        HOST.run({}, "hand", layout, OTHERS[other])


def test_a_warning_is_an_error_that_shows_it(files: Files) -> None:
    layout = Layout(make_tables())
    untidy = files(layout) | {"untidy.c": "int twice(int x); int twice(int x) { int idle; return 2 * x; }\n"}
    with pytest.raises(FirmwareError, match=r"(?s)ended with 1: .*untidy\.c.*unused variable .*idle"):
        HOST.run(untidy, "hand", layout, np.zeros((1, 8), np.uint8))


def test_a_sanitizer_s_finding_is_an_error_that_shows_it(files: Files) -> None:
    layout = Layout(make_tables())
    made = files(layout)
    head = "uint16_t thenar_classify(thenar *hand)\n{\n"
    broken = made | {"thenar.c": made["thenar.c"].replace(head, head + OVERFLOW)}
    assert broken != made
    with pytest.raises(FirmwareError, match="signed integer overflow"):
        HOST.run(broken, "hand", layout, np.zeros((1, 8), np.uint8))


OVERFLOW = "    volatile int most = 2147483647;\n    most = most + 1;\n"


def test_a_program_that_answers_too_few_frames_is_an_error(files: Files) -> None:
    layout = Layout(make_tables())
    made = files(layout)
    early = {"early.c": "#include <stdlib.h>\n__attribute__((constructor)) static void leave(void) { exit(0); }\n"}
    with pytest.raises(FirmwareError, match="printed 0 names for 5 grasp types"):
        HOST.run(made | early, "hand", layout, np.zeros((2, 8), np.uint8))
