"""Test binary formats of the field, written by their own libraries, and read back to the last digit."""

import datetime as dt
import sys
import tomllib
import zipfile

import numpy as np
import pytest

from rivid.config import Config, parse
from rivid.errors import DataError
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest
from rivid.logs.formats import as_text
from rivid.logs.sniff.propose import sniff
from rivid.logs.spec import MANY

N, STEP = 193, 900
TIMES = [dt.datetime(2024, 5, 1) + dt.timedelta(seconds=STEP * k) for k in range(N)]
UP, DOWN = 320.0 + 17 * (np.arange(N) // 9 % 5), 318.0 + 17 * (np.arange(N) // 11 % 5)
LEVEL = 118 + np.round(0.22 * np.cos(np.arange(N) / 15), 3)
UP[7], LEVEL[40] = np.nan, np.nan
LONG = {"layout": "long", "tag": "tag", "max_gap": 3600}


def netcdf(path, engine):
    """Write discharge by station, and a level of one station, in CF conventions; times are UTC."""
    import xarray

    data = xarray.Dataset(
        {
            "discharge": (
                ("station", "time"),
                np.array([UP, DOWN]),
                {"units": "m3 s-1", "_FillValue": -999.0},
            ),
            "stage": ("time", LEVEL, {"units": "m"}),
            "datum": ((), 100.0),
        },
        {
            "time": np.array(TIMES, "M8[ns]"),
            "name": ("station", ["upper", "lower"], {"cf_role": "timeseries_id"}),
        },
    )
    data.to_netcdf(path, engine=engine)
    return {**LONG, "u_Qi": "upper discharge", "u_Qo": "lower discharge", "h_L": "stage", "time_zone": "UTC"}


def workbook(path):
    """Write a sheet of remarks, and a sheet of values for each day, with the same header."""
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["made by", "the plant"])
    head = ["time", "Inflow [m3/s]", "Outflow [m3/s]", "Level [m]"]
    for day in (1, 2, 3):
        sheet = book.create_sheet(f"{day} May")
        sheet.append(head)
        for time, *cells in zip(TIMES, UP, DOWN, LEVEL, strict=True):
            if time.day == day:
                sheet.append([time, *(None if np.isnan(c) else float(c) for c in cells)])
    book.save(path)
    return dict(zip(("u_Qi", "u_Qo", "h_L"), head[1:], strict=True), max_gap=3600, time_zone="UTC")


def dss(path):
    """Write HEC-DSS 7, with a record per series and month."""
    import hecdss

    hecdss.HecDss.set_global_debug_level(0)
    series = {"UPPER/FLOW": (UP, "cms"), "LOWER/FLOW": (DOWN, "cms"), "LOWER/STAGE": (LEVEL, "m")}
    with hecdss.HecDss(str(path)) as file:
        for name, (values, unit) in series.items():
            file.put(
                hecdss.RegularTimeSeries.create(
                    np.nan_to_num(values, nan=-901.0).tolist(), path=f"/RIVER/{name}//15Minute/OBS/",
                    units=unit, data_type="INST-VAL",
                    start_date=TIMES[0], interval=dt.timedelta(seconds=STEP),
                )
            )  # fmt: skip
    names = {
        key: f"RIVER {name.replace('/', ' ')} 15Minute OBS" for key, name in zip(NAMES, series, strict=True)
    }
    return {**LONG, **names, "time_zone": "UTC"}


NAMES = ("u_Qi", "u_Qo", "h_L")
WRITERS = {
    "netCDF 4": ("x.nc", lambda path: netcdf(path, "h5netcdf")),
    "netCDF 3": ("x.nc", lambda path: netcdf(path, "scipy")),
    "workbook": ("x.xlsx", workbook),
    "HEC-DSS": ("x.dss", dss),
}


@pytest.fixture(scope="module", params=WRITERS)
def written(request, tmp_path_factory):
    name, write = WRITERS[request.param]
    path = tmp_path_factory.mktemp("format") / name
    return path, write(path)


def test_every_value_comes_back(written, tmp_path):
    path, given = written
    config = parse({"reach": {"sample_time": STEP}, "input": given}, Config, "test")
    outcome = ingest([path], tmp_path / "logs", config)
    assert outcome.counts["written"] == 2, outcome.days
    run = parse({"reach": {"sample_time": STEP}, "input": {"max_gap": 3600}}, Config, "test")
    for k, day in enumerate(find_days(tmp_path / "logs", run).days):
        found = read_window(tmp_path / "logs", [day], run)
        for values, name in ((UP, "inflow"), (DOWN, "outflow"), (LEVEL, "output")):
            true = values[96 * k : 96 * (k + 1)]
            there = np.isfinite(true)
            np.testing.assert_array_equal(getattr(found, name)[there], true[there])
    read = {name: source["read"] - source["used"] for name, source in outcome.ledger["sources"].items()}
    assert sorted(read.values()) == [1, 2, 2]  # the first sample of the third day, and a missing one


def test_sniff_proposes_the_names_and_units(written):
    path, given = written
    found = tomllib.loads(sniff(path).toml)["input"]
    for name in NAMES:
        assert found[name] == given[name]
        assert found["units"][name] == ("m" if name == "h_L" else "m3/s")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"CDF\x01 and no more", "not sound netCDF"),
        (b"\x89HDF\r\n\x1a\n", "not sound netCDF"),
        (b"ZDSS" + bytes(100), "not sound HEC-DSS"),
        (b"<TimeSeries><series>", "not sound PI-XML"),
        (b'<?xml version="1.0"?><TimeSeries xmlns="x"></TimeSeries>', "PI-XML without values"),
        (b'{"type": "FeatureCollection", "features": [{}]}', "not sound JSON of the OGC API"),
    ],
)
def test_a_damaged_file_is_refused_by_name(content, expected):
    with pytest.raises(DataError, match=expected) as error:
        as_text(content, "x")
    assert str(error.value).startswith("x is")


@pytest.mark.parametrize("content", [b"", b"time,u_Qi\n", b"<html><body>", b'{"rows": []}', b"PK\x03\x04zip"])
def test_other_content_stays_as_it_is(content):
    assert as_text(content, "x") is content


def test_a_workbook_that_unpacks_to_more_than_a_log_may_hold_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("rivid.logs.formats.MANY", (1 << 20, MANY[1]))
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        parts.writestr("xl/workbook.xml", bytes((1 << 20) + 1))
    with pytest.raises(DataError, match="too large for a log"):
        as_text(path.read_bytes(), "x")


def test_a_library_that_is_not_installed_is_named(written, monkeypatch):
    for name in ("xarray", "python_calamine", "hecdss"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(DataError, match=r"pip install 'rivid\[formats\]'"):
        as_text(written[0].read_bytes(), "x")
