"""Days dealt into roles, and blocks for sign flips longer than the residual's memory."""

import numpy as np
import pytest

from rivid.diagnosis.blocks import FEWEST_BLOCKS, MOST_ACROSS, Role, across, flip_blocks, memory, split
from rivid.errors import RividError
from tests.diagnosis import sizes


def remembering(days, rho, rng):
    """Stationary AR(1) day scores of variance 1."""
    x = rng.normal(size=days)
    for d in range(1, days):
        x[d] = rho * x[d - 1] + np.sqrt(1.0 - rho * rho) * x[d]
    return x


def p_of_flips(scores, label, rng, flips=199):
    sums = np.array([scores[label == b].sum() for b in np.unique(label)])
    flipped = np.abs(rng.choice([-1.0, 1.0], (flips, len(sums))) @ sums)
    return (1 + (flipped >= abs(sums.sum()) - 1e-9).sum()) / (1 + flips)


def test_blocks_are_dealt_fit_fit_select_fit_sealed():
    dealt = split(30)
    firsts = [Role(int(dealt.role[dealt.block == b][0])).name for b in range(10)]
    assert firsts == ["FIT", "FIT", "SELECT", "FIT", "SEALED"] * 2
    assert dealt.fit.sum() == 18 and dealt.select.sum() == 6 and dealt.sealed.sum() == 6
    assert all(len(set(dealt.role[dealt.block == b])) == 1 for b in range(10))
    for days, length in ((90, 3), (91, 7)):
        assert split(days).block.tolist() == [d // length for d in range(days)]
    assert split(13).complete and not split(12).complete and split(5, block_days=1).complete
    dated = split(np.datetime64("2024-02-20") + np.arange(30))
    for name in ("day", "role", "block"):
        assert np.array_equal(getattr(dated, name), getattr(dealt, name))


def test_a_block_does_not_reach_across_a_long_gap_and_numbers_have_no_holes():
    dates = np.datetime64("2024-01-01") + np.r_[0:6, 100:106]
    dealt = split(dates)
    assert np.array_equal(np.unique(dealt.block), np.arange(dealt.block.max() + 1))
    assert not set(dealt.block[:6]) & set(dealt.block[6:])
    assert dealt.day[6] == 100


@pytest.mark.parametrize(
    "days,word",
    [(0, "no days"), (["2024-01-02", "2024-01-01"], "in order"), (["2024-01-02", "2024-01-02"], "each once")],
)
def test_days_that_cannot_be_split_are_refused(days, word):
    with pytest.raises(RividError, match=word):
        split(days)
    with pytest.raises(RividError, match="30 days"):
        flip_blocks(np.ones(20), split(30))


@pytest.mark.parametrize("rho", [0.4, 0.8])
def test_memory_is_the_autocorrelation_of_the_days(rho):
    rng = np.random.default_rng(3)
    scores = np.stack([remembering(400, rho, rng) * 10.0**i for i in range(40)])
    found = memory(scores, np.arange(400))
    few = found[:3]
    assert np.allclose(few, rho ** np.arange(1, 4), atol=4.0 / np.sqrt(40 * 400 * (1 - rho) / (1 + rho)))


def test_days_apart_in_the_calendar_are_not_neighbours():
    rng = np.random.default_rng(0)
    every_other = remembering(600, 0.7, rng)[::2]
    assert np.isclose(memory(every_other[None], 2 * np.arange(300)).sum(), 0.0)  # no pair is one day apart
    assert memory(every_other[None], np.arange(300))[0] == pytest.approx(0.49, abs=0.15)


@pytest.mark.parametrize("length", [1, 3, 20])
def test_the_share_between_blocks_is_that_of_a_covariance_matrix(length):
    rho = 0.6 ** np.arange(1, 31)
    days = 40 * length
    lag = np.abs(np.subtract.outer(np.arange(days), np.arange(days)))
    cov = np.where(lag == 0, 1.0, np.where(lag <= 30, 0.6**lag, 0.0))
    label = np.arange(days) // length
    between = cov[label[:, None] != label[None]].sum() / cov.sum()
    assert across(rho, length) == pytest.approx(between, abs=2.5 / 40)  # the matrix has ends


def test_remembering_days_get_longer_blocks_that_are_unions_of_the_splits_and_are_enough_to_flip():
    rng = np.random.default_rng(2)
    dealt = split(365)
    assert np.array_equal(flip_blocks(rng.normal(size=(20, 365)), dealt), dealt.block)  # no memory
    label = flip_blocks(np.stack([remembering(365, 0.62, rng) for _ in range(20)]), dealt)
    assert len(np.unique(label)) < len(np.unique(dealt.block))
    assert all(len(set(label[dealt.block == b])) == 1 for b in np.unique(dealt.block))
    assert across(0.62 ** np.arange(1, 40), np.bincount(label).max()) < 1.5 * MOST_ACROSS
    few = split(40)
    label = flip_blocks(np.ones(40), few)  # the longest memory there is
    assert len(np.unique(label[~few.sealed])) >= FEWEST_BLOCKS


@sizes("sets", 100, 400)
def test_flips_of_days_are_wrong_where_days_remember_and_flips_of_these_blocks_are_not(sets):
    rng = np.random.default_rng(7)
    dealt = split(180)
    use = ~dealt.sealed
    p = np.empty((sets, 2))
    for i in range(sets):
        x = remembering(180, 0.62, rng)
        label = flip_blocks(x, dealt)
        p[i] = p_of_flips(x[use], np.arange(use.sum()), rng), p_of_flips(x[use], label[use], rng)
    by_day, by_block = (p <= 0.05).mean(0)
    promised = 0.063  # 2 (1 - Phi(1.96 sqrt(1 - MOST_ACROSS)))
    assert by_day > 0.2
    assert by_block < promised + 3.0 * np.sqrt(promised * (1.0 - promised) / sets)
