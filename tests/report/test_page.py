"""Test the report page: self-contained, escaped, with every number of the summary in its place."""

import base64
import dataclasses
import datetime as dt
import hashlib
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image

from benchmarks.browser import NAMES, browser, installed
from benchmarks.page_pictures import MOST_BYTES, WIDE, faults
from rivid.errors import RividError
from rivid.plots.draw import draw
from rivid.report.build import write_report
from rivid.report.page import caption
from rivid.results.read import results_of
from rivid.text import samples_first
from tests.plots.synthetic import (
    cases,
    dates_of,
    draw_all,
    probable,
    probable_river,
    results,
    river,
    searched,
    without_answers,
)
from tests.report.runs import STEADY, SUMMARY, among, combined, passing, simple, with_travel, write

NAN = np.nan
ATTACK = '"><script>alert(1)</script><img src=x onerror=alert(1)>'


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    out = tmp_path_factory.mktemp("drawn")
    run = results(("ml", "map", "jmap", "jmap-uniform"), dates_of(120, missing=9))
    files = draw_all(run, out)
    return out, run, files, *write(run, out, files)


def top(page):
    """Return the rows of the first list of the page: name, number, and the rest of the text."""
    listed = re.split(r"<dl class=\"glance\">|</dl>", page)[1]
    rows = re.findall(r"<dt>(.*?)</dt><dd.*?><strong>(.*?)</strong>(.*?)</dd>", listed, re.S)
    return {name: (strong, " ".join(re.sub("<.*?>", " ", text).split())) for name, strong, text in rows}


def headline(page):
    (text,) = re.findall(r'<p class="headline">(.*?)</p>', page)
    return text.replace("\u00a0", " ")


def test_four_estimators_are_one_file_of_moderate_size(drawn):
    out, run, files, html, _ = drawn
    assert len(html.encode()) < 3_000_000
    assert sorted(p.name for p in out.iterdir()) == ["figures", "report.html"]
    assert write(run, out, files)[0] == html, "the same run gives the same bytes"


def test_the_page_requests_nothing_and_runs_no_script(drawn):
    html, page = drawn[3:]
    assert "script" not in {tag for tag, _ in page.tags}
    for tag, attrs in page.tags:
        assert not any(name.startswith("on") or name == "style" for name in attrs)
        for name in {"src", "href"} & set(attrs):
            assert attrs[name].startswith(("data:image/png;base64,", "#")), f"<{tag} {name}>"
    assert "url(" not in html and "@import" not in html
    (style,) = re.findall(r"<style>(.*?)</style>", html, re.S)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    (policy,) = [a["content"] for tag, a in page.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy == (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    )


def test_every_figure_is_in_the_page_with_its_caption_and_opens(drawn):
    _, _, files, _, page = drawn
    shown = [attrs for tag, attrs in page.tags if tag == "img"]
    inside = {base64.b64decode(attrs["src"].split(",", 1)[1]) for attrs in shown}
    assert inside == {file.path.read_bytes() for file in files}
    assert all(caption(file) in page.words for file in files)
    assert all(attrs["alt"] and attrs["width"] and attrs["height"] for attrs in shown)
    cards = [attrs["id"] for tag, attrs in page.tags if "popover" in attrs]
    opens = [attrs["popovertarget"] for tag, attrs in page.tags if tag == "button"]
    assert cards == opens and len(set(cards)) == len(files)
    titles = ["Impulse response of each day", "Delay of each day", "How often each delay"]
    assert [text["alt"].split(",")[0] for text in shown[:4]] == [*titles, "Delay and discharge"]
    assert all(text["alt"].endswith(", jmap") for text in shown[:4])


@pytest.mark.parametrize("name", list(cases()))
def test_every_record_has_a_balanced_page_whose_links_lead_somewhere(name, tmp_path):
    run = cases()[name]
    page = write(run, tmp_path)[1]
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    assert {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"} <= set(ids)
    assert not re.search(r"\bnan\b|\bNone\b(?! of| in)|\{|\}", page.words)


def test_settings_and_versions_are_shown(drawn):
    words = drawn[4].words
    assert all(
        part in words
        for part in ("d_max 15", "sigma_d 6.5", "length 8200", "bed_level not set", "numpy 2.3.4")
    )


def test_names_and_reasons_are_text_and_never_markup(tmp_path):
    run = simple([6, NAN], ["ok", "failed"], ["", ATTACK])
    run = dataclasses.replace(run, reach=ATTACK)
    summary = {
        "config": {ATTACK: {ATTACK: ATTACK}},
        "versions": {ATTACK: ATTACK},
        "bad_files": [[ATTACK] * 2],
    }
    _, page = write(run, tmp_path, [draw(run, ("tdr", "jmap"), tmp_path)], summary)
    assert {tag for tag, _ in page.tags}.isdisjoint({"script"})
    assert all(attrs["src"].startswith("data:") for tag, attrs in page.tags if tag == "img")
    assert page.words.count("<script>alert(1)</script>") >= 6


@pytest.mark.parametrize(
    ("run", "number"),
    [
        (simple(STEADY), "15.5 to 17.7 min (delay d = 7 samples of 133 s), as in"),
        (simple(STEADY[:-7] + [9, 9, 8, 9, 9, 9, 8]), "4.4 min longer"),
        (simple([9, 9, 8, 9, 9, 9, 8] * 8 + [7, 6, 7, 7, 7, 7, 6]), "4.4 min shorter"),
        (simple(STEADY, prior_only=among(63, 5)), "5 of 7 days"),
        (simple(STEADY, prior_only=among(63, 63)), "all 7 days"),
        (simple([6], start=dt.date(2008, 3, 14)), "2008-03-14"),
        (simple([NAN] * 12 + [7, 7], ["failed"] * 12 + ["ok"] * 2), "2 of 7 days"),
        (simple([NAN] * 7, ["failed"] * 7), "None of 7 days has a delay: 7 failed"),
        (simple([NAN] * 7, ["failed"] * 7, ["short"] * 7), "7 failed. On all of them: short."),
        (simple([NAN] * 7, ["failed"] * 7, ["a", *["b; c"] * 6]), "7 failed. On 6 of 7 days: b."),
        (simple([NAN] * 3, ["pending"] * 3), "3 days are pending"),
        (simple([7] * 7 + [NAN] * 7, ["ok"] * 7 + ["failed"] * 6 + ["pending"]), "6 failed and 1 pending"),
        (with_travel(simple([7] * 14, name="posterior"), 0.25), "16.1 min (delay d = 7"),
        (passing([26.4], [300]), "6.6 h (26.4 samples)"),
        (results(("ml",), dates_of(4), unanswered=0), "3 of 4 days have an impulse response (ml)"),
        (dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[]), "no day"),
    ],
)  # fmt: skip
def test_the_headline_has_the_numbers_of_the_summary(run, number, tmp_path):
    assert number in headline(write(run, tmp_path)[0])


def test_no_line_of_the_headline_breaks_between_a_number_and_its_unit(tmp_path):
    html = write(simple([7] * 14), tmp_path)[0]
    assert "15.5 to 17.7\u00a0min (delay d = 7\u00a0samples of 133\u00a0s)" in html


def test_the_rows_at_the_top_have_their_numbers(tmp_path):
    rows = top(write(simple(STEADY, prior_only=among(63, 3)), tmp_path)[0])
    assert rows["Now"] == (
        "15.5 to 17.7 min (7 samples)",
        "Median of 2008-02-26 to 2008-03-03: 7 of 7 days with a delay, 13.3 to 17.7 min.",
    )
    assert rows["Has it moved?"][0] == "No" and "in the 8 weeks before" in rows["Has it moved?"][1]
    assert rows["Decided by the prior"][0] == "3 of 7 days"
    assert "sigma_d = 6.5 samples" in rows["Decided by the prior"][1]
    assert "3 of 63 days (5 %)" in rows["Decided by the prior"][1]
    assert rows["Gravity wave"][0] == "16.7 min"
    moved = top(write(simple(STEADY[:-7] + [9] * 7), tmp_path)[0])["Has it moved?"]
    assert moved[0] == "Yes, 4.4 min longer"
    for width, shown in ((0.3, "range from 14.9 to 16.0 min"), (1e-4, "each of these has that median")):
        weeks = np.repeat(np.linspace(-width, width, 9), 7)  # 1e-4 samples are 13 ms
        run = simple([7] * 63, name="posterior", probability=np.full(63, 0.9), travel_s=(7 + weeks) * 133)
        text = top(write(run, tmp_path)[0])["Has it moved?"][1]
        assert shown in text
    fast = top(write(simple([7] * 21, bound_gravity_s=np.full(21, 9.1 * 133)), tmp_path)[0])["Gravity wave"]
    assert fast[0] == "20.2 min" and "7 of 7 days" in fast[1]
    sure = simple(STEADY, name="posterior", probability=np.linspace(0.75, 0.95, 63))
    assert top(write(sure, tmp_path)[0])["Probability"][0] == "0.94"
    assert (
        top(write(simple(STEADY, name="cusum-map"), tmp_path)[0])["Decided by the data"][0] == "Not reported"
    )


def test_the_rows_of_a_river(tmp_path):
    run = passing([30, 30, 30, 27, 26, 26, 25, 25, 25, 24], range(200, 300, 10))
    html, page = write(run, tmp_path)
    assert top(html)["Part of the prior"][0] == "None in t50"
    for number in (
        "26 samples (6.5 h)",
        "80 % of the days between 24.9 (6.2 h) and 30 (7.5 h)",
        "7.5 h below a mean inflow of 230 m³/s, 6.2 h above 260 m³/s",
        "7 of 10 days",
        "gravity wave takes 2.0 h, a kinematic wave 7.0 h",
    ):
        assert number in page.words
    words = write(river(40), tmp_path)[1].words
    assert "map for t50 and jmap for the jump delay" in words and "d = 23 to 27" in words
    assert "Median t50" in words


def test_a_change_that_the_test_does_not_find_and_a_step_without_a_test_are_stated_as_such(tmp_path):
    """Regression: "within the scatter" of weeks that lie elsewhere, and a date beside "3 of the 3"."""
    flow = np.full(63, 219.0) + 229.0 * among(63, 7)
    weeks = [d for week in (5, 9, 6, 8, 7, 5, 9, 6, 4) for d in [week] * 7]
    html = write(simple(weeks, mean_inflow=flow), tmp_path)[0]
    output = headline(html)
    assert "finds no change from the weeks before, at a mean inflow of 448 m³/s, 219 m³/s in the" in output
    name, why = top(html)["Has it moved?"]
    assert name == "No change found" and "the last week lies outside, but the test finds no change" in why
    html = write(simple([5] * 19 + [8] * 9, mean_inflow=np.full(28, 300.0)), tmp_path)[0]
    name, why = top(html)["Has it moved?"]
    assert name == "Yes, on about 2008-01-20" and "is not tested yet. The test needs 4 earlier weeks" in why
    assert "there are 3." in why and "of the 3 weeks" not in why


def test_the_headline_has_the_median_since_a_step_and_not_that_of_the_last_week(tmp_path):
    """Regression: "15.8 min, since 2025-01-27; 13.2 before", where 15.8 min was the last week alone."""
    run = with_travel(simple([6] * 20 + [9] * 15, mean_inflow=np.full(35, 300.0)), 0.0)
    (e,) = run.estimators
    drift = e.travel_s + 8.0 * np.maximum(np.arange(35) - 20, 0) + np.tile([0.0, 60.0, -30.0, 20.0, -50.0], 7)
    run = dataclasses.replace(run, estimators=[dataclasses.replace(e, travel_s=drift)])
    now, since, before = (np.median(drift[days]) / 60 for days in np.s_[-7:, 20:, :20])
    output = headline(write(run, tmp_path)[0])
    assert f"after {now:.1f} min" in output and now - since > 0.3
    assert f"; {since:.1f} min since 2008-01-21, {before:.1f} min before" in output


def test_a_river_follows_posterior_of_which_d_is_t50_rounded(tmp_path):
    """Regression: t50 was that of jmap, and d of posterior a jump of the response from d to d + 1."""
    run = probable_river()
    e, figures = run.estimators[1], draw_all(run, tmp_path)
    html, page = write(run, tmp_path, figures)
    words = " ".join(page.words.replace("\u00a0", " ").split())
    rows, d = top(html), int(np.nanmedian(e.delay))
    assert "By <code>posterior</code>; the other" in html and "t50 of each day by posterior" in words
    assert "Probability" in rows and "Part of the prior" not in rows
    assert "Jump delay d" not in words and "It is t50 to the nearest sample" in words
    assert f"{d} samples ({samples_first([d], 900, True).split('(')[1]}" in words
    assert "between d - 1/2 and d + 1/2 samples" in words and "between d and d + 1 samples, or" not in words
    captions = {(f.kind, f.estimator): caption(f) for f in figures}
    assert not any("looks for a jump" in text for (_, name), text in captions.items() if name == "posterior")
    assert "band from d - 1/2 to d + 1/2 holds t50" in captions["fir_day", ""]
    assert "as a delay" not in captions["delay_map", "posterior"]


def test_a_pool_without_such_estimators_does_not_mention_rivers_cusum_or_probabilities(drawn):
    assert not any(
        word in drawn[4].words for word in ("t50", "CUSUM", "Probability", "90 % set", "posterior")
    )


def test_the_record_of_an_estimator_with_probabilities(tmp_path):
    run = probable()
    e = run.estimators[0]
    words = write(run, tmp_path)[1].words
    given = e.probability[np.isfinite(e.delay)]
    how = "of the delay, to within a tenth of a sample, on the median day"
    assert f"{np.median(given):.2f} {how}, {given.min():.2f} on the least" in words
    assert "26 of 30 days (87 %)" in words and "Unidentifiable on 3 days: the likeliest delay" in words
    assert f"6 and 7: 26 of 26 days {np.median(given):.2f} 0 –" in words
    assert "90 % set" in words and "For posterior also" in words


def test_a_search_that_piles_up_at_its_ends_is_reported(tmp_path):
    run = searched()
    edge = int(run.estimators[0].at_bound.sum())
    words = write(run, tmp_path)[1].words
    assert f"{edge} of 120 days at the shortest or longest delay searched, d = 1 or 15" in words
    assert "For CUSUM also" in words and "direct does not report" in words


def test_a_uniform_prior_is_quoted_with_its_own_numbers(tmp_path):
    run = combined(simple([6] * 9), simple([6] * 5 + [9] * 3 + [3], name="jmap-uniform"))
    assert (
        "jmap-uniform gives 6 or 9 samples (13.3 to 15.5 or 19.9 to 22.2 min) on 8 of 9 days"
        in write(run, tmp_path)[1].words
    )


def test_rows_of_days_are_linked_from_the_top_and_from_the_drawing(tmp_path):
    page = write(simple(STEADY[:-3] + [12, 6, 15]), tmp_path)[1]
    leads = [attrs["href"] for tag, attrs in page.tags if tag == "a" and "look-" in attrs["href"]]
    assert sorted(leads) == ["#look-0", "#look-0", "#look-1", "#look-1"]
    assert (
        "the delay is 12 samples (26.6 to 28.8 min); 90 % of the days lie between 6 and 7 samples"
        in page.words
    )


def test_a_long_list_is_cut_and_its_links_with_it(tmp_path):
    n = 1000
    run = simple([7.0] * 10 + [NAN] * n, ["ok"] * 10 + ["failed"] * n, [f"reason {i}" for i in range(n + 10)])
    html, page = write(run, tmp_path)
    assert html.count(">reason ") == 400
    assert "375 more" in page.words and "600 more, which are in delays.csv only" in page.words
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    assert {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"} <= ids


def test_days_without_a_log_are_named_the_latest_first_to_stay(tmp_path):
    dates = [dt.date(2008, 3, 1) + dt.timedelta(days=k) for k in range(21) if k not in (4, 11, 12)]
    html, page = write(simple([7] * 18, dates=dates), tmp_path)
    assert "No log on 3 days (2008-03-05, 2008-03-12 to 2008-03-13)." in top(html)["To look at"][1]
    assert "No log on 3 days: 2008-03-05, 2008-03-12 to 2008-03-13." in page.words
    dates = [dt.date(2008, 1, 1) + dt.timedelta(days=2 * k) for k in range(60)]
    html, page = write(simple([7] * 60, dates=dates), tmp_path)
    assert "(the latest " in top(html)["To look at"][1] and "2008-01-02" not in page.words
    assert "No log" not in write(simple([7] * 18), tmp_path)[1].words


def test_a_run_without_doubts_names_the_days_that_the_prior_decides(tmp_path):
    html, page = write(simple([7] * 21, prior_only=among(21, 10)), tmp_path)
    assert "On 10 days the prior, or chance, decides" in page.words
    assert "Decided by the prior" in top(html)["To look at"][1]
    assert "or chance, decides: the hollow" not in write(simple([7] * 21), tmp_path)[1].words


def test_an_assumed_geometry_is_named_and_no_wave_is_shown(tmp_path):
    for given in (simple(STEADY), river(30)):
        nothing = np.full(len(given.estimators[0].dates), NAN)
        bounds = {"bound_gravity_s": nothing, "bound_kinematic_s": nothing}
        bare = [dataclasses.replace(e, **bounds) for e in given.estimators]
        run = dataclasses.replace(given, estimators=bare, assumed=("length", "width", "depth"))
        figure = draw(run, ("delay_map", "jmap"), tmp_path)
        html, page = write(run, tmp_path, [figure])
        assert top(html)["Gravity wave"] == (
            "Not compared",
            "Length, width and depth of the reach are not given: there is no travel time to compare with.",
        )
        assert not any(word in page.words for word in ("gravity wave", "The blue line", "kinematic"))


def test_runs_without_an_answer_or_a_summary_have_a_page(tmp_path):
    page = write(without_answers(results(("jmap", "ml"), dates_of(4))), tmp_path, summary={})[1]
    assert "None of 4 days has a delay: 4 failed." in page.words and "Not recorded." in page.words


def test_a_missing_figure_is_an_error(tmp_path):
    run = results(("ml",), dates_of(2), unanswered=0)
    files = draw_all(run, tmp_path)
    files[0].path.unlink()
    with pytest.raises(RividError, match="cannot read .*tdr_ml.png: .*: draw the figures again"):
        write_report(run, files, tmp_path, summary={})


@pytest.mark.parametrize("keys", [None, [], ["depth"]])
def test_results_are_read_without_bounds_where_the_geometry_was_assumed(keys):
    row = {
        "date": dt.date(2024, 6, 3), "estimator": "posterior", "status": "ok", "message": None,
        "delay_samples": 5.0, "delay_s": 1650.0, "at_bound": False, "prior_only": None, "probability": 0.9,
        "delay_low": 5.0, "delay_high": 5.0, "t50_samples": None, "alpha": None, "noise_sd": None,
        "roughness_sd": None, "condition": None, "mean_inflow_m3s": 300.0, "bound_gravity_s": 1700.0,
        "bound_kinematic_s": 5000.0,
    }  # fmt: skip
    run = {"reach": "x", "sample_time": 300, "output_unit": "m", "delay_scale": 5}
    run["estimators"] = ["posterior"]
    if keys is not None:  # an older run.json has no such list
        run["assumed"] = keys
    tables = [pa.Table.from_pylist([row])]
    for axis, value in (("lag", "value"), ("delay_samples", "criterion")):
        long = {"date": row["date"], "estimator": "posterior", axis: 5, value: 0.9}
        tables.append(pa.Table.from_pylist([long]))
    got = results_of(run, *tables)
    (e,) = got.estimators
    assert got.assumed == tuple(keys or ()) and e.travel_s.tolist() == [1650.0]
    assert np.isnan([e.bound_gravity_s[0], e.bound_kinematic_s[0]]).tolist() == [bool(keys)] * 2


def many_faults(page):
    """Return the page with many faults together."""
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
"""Changes of a page, and the faults that must be found then."""


def restyled(page, rules):
    """Return the page with more rules, permitted by its policy."""
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.S)
    old, new = (
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, style + rules)
    )
    return page.replace(style, style + rules).replace(old, new)


@pytest.mark.long
@pytest.mark.skipif(installed() is None, reason=f"no browser on PATH: {', '.join(NAMES)}")
def test_a_browser_finds_no_fault_in_the_page_and_those_of_broken_ones(tmp_path):
    attack = "</style><script>alert(1)</script>" + "a_long_name_" * 30
    run = simple(STEADY[:-2] + [NAN, 15], ["ok"] * 61 + ["failed", "ok"], [attack] * 63)
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


def test_the_picture_of_the_readme_is_small_and_as_wide_as_the_window():
    path = Path(__file__).parents[2] / "docs" / "pictures" / "report.png"
    with Image.open(path) as image:
        assert image.width == WIDE
    assert path.stat().st_size < MOST_BYTES
