import numpy as np
import pytest

from thenar.compiler.samples import Samples, TrainingError


def make(n: int = 4, labels: tuple[int, ...] = (0, 1, 1, 2), classes: int = 3) -> Samples:
    bits = np.arange(n)[:, np.newaxis] >> np.arange(3) & 1 == 1
    return Samples(bits, np.zeros((n, 0), np.uint16), np.array(labels, dtype=np.intp), tuple(map(str, range(classes))))


def test_some_of_the_rows_are_a_learning_of_as_many_classes() -> None:
    some = make().rows(np.array([1, 3]))
    assert (some.n_switches, some.n_classes, some.labels.tolist()) == (3, 3, [1, 2])
    assert some.switches.tolist() == [[True, False, False], [True, True, False]]


@pytest.mark.parametrize(
    ("n", "labels", "classes"), [(3, (0, 1, 1, 2), 3), (0, (), 1), (4, (0, 1, 1, 2), 2), (4, (0, -1, 1, 2), 3)]
)
def test_what_does_not_fit_together_is_refused(n: int, labels: tuple[int, ...], classes: int) -> None:
    with pytest.raises(TrainingError):
        make(n, labels, classes)
