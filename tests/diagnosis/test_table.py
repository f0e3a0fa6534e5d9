"""The lines for the terminal: what they say, and that they stay calm and narrow."""

import dataclasses
import math
from pathlib import Path

import pytest

from rivid.diagnosis.result import VERDICTS, ClosedLoop, Estimate, Unknown, Where
from rivid.report.diagnosis_text import LABELS, MAY_NOT_SAY, WIDTH, summary, sure_words
from tests.diagnosis.answers import BYPASS, DIURNAL, LOCKS, TIED, diagnosis, evidence_of, gap_of, record_of
from tests.diagnosis.loops import loop_of

EVIDENCE = evidence_of()
RIVER = evidence_of(record_of(kind="river"), amplitude=40.0)


@pytest.mark.parametrize("verdict", VERDICTS)
@pytest.mark.parametrize("evidence", [EVIDENCE, RIVER], ids=["pool", "river"])
def test_no_line_is_wider_than_80_columns(verdict, evidence):
    said = summary(diagnosis(verdict, evidence), Path("out/diagnosis.html"))
    assert max(len(line) for line in said.splitlines()) <= WIDTH
    assert said.isascii() and not said.endswith("\n")
    assert said.splitlines()[-1] == "Page       out/diagnosis.html"


def test_every_verdict_has_its_own_words():
    assert set(LABELS) == set(MAY_NOT_SAY) == set(VERDICTS)
    heads = {summary(diagnosis(verdict, EVIDENCE)).splitlines()[0] for verdict in VERDICTS}
    assert len(heads) == len(VERDICTS)


def words(verdict, evidence=EVIDENCE, **changes):
    return " ".join(summary(diagnosis(verdict, evidence, **changes)).split())


def test_one_effect_is_told_with_size_interval_and_error():
    said = words("explained")
    assert said.startswith("Diurnal inflow was missing: amplitude 6.04 m3/s (5.83 to 6.25).")
    assert "p = 0.0002" in said and "97 % of the gap is closed" in said
    for row in (
        "without any effect 9.3 27 62",
        "+ diurnal inflow 3.5 10.3 24",
        "weather and gauge alone 3.3",
    ):
        assert row in said


def test_several_effects_and_the_rest_are_told():
    said = words("partly_explained")
    assert said.startswith(
        "Two effects were missing: unlogged upstream release (35.0 m3/s) and unlogged downstream release "
        "(11.8 m3/s). More is missing, and has no name yet."
    )
    assert "from 2024-05-05 to 2024-05-12, from 22:00 to 06:00" in said
    assert "97 % of the gap is closed with events timed on the day; beforehand, 31 % of the gap" in said
    assert "Unknown about 1.3 m3/s, from 10:00 to 14:00, going with hour of the day and inflow" in said


def test_a_tie_names_all_and_says_what_would_tell():
    said = words("cannot_tell")
    assert said.startswith("Something is missing. It is leakage or gate head effect, and these data cannot")
    assert "tied with gate head effect" in said
    assert "To tell hold the level 20 cm higher for a day" in said


def test_something_unknown_has_size_dates_period_and_driver_and_no_name():
    said = words("unknown")
    assert said.startswith(
        "Something is missing: about 3.2 m3/s, from 2024-05-01 to 2024-05-10, with a period of 90 min, "
        "going with level. It is none of the effects known here."
    )
    assert "Effect" not in said


def test_what_did_not_hold_is_not_called_missing():
    said = words("did_not_hold")
    assert said.startswith("The fitted days show diurnal inflow")
    assert "The days kept apart do not confirm it." in said
    assert "was missing" not in said and "the gap has not become smaller" in said


def test_no_gap_claims_only_what_the_data_could_show():
    said = words("no_gap")
    assert said.startswith("Nothing is missing that these data could show.")
    assert "closed" not in said and "Effect" not in said


def test_a_verdict_without_what_it_speaks_of_still_has_its_sentence():
    for verdict, sentence in VERDICTS.items():
        bare = dataclasses.replace(diagnosis(verdict, EVIDENCE), effects=(), unknown=None, gap=None)
        assert " ".join(summary(bare).split()).startswith(sentence)


def test_numbers_that_are_not_there_are_dashes_and_never_nan():
    nan = math.nan
    effect = dataclasses.replace(
        DIURNAL, p_value=nan, margin=nan, parameters=(Estimate("amplitude", nan, "m3/s", nan, nan),)
    )
    gap = dataclasses.replace(gap_of(EVIDENCE, (effect,)), rmse_baseline=(0.01, nan, nan), closed=nan)
    said = words("explained", effects=(effect,), gap=gap, unknown=Unknown(Where(), nan, (), nan))
    assert "nan" not in said.lower()
    assert "without any effect 10.0 - -" in said


def test_the_closed_loop_is_told_in_a_line_or_the_reason_why_there_is_none():
    loop = loop_of(EVIDENCE.record)
    assert (
        "Loop 12 days: the level is off by, without and with the named effects, 49 to 32 mm, the outflow by "
        "6.1 to 3.5 m3/s"
    ) in words("explained", closed_loop=loop)
    assert "Loop 12 days: the level is off by 49 mm, the outflow by 6.1 m3/s" in words(
        "no_gap", closed_loop=loop
    )
    assert "Loop Nobody moves." in words("no_gap", closed_loop=ClosedLoop(None, "Nobody moves."))
    assert "Loop" not in words("no_gap")


def test_text_that_steers_a_terminal_is_shown_as_words():
    hostile = "\x1b[31mred\x1b[0m\nnew line\ttab\x07"
    effect = dataclasses.replace(TIED, name=hostile, breaker=hostile, tied_with=(hostile,))
    lines = summary(diagnosis("cannot_tell", EVIDENCE, effects=(effect,), reason=hostile)).splitlines()
    assert all(line.isprintable() for line in lines)
    assert max(map(len, lines)) <= WIDTH


def test_a_name_longer_than_a_line_is_broken_or_cut():
    effect = dataclasses.replace(DIURNAL, name="x" * 200)
    said = summary(diagnosis("explained", EVIDENCE, effects=(effect,), gap=gap_of(EVIDENCE, (effect,))))
    assert max(map(len, said.splitlines())) <= WIDTH


@pytest.mark.parametrize(
    ("effect", "parts"),
    [
        (DIURNAL, ["p = 0.0002", "next best name is leakage, which removes 71 % less"]),
        (LOCKS, ["no other name comes near"]),
        (TIED, ["p = 0.0031", "cannot tell it from gate head effect"]),
        (dataclasses.replace(BYPASS, p_value=0.0), ["p < 0.0001", "rain inflow, which removes 40 % less"]),
    ],
)
def test_how_sure_a_name_is_stands_in_one_sentence(effect, parts):
    said = sure_words(effect)
    assert all(part in said for part in parts) and said.count(".") - said.count("0.") == 1
    assert "next best" not in sure_words(TIED), "what is tied is not said twice"
