"""Test the drawing of the last weeks: within its frame, with consistent axes."""

import numpy as np
import pytest

from rivid.report.strip import HEIGHT, WIDTH, strip, ticks
from rivid.report.summary import WEEKS, last_week, weeks_ago
from tests.plots.synthetic import cases, dates_of, probable, results, without_answers
from tests.report.runs import simple, with_travel


def drawn_of(run):
    return strip(last_week(run), run.sample_time, {})


def value_at(axis, y):
    """Return the value of an axis at a height."""
    return np.polyval(np.polyfit([at for at, _ in axis], [float(text) for _, text in axis], 1), y)


@pytest.mark.parametrize("name", list(cases()))
def test_every_record_is_drawn_within_the_frame(name):
    run = cases()[name]
    recent, drawn = last_week(run), drawn_of(run)
    shown = np.isfinite(recent.values[weeks_ago(recent.estimator.dates) <= WEEKS]).sum()
    assert (drawn is None) == (shown < 2)
    if drawn is not None:
        assert all(0 <= mark["x"] <= WIDTH and 0 <= mark["y"] <= HEIGHT for mark in drawn["marks"])
        assert all(mark["y"] < drawn["floor"] for mark in drawn["marks"] if mark["look"] != "none")
        assert 2 <= len(drawn["lags"]) <= 7 and 1 <= len(drawn["times"]) <= 7
        assert len(drawn["marks"]) <= 7 * (WEEKS + 1)


def test_both_axes_agree_and_marks_lie_at_their_values():
    run = results(("jmap",), dates_of(63))
    drawn = drawn_of(run)
    middle = (value_at(drawn["lags"], 100) + 0.5) * run.sample_time / 60  # of d to d + 1
    assert value_at(drawn["times"], 100) == pytest.approx(middle, rel=0.01)
    for mark in drawn["marks"]:
        if np.isfinite(mark["value"]):
            assert value_at(drawn["lags"], mark["y"]) == pytest.approx(mark["delay"], abs=0.05)
    exact = with_travel(probable(unsure=(), unseen=()), 0.4)
    drawn = drawn_of(exact)
    for mark in drawn["marks"]:
        assert value_at(drawn["times"], mark["y"]) == pytest.approx(
            mark["value"] * exact.sample_time / 60, abs=0.1
        )


def test_the_line_of_a_week_is_the_median_of_all_its_days():
    prior = np.zeros(14, bool)
    prior[7:9] = True  # the other five have the median 8
    run = simple([6] * 7 + [6, 6, 6, 7, 8, 8, 8], prior_only=prior)
    drawn = drawn_of(run)
    assert [value_at(drawn["lags"], y) for _, _, y in drawn["medians"]] == pytest.approx([6, 7], abs=0.02)
    assert last_week(run).median == 7 and [mark["look"] for mark in drawn["marks"]].count("prior") == 2


def test_ticks_are_few_and_inside():
    rng = np.random.default_rng(5)
    for _ in range(200):
        low = rng.uniform(0, 100)
        high = low + 10 ** rng.uniform(-1, 3)
        got = [value for value, _ in ticks(low, high)]
        assert 2 <= len(got) <= 7 and low <= got[0] and got[-1] <= high
        assert np.allclose(np.diff(got), got[1] - got[0])


def test_a_record_without_a_delay_has_no_drawing():
    assert drawn_of(without_answers(results(("jmap",), dates_of(7)))) is None
