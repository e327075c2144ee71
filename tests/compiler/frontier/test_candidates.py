from thenar.compiler.frontier.candidates import NO_SWITCHES, Choice, Screened, finalists, rate_of
from thenar.compiler.frontier.points import Rate, Way
from thenar.runtime.manifest import Inputs


def _screened(size: int, rate: float, frame_us: float, inputs: Inputs = "switches", method: str = "id3") -> Screened:
    choice = Choice(Way(method, float(size)), inputs)
    return Screened(choice, tuple(range(size)), Rate(rate, rate, rate), frame_us)


def test_joints_are_read_unless_switches_stand_alone() -> None:
    assert [Choice(NO_SWITCHES, kind).joints for kind in ("both", "joints", "switches")] == [True, True, False]


def test_the_best_and_the_smallest_that_is_level_come_first() -> None:
    best, level, between = _screened(40, 0.99, 300), _screened(16, 0.986, 200), _screened(8, 0.9, 100)
    assert finalists([between, level, best], [], 2) == (level, best)


def test_then_comes_what_is_least_like_those() -> None:
    best, near, far = _screened(40, 0.99, 300), _screened(20, 0.97, 200), _screened(4, 0.8, 100)
    assert finalists([far, near, best], [], 2) == (far, best)


def test_kinds_of_inputs_share_evenly() -> None:
    switches = [_screened(size, rate, size) for size, rate in ((40, 0.9), (20, 0.85), (10, 0.8))]
    both = [_screened(size, rate, 1000 + size, "both") for size, rate in ((40, 0.99), (20, 0.98), (10, 0.95))]
    chosen = finalists([*switches, *both], [], 4)
    assert [one.choice.inputs for one in chosen] == ["switches"] * 2 + ["both"] * 2


def test_what_others_beat_is_no_finalist() -> None:
    best, beaten = _screened(8, 0.9, 100), _screened(9, 0.8, 110)
    assert finalists([best, beaten], [], 5) == (best,)


def test_what_recognises_far_less_is_of_no_use() -> None:
    best, useless = _screened(8, 0.9, 100), _screened(1, 0.6, 50)
    assert finalists([useless, best], [], 5) == (best,)


def test_what_is_wanted_is_among_them_however_bad() -> None:
    best, bad = _screened(8, 0.9, 100), _screened(9, 0.1, 300)
    assert finalists([best, bad], [bad.choice], 1) == (best, bad)


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
