"""The report: what it says, that it needs nothing else, that names cannot break it."""

import base64
import dataclasses
import datetime as dt
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from rivid.errors import RividError
from rivid.figures import draw_all
from rivid.figures.headline import facts, headline
from rivid.report import attention, write_report
from tests.figures.synthetic import dates_of, estimator, results, river, without_answers

SUMMARY = {
    "config": {"reach": {"length": 8200.0, "bed_level": None}, "run": {"estimators": ["jmap"]}},
    "versions": {"rivid": "0.1.0", "numpy": "2.3.4"},
    "d_min": 1,
    "d_max": 15,
}
VOID = {"meta", "br", "img", "link", "hr", "input"}


class Page(HTMLParser):
    """Collects text, attributes and unbalanced tags."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text, self.tags = [], [], []
        self.feed(html)
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-1:]}"
        self.open.pop()

    def handle_data(self, data):
        if "style" not in self.open:
            self.text.append(data)

    @property
    def words(self):
        return re.sub(r"\s+", " ", " ".join(self.text))


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
    assert said[0] == "On 327 of 332 days the delay is 6 or 7 samples (13.3 to 15.5 min)."
    assert said[1] == "5 days say something else."
    assert said[2].startswith("The level first moves at sample d + 1, that is 15.5 to 17.7 min after")
    assert "On every day with a delay, the data alone say the same, to within a sample." in said
    assert any(s.startswith("The Rayleigh prior alone, without any data, answers 6 or 7") for s in said)


def test_headline_counts_days_without_an_answer_by_reason():
    nan = np.nan
    said = headline(simple([6, 6, 6, nan, nan, nan], ["ok"] * 3 + ["failed", "failed", "unidentifiable"]))
    assert said[0] == "On 3 of 6 days the delay is 6 samples (13.3 min)."
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
    assert said[0] == "On 2008-03-14 the delay is 6 samples (13.3 min)."
    assert "But the data alone favour another delay, or none: the answer is the prior's." in said


def test_delays_that_spread_are_a_range_and_long_ones_in_hours():
    run = dataclasses.replace(simple(np.arange(1, 16).repeat(4)), sample_time=3600.0)
    assert headline(run)[0] == (
        "Over 60 days the median delay is 8 samples (8.0 h); on four days of five it is 2 to 14 samples "
        "(2.0 to 14.0 h)."
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
    assert "These lines speak of the estimator jmap ; the others are in the table below" in page.words
    assert [a["alt"][:3] for tag, a in page.tags if tag == "img"][:2] == ["t50", "t50"]
    assert "t50" not in year[4].words


def test_a_rivers_page_names_who_gives_t50_and_who_the_jump(tmp_path):
    _, page = write(river(20), tmp_path)
    assert "These lines speak of the estimators map for t50 and jmap for the jump delay." in page.words


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
    assert html.count("<td>reason ") == 400
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
