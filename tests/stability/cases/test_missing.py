from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.runtime.build import Build, Recognition
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables
from thenar.stability.cases import missing
from thenar.stability.cases.missing import ExactTables, changes, every_loss
from thenar.stability.checks.integer_sums import bare_build
from thenar.stability.finding import Finding
from thenar.stability.inputs.hard_tables import every_frame, whole_numbers
from thenar.stability.inputs.small_sets import SmallBuild, small_build, small_set
from thenar.stability.reference.tables import balanced

Spoil = Callable[[IntegerTables], IntegerTables]


@pytest.fixture(scope="module")
def small() -> SmallBuild:
    return small_build(small_set(8, rows=100, switches=32, joints=2, types=4, noise=0.1), rounds=20)


small_tables = st.builds(
    whole_numbers,
    st.integers(0, 10_000),
    st.integers(2, 4),
    st.integers(0, 4),
    st.lists(st.integers(1, 4), max_size=2).map(tuple),
    st.sampled_from([1, 90]),
)


@settings(deadline=None)
@given(tables=small_tables, data=st.data())
def test_of_all_frames_none_changes_more_by_a_loss_than_the_bound_and_one_as_much(
    tables: IntegerTables, data: st.DataObject
) -> None:
    masks = st.lists(st.booleans(), min_size=tables.n_switches, max_size=tables.n_switches)
    switches = data.draw(masks)
    joints = data.draw(st.lists(st.booleans(), min_size=tables.n_joints, max_size=tables.n_joints))
    scorer = Scorer(tables)
    frames = [(np.array(bits, bool), np.array(codes, np.uint16)) for bits, codes in every_frame(tables)]
    changed = np.array([
        np.subtract(scorer.lanes_without(*frame, switches, joints), scorer.lanes(*frame)) for frame in frames
    ])  # fmt: skip
    for sign in (1, -1):
        most = [change.max(axis=0) for change in changes(tables, sign)]
        bound = np.sum([m for m, lost in zip(most, [*switches, *joints], strict=True) if lost], axis=0, initial=0)
        assert np.array_equal((sign * changed).max(axis=0), np.broadcast_to(bound, tables.n_classes))


@pytest.mark.parametrize("width", [8, 16])
def test_every_subset_of_ports_and_joints_is_lost_once(small: SmallBuild, width: int) -> None:
    losses = list(every_loss(small.build, width))
    columns = np.array([switch.column for switch in small.build.manifest.switches])
    ports = np.unique(columns // width)
    assert len({loss.name for loss in losses}) == len(losses) == 2 ** (ports.max() + 2 + 2)
    for loss in losses:
        for port in ports:
            assert len(set(loss.switches[columns // width == port])) == 1
    assert sum(not loss.inputs.any() for loss in losses) == 2 ** (ports.max() + 2 - len(ports))


@given(st.lists(st.booleans(), min_size=7, max_size=7))
def test_a_frame_is_degraded_if_and_only_if_something_is_lost(lost: list[bool]) -> None:
    tables = whole_numbers(1, 3, 4, (2, 3, 2), 9)
    frame = np.zeros(4, bool), np.zeros(3, np.uint16), np.array(lost[:4]), np.array(lost[4:])
    assert bare_build(tables).recognise(*frame).degraded == any(lost)


def test_the_exact_scores_are_those_of_fractions(small: SmallBuild) -> None:
    exact, tables, random = ExactTables(small), small.tables, np.random.default_rng(3)
    integers, scale = small.build.tables, Fraction(small.build.tables.scale)
    bias, joint_rows = balanced(tables.bias.tolist(), [rows.tolist() for rows in tables.joint_rows])
    for loss in list(every_loss(small.build, 16))[::5]:
        row = int(random.integers(len(small.bits)))
        bits, codes = small.bits[row], small.codes[row]
        rows = [[scale * Fraction(float(value)) for value in bias]]
        for switch, (weights, lost) in enumerate(zip(tables.switch_rows.tolist(), loss.switches, strict=True)):
            if lost:
                rows.append(integers.switch_means[switch].tolist())
            elif bits[switch]:
                rows.append([scale * Fraction(weight) for weight in weights])
        for joint, (steps, of_joint, lost) in enumerate(zip(tables.thresholds, joint_rows, loss.joints, strict=True)):
            picked = of_joint[int(np.searchsorted(steps, codes[joint]))]
            read = [scale * Fraction(float(value)) for value in picked]
            rows.append(integers.joint_means[joint].tolist() if lost else read)
        truth = [float(sum(column)) for column in zip(*rows, strict=True)]
        got = [float(score) for score in exact.scores(bits.tolist(), codes.tolist(), loss)]
        assert got == pytest.approx(truth, abs=1e-9)


def test_what_stands_in_is_to_the_step_what_the_reference_fits(small: SmallBuild) -> None:
    assert not any(ExactTables(small).strays)


def _shifted(rows: np.ndarray) -> np.ndarray:
    """Return the rows with one number a step nearer to zero: the bound of the sums stays as it is."""
    moved = rows.copy()
    at = np.unravel_index(np.abs(rows).argmax(), rows.shape)
    moved[at] -= np.sign(rows[at])
    return moved


@pytest.mark.parametrize(
    ("spoil", "caught"),
    [
        (lambda of: replace(of, switch_means=_shifted(of.switch_means)), "the replacement of each input"),
        (lambda of: replace(of, joint_means=_shifted(of.joint_means)), "the replacement of each input"),
        (lambda of: replace(of, switch_means=0 * of.switch_means), "lost the fit at 60 digits"),
        (lambda of: replace(of, joint_means=0 * of.joint_means), "lost the fit at 60 digits"),
    ],
    ids=["one step for a switch", "one step for a joint", "nothing for switches", "nothing for joints"],
)
def test_what_should_not_stand_in_is_caught(
    small: SmallBuild, monkeypatch: pytest.MonkeyPatch, spoil: Spoil, caught: str
) -> None:
    spoiled = small._replace(build=Build(small.build.manifest, spoil(small.build.tables)))
    monkeypatch.setattr(missing, "small_build", lambda *_, **__: spoiled)
    failed = [f"{finding.check} {finding.reference}" for finding in missing.findings(full=False) if not finding.holds]
    assert any(caught in name for name in failed)


def _found(monkeypatch: pytest.MonkeyPatch, recognise: Callable[..., Recognition]) -> dict[str, Finding]:
    monkeypatch.setattr(Build, "recognise", recognise)
    return {finding.check: finding for finding in missing.findings(full=False)}


def test_a_recogniser_that_tells_nobody_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Build.recognise

    def silent(self: Build, *frame: np.ndarray) -> Recognition:
        return replace(right(self, *frame), degraded=False)

    assert _found(monkeypatch, silent)["frames reported as degraded"].error == 1


def test_a_recogniser_that_reads_what_is_lost_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Build.recognise

    def nosy(self: Build, *frame: np.ndarray) -> Recognition:
        return replace(right(self, *frame[:2]), degraded=right(self, *frame).degraded)

    assert _found(monkeypatch, nosy)["outputs that depend on the value of a lost input"].error == 1
