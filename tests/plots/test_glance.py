"""The top of the page: what a person takes to the control room, and what it must not pass over."""

import dataclasses
import datetime as dt
import json

import numpy as np
import pyarrow as pa
import pytest

from rivid.config import Config
from rivid.plots.draw import draw_all
from rivid.report.attention import missing, spans
from rivid.report.headline import headline
from rivid.report.lately import lately
from rivid.report.strip import strip
from rivid.report.waves import too_fast
from rivid.results.read import _results
from rivid.results.record import assumed, describe
from tests.plots.synthetic import dates_of, river
from tests.plots.test_posterior import probable
from tests.test_report import STEADY, simple, top, write

FAST = " That is faster than any wave of this reach can be: is the clock or the geometry wrong?"


def with_travel(run, fraction):
    """The same delays, with travel times so far inside each sample."""
    e = run.estimators[0]
    e = dataclasses.replace(e, travel_s=(e.delay + fraction) * run.sample_time)
    return dataclasses.replace(run, estimators=[e])


def among(n, part):
    """The last `part` of n days."""
    return np.arange(n) >= n - part


def test_an_estimator_that_knows_the_fraction_gives_its_own_travel_time():
    run = with_travel(simple([7] * 14, name="posterior", probability=np.full(14, 0.9)), 0.25)
    said, lines = top(run)
    seconds = 7.25 * run.sample_time
    assert f"{seconds / 60:.0f}" == "16"
    assert said == "The inflow reaches the level after about 16 min (delay d = 7 samples of 133 s)."
    assert lines["Now"].strong == "about 16 min (7 samples)"
    assert headline(run)[0] == (
        "On all 14 days the delay is 7 samples; the inflow reaches the level after about 16 min on the "
        "median day."
    )


def test_a_move_of_a_fraction_of_a_sample_is_seen_where_the_fraction_is_known():
    rng = np.random.default_rng(3)
    run = simple([7] * 63, name="posterior", probability=np.full(63, 0.9))
    assert top(run)[1]["Has it moved?"].strong == "No"
    fraction = 0.2 + 0.02 * rng.standard_normal(63) + 0.5 * among(63, 7)
    said, lines = top(with_travel(run, fraction))
    assert lines["Has it moved?"].strong == "Yes, 1.1 min longer" and ": 1.1 min longer than" in said


def test_the_drawing_of_travel_times_has_a_scale_that_reads_them_off():
    run = with_travel(probable(unsure=(), unseen=()), 0.4)
    drawn = strip(run, lately(run), {})
    time = np.polyfit([y for y, _ in drawn.times], [float(text) for _, text in drawn.times], 1)
    for mark in drawn.marks:
        said = float(mark.words.split(": ")[1].split(" min")[0])
        assert np.polyval(time, mark.y) == pytest.approx(said, abs=0.1)


@pytest.mark.parametrize(("by_prior", "words"), [(2, ""), (3, ", on 3 of 7 days by the prior's word")])
def test_the_headline_says_that_the_prior_decides_from_a_third_of_the_week_on(by_prior, words):
    said, _ = top(simple([7] * 21, prior_only=among(21, by_prior)))
    assert (
        said == f"The inflow reaches the level after 15.5 to 17.7 min (delay d = 7 samples of 133 s){words}."
    )


def test_the_priors_word_stands_apart_from_what_is_said_of_the_weeks_before():
    said, _ = top(simple(STEADY, prior_only=among(63, 3)))
    assert said.endswith("of 133 s), as in the weeks before; on 3 of 7 days by the prior's word.")


def test_the_headline_says_that_the_prior_decides_a_third_of_the_record():
    prior = np.zeros(21, bool)
    prior[:7] = True
    assert top(simple([7] * 21, prior_only=prior))[0].endswith(
        "over the record on 7 of 21 days by the prior's word."
    )
    assert top(simple([7] * 21, prior_only=prior, name="jmap-uniform"))[0].endswith("perhaps by chance.")
    prior[6] = False
    assert "prior" not in top(simple([7] * 21, prior_only=prior))[0]


def test_the_prior_of_a_reach_without_geometry_is_not_called_the_hydraulics():
    run = simple([7] * 21, prior_only=among(21, 7))
    assert "what the reach's hydraulics let expect before looking" in top(run)[1]["The prior's part"].text
    text = top(dataclasses.replace(run, assumed=("width",)))[1]["The prior's part"].text
    assert (
        "hydraulics" not in text and "is expected before looking at the data, here by sigma_d = 6.5" in text
    )


def test_few_answers_are_counted_and_no_share_of_them_is_called_all(tmp_path):
    nan = np.nan
    run = simple([nan] * 12 + [7, 7], ["failed"] * 12 + ["ok"] * 2)
    said, _ = top(run)
    assert said.endswith(", on 2 of 7 days (the others have no answer).")
    words = write(run, tmp_path)[1].words
    assert "7: 2 of 2 days" in words and "100 %" not in words
    assert "On 2 of 14 days the inflow" in words


def test_the_median_of_the_headline_is_the_line_of_its_week():
    delays, prior = [6] * 7 + [6, 6, 6, 7, 8, 8, 8], np.zeros(14, bool)
    prior[7:9] = True  # the other five have the median 8
    run = simple(delays, prior_only=prior)
    recent = lately(run)
    lag = np.polyfit(*zip(*[(y, float(text)) for y, text in strip(run, recent, {}).lags], strict=True), 1)
    lines = [np.polyval(lag, y) for _, _, y in strip(run, recent, {}).medians]
    assert lines == pytest.approx([7, 6], abs=0.02) and recent.median == 7


def test_weeks_that_are_wanting_are_counted():
    moved = top(simple([7] * 21))[1]["Has it moved?"]
    expected = "It takes 4 earlier weeks with 3 days that have a delay that the data decide; "
    assert moved.text == f"{expected}the record has 2 earlier weeks."
    assert (
        top(simple([7] * 8))[1]["Has it moved?"].text
        == f"{expected}the record has 1 earlier week, none with so many."
    )
    prior = np.ones(63, bool)
    prior[-21:] = False
    moved = top(simple(STEADY, prior_only=prior))[1]["Has it moved?"]
    assert moved.text == f"{expected}among the 8 before the last: 2."


def test_days_without_a_log_are_named(tmp_path):
    dates = [dt.date(2008, 3, 1) + dt.timedelta(days=k) for k in range(21) if k not in (4, 11, 12)]
    run = simple([7] * 18)
    run = dataclasses.replace(run, estimators=[dataclasses.replace(run.estimators[0], dates=dates)])
    look = top(run)[1]["To look at"]
    assert look.text == "No log on 3 days (2008-03-05, 2008-03-12 to 2008-03-13)." and not look.doubt
    assert "No log on 3 days: 2008-03-05, 2008-03-12 to 2008-03-13." in write(run, tmp_path)[1].words
    late = [*dates[:16], dates[17]]
    run = simple([7] * 17)
    run = dataclasses.replace(run, estimators=[dataclasses.replace(run.estimators[0], dates=late)])
    assert top(run)[1]["To look at"].doubt, "a day of the last week"
    assert "No log" not in write(simple([7] * 18), tmp_path)[1].words


@pytest.mark.parametrize("seed", [1, 2])
def test_missing_days_are_those_between_the_first_and_the_last(seed):
    dates = dates_of(40, missing=15, seed=seed)
    gone = missing(dates)
    assert len(gone) == 15 and not set(gone) & set(dates)
    assert sorted([*gone, *dates]) == [dates[0] + dt.timedelta(days=k) for k in range(55)]
    assert missing([]) == missing(dates[:1]) == []
    assert len(spans(gone)) == sum((b - a).days > 1 for a, b in zip(dates, dates[1:], strict=False))


def test_many_gaps_are_cut_on_the_page_and_the_latest_are_named(tmp_path):
    dates = [dt.date(2008, 1, 1) + dt.timedelta(days=2 * k) for k in range(60)]
    run = simple([7] * 60)
    run = dataclasses.replace(run, estimators=[dataclasses.replace(run.estimators[0], dates=dates)])
    text = top(run)[1]["To look at"].text
    assert text.startswith("No log on 59 days (the latest ") and text.endswith(", 2008-04-27).")
    words = write(run, tmp_path)[1].words
    assert "No log on 59 days, the latest of them:" in words and "2008-01-02" not in words


def test_nothing_to_look_at_is_no_all_clear_where_the_prior_decides(tmp_path):
    run = simple([7] * 21, prior_only=among(21, 10))
    look = top(run)[1]["To look at"]
    assert (look.strong, look.text) == (
        "No day failed or stands out in the last week",
        "But see the prior's part.",
    )
    words = write(run, tmp_path)[1].words
    assert "On 10 days the answer is the prior's, or chance: the hollow marks above." in words
    assert "hollow marks above" not in write(simple([7] * 21), tmp_path)[1].words


def test_an_answer_that_beats_every_wave_is_in_the_headline():
    run = simple([7] * 21, bound_gravity_s=np.full(21, 9.1 * 133))  # at the latest at 8 samples, and one more
    said, lines = top(run)
    assert said.endswith(f"(delay d = 7 samples of 133 s).{FAST}")
    assert lines["The hydraulics"].strong == "20.2 min" and lines["The hydraulics"].doubt
    assert "On 7 of 7 days the answer is faster than any wave of this" in lines["The hydraulics"].text
    said, lines = top(simple([7] * 21, bound_gravity_s=np.full(21, 8.9 * 133)))
    assert FAST not in said and not lines["The hydraulics"].doubt


def test_a_few_fast_days_are_a_line_and_no_headline():
    late = np.where(among(21, 3), 1500.0, 1000.0)
    said, lines = top(simple([7] * 21, bound_gravity_s=late))
    assert FAST not in said and lines["The hydraulics"].doubt
    assert lines["The hydraulics"].text.endswith(
        " On 3 of 7 days the answer is faster than that by more than a sample: doubt it."
    )


def test_what_is_too_fast_is_told_from_the_time_that_is_known_best():
    bound = np.full(4, 9.1 * 133)
    run = simple([7, 8, 9, np.nan], ["ok"] * 3 + ["failed"], bound_gravity_s=bound)
    assert too_fast(run, run.estimators[0]).tolist() == [True, False, False, False]
    exact = with_travel(run, 0.05)
    assert too_fast(exact, exact.estimators[0]).tolist() == [True, True, False, False]
    water = river(5)
    e = dataclasses.replace(water.estimators[0], bound_gravity_s=(water.estimators[0].t50 + 1.01) * 900)
    fast = too_fast(water, e, passage=True)
    assert fast.tolist() == np.isfinite(e.t50).tolist() and fast.any()
    said, lines = top(dataclasses.replace(water, estimators=[e]))
    assert said.endswith(FAST) and lines["The hydraulics"].doubt


def test_geometry_that_nobody_gave_is_written_into_the_record(tmp_path):
    def keys(**reach):
        return assumed(Config.model_validate({"reach": reach}))

    assert keys(length=8200) == ["width", "depth"], "the default itself, given, is given"
    assert keys(length=1, width=1, depth=1) == keys(length=1, width=1, bed_level=90.0) == []
    now = dt.datetime(2024, 1, 1, tzinfo=dt.UTC)
    record = json.loads(json.dumps(describe(Config(), tmp_path, now)))
    assert record["assumed"] == ["length", "width", "depth"]


def test_bounds_of_an_assumed_reach_are_neither_told_nor_drawn(tmp_path):
    run = simple(STEADY)
    nothing = np.full(63, np.nan)
    for given in (run, river(30)):
        made = [
            dataclasses.replace(
                e, bound_gravity_s=nothing[: len(e.dates)], bound_kinematic_s=nothing[: len(e.dates)]
            )
            for e in given.estimators
        ]
        without = dataclasses.replace(given, estimators=made, assumed=("length", "width", "depth"))
        said = "Length, width and depth of the reach are not given: no travel time to compare with."
        line = top(without)[1]["The hydraulics"]
        assert (line.strong, line.text, line.doubt) == ("Not compared", said, False)
        assert said in headline(without)
        figures = draw_all(without, tmp_path)
        words = write(without, tmp_path, figures)[1].words
        assert not any(said in words for said in ("gravity wave", "The blue line", "kinematic"))
    (one,) = [s for s in headline(dataclasses.replace(run, assumed=("width",))) if "not given" in s]
    assert one == "Width of the reach is not given: no travel time to compare with."


@pytest.mark.parametrize("keys", [None, [], ["depth"]])
def test_results_are_read_without_bounds_where_the_geometry_was_assumed(keys):
    row = {
        "date": dt.date(2024, 6, 3), "estimator": "posterior", "status": "ok", "message": None,
        "delay_samples": 5.0, "delay_s": 1650.0, "at_bound": False, "prior_only": None, "probability": 0.9,
        "delay_low": 5.0, "delay_high": 5.0, "t50_samples": None, "alpha": None, "noise_sd": None,
        "roughness_sd": None, "condition": None, "mean_inflow_m3s": 300.0, "bound_gravity_s": 1700.0,
        "bound_kinematic_s": 5000.0,
    }  # fmt: skip
    run = {
        "reach": "x",
        "sample_time": 300,
        "output_unit": "m",
        "delay_scale": 5,
        "estimators": ["posterior"],
    }
    if keys is not None:  # an older run.json has no such list
        run["assumed"] = keys
    tables = [pa.Table.from_pylist([row])]
    for axis, value in (("lag", "value"), ("delay_samples", "criterion")):
        long = {"date": row["date"], "estimator": "posterior", axis: 5, value: 0.9}
        tables.append(pa.Table.from_pylist([long]))
    got = _results(run, *tables)
    (e,) = got.estimators
    assert got.assumed == tuple(keys or ()) and e.travel_s.tolist() == [1650.0]
    assert np.isnan([e.bound_gravity_s[0], e.bound_kinematic_s[0]]).tolist() == [bool(keys)] * 2


def test_no_line_of_the_headline_ends_between_a_number_and_its_unit(tmp_path):
    html, page = write(simple([7] * 14), tmp_path)
    assert "15.5 to 17.7\u00a0min (delay d = 7\u00a0samples of 133\u00a0s)." in html
    assert "after 15.5 to 17.7 min" in page.words
