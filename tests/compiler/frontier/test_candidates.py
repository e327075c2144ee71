from thenar.compiler.frontier.candidates import NO_SWITCHES, Choice, Screened, finalists, rate_of
from thenar.compiler.frontier.points import Rate, Way
from thenar.runtime.manifest import Inputs


def _screened(size: int, rate: float, frame_us: float, inputs: Inputs = "switches", method: str = "id3") -> Screened:
    choice = Choice(Way(method, float(size)), inputs)
    return Screened(choice, tuple(range(size)), Rate(rate, rate, rate), frame_us)


def test_joints_are_read_unless_switches_stand_alone() -> None:
    assert [Choice(NO_SWITCHES, kind).joints for kind in ("both", "joints", "switches")] == [True, True, False]


def test_those_on_a_front_come_first() -> None:
    best, worse, slower = _screened(8, 0.9, 100), _screened(9, 0.895, 110), _screened(20, 0.95, 200)
    assert finalists([best, worse, slower], [], 2) == (best, slower)


def test_what_is_far_from_the_front_is_no_finalist() -> None:
    best, far = _screened(8, 0.9, 100), _screened(9, 0.8, 100)
    assert finalists([best, far], [], 5) == (best,)


def test_what_is_wanted_is_among_them_however_far() -> None:
    best, far = _screened(8, 0.9, 100), _screened(9, 0.1, 300)
    assert finalists([best, far], [far.choice], 1) == (best, far)


def test_equal_placements_count_once() -> None:
    one, same = _screened(8, 0.9, 100), _screened(8, 0.9, 100, method="id3-ccp")
    assert finalists([one, same], [], 2) == (one,)


def test_a_placement_that_is_slow_but_small_is_a_finalist() -> None:
    quick, small = _screened(20, 0.9, 100), _screened(4, 0.89, 500)
    assert set(finalists([quick, small], [], 2)) == {quick, small}


def test_a_rate_has_the_interval_of_its_rows() -> None:
    rate = rate_of((90,), 100)
    assert rate.mean == 0.9
    assert 0.82 < rate.low < 0.9 < rate.high < 0.95
