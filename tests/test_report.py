"""The report: what it says, that it needs nothing else, that names cannot break it."""

import base64
import dataclasses
import datetime as dt
import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.browser import NAMES, browser, installed
from benchmarks.page_pictures import MOST_BYTES, WIDE, faults
from rivid.errors import RividError
from rivid.plots.draw import draw, draw_all
from rivid.report.attention import attention
from rivid.report.build import write_report
from rivid.report.glance import glance
from rivid.report.headline import facts, headline
from rivid.report.lately import lately
from rivid.report.looking import to_look_at
from tests.pages import Page
from tests.plots.synthetic import dates_of, estimator, results, river, without_answers

SUMMARY = {
    "config": {"reach": {"length": 8200.0, "bed_level": None}, "run": {"estimators": ["jmap"]}},
    "versions": {"rivid": "0.1.0", "numpy": "2.3.4"},
    "d_min": 1,
    "d_max": 15,
}


def write(run, out, figures=(), summary=SUMMARY):
    html = write_report(run, figures, out, summary=summary).read_text(encoding="utf-8")
    return html, Page(html)


def simple(delays, status=None, messages=None, name="jmap", start=dt.date(2008, 1, 1), **changes):
    """Results of one estimator with the given delays, all else calm."""
    n = len(delays)
    e = estimator(name, dates_of(n, start), unanswered=0)
    delays = np.array(delays, float)
    status = status or ["ok"] * n
    e = dataclasses.replace(
        e,
        delay=delays,
        status=status,
        messages=messages or [""] * n,
        at_bound=(delays == 1) | (delays == 15),
        prior_only=np.zeros(n, bool),
        bound_gravity_s=np.full(n, 1000.0),
    )
    e = dataclasses.replace(e, **changes)
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    out = tmp_path_factory.mktemp("year")
    run = results(("ml", "map", "jmap", "jmap-uniform"))
    files = draw_all(run, out)
    return out, run, files, *write(run, out, files)


def test_a_year_of_four_estimators_is_one_file_of_moderate_size(year):
    out, _, _, html, _ = year
    assert len(html.encode()) < 3_000_000
    assert sorted(p.name for p in out.iterdir()) == ["figures", "report.html"]


def test_the_page_asks_no_server_and_runs_no_script(year):
    html, page = year[3:]
    assert "script" not in {tag for tag, _ in page.tags}
    for tag, attrs in page.tags:
        assert not any(name.startswith("on") for name in attrs)
        for name in ("src", "href"):
            if name in attrs:
                assert attrs[name].startswith(("data:image/png;base64,", "#")), (
                    f"<{tag} {name}={attrs[name][:40]}>"
                )
    assert "url(" not in html and "@import" not in html


def test_every_figure_is_in_the_page_whole_with_its_caption(year):
    _, _, files, _, page = year
    shown = [attrs for tag, attrs in page.tags if tag == "img"]
    inside = {base64.b64decode(attrs["src"].split(",", 1)[1]) for attrs in shown}
    assert inside == {file.path.read_bytes() for file in files}
    for file in files:
        assert file.caption in page.words
    assert all(attrs["alt"] and attrs["width"] and attrs["height"] for attrs in shown)


def test_links_within_the_page_lead_somewhere(year):
    page = year[4]
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    links = {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"}
    assert links and links <= ids


def test_the_pages_policy_allows_its_own_style_and_pictures_alone(year):
    html, page = year[3:]
    (style,) = re.findall(r"<style>(.*?)</style>", html, re.S)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    (policy,) = [a["content"] for tag, a in page.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy == (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    )
    assert not any("style" in attrs for _, attrs in page.tags), "which the policy would forbid"


def test_every_figure_is_a_popover_that_its_own_picture_opens(year):
    page, files = year[4], year[2]
    cards = [attrs["id"] for tag, attrs in page.tags if "popover" in attrs]
    opens = [attrs["popovertarget"] for tag, attrs in page.tags if tag == "button"]
    assert cards == opens and len(set(cards)) == len(files)


def test_the_time_day_picture_comes_first_then_map_histogram_and_discharge(year):
    shown = [attrs["alt"] for tag, attrs in year[4].tags if tag == "img"]
    assert [text.split(",")[0] for text in shown[:4]] == [
        "Impulse response of each day",
        "Delay of each day",
        "How often each delay",
        "Delay and discharge",
    ]
    assert all(text.endswith(", jmap") for text in shown[:4])


def test_the_same_run_gives_the_same_page(year):
    out, run, files, html, _ = year
    assert write(run, out, files)[0] == html


def test_settings_and_versions_are_shown(year):
    words = year[4].words
    for part in ("d_max 15", "length 8200", "bed_level not set", "numpy 2.3.4"):
        assert part in words


def test_names_and_reasons_are_text_and_never_markup(tmp_path):
    attack = '"><script>alert(1)</script><img src=x onerror=alert(1)>'
    run = simple([6, np.nan], ["ok", "failed"], ["", attack])
    run = dataclasses.replace(run, reach=attack)
    files = draw_all(run, tmp_path)
    summary = {
        "config": {attack: {attack: attack}},
        "versions": {attack: attack},
        "bad_files": [[attack, attack]],
    }
    _, page = write(run, tmp_path, files, summary)
    assert {tag for tag, _ in page.tags}.isdisjoint({"script"})
    assert all(attrs["src"].startswith("data:") for tag, attrs in page.tags if tag == "img")
    assert page.words.count("<script>alert(1)</script>") >= 6


def test_headline_of_a_good_year():
    said = headline(simple([6] * 200 + [7] * 127 + [5] * 5))
    assert said[0] == (
        "On 327 of 332 days the inflow reaches the level after 13.3 to 17.7 min "
        "(delay d = 6 or 7 samples of 133 s)."
    )
    assert said[1] == "5 days say something else."
    assert said[2] == "By the hydraulics of the reach, a gravity wave takes 16.7 min."
    assert "On every day with a delay, the data alone say the same, to within a sample." in said
    assert any(s.startswith("The Rayleigh prior alone, without any data, answers 6 or 7") for s in said)


def test_headline_counts_days_without_an_answer_by_reason():
    nan = np.nan
    said = headline(simple([6, 6, 6, nan, nan, nan], ["ok"] * 3 + ["failed", "failed", "unidentifiable"]))
    assert said[0] == (
        "On 3 of 6 days the inflow reaches the level after 13.3 to 15.5 min (delay d = 6 samples of 133 s)."
    )
    assert said[1] == "3 days have no answer (2 failed and 1 unidentifiable)."


def test_headline_says_how_much_the_prior_decides_and_never_more_for_a_uniform_one():
    prior_only = np.array([True, True, False, False])
    said = headline(simple([6, 6, 7, 7], prior_only=prior_only))
    expected = "On 2 days (50 % of those with a delay) the data alone favour another delay, or none: "
    assert expected + "the answer is the prior's." in said
    said = headline(simple([6, 6, 7, 7], prior_only=prior_only, name="jmap-uniform"))
    assert expected + "the answer may be chance." in said
    assert not any("Rayleigh" in sentence for sentence in said)


def test_a_delay_far_from_the_prior_is_the_datas():
    assert any("it is the data that lead elsewhere" in s for s in headline(simple([11] * 9 + [12] * 9)))


def test_a_uniform_prior_beside_is_quoted():
    run = simple([6] * 9)
    uniform = simple([6] * 5 + [9] * 3 + [3], name="jmap-uniform").estimators
    said = headline(dataclasses.replace(run, estimators=run.estimators + uniform))
    assert any("With a uniform prior, jmap-uniform puts 8 of 9 days on 6 or 9 samples" in s for s in said)


def test_one_day_is_spoken_of_as_one_day():
    said = headline(simple([6], start=dt.date(2008, 3, 14), prior_only=np.array([True])))
    assert said[0] == f"On 2008-03-14 {SIX}."
    assert "But the data alone favour another delay, or none: the answer is the prior's." in said


def test_delays_that_spread_are_a_range_and_long_ones_in_hours():
    run = dataclasses.replace(simple(np.arange(1, 16).repeat(4)), sample_time=3600.0)
    assert headline(run)[0] == (
        "Over 60 days the median delay is 8 samples (8 to 9 h); on four days of five it is 2 to 14 samples "
        "(2 to 15 h)."
    )


def passing(t50, inflow, **changes):
    """A river's results with the given t50, all else calm."""
    n = len(t50)
    run = river(n)
    e = dataclasses.replace(
        run.estimators[0],
        status=["ok"] * n,
        messages=[""] * n,
        t50=np.array(t50, float),
        mean_inflow=np.array(inflow, float),
        bound_gravity_s=np.full(n, 7200.0),
        bound_kinematic_s=np.full(n, 25_200.0),
    )
    return dataclasses.replace(run, estimators=[dataclasses.replace(e, **changes)])


def test_a_river_leads_with_t50_and_says_how_it_goes_with_the_flow():
    said = headline(passing([30, 30, 30, 27, 26, 26, 25, 25, 25, 24], range(200, 300, 10)))
    assert said[0] == (
        "Half of a step has arrived after 26 samples (6.5 h) on the median day; between 24.9 (6.2 h) and "
        "30 (7.5 h) on four days in five."
    )
    assert said[1] == (
        "It falls as the flow rises: 7.5 h below a mean inflow of 230 m³/s, 6.2 h above 260 "
        "(medians of the lower and the upper third of days)."
    )
    assert (
        "a gravity wave takes 2.0 h and a kinematic wave takes 7.0 h; t50 lies between them on 7 of 10 days"
        in (said[2])
    )
    assert len(said) == 3, "map has no jump delay to speak of"


def test_t50_that_grows_or_stays_is_not_said_to_fall():
    rising = np.arange(12.0)
    assert "It grows as the flow rises" in headline(passing(20 + rising, 200 + rising))[1]
    wavering = 20 + np.array([0, 1] * 6)
    assert "It does not follow the flow" in headline(passing(wavering, 200 + rising))[1]
    for few_or_same in (passing([20] * 5, range(5)), passing(20 + rising, [300] * 12)):
        assert not any(s.startswith("It ") for s in headline(few_or_same))


def test_the_jump_delay_of_a_river_is_weighed_in_plain_words():
    run = river(40)
    f = facts(run, run.estimators[1])
    said = headline(run)
    assert said[0].startswith("Half of a step has arrived after 24.5 samples (6.1 h) on the median day")
    (jump,) = [s for s in said if s.startswith("The jump delay d of jmap is worth little here")]
    assert "a dispersive river has none" in jump
    assert f"on {f.prior_only} of {f.with_delay} days ({100 * f.prior_only / f.with_delay:.0f} %)" in jump
    assert any(s.startswith("The Rayleigh prior alone, without any data, answers 23 to 27") for s in said)
    assert not any("first moves at sample" in s for s in said)


def test_one_day_of_a_river_and_rivers_without_t50():
    assert headline(passing([26.4], [300]))[0] == (
        "On 2008-01-01 half of a step has arrived after 26.4 samples (6.6 h)."
    )
    nan = np.nan
    status = ["ok", "failed", "ok"]
    said = headline(passing([26.4, nan, nan], [300, nan, 310], status=status))
    assert said[0] == "Half of a step has arrived after 26.4 samples (6.6 h), on 1 day."
    assert said[-1] == (
        "2 days have no t50 (1 failed and 1 with a response that does not sum to anything positive)."
    )
    assert headline(without_answers(river(7))) == ["None of 7 days has a t50: 7 failed."]


def test_only_a_rivers_page_speaks_of_t50(tmp_path, year):
    run = river(20, ("jmap", "ml"))
    _, page = write(run, tmp_path, draw_all(run, tmp_path))
    assert "Median t50" in page.words and "25.1 samples (6.3 h)" in page.words
    assert "All of this speaks of the estimator jmap ; the others are in the table below" in page.words
    assert [a["alt"][:3] for tag, a in page.tags if tag == "img"][:2] == ["t50", "t50"]
    assert "t50" not in year[4].words


def test_a_rivers_page_names_who_gives_t50_and_who_the_jump(tmp_path):
    _, page = write(river(20), tmp_path)
    assert "All of this speaks of the estimators map for t50 and jmap for the jump delay." in page.words


def test_an_answer_faster_than_any_wave_is_doubted():
    slow = np.full(4, 9 * 133.0)  # the wave needs nine samples; d + 2 = 8 is still too early
    said = headline(simple([6, 8, 8, 8], bound_gravity_s=slow))
    assert any(s.startswith("On 1 day the level would move more than a sample before") for s in said)


def test_facts_are_counted_by_hand():
    nan = np.nan
    run = simple(
        [6, 7, 7, 15, nan],
        ["ok", "ok", "ok", "ok", "failed"],
        condition=np.array([1e4, 2e4, 3e4, 4e4, nan]),
        prior_only=np.array([True, False, False, True, True]),
    )
    f = facts(run, run.estimators[0])
    assert (f.days, f.answered, f.with_delay, f.at_bound, f.prior_only) == (5, 4, 4, 1, 2)
    assert f.common == (6, 7) and f.common_days == 3 and f.median == 7 and f.condition == 2.5e4


def test_days_to_look_at_join_neighbours_with_one_reason():
    nan = np.nan
    run = simple(
        [6, nan, nan, nan, 15, 15, 15, 6],
        ["ok", "failed", "failed", "failed", "ok", "ok", "ok", "ok"],
        ["", "no file", "no file", "too short", "", "", "", ""],
    )
    rows = [(r.when, r.days, r.kind) for r in attention(run)]
    assert rows == [
        ("2008-01-02 to 2008-01-03", 2, "failed"),
        ("2008-01-04", 1, "failed"),
        ("2008-01-05 to 2008-01-07", 3, "at a bound"),
    ]


def test_the_same_doubt_of_several_estimators_is_one_row():
    run = simple([np.nan, 6], ["failed", "ok"], ["no file", ""])
    other = simple([np.nan, 15], ["failed", "ok"], ["no file", ""], name="jmap-uniform").estimators
    rows = attention(dataclasses.replace(run, estimators=run.estimators + other))
    assert [r.estimators for r in rows] == [("jmap", "jmap-uniform"), ("jmap-uniform",)]


def test_an_estimator_that_is_always_degenerate_does_not_flood_the_list():
    run = simple([1, 6, 7], ["degenerate"] * 3, name="jmap-degenerate")
    assert attention(run) == []
    assert [r.kind for r in attention(simple([6, 7], ["degenerate", "ok"]))] == ["degenerate"]


def test_a_long_list_is_cut_and_says_so(tmp_path):
    n = 1000
    run = simple([np.nan] * n, ["failed"] * n, [f"reason {i}" for i in range(n)])
    html, page = write(run, tmp_path)
    assert html.count(">reason ") == 400
    assert "375 more" in page.words and "And 600 more, which are in delays.csv only." in page.words


def test_runs_without_an_answer_or_a_day_or_a_summary_still_have_a_page(tmp_path):
    _, page = write(without_answers(results(("jmap", "ml"), dates_of(4))), tmp_path, summary={})
    assert "None of 4 days has a delay: 4 failed." in page.words
    empty = dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[])
    assert "There is no day in these results." in write(empty, tmp_path, summary={})[1].words


def test_a_figure_that_is_gone_is_said(tmp_path):
    run = results(("ml",), dates_of(2), unanswered=0)
    files = draw_all(run, tmp_path)
    files[0].path.unlink()
    with pytest.raises(RividError, match="cannot read .*tdr_ml.png: .*: draw the figures again"):
        write_report(run, files, tmp_path, summary={})


SIX = "the inflow reaches the level after 13.3 to 15.5 min (delay d = 6 samples of 133 s)"
SEVEN = "The inflow reaches the level after 15.5 to 17.7 min (delay d = 7 samples of 133 s)"
NINE = "The inflow reaches the level after 19.9 to 22.2 min (delay d = 9 samples of 133 s)"

STEADY = [7, 7, 6, 7, 7, 6, 7] * 9
"""Nine weeks that are all alike."""


def top(run):
    """The headline, and the lines below it by their names."""
    recent = lately(run)
    said = glance(run, recent, to_look_at(run, recent))
    return said.headline, {line.name: line for line in said.lines}


def test_a_steady_delay_is_said_to_be_as_before_with_its_scatter_beside():
    said, lines = top(simple(STEADY))
    assert said == f"{SEVEN}, as in the weeks before."
    assert lines["Now"].strong == "15.5 to 17.7 min (7 samples)"
    assert lines["Now"].text == (
        "The median of 2008-02-26 to 2008-03-03: 7 of 7 days with a delay, from 13.3 to 17.7 min."
    )
    moved = lines["Has it moved?"]
    assert moved.strong == "No" and not moved.doubt
    said = (
        "Median 15.5 to 17.7 min in the last week, 15.5 to 17.7 min in the 8 weeks before; each of these has "
        "that median."
    )
    assert moved.text.startswith(f"{said} Mean inflow ")
    look = lines["To look at"]
    assert (look.strong, look.links) == ("No day failed or stands out in the last week", ())
    assert look.text == "" and not look.doubt
    assert lines["The prior's part"].strong == "0 of 7 days"
    wave = lines["The hydraulics"]
    assert (wave.strong, wave.doubt) == ("16.7 min", False)
    assert wave.text == "for a gravity wave, the fastest of the reach, at the flows of these days."


def test_a_delay_that_has_moved_is_told_with_the_size_of_the_move():
    said, lines = top(simple(STEADY[:-7] + [9, 9, 8, 9, 9, 9, 8]))
    assert said == f"{NINE}: 4.4 min longer than in the weeks before."
    moved = lines["Has it moved?"]
    assert moved.strong == "Yes, 4.4 min longer" and moved.doubt
    assert moved.text.startswith("Median 19.9 to 22.2 min in the last week, 15.5 to 17.7 min in the 8 weeks")
    said, lines = top(simple([9, 9, 8, 9, 9, 9, 8] * 8 + [7, 6, 7, 7, 7, 7, 6]))
    assert said.endswith(": 4.4 min shorter than in the weeks before.")


def test_a_change_within_the_scatter_of_weeks_is_not_called_a_move():
    weeks = [5, 9, 6, 8, 7, 5, 9, 6, 8]
    said, lines = top(simple([d for week in weeks for d in [week] * 7]))
    assert said == (
        "The inflow reaches the level after 17.7 to 19.9 min (delay d = 8 samples of 133 s), within the "
        "scatter of the weeks before."
    )
    moved = lines["Has it moved?"]
    assert moved.strong == "Not beyond its scatter" and not moved.doubt
    assert moved.text.startswith(
        "3.3 min longer. Median 17.7 to 19.9 min in the last week, 13.3 to 17.7 min in the 8 weeks before; "
        "theirs lie from 11.1 to 22.2 min."
    )


def test_a_week_whose_days_are_mostly_the_priors_claims_nothing_of_a_move():
    prior = np.zeros(63, bool)
    prior[-5:] = True
    run = simple(STEADY[:-7] + [9] * 7, prior_only=prior)
    said, lines = top(run)
    assert said == f"{NINE}, on 5 of 7 days by the prior's word."
    moved = lines["Has it moved?"]
    assert moved.strong == "Cannot be told"
    assert moved.text == "It takes 3 days that have a delay that the data decide; the last week has 2."
    word = lines["The prior's part"]
    assert word.strong == "5 of 7 days" and word.doubt
    assert word.text == (
        "There the data alone favour another delay, or none. The prior is what the reach's hydraulics let "
        "expect before looking at the data, sigma_d = 6.5 samples. In the whole record 5 of 63 days (8 %)."
    )
    assert lines["To look at"].text == "But see the prior's part."


def test_a_record_of_the_prior_alone_says_so_and_a_uniform_priors_says_chance():
    everything = np.ones(63, bool)
    said, lines = top(simple(STEADY, prior_only=everything))
    assert said == f"{SEVEN}, on all 7 days by the prior's word."
    assert lines["Has it moved?"].strong == "Cannot be told"
    assert lines["The prior's part"].strong == "7 of 7 days"
    said, lines = top(simple(STEADY, prior_only=everything, name="jmap-uniform"))
    assert said == f"{SEVEN}, on all 7 days perhaps by chance."
    word = lines["Perhaps chance"]
    assert word.strong == "7 of 7 days" and "The prior is" not in word.text


def test_days_of_the_prior_take_no_part_in_what_is_said_of_a_move():
    prior = np.zeros(63, bool)
    prior[-3:] = True
    delays = STEADY[:-7] + [7, 7, 6, 7, 12, 12, 12]
    said, lines = top(simple(delays, prior_only=prior))
    assert lines["Has it moved?"].strong == "No"
    assert "in the 8 weeks before, on the days that the data decide; each" in lines["Has it moved?"].text


def test_a_last_week_without_a_good_day_says_so_and_names_the_last_delay():
    nan = np.nan
    run = simple(STEADY[:-7] + [nan] * 7, ["ok"] * 56 + ["failed"] * 6 + ["pending"], ["gap"] * 63)
    said, lines = top(run)
    assert said == "No day of the last week has a delay: 6 failed and 1 pending."
    assert lines["Now"].strong == "not known" and lines["Now"].doubt
    assert lines["Now"].text == (
        "No delay on 2008-02-26 to 2008-03-03; the last one is of 2008-02-25: 15.5 to 17.7 min."
    )
    assert lines["Has it moved?"].strong == "Cannot be told"
    look = lines["To look at"]
    assert look.strong == "7 days of the last week" and look.doubt
    assert look.links == (("2008-03-03 pending", 0), ("2008-02-26 to 2008-03-02 failed", 1))


def test_one_day_alone_has_no_trend():
    said, lines = top(simple([6], start=dt.date(2008, 3, 14)))
    assert said == f"On 2008-03-14 {SIX}."
    assert lines["Now"].text == "One day alone."
    assert lines["Has it moved?"].text == "There are no weeks before to compare with."
    assert lines["To look at"].strong == "No day failed or stands out"


def test_all_days_failing_and_all_days_pending_are_told_apart():
    nan = np.nan
    said, lines = top(simple([nan] * 7, ["failed"] * 7, ["no file"] * 7))
    assert said == "None of 7 days has a delay: 7 failed."
    assert set(lines) == {"Now", "To look at"} and lines["To look at"].strong == "7 of 7 days"
    assert lines["Now"].text == "No delay on 2008-01-01 to 2008-01-07."
    assert top(simple([nan] * 3, ["pending"] * 3))[0] == "No day is finished yet: 3 days are pending."
    assert top(simple([nan], ["pending"]))[0] == "No day is finished yet: 1 day is pending."


def test_a_median_at_the_end_of_what_was_tried_may_lie_outside():
    now = top(simple([15] * 6))[1]["Now"]
    assert now.doubt and now.text.endswith("It is an end of what was tried: the true delay may lie outside.")


def test_an_estimator_that_does_not_judge_its_delays_is_not_judged_for_it():
    _, lines = top(simple(STEADY, name="cusum-map"))
    assert lines["The prior's part"].strong == "Not told"
    assert "cusum-map does not tell on which days the data decide." in lines["Has it moved?"].text


def test_an_estimator_with_probabilities_says_how_sure_the_week_is():
    sure = np.linspace(0.75, 0.95, 63)
    line = top(simple(STEADY, name="posterior", probability=sure))[1]["Probability"]
    assert line.strong == f"{np.median(sure[-7:]):.2f}" and f"{sure[-7]:.2f} on the least sure" in line.text


def test_a_river_speaks_of_t50_in_which_the_prior_has_no_part():
    said, lines = top(river(80))
    assert re.fullmatch(r"Half of a step arrives after [\d.]+ h \([\d.]+ samples\).*\.", said)
    assert lines["The prior's part"].strong == "None in t50"
    assert "The jump delay of jmap is the prior's on" in lines["The prior's part"].text


def test_days_far_outside_the_band_are_rows_and_links_of_the_page(tmp_path):
    run = simple(STEADY[:-3] + [12, 6, 15])
    rows = to_look_at(run, lately(run))
    assert [(row.when, row.kind) for row in rows] == [
        ("2008-03-03", "at a bound"),
        ("2008-03-01", "far outside"),
    ]
    assert rows[1].reason == (
        "the delay is 12 samples (26.6 to 28.8 min): nine days in ten lie between 6 and 7 samples"
    )
    _, page = write(run, tmp_path)
    leads = [attrs["href"] for tag, attrs in page.tags if tag == "a" and "look-" in attrs["href"]]
    assert set(leads) == {"#look-0", "#look-1"} and len(leads) == 4, "at the top, and from the marks"
    assert {"look-0", "look-1"} <= {attrs["id"] for _, attrs in page.tags if "id" in attrs}


def test_days_doubted_by_other_estimators_only_are_counted_apart():
    run = simple(STEADY)
    other = simple([15] * 2 + STEADY[2:], name="jmap-uniform").estimators
    _, lines = top(dataclasses.replace(run, estimators=run.estimators + other))
    assert lines["To look at"].strong == "No day failed or stands out in the last week"
    assert lines["To look at"].text == "2 days that only other estimators doubt."


def test_links_to_rows_that_the_page_does_not_hold_are_not_made(tmp_path):
    n = 450
    run = simple(
        [7.0] * 10 + [np.nan] * n, ["ok"] * 10 + ["failed"] * n, [f"reason {i}" for i in range(n + 10)]
    )
    _, page = write(run, tmp_path)
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    assert {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"} <= ids


def many_faults(page):
    """The page with all that can be wrong with it side by side."""
    ours = "<main><script>0</script>", f"<h6>{'x' * 300}</h6>", '<img src="http://127.0.0.1/x.png" alt="">'
    page = restyled(page.replace("<main>", "".join(ours)), "p { color: #aaa; }")
    return restyled(
        page, "@media print { .card .zoom img { height: 300cm; max-height: none; object-fit: fill; } }"
    )


BROKEN = [
    (many_faults, {"420 pixels the page is", "asks for http:", "inline script", "to read, P", "cut in two"}),
    (lambda page: page.replace(" popover>", ">"), {"a click does not enlarge it"}),
    (lambda page: restyled(page, ".space { display: none; }"), {"the page behind it moves"}),
]
"""What is done to a page, and what then has to be found."""


def restyled(page, rules):
    """The page with more rules, which its policy allows."""
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.S)
    old, new = (
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, style + rules)
    )
    return page.replace(style, style + rules).replace(old, new)


@pytest.mark.skipif(installed() is None, reason=f"no browser on PATH: {', '.join(NAMES)}")
def test_a_browser_finds_nothing_wrong_with_the_page_and_something_with_broken_ones(tmp_path):
    attack = "</style><script>alert(1)</script>" + "a_long_name_" * 30
    run = simple(STEADY[:-2] + [np.nan, 15], ["ok"] * 61 + ["failed", "ok"], [attack] * 63)
    run = dataclasses.replace(run, reach=attack)
    figures = [draw(run, (kind, "jmap"), tmp_path) for kind in ("tdr", "histogram")]
    html, _ = write(run, tmp_path, figures, SUMMARY | {"bad_files": [[attack, attack]]})
    with browser(installed()) as tab:
        assert faults(tab, tmp_path / "report.html", tmp_path / "pictures") == []
        for damage, expected in BROKEN:
            tab.requests.clear()
            tab.complaints.clear()
            page = tmp_path / "broken.html"
            page.write_text(damage(html), encoding="utf-8")
            found = faults(tab, page, tmp_path / "pictures")
            missed = {words for words in expected if not any(words in text for text in found)}
            assert not missed, found


def test_the_readmes_picture_is_small_and_as_wide_as_the_window():
    from PIL import Image

    path = Path(__file__).parents[1] / "docs" / "pictures" / "report.png"
    with Image.open(path) as image:
        assert image.width == WIDE
    assert path.stat().st_size < MOST_BYTES
