"""The page: what it says for each verdict, that it needs nothing else, that names cannot break it."""

import base64
import dataclasses
import datetime as dt
import math
import re

import pytest

from rivid.diagnosis.result import VERDICTS, ClosedLoop, Estimate, Unknown, Where
from rivid.effects import effect_classes
from rivid.errors import RividError
from rivid.plots.style import FigureFile
from rivid.report.diagnosis_files import write_diagnosis
from rivid.report.diagnosis_page import write_page
from rivid.report.diagnosis_text import LABELS, MAY_NOT_SAY
from tests.diagnosis.answers import BYPASS, DIURNAL, LOCKS, diagnosis, evidence_of, gap_of, record_of
from tests.diagnosis.loops import OPERATORS, REGIMES, loop_of, with_loop
from tests.pages import Page

EVIDENCE = evidence_of()
RIVER = evidence_of(record_of(kind="river"), amplitude=40.0)


def page(folder, verdict, evidence=EVIDENCE, **changes):
    answer = diagnosis(verdict, evidence, **changes)
    given = None if verdict == "insufficient_data" else evidence
    return Page(write_page(folder, answer, given, [], reach="basse_isere").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    evidence = evidence_of(record_of(days=60, n=288, gone=(20, 21)))
    path = write_diagnosis(out, diagnosis("partly_explained", evidence), evidence, reach="basse_isere")
    html = path.read_text(encoding="utf-8")
    return out, html, Page(html)


def test_the_page_is_one_file_that_asks_no_server_and_runs_no_script(whole):
    _, html, seen = whole
    assert len(html.encode()) < 3_000_000
    assert "script" not in {tag for tag, _ in seen.tags} and "link" not in {tag for tag, _ in seen.tags}
    for tag, attrs in seen.tags:
        assert not any(name.startswith("on") for name in attrs)
        for name in ("src", "href"):
            if name in attrs:
                assert attrs[name].startswith(("data:image/png;base64,", "#")), f"<{tag} {name}>"
    assert "url(" not in html and "@import" not in html
    assert "http:" not in html and "https:" not in html


def test_every_picture_is_in_the_page_whole_once_with_its_caption(whole):
    out, _, seen = whole
    shown = [attrs for tag, attrs in seen.tags if tag == "img"]
    inside = sorted(base64.b64decode(attrs["src"].split(",", 1)[1]) for attrs in shown)
    assert inside == sorted(p.read_bytes() for p in (out / "figures").iterdir()) and len(inside) == 4
    for attrs in shown:
        assert attrs["width"] and attrs["height"]
        assert attrs["alt"].partition(". ")[2] in seen.words


def test_links_within_the_page_lead_somewhere(whole, tmp_path):
    for seen in (whole[2], page(tmp_path, "insufficient_data")):
        ids = {attrs["id"] for _, attrs in seen.tags if "id" in attrs}
        links = {attrs["href"][1:] for tag, attrs in seen.tags if tag == "a"}
        assert links and links <= ids


def test_the_page_reads_in_light_dark_and_print(whole):
    html = whole[1]
    assert "prefers-color-scheme: dark" in html and "@media print" in html
    assert '<meta name="color-scheme" content="light dark">' in html


@pytest.mark.parametrize("verdict", VERDICTS)
@pytest.mark.parametrize("evidence", [EVIDENCE, RIVER], ids=["pool", "river"])
def test_every_verdict_has_label_reason_and_limits(verdict, evidence, tmp_path):
    said = page(tmp_path, verdict, evidence).words
    answer = diagnosis(verdict, evidence)
    assert LABELS[verdict] in said and answer.reason in said.replace("\u00a0", " ")
    assert MAY_NOT_SAY[verdict] in said and "What this may and may not say" in said
    assert "{{" not in said and "None" not in re.sub("None of the", "", said) and "nan" not in said.split()


def test_units_and_words_of_a_river_are_those_of_discharge(tmp_path):
    said = page(tmp_path, "no_gap", RIVER).words
    assert "the simulated discharge is off by 16.3 m³/s" in said and "Error [m³/s]" in said
    assert "level" not in said and "mm" not in said.split()


def test_a_card_has_size_dates_hours_and_how_sure(whole):
    said = whole[2].words
    known = effect_classes()["unlogged_upstream_release"]
    for part in (
        known.sentence, known.looks, "35.0 m³/s (33.8 to 36.1)", known.parameters()["size"].meaning,
        "from 2024-05-05 to 2024-05-12, from 22:00 to 06:00", "p = 0.0004", "143 events",
        "next best name is rain inflow, which removes 40 % less of the excess error",
    ):  # fmt: skip
        assert part in said
    assert "More, without a name" in said and "about 1.3 m³/s, from 10:00 to 14:00" in said


def test_the_gap_table_has_a_row_for_each_step_and_for_events_timed_on_the_day(whole):
    said = whole[2].words
    for row in (
        "Without any effect 9.3 27 62", "+ unlogged upstream release 3.5 10.3 24",
        "+ unlogged downstream release 1.3 3.9 9.0", "events timed on the day 0.4 1.2 2.7",
    ):  # fmt: skip
        assert row in said
    assert (
        "With events timed on the day itself, 97 % of the gap is closed; by what is known beforehand, 31"
        in said
    )


def test_the_gap_by_regime_shows_before_and_after_and_a_dash_where_nothing_ends(tmp_path):
    gap = dataclasses.replace(gap_of(EVIDENCE, (DIURNAL,)), by_regime=REGIMES)
    said = page(tmp_path, "explained", gap=gap).words
    assert "By regime" in said and "without any effect → with the named ones" in said
    assert "Inflow below 153 m³/s 15.6 → 8.0 79 → 27 286 → 137" in said
    assert "Longer after a step 11.6 → 6.9 59 → 22 –" in said
    gap = dataclasses.replace(gap_of(EVIDENCE), by_regime=REGIMES)
    said = page(tmp_path, "no_gap", gap=gap).words
    assert "Inflow below 153 m³/s 15.6 79 286" in said and "→" not in said
    assert "By regime" not in page(tmp_path, "no_gap").words


def test_the_closed_loop_has_its_table_its_day_and_the_operators_in_words(tmp_path):
    answer = with_loop(diagnosis("explained", EVIDENCE), EVIDENCE.record)
    path = write_diagnosis(tmp_path, answer, EVIDENCE)
    seen = Page(path.read_text(encoding="utf-8"))
    said = seen.words.replace("\u00a0", " ")
    assert "With the operators in the loop" in said and "Over 12 days kept apart" in said
    assert "Measured 56 Without any effect 144 49 6.1 40 With the named effects 65 32 3.5 45" in said
    assert (
        "They pass on 95 % of a change of the inflow, at once, and let out 131 m³/s more for each metre of "
        "level beyond 1.2 cm about 130.01 m, and as much again for each 3.93 h that it lasts. They look "
        "every 17.7 min, and when the inflow moves by more than 4 m³/s. This explains 98.7 % of the hourly "
    ) in said
    assert "the inflow alone 96.7 %, and leaves 3.0 of 26 m³/s." in said
    shown = [attrs["alt"] for tag, attrs in seen.tags if tag == "img"]
    assert len(shown) == 5 and sum(alt.startswith("With the operators in the loop") for alt in shown) == 1
    assert {"href": "#loop"} in [attrs for tag, attrs in seen.tags if tag == "a"]


def test_operators_who_answer_no_level_and_look_by_the_clock_are_told_so(tmp_path):
    slow = dataclasses.replace(
        OPERATORS, level_gain=0.0, trim_time_s=None, notice=None, lag_s=532.0, r2_inflow=-0.1, dead_band=0.0
    )
    loop = dataclasses.replace(loop_of(EVIDENCE.record), operators=slow)
    said = page(tmp_path, "no_gap", closed_loop=loop).words.replace("\u00a0", " ")
    assert "of the inflow, 8.87 min later; no answer to the level is seen. They look every 17.7 min." in said
    assert "the inflow alone 0.0 %" in said and "Simulated 144 49 6.1 40" in said
    assert "Without any effect 144" not in said


def test_where_there_is_no_closed_loop_the_reason_stands(tmp_path):
    loop = ClosedLoop(
        OPERATORS, "Inflow and level explain 31 % of the hourly changes: expected 50 % or more."
    )
    said = page(tmp_path, "no_gap", closed_loop=loop).words
    assert "There is no closed loop here. Inflow and level explain 31 % of" in said
    assert "root mean square errors" not in said and "The operators, by the logs" in said
    loop = ClosedLoop(None, "The outflow hardly moves.")
    said = page(tmp_path, "no_gap", closed_loop=loop).words
    assert "The outflow hardly moves." in said and "by the logs" not in said
    assert "operators in the loop" not in page(tmp_path, "no_gap", RIVER).words


def test_a_tie_shows_all_its_names_and_the_measurement_that_would_tell(tmp_path):
    said = page(tmp_path, "cannot_tell").words
    assert "leakage or gate head effect" in said and "Do not act on one of the names alone" in said
    assert "To be sure hold the level 20 cm higher for a day" in said


def test_what_did_not_hold_is_marked_on_its_card_too(tmp_path):
    said = page(tmp_path, "did_not_hold").words
    assert said.count("The days kept apart do not confirm it.") == 2 and "was missing" not in said


def test_an_unknown_gets_a_card_without_a_name(tmp_path):
    said = page(tmp_path, "unknown").words
    assert "Something without a name" in said and "with a period of 90 min" in said
    assert f"None of the {len(effect_classes())} effects known here removes it" in said


def test_too_few_data_say_nothing_about_the_reach(tmp_path):
    said = page(tmp_path, "insufficient_data").words
    assert "It says nothing about the reach" in said and "6 days can be used" in said
    assert "The gap" not in said and "reconstruction" not in said


def test_an_effect_of_a_user_without_words_has_a_card(tmp_path):
    effect = dataclasses.replace(DIURNAL, name="hunting_of_a_turbine", table={})
    gap = gap_of(EVIDENCE, (effect,))
    said = page(tmp_path, "explained", effects=(effect,), gap=gap).words
    assert "hunting of a turbine" in said and "family “flow” that was added to the list" in said


def test_words_of_a_users_effect_are_taken_where_they_are_given(tmp_path):
    class Own:
        sentence, looks = "A turbine hunts for its speed.", "The level swings in eight minutes."

        @staticmethod
        def parameters():
            return {}

    effect = dataclasses.replace(DIURNAL, name="hunting")
    answer = diagnosis("explained", EVIDENCE, effects=(effect,))
    path = write_page(tmp_path, answer, EVIDENCE, [], classes={"hunting": Own})
    assert "A turbine hunts for its speed." in Page(path.read_text(encoding="utf-8")).words


def test_values_are_said_again_as_people_say_them(tmp_path):
    effect = dataclasses.replace(
        LOCKS,
        parameters=(
            Estimate("error", -0.1, "-", -0.11, -0.09), Estimate("offset", 532.0, "s", 520.0, 544.0),
            Estimate("start", 30.5, "h", 30.0, 31.0),
            *(Estimate(f"starts[{i}]", 24.0 * i, "h", 24.0 * i - 1, 24.0 * i + 1) for i in range(40)),
        ),
    )  # fmt: skip
    said = page(tmp_path, "explained", effects=(effect,)).words
    assert "-10.0 %" in said and "8.9 min" in said and "2024-05-02 06:30" in said
    assert "and 31 more, in diagnosis.json" in said


def test_a_size_that_changes_is_one_row(tmp_path):
    sizes = tuple(
        Estimate(f"size[{i}]", 100.0 + 10 * i, "m3/s", 95.0 + 10 * i, 105.0 + 10 * i) for i in range(8)
    )
    effect = dataclasses.replace(DIURNAL, parameters=sizes)
    said = page(tmp_path, "explained", effects=(effect,)).words.replace("\u00a0", " ")
    assert said.count("100 m³/s (95 to 105); 110 m³/s (105 to 115)") == 1 and "size[" not in said
    assert "Diurnal inflow was missing: size from 100 to 170 m³/s" in said, said
    assert said.count("one after the other") == 1


def test_names_and_texts_are_text_and_never_markup(tmp_path):
    attack = '"><script>alert(1)</script><img src=x onerror=alert(1)>'
    effect = dataclasses.replace(
        BYPASS, name=attack, family=attack, tied_with=(attack,), runner_up=attack, breaker=attack,
        parameters=(Estimate(attack, 1.0, attack, 0.0, 2.0),), table={attack: attack},
        where=Where(dates=(dt.date(2024, 5, 2), dt.date(2024, 5, 3)), regime=attack),
    )  # fmt: skip
    answer = dataclasses.replace(
        diagnosis("cannot_tell", EVIDENCE), effects=(effect,), reason=attack, notes=(attack,),
        reach_response=attack, reach_parameters=(Estimate(attack, 1.0, attack, 0.0, 2.0),),
        unknown=Unknown(Where(regime=attack), 1.0, (attack,)), noise={attack: 1.0},
        gap=gap_of(EVIDENCE, (effect,)),
    )  # fmt: skip
    path = write_diagnosis(tmp_path, answer, EVIDENCE, reach=attack)
    seen = Page(path.read_text(encoding="utf-8"))
    assert "script" not in {tag for tag, _ in seen.tags}
    assert all(attrs["src"].startswith("data:") for tag, attrs in seen.tags if tag == "img")
    assert seen.words.count("<script>alert(1)</script>") >= 10


def test_numbers_that_are_not_there_are_dashes(tmp_path):
    nan = math.nan
    effect = dataclasses.replace(
        DIURNAL, p_value=nan, margin=nan, parameters=(Estimate("amplitude", nan, "m3/s", nan, nan),)
    )
    gap = dataclasses.replace(gap_of(EVIDENCE, (effect,)), rmse_baseline=(nan, 0.01, nan), closed=nan)
    said = page(tmp_path, "explained", effects=(effect,), gap=gap).words
    assert not re.search(r"\bnan\b", said.lower()) and "Without any effect – 10.0 –" in said


def test_an_effect_can_be_copied_as_a_table_of_a_scenario(tmp_path):
    import tomllib

    table = {
        "name": "x", "size": [1.0, 2.5], "dates": [dt.date(2024, 5, 1), dt.date(2024, 5, 9)], "per_day": 0.0,
        "words": 'a "quoted" one',
    }  # fmt: skip
    answer = diagnosis("explained", EVIDENCE, effects=(dataclasses.replace(DIURNAL, table=table),))
    html = write_page(tmp_path, answer, EVIDENCE, []).read_text(encoding="utf-8")
    (text,) = (part for part in Page(html).text if part.startswith("[[effects]]"))
    assert tomllib.loads(text)["effects"] == [table]


def test_a_picture_that_is_gone_is_said(tmp_path):
    gone = FigureFile("diagnosis_map", "", tmp_path / "figures" / "diagnosis_map.png", "t", "c", 1, 1)
    with pytest.raises(RividError, match="cannot read .*diagnosis_map.png: .*: run the diagnosis again"):
        write_page(tmp_path, diagnosis("no_gap", EVIDENCE), EVIDENCE, [gone])
