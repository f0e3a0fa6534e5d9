"""Test the assignment of days to roles, in blocks."""

import numpy as np

from rivid.diagnosis.blocks import Role, split


def dates(days):
    return np.datetime64("2024-02-20") + np.arange(days)


def test_blocks_are_dealt_fit_fit_select_fit_sealed():
    dealt = split(dates(30))
    firsts = [Role(int(dealt.role[dealt.block == b][0])).name for b in range(10)]
    assert firsts == ["FIT", "FIT", "SELECT", "FIT", "SEALED"] * 2
    assert dealt.fit.sum() == 18 and dealt.select.sum() == 6 and dealt.sealed.sum() == 6
    assert all(len(set(dealt.role[dealt.block == b])) == 1 for b in range(10))
    for days, length in ((90, 3), (91, 7)):
        assert split(dates(days)).block.tolist() == [d // length for d in range(days)]
    assert split(dates(13)).complete and not split(dates(12)).complete
    assert split(dates(5), block_days=1).complete


def test_a_block_does_not_reach_across_a_long_gap_and_numbers_have_no_holes():
    dealt = split(np.datetime64("2024-01-01") + np.r_[0:6, 100:106])
    assert np.array_equal(np.unique(dealt.block), np.arange(dealt.block.max() + 1))
    assert not set(dealt.block[:6]) & set(dealt.block[6:])
