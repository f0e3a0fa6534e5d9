"""Test the assignment of days to roles, in blocks."""

import numpy as np
import pytest

from rivid.diagnosis.blocks import Role, split
from rivid.errors import RividError


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
