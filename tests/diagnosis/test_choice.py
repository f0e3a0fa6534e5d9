"""The choice of a response by the days that select."""

import pytest

from rivid.diagnosis.blocks import split
from rivid.diagnosis.choice import as_candidates, calibrated
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.workflow import find_effects
from rivid.effects import CATALOGUE
from rivid.errors import RividError
from tests.diagnosis.pools import GAUGE_FLOOR, fresh, nominal, season


class Broken:
    """A response that cannot be run."""

    name = "broken"
    parameters = ()
    surface_area = 1.0

    def settled(self, record):
        raise RividError("no water")


def choice(record, responses):
    return calibrated(record, split(record.dates), [fresh(record, r) for r in responses], 0.0)


def test_of_responses_that_predict_alike_the_first_is_enough():
    record = season(1, days=12)
    (first,), refused = choice(record, [nominal(record, fronts) for fronts in ("none", "zero", "fir")])
    assert first.model.reach.name == "integrator-delay" and first.acceptable() and not refused
    assert first.evaluation.likelihood.shape == (12,)


def test_a_response_that_cannot_follow_is_behind():
    """A pool of a tenth of the surface, thought to be known within a hundredth."""
    record = season(4, days=12)
    known = {"area_sd": 0.01, "delay_sd": 0.01}
    small = LinearPool.nominal(record, "zero", surface_area=6e4, delay=4000.0, **known)
    (poor, good), _ = choice(record, [small, nominal(record)])
    assert not poor.acceptable() and poor.shortfall > 100.0 and good.deficit == 0.0
    days = split(record.dates).select
    gap = (good.evaluation.likelihood - poor.evaluation.likelihood)[days].sum()
    assert poor.deficit == pytest.approx(gap)


def test_a_candidate_that_cannot_be_run_is_skipped_or_raised_if_it_is_the_only_one():
    record = season(5, days=12)
    one = nominal(record)
    assert as_candidates(one) == (one,) and as_candidates([one, one]) == (one, one)
    (only,), refused = choice(record, [Broken(), nominal(record)])
    assert only.model.reach.name == "integrator-delay" and refused == ("no water",)
    for candidates in ([Broken()], [Broken(), Broken()]):
        with pytest.raises(RividError, match="no water"):
            choice(record, candidates)


def test_a_response_that_lacks_an_effect_is_not_left_for_more_coefficients():
    """A lag of ten minutes: a FIR follows it, the integrator does not, and the lag is what is missing."""
    record = season(6, days=24, effects=(CATALOGUE["outflow_lag"](lag=900.0),))
    classes = {"outflow_lag": CATALOGUE["outflow_lag"]}
    study = find_effects(record, [nominal(record), nominal(record, "fir")], classes, gauge_floor=GAUGE_FLOOR)
    assert study.first.reach.name == "integrator-delay"
    assert [r.proposal.name for r in study.named] == ["outflow_lag"]
