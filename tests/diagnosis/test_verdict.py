"""The verdict, on studies of a few numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from rivid.diagnosis import selection as verdict
from rivid.diagnosis.fit import DayErrors, limited
from rivid.diagnosis.result import Gap, Unknown, Where
from rivid.diagnosis.selection import HELD, verdict_of

DAYS = 20
SELECT, SEALED = np.arange(DAYS) % 4 == 2, np.arange(DAYS) % 4 == 3


def evaluation(errors, likelihood):
    """Errors of all days, and their likelihood."""
    squares = np.repeat(np.square(np.asarray(errors, float))[:, None], DAYS, axis=1)
    return SimpleNamespace(
        errors=DayErrors(squares, np.ones_like(squares)), likelihood=np.asarray(likelihood, float)
    )


def study(end=(1.0, 2.0, 3.0), gain=0.0, tied=(), named=True, contradicted=None, noise=None):
    """From errors 2, 4, 6 to `end`; what days gain in likelihood, one number or for each."""
    before = evaluation((2.0, 4.0, 6.0), np.zeros(DAYS))
    after = evaluation(end, np.zeros(DAYS) + gain)
    proposal = SimpleNamespace(
        name="leakage", improvement=np.full(3, 0.5), columns=np.ones((1, DAYS, 2)), gains=noise,
        level_noise=noise is not None,
    )  # fmt: skip
    turn = SimpleNamespace(
        proposal=proposal, tied=tied, before=before, after=after
    )  # fmt: skip
    return SimpleNamespace(
        named=(turn,) if named else (), first_evaluation=before, last_evaluation=after,
        last=SimpleNamespace(effects=()), last_linear=None,
        record=SimpleNamespace(days=DAYS), split=SimpleNamespace(select=SELECT, sealed=SEALED),
        contradicted=contradicted,
    )  # fmt: skip


GAP = Gap((), (1.0, 4.0, 24.0), "m", (2.0, 4.0, 6.0), (1.0, 2.0, 3.0), None, None, None, ())
LEFT = Unknown(Where(), 2.0, ("a swing with a period of 40 min",), 2400.0)


def word(**said):
    unknown = said.pop("unknown", None)
    return verdict_of(study(**said), GAP, unknown)[0]


def test_each_verdict_has_its_case():
    assert word(named=False) == "no_gap"
    assert word(named=False, unknown=LEFT) == "unknown"
    assert word(named=False, contradicted=SimpleNamespace(name="rain_inflow")) == "did_not_hold"
    assert word() == "explained"
    assert word(tied=("gate_head_effect",)) == "cannot_tell"
    assert word(unknown=LEFT) == "partly_explained"


def test_a_name_under_which_sealed_errors_grow_did_not_hold():
    assert word(end=(2.1, 4.2, 6.3)) == "did_not_hold"
    assert word(end=(2.1, 4.2, 5.9)) == "did_not_hold"  # and next to nothing of what was promised
    assert word(end=(2.1, 3.2, 5.9)) == "explained"


def test_sealed_days_that_gain_in_likelihood_hold_what_errors_hardly_show():
    assert word(end=(2.1, 4.2, 6.3), gain=5.0) == "explained"
    on_fit_only = np.where(SEALED, 0.0, 5.0)
    assert word(end=(2.1, 4.2, 6.3), gain=on_fit_only) == "did_not_hold"
    less = np.where(SEALED, 0.5 * HELD * 5.0, 5.0)
    assert word(end=(2.1, 4.2, 6.3), gain=less) == "did_not_hold"


def test_a_noise_is_judged_by_what_it_gains_itself():
    assert word(end=(2.1, 4.2, 6.3), noise=np.full(DAYS, 3.0)) == "explained"
    assert word(end=(2.1, 4.2, 6.3), noise=np.where(SEALED, -3.0, 3.0)) == "did_not_hold"


def test_an_odd_day_counts_for_a_few_usual_ones():
    gain = np.r_[np.full(9, 2.0), 500.0, -500.0]
    assert limited(gain)[:9] == pytest.approx(2.0)
    assert limited(gain)[9] == -limited(gain)[10] == pytest.approx(4.0 * 2.0 + 5.0)


def test_the_size_on_the_sealed_days_tells_more_than_their_gain(monkeypatch):
    monkeypatch.setattr(verdict, "held_share", lambda *_: (0.1, 0.1))
    assert word(gain=5.0) == "did_not_hold"
    monkeypatch.setattr(verdict, "held_share", lambda *_: (0.4, 0.1))
    assert word(end=(2.1, 4.2, 6.3)) == "explained"  # a size of a half lies within its error
