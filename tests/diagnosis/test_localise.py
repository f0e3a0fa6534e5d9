"""Test bins against plain loops, chance against its own error, and places against planted ones."""

import datetime as dt

import numpy as np
import pytest

from rivid.diagnosis.data import as_record
from rivid.diagnosis.localise import (
    Driver,
    Scores,
    drivers,
    influence,
    named,
    p_values,
    season,
    since_step,
    strongest,
)
from tests.diagnosis import sizes

DAYS, N, BLOCK = 60, 144, 3
DATES = [dt.date(2024, 5, 1) + dt.timedelta(days=i) for i in range(DAYS)]
BLOCKS = np.arange(DAYS) // BLOCK
CLOCK = np.tile(np.arange(N) / 6.0, (DAYS, 1))
HOUR = Driver("hour", 24, CLOCK.astype(np.int64), lambda a, b: f"hours {a} to {b + 1}", True)
WEEKDAY = named(
    "weekday", ("Mo", "Tu", "We", "Th", "Fr", "Sa", "Su"),
    np.repeat((np.arange(DAYS)[:, None] + 2) % 7, N, 1),
)  # fmt: skip
DATE = season(BLOCKS, N)
USED = np.ones((DAYS, N), bool)
USED[:, :9] = False
USED[17, 60:] = False


def scores(seed, added=0.0, blocks=BLOCKS):
    """Noise that the days of a block share, a level and a course over the day, and an added inflow."""
    rng = np.random.default_rng(seed)
    level = 0.5 * rng.standard_normal((DAYS, 1))[BLOCKS]
    course = 0.7 * rng.standard_normal((DAYS, 24))[BLOCKS][:, np.arange(N) // 6]
    noise = rng.standard_normal((DAYS, N)) + level + course
    return Scores(np.where(USED, noise + added, 0.0), USED, blocks)


def test_the_influence_of_a_block_is_what_its_removal_changes():
    rng = np.random.default_rng(1)
    J = 400
    Q = rng.uniform(0.5, 1.5, (J, 3))
    S = Q + 0.3 * rng.standard_normal((J, 3))
    psi = influence(S, Q)
    departure = S.sum(0) / Q.sum(0) - S.sum() / Q.sum()
    assert psi.sum(0) == pytest.approx(departure)
    for j in (0, 5):
        S2, Q2 = np.delete(S, j, 0), np.delete(Q, j, 0)
        change = departure - (S2.sum(0) / Q2.sum(0) - S2.sum() / Q2.sum())
        own = (S[j] - S.sum(0) / Q.sum(0) * Q[j]) / Q.sum(0)
        own -= (S[j].sum() - S.sum() / Q.sum() * Q[j].sum()) / Q.sum()
        assert change == pytest.approx(own, rel=0.02, abs=2e-5)
        assert psi[j] == pytest.approx(own, abs=2e-4)  # apart from small departures


@sizes("seasons", 40, 300)
def test_the_false_rate_is_that_of_p_under_noise_that_blocks_share(seasons):
    level = 0.05
    below, of_days = np.zeros(4), 0
    for seed in range(seasons):
        each, p = p_values(scores(seed), [HOUR, WEEKDAY, DATE], draws=99, seed=seed)
        below += [*(each <= level), p <= level]
        if seed < seasons / 3:
            of_days += p_values(scores(seed, blocks=np.arange(DAYS)), [HOUR], draws=99)[1] <= level
    assert np.abs(below / seasons - level).max() <= 3 * np.sqrt(level * (1 - level) / seasons)
    assert of_days > 0.05 * seasons  # flips of single days ignore the correlation


SURE = 0.6
"""Four standard errors of a size, by the scatter of blocks."""


@sizes("seasons", 3, 10)
def test_hours_and_dates_of_a_planted_inflow_are_found(seasons):
    days = (np.arange(DAYS) >= 12) & (np.arange(DAYS) < 45)
    right = 0
    for seed in range(seasons):
        there = np.isin(np.arange(N) // 6, range(9, 17))[None] & days[:, None]
        place = strongest(scores(seed, 3.0 * there), [HOUR, WEEKDAY], DATES)
        assert place is not None and place.where.startswith("hours")
        assert place.size == pytest.approx(3.0, abs=SURE)
        right += place.where == "hours 9 to 17" and place.windows == ((DATES[12], DATES[44]),)
    assert right >= 0.8 * seasons


NIGHT = np.isin(np.arange(N) // 6, (22, 23, 2, 3))[None] & np.ones((DAYS, 1), bool)
LATER = np.broadcast_to((np.arange(DAYS) >= 33)[:, None], (DAYS, N))


@pytest.mark.parametrize(
    ("there", "size", "by", "expected", "first"),
    [(NIGHT, -2.0, [HOUR], "hours 22 to 4", 0),
     (WEEKDAY.bin >= 5, 2.0, [HOUR, WEEKDAY], "weekday Sa to Su", 0),
     (LATER, 3.0, [HOUR, DATE], "", 33)],
    ids=["past midnight", "weekends", "dates"],
)  # fmt: skip
def test_a_flow_is_localised_by_what_it_depends_on(there, size, by, expected, first):
    place = strongest(scores(3, size * there), by, DATES)
    assert place.where == expected
    assert place.size == pytest.approx(size, abs=SURE)
    assert place.windows == ((DATES[first], DATES[-1]),)


def record(kind="pool"):
    rng = np.random.default_rng(7)
    seconds = np.arange(N) * 600.0
    flow = 300.0 + 50.0 * rng.integers(0, 5, (DAYS, 6))[:, np.arange(N) // 24]
    output = 10.0 + np.cumsum(rng.standard_normal((DAYS, N)), axis=1) * 0.01
    output[4, 20:30] = np.nan
    outflow = None if kind == "river" else flow[:, ::-1]
    return as_record(DATES, seconds, flow, outflow, output, sample_time=600.0, lead=33, kind=kind)


def label(driver, day, sample):
    b = driver.bin[day, sample]
    return driver.words(b, b)


def test_every_used_sample_of_a_record_is_in_the_bin_of_its_label():
    names = {d.name for d in drivers(record("river"), BLOCKS)}
    assert "discharge" in names and not any("outflow" in name for name in names)
    rec = record()
    by = {d.name: d for d in drivers(rec, BLOCKS)}
    assert set(by) == {
        "hour", "shift", "weekday", "date", "inflow", "rate of inflow", "outflow", "rate of outflow", "level",
        "rate of level", "hours since a step of the inflow", "hours since a step of the outflow",
    }  # fmt: skip
    k = rec.lead + 75  # 12:30
    assert (by["hour"].bin[:, k] == 12).all()
    assert label(by["shift"], 0, k) == "shift 5 to 13 h"
    names = [label(by["weekday"], day, k) for day in range(DAYS)]
    assert names == [f"weekday {date:%A}" for date in DATES]
    for name, values in (("inflow", rec.inflow), ("level", rec.output)):
        d = by[name]
        for b in range(d.count):
            low, high = map(float, d.words(b, b).split()[1:4:2])  # with four digits
            inside = values[rec.used & (d.bin == b)]
            assert low * 0.999 <= inside.min() and inside.max() <= high * 1.001
    counts = np.bincount(by["level"].bin[rec.used])
    assert counts.max() - counts.min() <= 0.02 * counts.sum()
    assert (by["level"].bin[np.isnan(rec.output)] == -1).all()


def test_hours_since_a_step_are_counted_from_it():
    flow = np.full((1, N), 100.0)
    flow[0, 30:] = 200.0
    flow[0, 31:] += 0.5  # too small to be a step
    d = since_step("since", flow, 600.0)
    assert (d.bin[0, :30] == -1).all()
    assert [label(d, 0, 30 + k) for k in (0, 2, 3, 6, 47, 48)] == [
        f"since {hours} h" for hours in ("0 to 0.5", "0 to 0.5", "0.5 to 1", "1 to 2", "4 to 8", "8 to 24")
    ]
    assert since_step("since", np.full((1, N), 100.0), 600.0) is None


def test_parts_of_the_season_are_whole_blocks():
    assert DATE.count == 2
    for part in range(DATE.count):
        days = np.flatnonzero(DATE.bin[:, 0] == part)
        assert len(days) == 30 and days[0] % BLOCK == 0
    assert season(BLOCKS[:24], N) is None
