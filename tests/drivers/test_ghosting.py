from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.scanner import read_without_diodes
from thenar.drivers.scanner_state import ambiguous

MATRICES = st.tuples(st.integers(1, 5), st.integers(1, 5)).flatmap(
    lambda size: st.tuples(st.just(size[0]), st.just(size[1]), st.integers(0, (1 << size[0] * size[1]) - 1))
)


def test_three_corners_of_a_rectangle_make_all_four_doubtful() -> None:
    pressed = 0b0011_0000_0001  # rows of four: key 0, and keys 8 and 9
    read = read_without_diodes(pressed, 3, 4)
    assert read == 0b0011_0000_0011
    assert ambiguous(read, 3, 4) == read


def test_keys_of_one_row_or_one_column_are_sure() -> None:
    assert ambiguous(0b1111, 4, 4) == 0
    assert ambiguous(0b0001_0001_0001, 4, 4) == 0


@given(MATRICES)
def test_what_is_not_doubtful_is_as_pressed(matrix: tuple[int, int, int]) -> None:
    rows, columns, pressed = matrix
    read = read_without_diodes(pressed, rows, columns)
    sure = ~ambiguous(read, rows, columns)
    assert read & sure == pressed & sure
    assert read & pressed == pressed


@given(MATRICES)
def test_what_is_doubtful_reads_closed_and_might_be_open(matrix: tuple[int, int, int]) -> None:
    rows, columns, pressed = matrix
    read = read_without_diodes(pressed, rows, columns)
    doubtful = ambiguous(read, rows, columns)
    assert doubtful & ~read == 0
    for key in range(rows * columns):
        if doubtful >> key & 1:
            assert read_without_diodes(read & ~(1 << key), rows, columns) == read


@given(MATRICES, st.lists(st.integers(0, 24), max_size=2))
def test_two_keys_are_always_right(matrix: tuple[int, int, int], keys: list[int]) -> None:
    rows, columns, _ = matrix
    pressed = sum({1 << key % (rows * columns) for key in keys})
    assert read_without_diodes(pressed, rows, columns) == pressed
    assert ambiguous(pressed, rows, columns) == 0
