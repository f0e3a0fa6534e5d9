"""Test that numbers meaning "not measured" are never read as data, and data never as such numbers."""

import datetime as dt

import numpy as np
import pytest

from rivid.errors import DataError
from rivid.logs.log import SENTINELS, sentinels_in
from tests.logs.helpers import DAY, put, read, rows

FLOW = np.round(300 + 50 * np.sin(np.arange(650) / 40))
LEVEL = 118 + 0.1 * np.sin(np.arange(650) / 40)


def holding(values, sentinel, at=(7,)):
    out = values.copy()
    out[list(at)] = sentinel
    return out


@pytest.mark.parametrize("sentinel", SENTINELS)
@pytest.mark.parametrize("values", [FLOW, LEVEL], ids=["flow", "level"])
def test_every_known_sentinel_among_flows_and_levels_is_seen(values, sentinel):
    for at in ((7,), (3, 200, 649), range(600)):
        held = holding(values, sentinel, at)
        assert sentinels_in(held) == [sentinel]


def test_several_sentinels_and_nothing_else():
    values = holding(holding(FLOW, -999, (1, 2)), -9999, (3,))
    assert sentinels_in(values) == [-9999, -999]
    assert sentinels_in(np.full(650, -999.0)) == [-999]
    assert sentinels_in(np.full(650, np.nan)) == []


@pytest.mark.parametrize(
    "values",
    [
        np.tile([0.0, 120.0, -99.0, 60.0], 160),  # a pump of 99 m3/s
        np.repeat([0.0, -99.0], 300),
        np.repeat([0.0, 800.0, -1000.0], 200),  # L/s
        np.linspace(-1200.0, 900.0, 2101),  # contains -1000, -999, -99
        np.linspace(9000.0, 10500.0, 1501),  # contains 9999: cfs in spring
        np.linspace(32000.0, 33500.0, 1501),
        np.linspace(-100.0, -98.0, 2001),
        np.zeros(650),
        FLOW,
        -FLOW,
        LEVEL,
    ],
)
def test_what_plants_and_rivers_do_is_no_sentinel(values):
    assert sentinels_in(values) == []
    assert sentinels_in(np.append(values, np.nan)) == []


def test_the_day_fails_with_the_line_and_what_to_declare(tmp_path):
    lines = rows()
    for k in (100, 101, 102):
        lines[k][1] = "-999"
    for k in (300, 301, 302, 303):
        lines[k][3] = "-1000"
    put(tmp_path, lines)
    with pytest.raises(DataError) as caught:
        read(tmp_path)
    assert "2008-03-10.csv, line 102: column 'u_Qi' holds -999 3 times" in str(caught.value)
    assert "set [input] sentinels = [-999, -1000]" in str(caught.value)
    data = read(tmp_path, sentinels=[-999, -1000])
    assert data.notes == "7 sentinels masked" and data.n_filled == 7
    assert data.inflow.min() > 0 and data.output.min() > 100
    with pytest.raises(DataError, match=r"sentinels = \[-9, -999\]"):
        read(tmp_path, sentinels=[-9], not_sentinels=[-1000])
    assert read(tmp_path, not_sentinels=[-999, -1000]).output.min() == -1000


def test_a_sum_does_not_hide_a_sentinel(tmp_path):
    lines = [[r[0], r[1], r[2], "20", r[3]] for r in rows()]
    lines[5][3] = "-999"
    put(tmp_path, lines, head="time,u_Qi,unit1,unit2,h_L")
    with pytest.raises(DataError, match="column 'unit2' holds -999, far from the day's 20 to 20"):
        read(tmp_path, u_Qo=["unit1", "unit2"])


def test_in_a_file_of_many_days_only_the_days_that_hold_one_fail(tmp_path):
    dates = [DAY + dt.timedelta(days=k) for k in range(4)]
    lines = [row for date in dates for row in rows(date)]
    lines[700][1] = "-999"
    lines[1400][1] = "-5000"  # another kind of fault does not hide it
    lines[1500][3] = "99999"
    folder = put(tmp_path, lines, name="march.csv")
    for date, line in ((dates[1], 702), (dates[2], 1502)):
        with pytest.raises(DataError, match=rf"march.csv, line {line}: column .* \[-999, 99999\]"):
            read(folder, day=date)
    assert read(folder, day=dates[0]).notes == read(folder, day=dates[3]).notes == ""
