"""The responses of one day."""

import dataclasses
import datetime as dt

import numpy as np

from rivid.plots.draw import draw_all
from rivid.plots.fir_day import typical_day
from tests.plots.synthetic import dates_of, results, without_answers


def test_the_typical_day_is_answered_by_most_and_of_median_condition():
    run = results(("ml", "jmap"), dates_of(5), unanswered=0)
    made = []
    for e in run.estimators:
        status = ["ok"] * 5
        if e.estimator == "jmap":
            status[0] = "unidentifiable"
        made.append(dataclasses.replace(e, status=status, condition=np.array([5e4, 9e4, 1e4, 5e4, 6e4])))
        made[-1].fir[:] = 1.0
    run = dataclasses.replace(run, estimators=made)
    assert typical_day(run) == dt.date(2008, 1, 4)  # of 9e4, 1e4, 5e4, 6e4 the nearest to their median


def test_a_run_without_answers_has_none():
    assert typical_day(without_answers(results(("jmap",), dates_of(3)))) is None


def test_a_chosen_day_is_drawn(tmp_path):
    run = results(("ml", "map", "jmap"), dates_of(9), unanswered=0)
    file = draw_all(run, tmp_path, day=dt.date(2008, 1, 5))[-1]
    assert file.kind == "fir_day" and "2008-01-05" in file.title
