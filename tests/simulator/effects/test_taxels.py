"""What becomes of the force on a taxel on its way to a count."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.glove import TaxelConverter

from ..small import make_batch, make_condition, make_draw, make_setting

FRAMES, PADS = 5, 40
# Rows, frames, pads; newtons.
FORCES = arrays(np.float64, (3, FRAMES, PADS), elements=st.just(0.0) | st.floats(1e-6, 50.0))


def acted(name: str, newtons: np.ndarray, subject: str = "A", times_us: Any = None, **parameters: float) -> np.ndarray:
    """Return what an effect makes of forces (n, F, t).

    Frames come every 10 ms from contact on, unless `times_us` are given.
    """
    batch = make_batch(range(len(newtons)), make_condition(subject))
    batch.taxels_n = newtons
    at = 10_000 * np.arange(newtons.shape[1]) if times_us is None else np.asarray(times_us)
    batch.frame_us = np.tile(at, (len(newtons), 1))
    effect = EFFECTS[name]
    assert effect.prepare is not None
    frames = {"timed": True, "first_us": 0, "hold_us": 10_000 * (newtons.shape[1] - 1), "release_us": 0}
    setting = make_setting(taxels=tuple(range(newtons.shape[2])), **frames)
    given: Any = parameters
    effect.prepare(setting, **given)(batch, make_draw(name, batch))
    return batch.taxels if batch.taxels is not None else batch.taxels_n


def test_every_pad_has_its_own_gain_for_all_wearers() -> None:
    found = acted("taxel.gain", np.full((2, 1, 1600), 2.0), log_sd=0.06)
    logs = np.log(found[0, 0] / 2.0)
    assert abs(logs.mean()) < 4 * 0.06 / 40
    assert abs(logs.std() - 0.06) < 4 * 0.06 / (2 * 1600) ** 0.5
    assert (found[0] == found[1]).all()
    assert (acted("taxel.gain", np.full((2, 1, 1600), 2.0), subject="B", log_sd=0.06) == found).all()


@given(newtons=FORCES)
def test_a_pad_reads_nothing_below_what_actuates_it_and_its_force_above(newtons: np.ndarray) -> None:
    found = acted("taxel.gain", newtons, log_sd=0.0, actuates_n=0.2)
    assert (found == np.where(newtons >= 0.2, newtons, 0.0)).all()


@given(newtons=FORCES, share=st.floats(0.0, 1.0))
def test_hysteresis_exceeds_only_falling_forces_by_a_share(newtons: np.ndarray, share: float) -> None:
    found = acted("taxel.hysteresis", newtons, share=share)
    assert (found >= newtons).all()
    assert (found <= (1.0 + share) * newtons).all()
    rising = np.sort(newtons, axis=1)
    assert (acted("taxel.hysteresis", rising, share=share) == rising).all()


def test_a_reading_stays_until_the_force_has_fallen_by_the_share() -> None:
    newtons = np.array([0.0, 1.1, 1.05, 0.5, 0.0])[None, :, None]
    np.testing.assert_allclose(acted("taxel.hysteresis", newtons, share=0.1)[0, :, 0], [0, 1.1, 1.1, 0.55, 0])


def test_creep_is_that_of_its_differential_equations() -> None:
    """The relaxations' closed form, one frame or many, before contact and after release."""
    tau = np.array([0.1, 1.0, 10.0])
    held = 2.0 * (1.0 + 0.05 * (1.0 - np.exp(-0.25 / tau)).sum())
    many = acted("taxel.creep", np.full((1, 6, 1), 2.0), times_us=50_000 * np.arange(6), per_decade=0.05)
    one = acted("taxel.creep", np.full((1, 1, 1), 2.0), times_us=[250_000], per_decade=0.05)
    np.testing.assert_allclose([many[0, -1, 0], one[0, 0, 0]], held, rtol=1e-12)
    newtons = np.array([0.0, 2.0, 0.0])[None, :, None]
    before, _, after = acted("taxel.creep", newtons, times_us=[-10_000, 250_000, 350_000], per_decade=0.05)[0, :, 0]
    assert before == 0.0
    left = 2.0 * 0.05 * ((1.0 - np.exp(-0.25 / tau)) * np.exp(-0.1 / tau)).sum()
    np.testing.assert_allclose(after, left, rtol=1e-12)


@given(newtons=FORCES, row_ohm=st.floats(0.0, 1000.0))
def test_crosstalk_is_what_kirchhoff_says_of_a_driven_row(newtons: np.ndarray, row_ohm: float) -> None:
    found = acted("taxel.crosstalk", newtons, row_ohm=row_ohm, pad_ohm=10_000.0)
    for row in range(0, PADS, 16):
        siemens = newtons[:, :, row : row + 16] / 10_000.0
        total = siemens.sum(axis=2, keepdims=True)
        # The current through row_ohm and all pads of the row in parallel, shared by their conductance, of 1 V.
        with np.errstate(divide="ignore", invalid="ignore"):
            current = np.where(total > 0.0, 1.0 / (row_ohm + 1.0 / total), 0.0)
            shared = np.where(total > 0.0, current * siemens / total, 0.0)
        np.testing.assert_allclose(found[:, :, row : row + 16], shared * 10_000.0, rtol=1e-9, atol=1e-12)


def test_noise_has_the_requested_size_per_repetition_and_frame() -> None:
    newtons = np.full((200, FRAMES, PADS), 2.0)
    gains = np.log(acted("taxel.noise", newtons, trial_log_sd=0.02, sd_n=0.0) / 2.0)
    assert (gains == gains[:, :1]).all()
    assert abs(gains[:, 0].std() - 0.02) < 4 * 0.02 / (2 * 200 * PADS) ** 0.5
    noise = acted("taxel.noise", newtons, trial_log_sd=0.0, sd_n=0.005) - newtons
    assert abs(noise.std() - 0.005) < 4 * 0.005 / (2 * noise.size) ** 0.5
    assert abs(np.corrcoef(noise[:, 0].ravel(), noise[:, 1].ravel())[0, 1]) < 4 / (200 * PADS) ** 0.5


@given(newtons=arrays(np.float64, (2, 3, 4), elements=st.floats(-1.0, 50.0)), bits=st.integers(1, 15))
def test_counts_are_the_nearest_and_end_where_the_converter_does(newtons: np.ndarray, bits: int) -> None:
    codes = acted("taxel.adc", newtons, bits=bits, full_n=10.0)
    count_n = 10.0 / 2**bits
    values = TaxelConverter(bits, 10.0).column("pad").value(codes)
    inside = (newtons >= 0.0) & (newtons <= 10.0 - count_n)
    assert (np.abs(values - newtons)[inside] <= count_n / 2 * (1 + 1e-9)).all()
    assert (codes[newtons < 0.0] == 0).all()
    assert (codes[newtons >= 10.0] == 2**bits - 1).all()
