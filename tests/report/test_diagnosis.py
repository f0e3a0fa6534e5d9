"""Test the files and the terminal summary of a diagnosis: contents, escaping, missing numbers, same bytes."""

import base64
import dataclasses
import datetime as dt
import json
import math
import re
import tomllib

import numpy as np
import pyarrow.parquet as pq
import pytest

from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.result import VERDICTS, ClosedLoop, Estimate, Ranked, Step, Unknown, Where
from rivid.effects import effect_classes
from rivid.errors import RividError
from rivid.report.diagnosis import NOISE, WIDTH, headline, summary, write_diagnosis
from rivid.report.page import data_uri
from rivid.report.quantities import explanations
from tests.diagnosis.answers import BYPASS, DIURNAL, LOCKS, TIED, diagnosis, evidence_of, gap_of, record_of
from tests.diagnosis.loops import OPERATORS, REGIMES, loop_of, with_loop
from tests.pages import Page

EVIDENCE = evidence_of(gone=(13,))
RIVER = evidence_of(record_of(kind="river"), amplitude=40.0)
FIGURES = ["diagnosis_day.png", "diagnosis_gap.png", "diagnosis_inflow.png", "diagnosis_map.png"]
NAN = math.nan


def page(folder, verdict, evidence=EVIDENCE, classes=None, **changes):
    """Return the page of a verdict without figures."""
    answer = diagnosis(verdict, evidence, **changes)
    given = None if verdict == "insufficient_data" else evidence
    path = write_diagnosis(folder, answer, given, draw=False, reach="basse_isere", classes=classes)
    return Page(path.read_text(encoding="utf-8"))


def words(page):
    return page.words.replace("\u00a0", " ")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Return the folder of a written diagnosis with all its figures."""
    folder = tmp_path_factory.mktemp("out")
    answer = with_loop(diagnosis("partly_explained", EVIDENCE), EVIDENCE.record)
    write_diagnosis(folder, answer, EVIDENCE, reach="basse_isere")
    return folder


@pytest.fixture(scope="module")
def whole(out):
    html = (out / "diagnosis.html").read_text(encoding="utf-8")
    return html, Page(html)


def test_the_files_are_those_of_the_contract(out):
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnosis.html", "diagnosis.json", "figures", "unexplained_inflow.parquet"
    ]  # fmt: skip
    assert sorted(p.name for p in (out / "figures").iterdir()) == sorted([*FIGURES, "diagnosis_loop.png"])
    answer = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert answer["verdict"] == "partly_explained" and answer["gap"]["horizon_h"] == [1.0, 4.0, 24.0]
    assert [e["name"] for e in answer["effects"]] == [BYPASS.name, LOCKS.name]
    assert "shown" not in answer["closed_loop"]


def test_a_tie_beside_a_named_effect_is_one_more_that_is_missing(tmp_path):
    answer = diagnosis("partly_explained", EVIDENCE, effects=(DIURNAL, TIED), unknown=None)
    text = headline(answer)
    assert text.startswith("Diurnal inflow was missing: ") and "no name yet" not in text
    others = " or ".join(name.replace("_", " ") for name in TIED.tied_with)
    assert f"One more is missing. It is {TIED.name.replace('_', ' ')} or {others}; these data" in text
    alone = diagnosis("partly_explained", EVIDENCE, effects=(DIURNAL,), unknown=None)
    assert headline(alone).endswith("More is unexplained and has no name yet.")


@pytest.mark.parametrize(
    ("evidence", "unit", "size"), [(EVIDENCE, "m", "31 mm"), (RIVER, "m3/s", "0.031 m³/s")]
)
def test_sizes_of_a_level_are_in_the_unit_of_its_errors(tmp_path, evidence, unit, size):
    amplitude = Estimate("amplitude", 0.0307, "m or m3/s", 0.0281, 0.0407)
    tide = dataclasses.replace(DIURNAL, name="tide", parameters=(amplitude,))
    answer = diagnosis("explained", evidence, effects=(tide,))
    assert f"amplitude {size}".replace("³", "3") in summary(answer)
    assert f"amplitude {size}" in headline(answer)
    text = words(page(tmp_path, "explained", evidence, effects=(tide,), noise={"gauge_sd": 0.0036}))
    assert size in text and ("3.6 mm" in text) == (unit == "m")


def test_the_unexplained_inflow_has_a_row_per_used_sample(out):
    table = pq.read_table(out / "unexplained_inflow.parquet")
    record, kept = EVIDENCE.record, EVIDENCE.record.used
    assert len(table) == kept.sum() < kept.size
    midnight = np.datetime64(dt.datetime.combine(record.dates[0], dt.time()), "ms")
    seconds = (table["time"].to_numpy() - midnight) / np.timedelta64(1, "s")
    np.testing.assert_allclose(seconds, record.time[kept])
    columns = {name: table[name].to_numpy() for name in table.column_names[1:]}
    np.testing.assert_array_equal(columns["w_m3s"], EVIDENCE.inflow_after[kept])
    np.testing.assert_array_equal(columns["w_before_m3s"], EVIDENCE.inflow_before[kept])
    half = 1.959964 * EVIDENCE.inflow_after_sd[kept]
    np.testing.assert_allclose(columns["high"] - columns["w_m3s"], half)
    np.testing.assert_allclose(columns["w_before_m3s"] - columns["low_before"], half / 0.8)


def test_an_unknown_inflow_is_an_empty_cell(tmp_path):
    evidence = evidence_of()
    evidence.inflow_after[4, 60] = np.nan
    write_diagnosis(tmp_path, diagnosis("no_gap", evidence), evidence, draw=False)
    column = pq.read_table(tmp_path / "unexplained_inflow.parquet")["w_m3s"]
    assert evidence.record.used[4, 60] and column.null_count == 1


def test_the_page_is_one_file_without_requests_or_scripts(whole):
    html, seen = whole
    assert len(html.encode()) < 3_000_000
    assert not {"script", "link"} & {tag for tag, _ in seen.tags}
    for tag, attrs in seen.tags:
        assert not any(name.startswith("on") for name in attrs)
        for name in {"src", "href"} & set(attrs):
            assert attrs[name].startswith(("data:image/png;base64,", "#")), f"<{tag} {name}>"
    assert not re.search(r"url\(|@import|https?:", html)
    ids = {attrs["id"] for _, attrs in seen.tags if "id" in attrs}
    links = {attrs["href"][1:] for tag, attrs in seen.tags if tag == "a"}
    assert len(links) == 7 and links <= ids


def test_each_figure_is_embedded_once_with_its_caption(out, whole):
    shown = [attrs for tag, attrs in whole[1].tags if tag == "img"]
    inside = sorted(base64.b64decode(attrs["src"].split(",", 1)[1]) for attrs in shown)
    assert inside == sorted(p.read_bytes() for p in (out / "figures").iterdir())
    assert all(attrs["alt"].partition(". ")[2] in whole[1].words for attrs in shown)


@pytest.mark.parametrize("verdict", VERDICTS)
@pytest.mark.parametrize("evidence", [EVIDENCE, RIVER], ids=["pool", "river"])
def test_each_verdict_has_a_page_and_a_narrow_summary(verdict, evidence, tmp_path):
    answer = diagnosis(verdict, evidence)
    text = words(page(tmp_path, verdict, evidence))
    assert answer.reason in text and headline(answer) in text
    assert (
        "{{" not in text and "nan" not in text.lower().split() and "None" not in text.replace("None of", "")
    )
    lines = summary(answer).splitlines()
    assert max(map(len, lines)) <= WIDTH and all(line.isprintable() for line in lines)
    assert " ".join(lines).startswith(headline(answer).replace("m³", "m3")[:60])


def test_verdicts_have_headlines_of_their_own_and_need_no_details():
    assert len({headline(diagnosis(verdict, EVIDENCE)) for verdict in VERDICTS}) == len(VERDICTS)
    for verdict, sentence in VERDICTS.items():
        bare = dataclasses.replace(diagnosis(verdict, EVIDENCE), effects=(), unknown=None, gap=None)
        assert headline(bare) == sentence


def test_what_is_left_has_its_period_once_and_one_unit(tmp_path):
    drivers = ("4 pulses of about 40 m3/s that last 2 h", "a rhythm with a period of 8.02 h (to 0.02 h)")
    unknown = Unknown(Where(), 17.5, drivers, 28_872.0)
    text = words(page(tmp_path, "unknown", unknown=unknown, reason="", next_measurement=None))
    expected = f"about 17.5 m³/s, on all days, at all hours: {drivers[0]} and {drivers[1]}"
    assert text.count(expected.replace("m3/s", "m³/s")) == 2 and "m3/s" not in text


def test_a_river_has_units_of_discharge(tmp_path):
    text = words(page(tmp_path, "no_gap", RIVER))
    assert "16.3 m³/s" in text and "Error [m³/s]" in text and not re.search(r"\blevel\b|\bmm\b", text)


def test_the_card_of_an_effect_has_size_interval_time_and_certainty(whole):
    text, known = words(whole[1]), effect_classes()[BYPASS.name]
    for part in (
        known.sentence, known.looks, known.parameters()["size"].meaning, "35.0 m³/s (33.8 to 36.1)",
        "from 2024-05-05 to 2024-05-12, from 22:00 to 06:00", "Probability above 0.99", "143 events",
        "about 1.3 m³/s, from 10:00 to 14:00",
    ):  # fmt: skip
        assert part in text, part


def test_the_gap_has_a_row_per_step_and_regime(whole, tmp_path):
    text = words(whole[1])
    for row in (
        "Without any effect 9.3 (9.7) 27 (28) 62 (65)", "+ unlogged upstream release 3.5 10.3 24",
        "+ unlogged downstream release 1.3 (1.3) 3.9 (3.8) 9.0 (8.8)",
        "Squared error removed 98 % 98 % 98 %", "Events timed on the day 0.4 1.2 2.7",
        "Inflow below 153 m³/s 15.6 → 8.0 79 → 27 286 → 137", "Longer after a step 11.6 → 6.9 59 → 22 –",
        "97 % of the gap is closed", "31 % of the gap is closed",
    ):  # fmt: skip
        assert row in text, row
    gap = dataclasses.replace(gap_of(EVIDENCE), by_regime=REGIMES)
    text = words(page(tmp_path, "no_gap", gap=gap))
    assert "Inflow below 153 m³/s 15.6 79 286" in text and "→" not in text


def test_a_step_that_increases_an_error_is_reported(tmp_path):
    gap = dataclasses.replace(gap_of(EVIDENCE), steps=(Step("leakage", (0.005, 0.0272, 0.07)),))
    text = words(page(tmp_path, "explained", gap=gap))
    assert "Adding leakage increases the error 24 h ahead." in text and text.count("increases the error") == 1


def test_the_closed_loop_has_its_errors_and_operators(whole, tmp_path):
    text = words(whole[1])
    assert "Measured 56 Without any effect 144 49 6.1 40 With the named effects 65 32 3.5 45" in text
    for part in (
        "95 % of a change",
        "131 m³/s",
        "12 mm",
        "130.01 m",
        "3.93 h",
        "17.7 min",
        "4 m³/s",
        "98.7 %",
    ):
        assert part in text, part
    slow = dataclasses.replace(
        OPERATORS, level_gain=0.0, trim_time_s=None, notice=None, lag_s=532.0, r2_inflow=-0.1
    )
    loop = dataclasses.replace(loop_of(EVIDENCE.record), operators=slow)
    text = words(page(tmp_path, "no_gap", closed_loop=loop))
    assert "8.87 min" in text and "no response to the level" in text and "the inflow alone 0.0 %" in text
    assert "Simulated 144 49 6.1 40" in text
    text = words(page(tmp_path, "no_gap", closed_loop=ClosedLoop(OPERATORS, "The outflow hardly moves.")))
    assert "The outflow hardly moves." in text and "root mean square errors over" not in text.lower()


def bars(seen):
    """Return the widths of the bars of a ranking, in per cent."""
    return [float(attrs["width"]) for tag, attrs in seen.tags if attrs.get("class") == "part"]


def test_the_ranking_has_a_bar_as_long_as_each_probability(tmp_path):
    seen = page(tmp_path, "cannot_tell")
    answer = diagnosis("cannot_tell", EVIDENCE)
    assert bars(seen) == pytest.approx([100 * one.probability for one in answer.ranking], rel=1e-3)
    for row in ("Leakage 0.51 Gate head effect 0.46", "Lateral inflow too small to matter below 0.01"):
        assert row in words(seen), row
    assert bars(page(tmp_path, "cannot_tell", ranking=())) == []


def test_what_to_measure_what_is_small_and_the_notes_are_on_the_page_and_the_terminal(tmp_path):
    left_out = ("2 of 31 days were left out: at their flows the configured reach would be dry",)
    for verdict in ("cannot_tell", "explained", "insufficient_data"):
        answer = diagnosis(verdict, EVIDENCE, notes=left_out)
        shown = words(page(tmp_path, verdict, notes=left_out)), summary(answer).replace("m3", "m³")
        for text in (" ".join(one.split()) for one in shown):
            assert all(part in text for part in (*answer.small, answer.next_measurement or "", *left_out))


def test_the_terminal_has_verdict_probability_size_and_share_removed():
    text = " ".join(summary(diagnosis("explained", EVIDENCE)).split())
    for part in (
        "Verdict explained", "Effect diurnal inflow, probability above 0.99, amplitude 6.04 m3/s",
        "Ranking diurnal inflow 0.98 ", "squared error removed 86 % 86 % 86 %",
    ):  # fmt: skip
        assert part in text, part
    old = dataclasses.replace(DIURNAL, probability=None)
    text = summary(diagnosis("explained", EVIDENCE, effects=(old,), ranking=()))
    assert "Ranking" not in text and "p = 0.0002" in text


def test_each_parameter_of_the_noise_has_a_name_in_words():
    assert {field.name for field in dataclasses.fields(NoiseModel)} <= set(NOISE)


@pytest.mark.parametrize(("unknown", "words"), [(0.6, "none of the effects"), (0.1, "probable enough")])
def test_only_a_probable_unknown_cause_is_none_of_the_effects_in_the_catalogue(unknown, words):
    """Regression: four tied effects with 0.92 together were "none of the effects in the catalogue"."""
    ranking = (
        Ranked(("lateral_inflow",), None, "saint-venant", 0.9 - unknown, 20.0, True),
        Ranked((), "flow", "saint-venant", unknown, 2.0, True),
    )
    found = Unknown(Where(), 1.4, ("an unlogged flow of 1.4 m3/s",), 9.0)
    answer = diagnosis("unknown", effects=(), unknown=found, ranking=ranking)
    assert headline(answer).endswith("of the catalogue is probable enough to be named.") == (unknown < 0.5)
    assert words in headline(answer) and "\n" not in headline(answer)


def test_of_many_explanations_the_likeliest_and_nothing_and_unknown_remain():
    def one(names, unknown, probability):
        return Ranked(names, unknown, "saint-venant", probability, 0.0, True)

    named = [one((f"effect_{i}",), None, 0.1 / 2**i) for i in range(6)]
    ranking = [*named, one(("leakage", "seiche"), None, 0.6), one((), "flow", 0.0), one((), None, 0.0)]
    rows, left, rest = explanations(ranking, "explained")
    assert [row.probability for row in rows] == pytest.approx([0.6, 0.1, 0.05, 0.025, 0.0, 0.0])
    assert [row.kind for row in rows] == ["named"] * 4 + ["unknown", "nothing"]
    assert left == 3 and rest == pytest.approx(0.1 / 8 + 0.1 / 16 + 0.1 / 32)
    assert explanations((), "explained") == ([], 0, 0)
    rest = {verdict: explanations(ranking, verdict)[0][-1].words for verdict in ("no_gap", "unknown")}
    assert rest == {"no_gap": "nothing missing", "unknown": "no known effect"}


def test_ties_name_all_candidates_and_the_separating_measurement(tmp_path):
    text = words(page(tmp_path, "cannot_tell"))
    assert "leakage or gate head effect" in text and TIED.breaker in text
    assert "next best" not in text


def test_effects_of_users_need_no_description(tmp_path):
    effect = dataclasses.replace(DIURNAL, name="hunting_of_a_turbine", table={})
    text = words(page(tmp_path, "explained", effects=(effect,), gap=gap_of(EVIDENCE, (effect,))))
    assert "hunting of a turbine" in text and "family “flow”" in text

    class Own:
        sentence, looks = "A turbine hunts for its speed.", "The level swings in eight minutes."
        parameters = staticmethod(dict)

    text = words(page(tmp_path, "explained", classes={"hunting_of_a_turbine": Own}, effects=(effect,)))
    assert Own.sentence in text and Own.looks in text


def test_values_have_a_second_form_and_series_are_one_row(tmp_path):
    starts = tuple(Estimate(f"starts[{i}]", 24.0 * i, "h", 24.0 * i - 1, 24.0 * i + 1) for i in range(40))
    effect = dataclasses.replace(
        LOCKS,
        parameters=(
            Estimate("error", -0.1, "-", -0.11, -0.09), Estimate("offset", 532.0, "s", 520.0, 544.0),
            Estimate("start", 30.5, "h", 30.0, 31.0), *starts,
        ),
    )  # fmt: skip
    text = words(page(tmp_path, "explained", effects=(effect,)))
    assert all(part in text for part in ("-10.0 %", "8.9 min", "2024-05-02 06:30", "and 31 more"))
    sizes = tuple(
        Estimate(f"size[{i}]", 100.0 + 10 * i, "m3/s", 95.0 + 10 * i, 105.0 + 10 * i) for i in range(8)
    )
    text = words(page(tmp_path, "explained", effects=(dataclasses.replace(DIURNAL, parameters=sizes),)))
    assert "size from 100 to 170 m³/s" in text and "size[" not in text
    assert text.count("100 m³/s (95 to 105); 110 m³/s (105 to 115)") == 1


def test_missing_numbers_are_dashes(tmp_path):
    effect = dataclasses.replace(
        DIURNAL, p_value=NAN, margin=NAN, parameters=(Estimate("amplitude", NAN, "m3/s", NAN, NAN),)
    )
    gap = dataclasses.replace(
        gap_of(EVIDENCE, (effect,)), rmse_baseline=(NAN, 0.01, NAN), closed=NAN, rmse_open_baseline=None
    )
    text = words(page(tmp_path, "explained", effects=(effect,), gap=gap))
    assert not re.search(r"\bnan\b", text.lower()) and "Without any effect – 10.0 –" in text
    answer = diagnosis("explained", effects=(effect,), gap=gap, unknown=Unknown(Where(), NAN, (), NAN))
    assert "nan" not in summary(answer).lower() and re.search(
        r"without any effect +- +10\.0 +-\n", summary(answer)
    )


def test_a_text_is_escaped_once(tmp_path):
    sure = dataclasses.replace(BYPASS, p_value=1e-6, probability=None)
    got = page(tmp_path, "explained", effects=(sure,))
    assert "p < 0.0001; the next best name is rain inflow, which removes 40 % less" in words(got)


def test_names_and_texts_are_escaped(tmp_path):
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
        gap=gap_of(EVIDENCE, (effect,)), small=(attack,), next_measurement=attack,
        ranking=(Ranked((attack,), "flow", attack, 1.0, 0.0, True),),
    )  # fmt: skip
    path = write_diagnosis(tmp_path, answer, EVIDENCE, reach=attack)
    seen = Page(path.read_text(encoding="utf-8"))
    assert "script" not in {tag for tag, _ in seen.tags}
    assert all(attrs["src"].startswith("data:") for tag, attrs in seen.tags if tag == "img")
    assert seen.words.count("<script>alert(1)</script>") >= 13


def test_the_summary_escapes_control_characters_and_cuts_long_names():
    hostile = "\x1b[31mred\x1b[0m\nnew line\ttab\x07 & <b>"
    effect = dataclasses.replace(TIED, name=hostile, breaker=hostile, tied_with=(hostile,))
    text = summary(
        diagnosis(
            "cannot_tell",
            EVIDENCE,
            effects=(effect,),
            reason=hostile,
            small=(hostile,),
            notes=(hostile,),
            next_measurement=hostile,
            ranking=(Ranked((hostile,), None, hostile, 1.0, 0.0, True),),
        )
    )
    assert all(line.isprintable() and len(line) <= WIDTH for line in text.splitlines()) and "& <b>" in text
    effect = dataclasses.replace(DIURNAL, name="x" * 200)
    text = summary(diagnosis("explained", EVIDENCE, effects=(effect,), gap=gap_of(EVIDENCE, (effect,))))
    assert max(map(len, text.splitlines())) <= WIDTH


def test_an_effect_is_shown_as_a_table_of_a_scenario(tmp_path):
    dates = [dt.date(2024, 5, 1), dt.date(2024, 5, 9)]
    table = {"name": "x", "size": [1.0, 2.5], "dates": dates, "per_day": 0.0, "words": 'a "quoted" one'}
    seen = page(tmp_path, "explained", effects=(dataclasses.replace(DIURNAL, table=table),))
    (text,) = (part for part in seen.text if part.startswith("[[effects]]"))
    assert tomllib.loads(text)["effects"] == [table]


def test_equal_results_give_equal_bytes(tmp_path):
    for name in ("a", "b"):
        write_diagnosis(tmp_path / name, diagnosis("unknown", RIVER), RIVER, reach="r", draw=False)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) == 3
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)


def test_figures_of_an_earlier_diagnosis_are_removed_and_other_files_remain(tmp_path):
    (tmp_path / "figures").mkdir()
    for name in (*FIGURES, "tdr_jmap.png"):
        (tmp_path / "figures" / name).write_bytes(b"a picture")
    path = write_diagnosis(tmp_path, diagnosis("insufficient_data"), None, draw=False)
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["tdr_jmap.png"]
    assert "<img" not in path.read_text(encoding="utf-8")
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == "insufficient_data"
    assert len(pq.read_table(tmp_path / "unexplained_inflow.parquet")) == 0


def test_files_that_cannot_be_read_or_written_are_errors(tmp_path):
    with pytest.raises(RividError, match="cannot read .*diagnosis_map.png"):
        data_uri(tmp_path / "figures" / "diagnosis_map.png")
    (tmp_path / "diagnosis.html").mkdir()
    with pytest.raises(RividError, match="cannot write .*diagnosis.html") as error:
        write_diagnosis(tmp_path, diagnosis("no_gap", EVIDENCE), EVIDENCE, draw=False)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.rglob("*.part")) and not (tmp_path / "diagnosis.json").exists()
