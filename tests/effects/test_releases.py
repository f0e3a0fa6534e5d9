import datetime as dt
import math
from dataclasses import replace

import numpy as np
import pytest

from rivid.effects.flow import RainInflow, UnloggedDownstreamRelease, UnloggedUpstreamRelease
from rivid.errors import ConfigError
from tests.effects.worlds import FIRST, samples_of, total, world


def flow_of(effect, here, place):
    (one,) = effect.changes(here).added
    assert one.place == place
    return one.flow


def rain_at(second, start, peak, rise, recession):
    """Return the flow of a single shower, all times in seconds."""
    since = second - start
    if since <= 0:
        return 0.0
    return peak * since / rise if since <= rise else peak * math.exp(-(since - rise) / recession)


def test_given_rain_is_a_rise_and_a_recession_second_by_second():
    here = world(days=2)
    effect = RainInflow(starts=(-3.0, 10.0, 12.5), peak=(4.0, 9.0, 2.0), rise=0.5, recession=3.0, place=0.2)
    slow = np.zeros(3 * 86_400)
    for start, peak in zip((-3.0, 10.0, 12.5), (4.0, 9.0, 2.0), strict=True):
        slow += [rain_at(s - 86_400 + 0.5, start * 3600, peak, 1800, 10_800) for s in range(len(slow))]
    assert flow_of(effect, here, 0.2) == pytest.approx(samples_of(here.time, slow, 133.0), abs=1e-6)


def test_a_shower_between_two_samples_keeps_its_volume():
    here = world(days=3, sample_time=3600.0)
    effect = RainInflow(starts=(5.3,), peak=50.0, rise=0.02, recession=0.06)
    volume = 3600.0 * flow_of(effect, here, 0.5).sum()
    assert volume == pytest.approx(50.0 * 3600.0 * (0.02 / 2 + 0.06), rel=1e-9)


@pytest.mark.parametrize("rows", [False, True])
def test_drawn_events_given_again_make_the_same_flow(rows):
    here = world(3, days=40, rows=rows)
    rain = RainInflow(per_month=20.0, peak=8.0)
    events = rain.events(here)
    assert len(events) > 10
    given = RainInflow(starts=tuple(e["start_h"] for e in events), peak=tuple(e["peak_m3s"] for e in events))
    assert flow_of(given, here, 0.5) == pytest.approx(flow_of(rain, here, 0.5), abs=1e-9)
    assert given.events(here) == events
    lock = UnloggedDownstreamRelease(size=6.0, per_day=9.0, duration=0.4)
    events = lock.events(here)
    again = UnloggedDownstreamRelease(
        size=tuple(e["size_m3s"] for e in events),
        starts=tuple(e["start_h"] for e in events),
        duration=tuple(e["duration_h"] for e in events),
    )
    assert flow_of(again, here, 1.0) == pytest.approx(flow_of(lock, here, 1.0), abs=1e-9)


def test_the_same_seed_draws_the_same_and_a_longer_record_more():
    short, long, other = world(1, days=20), world(1, days=50), replace(world(1, days=20), seed=(2,))
    for effect in (RainInflow(per_month=30.0), UnloggedDownstreamRelease()):
        events = effect.events(short)
        assert effect.events(short) == events
        assert effect.events(long)[: len(events)] == events
        assert effect.events(other) != events


def test_events_have_their_mean_number_and_size():
    days, seeds = 100, range(12)
    counts, peaks = [], []
    for seed in seeds:
        here = world(seed, days=days, sample_time=3600.0, lead=0)
        events = RainInflow(per_month=300.0, peak=8.0).events(here)
        counts.append(len(events))
        peaks += [e["peak_m3s"] for e in events]
    mean = 300.0 * days / 30
    assert np.mean(counts) == pytest.approx(mean, abs=4 * math.sqrt(mean / len(seeds)))
    assert np.mean(peaks) == pytest.approx(8.0, abs=4 * 8.0 / math.sqrt(len(peaks)))
    # exponential intervals: half of them are below the median
    below = np.mean(np.array(peaks) < 8.0 * math.log(2))
    assert below == pytest.approx(0.5, abs=4 * 0.5 / math.sqrt(len(peaks)))


@pytest.mark.parametrize("hours", [(20.0, 5.0), (8.0, 12.0)])
def test_dates_and_hours_limit_when_events_begin(hours):
    here = world(6, days=30)
    dates = (FIRST + dt.timedelta(days=5), FIRST + dt.timedelta(days=14))
    effect = UnloggedDownstreamRelease(per_day=8.0, dates=dates, hours=hours)
    starts = np.array([e["start_h"] for e in effect.events(here)])
    assert ((starts >= 5 * 24) & (starts < 15 * 24)).all()
    hour = starts % 24
    late, early = hour >= hours[0], hour < hours[1]
    assert (late & early if hours[0] < hours[1] else late | early).all()
    assert set(starts // 24) == set(range(5, 15))
    assert len(starts) == pytest.approx(80, abs=4 * math.sqrt(80))
    assert (starts == np.sort(starts)).all()
    given = tuple(np.arange(0.0, 30 * 24, 2.5))
    kept = [e["start_h"] for e in RainInflow(starts=given, dates=dates, hours=hours).events(here)]
    inside = [s for s in given if 120 <= s < 360 and (
        hours[0] <= s % 24 < hours[1] if hours[0] < hours[1] else s % 24 >= hours[0] or s % 24 < hours[1]
    )]  # fmt: skip
    assert kept == inside


def test_lock_pulses_take_their_volume_at_the_dam():
    here = world(days=2)
    effect = UnloggedDownstreamRelease(size=(10.0, 4.0), starts=(3.21, 30.02), duration=(0.5, 1.25))
    flow = flow_of(effect, here, 1.0)
    assert flow.max() == 0.0
    assert total(here.time, flow, 133.0) == pytest.approx(-3600 * (10 * 0.5 + 4 * 1.25), rel=1e-9)
    assert flow_of(replace(effect, per_day=0.0), here, 1.0).tolist() == flow.tolist()
    slow = np.zeros(3 * 86_400)
    for start, size, length in ((3.21, 10.0, 0.5), (30.02, 4.0, 1.25)):
        first = round((start + 24) * 3600)
        slow[first : first + round(length * 3600)] -= size
    assert flow == pytest.approx(samples_of(here.time, slow, 133.0), abs=1e-8)


def test_a_downstream_release_by_schedule_fills_its_hours():
    here = world(days=2)
    flow = flow_of(UnloggedDownstreamRelease(size=5.0, per_day=0.0, hours=(23, 2)), here, 1.0)
    hour = here.time / 3600 % 24
    assert flow.tolist() == np.where((hour >= 23) | (hour < 2), -5.0, 0.0).tolist()
    assert UnloggedDownstreamRelease(per_day=0.0).events(here) == []


def test_an_upstream_release_follows_its_sizes_over_its_dates_and_hours():
    here = world(days=8)
    dates = (FIRST + dt.timedelta(days=2), FIRST + dt.timedelta(days=5))
    flow = flow_of(UnloggedUpstreamRelease(size=(10.0, 50.0), dates=dates, hours=(6, 18)), here, 0.0)
    for t, q in zip(here.time.tolist(), flow.tolist(), strict=True):
        there = 2 <= t / 86_400 < 6 and 6 <= t / 3600 % 24 < 18
        assert q == pytest.approx(10.0 + 40.0 * (t / 86_400 - 2) / 4 if there else 0.0, abs=1e-12)


def test_events_need_one_value_or_one_for_each_start():
    keys = {RainInflow: ("peak", "rise", "recession"), UnloggedDownstreamRelease: ("size", "duration")}
    for effect in keys:
        for key in keys[effect]:
            for starts in ((1.0, 2.0, 3.0), ()):
                with pytest.raises(ConfigError, match=f"{key} has 2 values for {len(starts)} starts"):
                    effect(starts=starts, **{key: (1.0, 2.0)})


@pytest.mark.parametrize("effect", [RainInflow, UnloggedDownstreamRelease])
def test_a_single_start_may_be_a_number(effect):
    one = effect.from_table({"starts": 3.5})
    assert one == effect(starts=(3.5,)) and [event["start_h"] for event in one.events(world())] == [3.5]
