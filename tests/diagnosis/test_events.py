"""Test events against slow searches, planted truth, and days of noise."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from rivid.diagnosis import events
from rivid.diagnosis.events import (
    Event,
    Form,
    Kind,
    Rows,
    at_lags,
    extended,
    find_events,
    size_variation,
    timetable,
)
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.pursuit import receding
from tests.diagnosis import sizes

T, N, A = 133.0, 400, 2e6
NOISE = NoiseModel(
    gauge_sd=0.004, walk_sd=0.0003, inflow_sd=1.5, inflow_memory=21600.0, level_sd=0.0, level_memory=3600.0,
    sample_time=T, surface_area=A,
)  # fmt: skip
RIVER = NoiseModel(
    gauge_sd=1.0, walk_sd=0.0, inflow_sd=0.0, inflow_memory=3600.0, level_sd=3.0, level_memory=7200.0,
    sample_time=T, surface_area=None,
)  # fmt: skip
HERE = np.arange(N) * T / A
FAR = np.convolve(np.clip(np.arange(N) - 12.0, 0, None) * T / A, np.full(6, 1 / 6))[:N]
ARRIVAL = 1.0 - np.exp(-np.clip(np.arange(N) - 10.0, 0, None) / 8.0)
LOCK = Kind("lock", "pulse", -1, HERE)
RELEASE = Kind("release", "pulse", 1, FAR)
RAIN = Kind("rain", "recession", 1, FAR)


def response(kernel, shape, samples, length, rise=0):
    """The response (length,) to a unit pulse or recession that starts at 0."""
    h = extended(kernel, length)
    if shape == "pulse":
        return h - at_lags(h, np.arange(length, dtype=float) - samples)
    return receding(h[::-1, None].copy(), samples, rise)[::-1, 0]


def lasting(found):
    return np.median([e.duration_s for e in found.events])


def planted(seed, days, kind, samples, starts, size, noise=NOISE, n=N, rise=0):
    """Return noise with events at starts(rng) of each row, and the events: (day, start, size)."""
    rng = np.random.default_rng(seed)
    z, truth = noise.simulate(days, n, rng), []
    shape = response(kind.kernel, kind.shape, samples, 3 * n, rise)
    for d in range(days):
        for k in starts(rng):
            truth.append((d, int(k), kind.sign * size))
            lag = np.arange(n) - k
            z[d] += kind.sign * size * np.where(lag >= 0, shape[np.maximum(lag, 0)], 0.0)
    return z, truth


def starts_of(found):
    return [(e.day, round(e.start_s / T)) for e in found.events]


def mean_flow(shape, samples, rise, n):
    """Return the sample means of a flow that begins at 0, from its values at many times."""
    t = (np.arange(400 * n) + 0.5) / 400
    if shape == "pulse":
        flow = (t < samples) * 1.0
    else:
        flow = np.where(t < rise, t / max(rise, 1), np.exp(-(t - rise) / samples))
    return flow.reshape(n, 400).mean(axis=1)


@pytest.mark.parametrize("shape, rise", [("pulse", 0), ("recession", 0), ("recession", 1), ("recession", 5)])
@pytest.mark.parametrize("noise", [NOISE, RIVER])
def test_an_atom_is_the_whitened_response_of_its_flow(shape, rise, noise):
    n, kernel = 60, FAR[:40] if noise is NOISE else ARRIVAL[:40]
    there = np.ones(n, bool)
    there[:5] = there[22:31] = False
    like = np.where(there, 0.0, np.nan)[None]
    kind = Kind("x", shape, 1, kernel, (7.25 * T, 18.0 * T))
    rows = Rows(like, noise.whiten, kind, T, 0, None)
    h = extended(kernel, 3 * n)
    for samples in (7.25, 18.0):
        steps, unit = rows.atoms(rows.pattern(there), Form((samples,), rise))
        for start in (-int(samples) + 1, -2, 0, 11, 25, 40):
            flow = mean_flow(shape, samples, rise, 2 * n)  # from `start` on
            after = np.arange(n) - start
            rise_of = np.diff(h, prepend=0.0)
            slow = np.array([sum(flow[i] * rise_of[t - i] for i in range(t + 1)) for t in after])
            expected = noise.whiten(slow[None, None], like)[0, 0]
            s = start + steps.before
            found = steps.W[s].copy()
            if shape == "pulse":
                end = int(samples) + s
                share = samples % 1.0
                found -= (1.0 - share) * steps.W[end] + share * steps.W[end + 1]
            assert found == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())
            norm = np.linalg.norm(found)
            assert unit[0, s] in (0.0, pytest.approx(1.0 / max(norm, 1e-300)))
            fine = response(kernel, shape, samples, 2 * n, rise)
            wanted = np.where(after >= 0, fine[np.maximum(after, 0)], 0.0)
            np.testing.assert_allclose(slow, wanted, atol=2e-4 * np.abs(slow).max())


@sizes("seeds", 3, 12)
def test_pursuit_finds_what_a_search_over_all_pairs_finds(seeds, monkeypatch):
    n, samples, agree = 70, 8, 0
    kind = Kind("lock", "pulse", -1, HERE[:n], (samples * T,))
    for seed in range(seeds):
        z, _ = planted(
            seed, 1, LOCK, samples, lambda rng: (rng.integers(8, 28), rng.integers(38, 56)), 60.0, n=n
        )
        monkeypatch.setattr(events, "MOST", 2)
        rows = Rows(z, NOISE.whiten, kind, T, 0, None)
        (found,) = rows.search([Form((float(samples),))], [0])
        steps, unit = rows.atoms(rows.pattern(np.ones(n, bool)), found.form)
        A = steps.W - np.concatenate([steps.W[samples:], np.zeros((samples, n))])
        best, r = (0.0, ()), rows.white[0]
        for pair in combinations(np.flatnonzero(unit[0]), 2):
            if pair[1] - pair[0] >= samples / 2:
                X = A[list(pair)]
                size, *_ = np.linalg.lstsq(X.T, r, rcond=None)
                worth = 0.5 * (r @ r - np.sum((r - size @ X) ** 2))
                if (size < 0).all() and worth > best[0]:
                    best = (worth, pair, size)
        assert found.gain <= best[0] - 24.0 + 1e-6
        starts = [round(e[1]) + steps.before for e in found.events]
        if sorted(starts) == list(best[1]):
            agree += 1
            assert found.gain == pytest.approx(best[0] - 24.0)
            assert sorted(e[3] for e in found.events) == pytest.approx(sorted(best[2]))
            X = A[starts]
            assert [e[4] for e in found.events] == pytest.approx(np.diag(np.linalg.inv(X @ X.T)))
    assert agree >= 0.9 * seeds


@sizes("days", 20, 60)
@pytest.mark.parametrize("kind", [LOCK, RELEASE, RAIN], ids=lambda kind: kind.name)
def test_days_of_noise_have_no_events(kind, days):
    found = find_events(
        NOISE.simulate(days, N, np.random.default_rng(1)), NOISE.whiten, kind, T, refine=False
    )
    assert len({e.day for e in found.events}) < 0.05 * days
    assert found.gain >= 0.0 and (found.coded == 0.0).all() == (not found.events)


def two_locks(rng):
    return rng.permutation(np.arange(30, 350, 45))[:2] + rng.integers(-8, 9)


IN_A_RIVER = Kind("river", "pulse", 1, ARRIVAL)
PLANTED = [
    (NOISE, LOCK, 1800.0 / T, 60.0, 1800.0, two_locks),
    (NOISE, RELEASE, 7200.0 / T, 45.0, 7200.0, lambda rng: rng.integers(20, 280, 1)),
    (NOISE, RAIN, 9 * 3600 / T, 60.0, 32400.0, lambda rng: rng.integers(15, 200, 1)),
    (RIVER, IN_A_RIVER, 7200.0 / T, 20.0, 7200.0, lambda rng: rng.integers(20, 300, 1)),
]


@sizes("seasons", 1, 3)
@pytest.mark.parametrize(
    "noise, kind, samples, size, duration, starts", PLANTED, ids=["lock", "release", "rain", "river"]
)
def test_planted_events_are_found_with_time_and_size(noise, kind, samples, size, duration, starts, seasons):
    near, deviation, many = [], [], 0
    for seed in range(seasons):
        z, truth = planted(seed, 12, kind, samples, starts, size, noise)
        found = find_events(z, noise.whiten, kind, T, refine=False)
        assert lasting(found) == duration
        many += len(found.events) - len(truth)
        for d, k, a in truth:
            e = min((e for e in found.events if e.day == d), key=lambda e: abs(e.start_s / T - k))
            near.append(abs(round(e.start_s / T) - k) <= 1)
            deviation.append((e.size - a) / e.size_se)
    assert many == 0
    assert np.mean(near) >= 0.9
    inside = np.mean(np.abs(deviation) <= 2.0)
    assert inside >= 0.954 - 3 * np.sqrt(0.046 * 0.954 / len(deviation))
    assert abs(np.mean(deviation)) < 4 / np.sqrt(len(deviation))


def locks(seed, days, per_day, duration, size=30.0, noise=0.002, area=1e6, form=None):
    """Return rows of n samples with pulses of one duration [s] at random times, and the start times [s]."""
    rng = np.random.default_rng([seed, 8])
    lead, n = 40, 690
    row, gauge = n - lead, replace(NOISE, gauge_sd=noise, walk_sd=1e-5, surface_area=area)
    time = T * np.arange(days * row + lead + 1)
    starts = np.sort(rng.uniform(0.0, time[-1], rng.poisson(per_day * time[-1] / 86400.0)))
    lasts = rng.choice(duration, len(starts))
    passed = sum(np.clip(time - s, 0.0, last) for s, last in zip(starts, lasts, strict=True))
    z = gauge.simulate(1, len(time), rng)[0] - size * passed / area
    rows = np.stack([z[d * row : d * row + n] for d in range(days)])
    rows[:, :lead] = np.nan
    kind = Kind("lock", "pulse", -1, np.arange(n) * T / area)
    found = find_events(rows, gauge.whiten, kind, T, lead=lead, follows=np.arange(days) > 0)
    if form:
        held = Rows(rows, gauge.whiten, kind, T, lead, np.arange(days) > 0)
        found = held.as_events(held.search([form], range(days), timed=2)[0])
    at = np.array([e.day * row * T + e.start_s + lead * T for e in found.events])
    return found, at, starts


@sizes("seeds", 2, 8)
@pytest.mark.parametrize("duration", [400.0, 1500.0, 5000.0])
def test_durations_are_refined_beyond_the_grid(duration, seeds):
    """Locks at random times may overlap; 30 m3/s lower the pool by 6 cm in 25 min."""
    for seed in range(seeds):
        days, per_day = 12, 7.0 if duration < 5000.0 else 3.0
        found, at, starts = locks(seed, days, per_day, [duration])
        known, *_ = locks(seed, days, per_day, [duration], form=Form((duration / T,)))
        assert found.gain - known.gain < 8.0  # four standard errors
        # One of 400 s, three samples, has a standard error of 6 %.
        assert lasting(found) == pytest.approx(duration, rel=0.06 if duration > 400.0 else 0.24)
        off = np.abs(at - starts[:, None]).min(axis=1)
        assert np.mean(off < 300.0) > 0.88 and np.median(off) < 0.5 * T
        assert len(found.events) == pytest.approx(len(starts), rel=0.15)
        volumes = [e.size * e.duration_s for e in found.events]
        assert np.median(volumes) == pytest.approx(-30.0 * duration, rel=0.1)


@sizes("seeds", 1, 3)
def test_pulses_have_two_durations_or_one_each_where_they_need_them(seeds):
    for seed in range(seeds):
        found, at, starts = locks(seed, 20, 3.0, [1200.0, 6000.0])
        off = np.abs(at - starts[:, None]).min(axis=1)
        assert np.mean(off < 300.0) > 0.9 and len(found.events) == pytest.approx(len(starts), rel=0.1)
        lasts = np.array([e.duration_s for e in found.events])
        near = [np.abs(lasts / of - 1.0) < 0.15 for of in (1200.0, 6000.0)]
        assert np.mean(near[0] | near[1]) > 0.6 and min(near[0].mean(), near[1].mean()) > 0.2
        assert found.price >= events.PRICE + np.log(2.0)  # each has one of two durations, or more


@sizes("seeds", 1, 4)
@pytest.mark.parametrize("rise, recession", [(0.5, 6.0), (2.0, 14.0)])
def test_recession_and_rise_of_rain_are_refined(rise, recession, seeds):
    for seed in range(seeds):
        z, truth = planted(
            seed, 12, RAIN, recession * 3600.0 / T, lambda rng: rng.integers(15, 200, 1), 60.0,
            rise=round(rise * 3600.0 / T),
        )  # fmt: skip
        found = find_events(z, NOISE.whiten, RAIN, T)
        assert len(found.events) == 12
        assert found.rise_s == pytest.approx(3600.0 * rise, abs=T)
        assert lasting(found) == pytest.approx(3600.0 * recession, rel=0.1)
        assert np.mean([e.size for e in found.events]) == pytest.approx(60.0, rel=0.05)
        assert (
            np.median([abs(e.start_s / T - k) for e, (_, k, _) in zip(found.events, truth, strict=True)])
            < 2.0
        )


def test_missing_samples_cost_precision_and_nothing_else():
    z, truth = planted(4, 10, LOCK, 27, lambda rng: rng.integers(60, 300, 1), 60.0)
    z[:, :20] = np.nan
    for d in range(10):
        z[d, 40 + 30 * d : 52 + 30 * d] = np.nan
    z[9] = np.nan
    found = find_events(z, NOISE.whiten, LOCK, T, refine=False)
    by_day = {day: e for day, e in zip((e.day for e in found.events), found.events, strict=True)}
    assert len(found.events) == 9 and sorted(by_day) == list(range(9))
    for d, k, a in truth[:9]:
        assert abs(by_day[d].start_s / T - k) <= 12  # within the gap, if the event begins there
        assert abs(by_day[d].size - a) < 4 * by_day[d].size_se
    assert (found.coded[9] == 0.0).all()


def rows_of(z, lead):
    """Return a long series as rows, each with the end of the day before as an unused lead."""
    row = N - lead
    days = (len(z) - lead) // row
    rows = np.stack([z[d * row : d * row + N] for d in range(days)])
    rows = rows - rows[:, lead : lead + 1]
    rows[:, :lead] = np.nan
    return rows


@sizes("seeds", 1, 4)
def test_rain_over_midnight_is_one_event_and_leaves_nothing_behind(seeds):
    lead, samples = 40, 9 * 3600 / T
    once, deviation = 0, []
    for seed in range(seeds):
        z = NOISE.simulate(1, 1500, np.random.default_rng(seed))[0]
        z[300:] += 60.0 * response(FAR, "recession", samples, 1200)
        rows = rows_of(z, lead)
        found = find_events(
            rows, NOISE.whiten, RAIN, T, lead=lead, follows=np.arange(len(rows)) > 0, refine=False
        )
        once += len(found.events) == 1 and abs(starts_of(found)[0][1] - (300 - lead)) <= 2
        deviation.append((found.events[0].size - 60.0) / found.events[0].size_se)
        white = NOISE.whiten((rows - found.coded)[None], rows)[0]
        assert np.mean(white[np.isfinite(rows)] ** 2) == pytest.approx(1.0, abs=0.15)
        alone = find_events(rows, NOISE.whiten, RAIN, T, lead=lead, refine=False)
        assert len(alone.events) >= 2  # each day has its own events, without the carry-over
    assert once >= 0.75 * seeds
    assert np.sqrt(np.mean(np.square(deviation))) < 1.8


@sizes("seeds", 16, 64)
def test_a_release_at_midnight_puts_nothing_into_the_day_before(seeds):
    lead = 40
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        z = NOISE.simulate(1, 1500, rng)[0]
        for midnight in (lead + (N - lead) * np.arange(1, 4)).tolist():
            at = midnight + int(rng.integers(-4, 3))
            z[at:] -= 20.0 * response(HERE, "pulse", 10.0, 1500)[: 1500 - at]
        rows = rows_of(z, lead)
        found = find_events(rows, NOISE.whiten, LOCK, T, lead=lead, follows=np.arange(len(rows)) > 0)
        seen = np.isfinite(rows).sum(axis=1)
        before = (NOISE.whiten(rows[None], rows)[0] ** 2).sum(axis=1)
        after = (NOISE.whiten((rows - found.coded)[None], rows)[0] ** 2).sum(axis=1)
        assert (after <= before + 9.0).all()  # coded before midnight, a release fits both days or is none
        assert (after < seen + 5.0 * np.sqrt(2.0 * seen)).all()


def test_rain_that_began_before_the_first_row_is_under_way():
    z = NOISE.simulate(4, N, np.random.default_rng(6))
    shape = response(FAR, "recession", 6 * 3600 / T, 2 * N)
    z += 80.0 * (shape[60 : 60 + N] - shape[60])
    found = find_events(z, NOISE.whiten, RAIN, T, refine=False)
    assert len(found.events) == 4
    assert all(e.under_way and e.start_s < 0 for e in found.events)


def test_rain_is_not_a_release_and_down_is_not_up():
    up_here, down_far = Kind("in", "pulse", 1, HERE), Kind("loss", "pulse", -1, FAR)
    z, _ = planted(0, 4, RAIN, 6 * 3600 / T, lambda rng: rng.integers(30, 200, 1), 50.0)
    gains = [find_events(z, NOISE.whiten, kind, T, refine=False).gain for kind in (RAIN, RELEASE, down_far)]
    assert gains[0] > max(gains[1:]) + 20.0
    z, _ = planted(0, 4, LOCK, 14, lambda rng: rng.integers(30, 360, 1), 40.0)
    gains = [find_events(z, NOISE.whiten, kind, T, refine=False).gain for kind in (LOCK, up_here, RAIN)]
    assert gains[0] > max(gains[1:]) + 20.0


def test_close_events_are_separated_and_timed_from_midnight():
    z, _ = planted(3, 6, LOCK, 14, lambda rng: (100, 121, 142), 60.0)
    found = find_events(z, NOISE.whiten, LOCK, T, lead=43, refine=False)
    assert lasting(found) == 1800.0 and len(found.events) == 18
    for d in range(6):
        starts = [k for day, k in starts_of(found) if day == d]
        assert (np.diff(starts) >= 14).all()
        assert starts == pytest.approx([57, 78, 99], abs=1)


def events_at(hours, days, size=20.0, se=1.0):
    return [Event(d, h * 3600.0, 1800.0, size, se, False) for d, h in zip(days, hours, strict=True)]


def test_starts_at_fixed_hours_are_a_timetable():
    rng = np.random.default_rng(0)
    days = np.repeat(np.arange(20), 2)
    hours = (np.tile([7.9, 23.95], 20) + rng.normal(0.0, 0.1, 40)) % 24.0
    assert timetable(events_at(hours, days)) == (0.001, 1.0)


@sizes("seasons", 20, 200)
def test_storms_of_the_afternoon_are_no_timetable(seasons):
    p = []
    for seed in range(seasons):
        hours = np.random.default_rng(seed).normal(16.5, 1.5, 13) % 24.0
        p.append(timetable(events_at(hours, np.arange(13)), seed=seed)[0])
    assert np.mean(np.array(p) <= 0.002) <= 0.05


@sizes("seasons", 50, 200)
def test_starts_at_random_are_a_timetable_no_more_often_than_the_level(seasons):
    level = 0.05
    p = []
    for seed in range(seasons):
        hours = np.random.default_rng(seed).uniform(0.0, 24.0, 25)
        p.append(timetable(events_at(hours, np.arange(25)), draws=199, seed=seed)[0])
    # There are few pairs, hence ties: p is conservative.
    assert np.mean(np.array(p) <= level) <= level + 3 * np.sqrt(level * (1 - level) / seasons)
    assert np.mean(np.array(p) <= 0.5) > 0.35


def test_events_of_one_day_or_under_way_make_no_timetable():
    one_day = events_at([7.0, 7.1, 7.2], [0, 0, 0])
    assert timetable(one_day)[0] == 1.0
    late = [Event(d, -3600.0, 1800.0, 20.0, 1.0, True) for d in range(9)]
    assert timetable(late)[0] == timetable([])[0] == 1.0


def test_sizes_are_as_different_as_they_are_beyond_their_errors():
    rng = np.random.default_rng(1)
    alike = [events_at([8.0], [d], 20.0 + 4.0 * rng.standard_normal(), 4.0)[0] for d in range(400)]
    assert size_variation(alike) < 0.08
    mixed = [events_at([8.0], [d], 20.0 + 10.0 * rng.standard_normal(), 1.0)[0] for d in range(400)]
    assert size_variation(mixed) == pytest.approx(0.5, abs=0.06)


JUMP = Kind("jump", "jump", 0, np.ones(N))


@sizes("seeds", 3, 12)
def test_all_jumps_of_a_season_are_found_up_and_down(seeds):
    """Pairs of 6 cm within a day, single jumps, and one before midnight that the next row repeats."""
    lead, row = 40, N - 40
    truth = {
        (2, 100): 0.06,
        (2, 250): -0.06,
        (7, 80): -0.03,
        (11, 300): 0.03,
        (15, 370): 0.05,
        (15, 200): 0.09,
    }
    deviations = []
    for seed in range(seeds):
        z = NOISE.simulate(20, N, np.random.default_rng([seed, 5]))
        for (d, k), size in truth.items():
            z[d, k:] += size
            if k >= row:
                z[d + 1, k - row :] += size
        seen = z.copy()
        seen[:, :lead] = np.nan
        found = find_events(seen, NOISE.whiten, JUMP, T, lead=lead, follows=np.arange(20) > 0)
        at = {(e.day, round(e.start_s / T + 0.5) + lead): e for e in found.events}
        assert set(at) == set(truth)
        deviations += [(at[key].size - size) / at[key].size_se for key, size in truth.items()]
        assert found.price == pytest.approx(np.log(20 * row * 2.0 / (np.sqrt(2 * np.pi) * 0.0018)), abs=0.2)
        late = at[15, 370].size
        assert found.coded[16, :12].tolist() == [0.0] * 10 + [late] * 2
    assert np.sqrt(np.mean(np.square(deviations))) == pytest.approx(1.0, abs=3 / np.sqrt(2 * len(deviations)))


@sizes("seasons", 10, 60)
def test_seasons_of_noise_have_no_jumps(seasons):
    many = [
        len(
            find_events(NOISE.simulate(20, N, np.random.default_rng([seed, 6])), NOISE.whiten, JUMP, T).events
        )
        for seed in range(seasons)
    ]
    assert sum(many) <= seasons // 30
