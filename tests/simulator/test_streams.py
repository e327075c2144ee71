"""Random numbers by draw site."""

from collections import Counter
from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.streams import Draw, RandomWords, Site
from thenar.stability.reference.intervals import normal_quantile
from thenar.stability.reference.numbers import distance

NAME = st.text(alphabet="abc", max_size=3)


def draw_for(
    seed: int = 1,
    effect: str = "joint.noise",
    subject: str = "A",
    grasp: str = "PoS",
    thing: str = "ball",
    repetitions: list[int] | None = None,
) -> Draw:
    numbers = np.array([0, 1, 2] if repetitions is None else repetitions, dtype=np.int64)
    return Draw(seed, effect, Site(subject, grasp, thing, numbers), Counter())


def every_draw(draw: Draw) -> tuple[bytes, bytes, bytes]:
    return tuple(  # type: ignore[return-value]
        numbers.words.tobytes() for numbers in (draw.per_repetition(2), draw.per_subject(2), draw.per_glove(2))
    )


@given(st.lists(st.integers(0, 2**40), min_size=1, max_size=6), st.integers(1, 5))
def test_a_repetition_draws_the_same_in_any_company_and_order(repetitions: list[int], size: int) -> None:
    together = draw_for(repetitions=repetitions).per_repetition(size).words
    for row, number in enumerate(repetitions):
        np.testing.assert_array_equal(draw_for(repetitions=[number]).per_repetition(size).words[0], together[row])


@given(st.integers(1, 6), st.integers(0, 6))
def test_who_asks_for_more_gets_the_same_and_then_more(few: int, more: int) -> None:
    short, long = (draw_for().per_repetition(size).words for size in (few, few + more))
    np.testing.assert_array_equal(long[:, :few], short)


def test_shapes_are_filled_row_by_row() -> None:
    flat, shaped = draw_for().per_repetition(6).words, draw_for().per_repetition(2, 3).words
    np.testing.assert_array_equal(shaped.reshape(3, 6), flat)
    assert draw_for().per_repetition().words.shape == (3,)
    assert draw_for().per_subject(4, 2).words.shape == (4, 2)


SITES = st.tuples(st.integers(0, 3), NAME, NAME, NAME, NAME)


@given(SITES, SITES)
def test_other_seeds_effects_subjects_types_and_objects_draw_otherwise(one: tuple, other: tuple) -> None:
    first, second = (draw_for(*site).per_repetition(2).words.tobytes() for site in (one, other))
    assert (first == second) == (one == other)


@given(SITES, SITES)
def test_what_is_the_subjects_own_depends_on_nothing_else(one: tuple, other: tuple) -> None:
    first, second = (draw_for(*site).per_subject(2).words.tobytes() for site in (one, other))
    assert (first == second) == (one[:3] == other[:3])


@given(SITES, SITES)
def test_what_is_the_gloves_own_depends_on_seed_and_effect_alone(one: tuple, other: tuple) -> None:
    first, second = (draw_for(*site).per_glove(2).words.tobytes() for site in (one, other))
    assert (first == second) == (one[:2] == other[:2])


def test_repetition_subject_and_glove_draw_apart() -> None:
    assert len(set(every_draw(draw_for(repetitions=[0])))) == 3


def test_names_that_read_alike_when_joined_draw_apart() -> None:
    assert every_draw(draw_for(grasp="ab", thing="c")) != every_draw(draw_for(grasp="a", thing="bc"))
    assert every_draw(draw_for(seed=1, effect="1x")) != every_draw(draw_for(seed=11, effect="x"))


def test_every_number_drawn_is_counted() -> None:
    draw = draw_for()
    every_draw(draw)
    assert dict(draw.draws) == {"joint.noise": 3 * 2 + 2 + 2}


def test_words_are_those_of_philox_on_every_machine_and_of_every_numpy() -> None:
    words = draw_for(repetitions=[5]).per_repetition(3).words
    assert words.tolist() == [GOLDEN]


WORDS = st.integers(0, 2**64 - 1)


@given(WORDS)
def test_uniform_numbers_lie_strictly_between_zero_and_one(word: int) -> None:
    (number,) = RandomWords(np.array([word], dtype=np.uint64)).uniform()
    assert 0.0 < number < 1.0
    assert abs(Fraction(float(number)) - Fraction(word, 2**64)) <= Fraction(1, 2**52)


@given(WORDS)
def test_a_normal_number_is_the_quantile_of_the_uniform_one(word: int) -> None:
    numbers = RandomWords(np.array([word], dtype=np.uint64))
    truth = normal_quantile(float(numbers.uniform()[0]))
    # AS 241 is good to about 1e-16 of the number; a dozen roundings come on top.
    assert distance(float(numbers.normal()[0]), truth) <= 1e-15 * max(abs(float(truth)), 1e-3)


def test_normal_numbers_are_symmetric() -> None:
    words = draw_for().per_glove(1000).words
    np.testing.assert_array_equal(RandomWords(~words).normal(), -RandomWords(words).normal())


def test_a_hundred_thousand_normal_numbers_have_the_moments_of_a_normal_law() -> None:
    numbers = draw_for().per_glove(100_000).normal()
    # Four standard errors of each: their squares are 1, 2 and 96 over n.
    assert abs(numbers.mean()) < 4 * (1 / 1e5) ** 0.5
    assert abs((numbers**2).mean() - 1.0) < 4 * (2 / 1e5) ** 0.5
    assert abs((numbers**4).mean() - 3.0) < 4 * (96 / 1e5) ** 0.5


GOLDEN = [544163704864425136, 684730265985137141, 15270083872920736556]
