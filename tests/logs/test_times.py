"""Test zones, offsets, and the days of 23 and 25 hours."""

import datetime as dt
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from rivid.errors import DataError
from rivid.logs.spec import day_bounds, read_text, to_utc
from tests.logs.helpers import put, read

MARCH, OCTOBER = dt.date(2024, 3, 31), dt.date(2024, 10, 27)
PARIS = ZoneInfo("Europe/Paris")


def lines(date, written, step=600):
    """Return a log of a Paris day; `written(moment)` is the local time shown for a moment of UTC."""
    start, end = (t // 10**6 for t in day_bounds(date, PARIS))
    out = []
    for k, t in enumerate(range(start, end, step)):
        moment = dt.datetime.fromtimestamp(t, PARIS)
        out.append([written(moment), str(100 + k), "50", "2.5"])
    return out


def offset(moment):
    return moment.isoformat()


def naive(moment):
    return moment.replace(tzinfo=None).isoformat()


REACH = {"sample_time": 600}


@pytest.mark.parametrize(("date", "hours"), [(MARCH, 23), (dt.date(2024, 6, 1), 24), (OCTOBER, 25)])
def test_days_of_23_24_and_25_hours_with_offsets(tmp_path, date, hours):
    data = read(put(tmp_path, lines(date, offset), name=f"{date}.csv"), reach=REACH, time_zone="Europe/Paris")
    assert (data.inflow == 100 + np.arange(hours * 6)).all()
    assert (data.n_filled, data.notes) == (0, "")


def test_a_day_of_mixed_offsets_needs_a_zone(tmp_path):
    put(tmp_path, lines(MARCH, offset), name=f"{MARCH}.csv")
    with pytest.raises(DataError, match="several UTC offsets: set the zone"):
        read(tmp_path, reach=REACH)


def test_the_hour_that_does_not_exist(tmp_path):
    good = lines(MARCH, naive)
    data = read(put(tmp_path, good, name=f"{MARCH}.csv"), reach=REACH, time_zone="Europe/Paris")
    assert len(data.inflow) == 138 and data.n_filled == 0
    good.insert(12, ["2024-03-31T02:30:00", "1", "1", "1"])
    put(tmp_path, good, name=f"{MARCH}.csv")
    with pytest.raises(DataError, match=r"line 14: 2024-03-31 02:30:00 does not exist in Europe/Paris"):
        read(tmp_path, reach=REACH, time_zone="Europe/Paris")


def test_the_hour_that_occurs_twice(tmp_path):
    put(tmp_path, lines(OCTOBER, naive), name=f"{OCTOBER}.csv")
    found = r"line 14: 2024-10-27 02:00:00 occurs twice in Europe/Paris .* \(and 11 more\)"
    with pytest.raises(DataError, match=found):  # rows, not values
        read(tmp_path, reach=REACH, time_zone="Europe/Paris")
    data = read(tmp_path, reach=REACH, time_zone="Europe/Paris", ambiguous="order")
    assert (data.inflow == 100 + np.arange(150)).all()
    for turn in ("first", "second"):  # both hours on one clock: they contradict each other
        with pytest.raises(DataError, match="logged twice with different u_Qi"):
            read(tmp_path, reach=REACH, time_zone="Europe/Paris", ambiguous=turn)


@pytest.mark.parametrize(("turn", "hour"), [("first", 0), ("second", 1)])
def test_one_turn_of_the_doubled_hour_can_be_chosen(turn, hour):
    local = np.array(
        [(dt.datetime(2024, 10, 27, 2, 30) - dt.datetime(1970, 1, 1)) // dt.timedelta(microseconds=1)]
    )
    utc, refused = to_utc(local, PARIS, turn)
    assert not refused
    assert dt.datetime.fromtimestamp(utc[0] / 1e6, dt.UTC).time() == dt.time(hour, 30)


def test_local_times_agree_with_the_standard_library_all_year():
    moments = [dt.datetime(2024, 1, 1) + dt.timedelta(minutes=37 * k) for k in range(14_000)]
    local = np.array([(m - dt.datetime(1970, 1, 1)) // dt.timedelta(microseconds=1) for m in moments])
    utc, refused = to_utc(local, PARIS, "first")
    bad = {i for i, _ in refused}
    assert 0 < len(bad) < 3
    for i in range(0, len(moments), 7):
        if i not in bad:
            assert utc[i] == moments[i].replace(tzinfo=PARIS).timestamp() * 1e6


def test_a_winter_zone_makes_days_of_24_hours(tmp_path):
    day = [[f"2024-03-31T{k // 6:02d}:{k % 6}0:00", str(k), "1", "1"] for k in range(144)]
    data = read(put(tmp_path, day, name=f"{MARCH}.csv"), reach=REACH, time_zone="Etc/GMT-1")
    assert len(data.inflow) == 144


def test_midnight_is_the_zones(tmp_path):
    day = [[f"2024-05-31T{22 + k // 6:02d}:{k % 6}0:00Z", str(k), "1", "1"] for k in range(12)]
    day += [[f"2024-06-01T{k // 6:02d}:{k % 6}0:00Z", str(12 + k), "1", "1"] for k in range(132)]
    put(tmp_path, day, name="2024-06-01.csv")
    data = read(tmp_path, reach=REACH, time_zone="Europe/Paris")
    assert (data.inflow == np.arange(144)).all() and data.notes == ""


@pytest.mark.parametrize(
    ("text", "time_format", "meant"),
    [
        ("2024-05-01T00:00", None, "2024-05-01 00:00:00"),
        ("2024-05-01 24:00", None, "2024-05-02 00:00:00"),
        ("31/12/2024 24:00:00", "%d/%m/%Y %H:%M:%S", "2025-01-01 00:00:00"),
        ("24.02.2024 24:00", "%d.%m.%Y %H:%M", "2024-02-25 00:00:00"),
        ("12/31/2024 12:05 AM", "%m/%d/%Y %I:%M %p", "2024-12-31 00:05:00"),
        ("24:00:15", None, None),
        ("2024-02-30 00:00", None, None),
        ("30/02/2024 00:00", "%d/%m/%Y %H:%M", None),
        ("9999-12-31 24:00", None, None),
        ("0001-01-01T00:00", None, None),
        ("", None, None),
    ],
)
def test_texts_of_times(text, time_format, meant):
    time = read_text(text, time_format)
    if meant is None:
        assert time is None
    else:
        assert str(dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=time[0])) == meant and time[1] is None


def test_a_day_that_does_not_exist_is_refused_in_any_format(tmp_path):
    """The fast reader must not change 30 February to a day in March."""
    day = [[f"30/02/2024 {k // 6:02d}:{k % 6}0", str(k), "1", "1"] for k in range(144)]
    put(tmp_path, day, name="2024-03-01.csv")
    with pytest.raises(DataError, match="'30/02/2024 00:00' is no time"):
        read(tmp_path, reach=REACH, time_zone="Etc/GMT-1", time_format="%d/%m/%Y %H:%M")
