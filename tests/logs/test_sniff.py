"""Test foreign exports that the proposal alone can read: integer tags, no header, tide, kcfs."""

import datetime as dt
import tomllib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.config import Config, parse
from rivid.errors import DataError, RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest
from rivid.logs.sniff.columns import stated_unit
from rivid.logs.sniff.propose import sniff
from rivid.logs.spec import MICRO, read_text

TIMES = [dt.datetime(2024, 5, 1) + dt.timedelta(minutes=15 * k) for k in range(97)]
UP, DOWN, LEVEL = 100 + np.arange(97) % 7, 90 + np.arange(97) % 5, 5 + np.arange(97) % 3
KCFS = 28.316846592


def wide(header, *columns, separator=",", clock="%Y-%m-%d %H:%M"):
    rows = [
        separator.join([f"{t:{clock}}", *(f"{v:.2f}" for v in row)])
        for t, *row in zip(TIMES, *columns, strict=True)
    ]
    return "\n".join([*([header] if header else []), *rows]) + "\n"


def long(header, **series):
    rows = [
        f"{tag.replace('_', ',')},{t:%Y-%m-%d %H:%M},{v:.2f}"
        for tag, values in series.items()
        for t, v in zip(TIMES, values, strict=True)
    ]
    return "\n".join([header, *rows]) + "\n"


FILES = {
    "integer station ids": (
        long("station_id,datetime,value", **{"1": UP, "2": DOWN, "3": LEVEL}),
        {"tag": "station_id", "u_Qi": "1", "u_Qo": "2", "h_L": "3"},
        (UP, LEVEL),
    ),
    "station ids and parameters": (
        long("station,parameter,datetime,value", **{"11_flow": UP, "12_flow": DOWN, "12_stage": LEVEL}),
        {"tag": ["station", "parameter"], "u_Qi": "11 flow", "u_Qo": "12 flow", "h_L": "12 stage"},
        (UP, LEVEL),
    ),
    "unit in the name of the values": (
        long("site_no,time,discharge_cfs", **{"11": UP * 1000 / KCFS, "12": DOWN * 1000 / KCFS}),
        {"tag": "site_no", "u_Qi": "11", "Q_L": "12", "units": {"u_Qi": "cfs", "Q_L": "cfs"}},
        (UP, DOWN),
    ),
    "no header": (
        wide("", UP, DOWN, LEVEL),
        {"u_Qi": "column 2", "u_Qo": "column 3", "h_L": "column 4"},
        (UP, LEVEL),
    ),
    "no header and blanks": (
        wide("", UP, DOWN, separator=" "),
        {"time": ["column 1", "column 2"], "u_Qi": "column 3", "Q_L": "column 4", "separator": " "},
        (UP, DOWN),
    ),
    "a tide beside a level": (
        wide("time,Q in [m3/s],Q out [m3/s],tide level [m],water level [m]", UP, DOWN, DOWN / 50, LEVEL),
        {"u_Qi": "Q in [m3/s]", "u_Qo": "Q out [m3/s]", "h_L": "water level [m]"},
        (UP, LEVEL),
    ),
    "a tide alone": (
        wide("time,inflow_m3s,tide_m", UP, LEVEL),
        {"u_Qi": "inflow_m3s", "u_Qo": "", "h_L": "tide_m"},
        (UP, LEVEL),
    ),
    "kcfs": (
        wide("time,Inflow (kcfs),Outflow (kcfs),Forebay (m)", UP / KCFS, DOWN / KCFS, LEVEL),
        {"u_Qi": "Inflow (kcfs)", "units": {"u_Qi": "kcfs", "u_Qo": "kcfs", "h_L": "m"}},
        (UP, LEVEL),
    ),
    "points in the clock, a level above the sea": (
        wide(
            "Data e ora;Portata in arrivo;Portata turbinata;Livello\n;m3/s;m3/s;cm s.l.m.",
            UP, DOWN, 100 * LEVEL, separator=";", clock="%d/%m/%Y %H.%M",
        ),
        {"time_format": "%d/%m/%Y %H.%M", "units": {"u_Qi": "m3/s", "u_Qo": "m3/s", "h_L": "cm"}},
        (UP, LEVEL),
    ),
    "two columns of one name": (
        wide("time,flow,flow,level (m)", UP, DOWN, LEVEL),
        {"u_Qi": "flow 2", "u_Qo": "flow 3", "columns": ["time", "flow 2", "flow 3", "level (m)"]},
        (UP, LEVEL),
    ),
    "times of twelve digits": (
        wide("time,inflow_m3s,outflow_m3s,level_m", UP, DOWN, LEVEL, clock="%Y%m%d%H%M"),
        {"time_format": "%Y%m%d%H%M", "u_Qi": "inflow_m3s"},
        (UP, LEVEL),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_a_first_proposal_is_read_by_ingest(name, tmp_path):
    text, keys, (inflow, output) = FILES[name]
    path = tmp_path / "export.csv"
    path.write_text(text)
    proposal = sniff(path, "UTC")
    raw = tomllib.loads(proposal.toml)
    assert {key: raw["input"].get(key) for key in keys} == keys, proposal.toml
    config = parse(raw, Config)
    outcome = ingest([path], tmp_path / "logs", config)
    assert outcome.exit_code == 0, [day.reason for day in outcome.days]
    settings = parse(
        {
            "reach": {"kind": config.reach.kind, "sample_time": 900},
            "input": {"u_Qo": config.input.u_Qo and "u_Qo"},
        },
        Config,
    )
    day = read_window(tmp_path / "logs", find_days(tmp_path / "logs", settings).days[:1], settings)
    assert np.allclose(day.inflow, inflow[:96], atol=0.02 * KCFS)
    assert np.allclose(day.output, output[:96], atol=0.02)


@pytest.mark.parametrize(
    ("unit", "known"), [("m ü. NN", "m"), ("müM", "m"), ("m üA", "m"), ("ft NAVD88", "ft"), ("m/s", "")]
)
def test_the_unit_of_a_level_may_state_its_datum(unit, known):
    assert stated_unit("", unit, level=True) == known


def test_series_one_below_the_other_need_a_pattern_of_their_tags(tmp_path):
    path, lines = tmp_path / "export.csv", list[str]()
    for tag, values in (("Q up", UP), ("Q down", DOWN), ("W", LEVEL)):
        lines += [f"#Station;{tag}", "#Timestamp;Value;Quality"]
        lines += [f"{t:%Y-%m-%d %H:%M};{v};200" for t, v in zip(TIMES, values, strict=True)]
    path.write_text("\n".join(lines))
    (question,) = (text for key, text in sniff(path, "UTC").questions if key == "layout")
    assert "tag_pattern" in question
    given = {
        "layout": "long", "tag_pattern": "#Station;(.+)", "u_Qi": "Q up", "u_Qo": "Q down", "h_L": "W",
        "columns": ["time", "value", "quality"], "separator": ";", "comment": "#", "time_zone": "UTC",
        "time_format": "%Y-%m-%d %H:%M", "quality": "quality", "good": ["200"],
    }  # fmt: skip
    settings = parse({"reach": {"sample_time": 900}, "input": given}, Config)
    done = ingest([path], tmp_path / "logs", settings)
    assert [day.status for day in done.days] == ["written"], done.days
    settings = parse({"reach": {"sample_time": 900}}, Config)
    day = read_window(tmp_path / "logs", find_days(tmp_path / "logs", settings).days[:1], settings)
    assert np.allclose([day.inflow, day.outflow, day.output], [UP[:96], DOWN[:96], LEVEL[:96]])


def test_a_unit_that_is_written_and_not_known_is_quoted(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(wide("time,inflow,outflow,level\n,m3/s,m3/s,rod", UP, DOWN, LEVEL))
    questions = [text for _, text in sniff(path, "UTC").questions]
    assert any("the unit of h_L, 'rod', is not known" in text for text in questions), questions


@pytest.mark.parametrize("name", ["Stato", "Estado", "Calidad"])
def test_flags_are_known_by_their_name_in_other_languages(name, tmp_path):
    path = tmp_path / "export.csv"
    lines = wide("time,inflow,outflow,level", UP, DOWN, LEVEL).splitlines()
    path.write_text("\n".join([f"{lines[0]},{name}", *(f"{line},OK" for line in lines[1:])]))
    keys = tomllib.loads(sniff(path, "UTC").toml)["input"]
    assert (keys["quality"], keys["good"]) == (name, ["OK"])


def test_names_that_state_nothing_leave_questions(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(wide("", UP, DOWN, LEVEL))
    assert {"columns", "u_Qi"} <= dict(sniff(path, "UTC").questions).keys()


def test_an_export_with_the_newest_row_first_has_its_sample_time(tmp_path):
    path = tmp_path / "export.csv"
    head, *rows = wide("time,inflow_m3s,outflow_m3s,level_m", UP, DOWN, LEVEL).splitlines()
    path.write_text("\n".join([head, *reversed(rows)]))
    raw = tomllib.loads(sniff(path, "UTC").toml)
    assert raw["reach"]["sample_time"] == 900
    outcome = ingest([path], tmp_path / "logs", parse(raw, Config))
    assert outcome.exit_code == 0 and {day.status for day in outcome.days} == {"written"}


def test_one_missing_value_an_hour_fails_no_day(tmp_path):
    path = tmp_path / "export.csv"
    times = [t for k in range(49) if k != 9 and (t := dt.datetime(2024, 5, 1) + dt.timedelta(hours=k))]
    path.write_text(
        "time,inflow_m3s,level_m\n" + "".join(f"{t},{100 + t.hour},{t.hour / 9:.2f}\n" for t in times)
    )
    raw = tomllib.loads(sniff(path, "UTC").toml)
    assert raw["input"]["max_gap"] == raw["reach"]["sample_time"] == 3600
    outcome = ingest([path], tmp_path / "logs", parse(raw, Config))
    assert [day.status for day in outcome.days] == ["good"] * 2 or outcome.exit_code == 0


CODES = {"one name": "Q Q Q", "a name of flags": "Status Status Status", "names of flows": "Q1 Q2 Q3"}


@pytest.mark.parametrize("names", CODES.values(), ids=CODES)
@pytest.mark.parametrize("above", ["", "# exported\n", "plant: lower\n\n"])
def test_codes_beside_each_value_are_its_quality_and_the_proposal_drops_what_is_bad(names, above, tmp_path):
    path, codes = tmp_path / "export.csv", ["192"] * 97
    codes[7], codes[60] = "0", "24"
    q1, q2, q3 = names.split()
    lines = [f"time;UP total [m³/s];{q1};DN total [m³/s];{q2};DN level [m];{q3}"]
    for k, (t, i, o, h) in enumerate(zip(TIMES, UP, DOWN, LEVEL, strict=True)):
        bad = codes[k] != "192"
        lines.append(f"{t};{i};192;{o};192;{0 if bad else h};{codes[k]}")
    path.write_text(above + "\n".join(lines))
    proposal = sniff(path, "UTC")
    raw = tomllib.loads(proposal.toml)
    keys = raw["input"]
    assert (keys["u_Qi"], keys["u_Qo"], keys["h_L"]) == ("UP total [m³/s]", "DN total [m³/s]", "DN level [m]")
    assert keys["good"] == ["192"] and set(keys["quality"]) == {"u_Qi", "u_Qo", "h_L"}
    assert "good" in dict(proposal.questions) and "ignore" not in keys
    outcome = ingest([path], tmp_path / "logs", parse({**raw, "input": {**keys, "max_gap": 900}}, Config))
    assert outcome.exit_code == 0
    level = [line.split(",")[3] for line in (tmp_path / "logs/2024-05-01.csv").read_text().splitlines()[1:]]
    assert [k for k, cell in enumerate(level) if not cell] == [7, 60] and "0" not in level


def test_a_flow_of_whole_numbers_that_rests_is_no_quality(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(wide("time,spill [m3/s],gates [m3/s],level [m],inflow [m3/s]", 0 * UP, 0 * UP, LEVEL, UP))
    keys = tomllib.loads(sniff(path, "UTC").toml)["input"]
    assert "quality" not in keys and keys["u_Qo"] == ["spill [m3/s]", "gates [m3/s]"]


def test_the_error_for_two_columns_of_one_name_gives_the_keys_to_set(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(wide("time,Q,Q,level", UP, DOWN, LEVEL))
    with pytest.raises(RividError, match=r"2 columns are named 'Q'.*columns.*skip_rows.*header_rows"):
        ingest([path], tmp_path / "logs", parse({"input": {"u_Qi": "Q", "u_Qo": "", "h_L": "level"}}, Config))


@pytest.mark.parametrize(
    ("name", "unit", "time_format"),
    [("time", 1, "unix"), ("t_ms", 1000, "unix_ms"), ("Zeit", 1000, "unix_ms"), ("x", 1, "unix")],
)
def test_numbers_of_seconds_or_milliseconds_since_1970_are_times(name, unit, time_format, tmp_path):
    path = tmp_path / "export.csv"
    stamps = [str(1710025200 * unit + 300 * unit * k) for k in range(97)]
    rows = [f"{t},{i},{o},{h}" for t, i, o, h in zip(stamps, UP, DOWN, LEVEL, strict=True)]
    path.write_text("\n".join([f"{name},inflow_m3s,outflow_m3s,level_m", *rows]))
    raw = tomllib.loads(sniff(path).toml)
    assert raw["input"]["time_format"] == time_format and raw["input"].get("time", "time") == name
    assert raw["reach"]["sample_time"] == 300


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ",")])
def test_days_of_a_spreadsheet_are_times_with_a_question_and_are_read_to_the_second(
    separator, decimal, tmp_path
):
    path = tmp_path / "export.csv"
    rows = [
        separator.join(str(v).replace(".", decimal) for v in (f"{45717 + k / 288:.6f}", *row))
        for k, row in enumerate(zip(UP, DOWN, LEVEL + 0.5, strict=True))
    ]
    path.write_text("\n".join([separator.join(["Time", "inflow_m3s", "outflow_m3s", "level_m"]), *rows]))
    proposal = sniff(path, "Etc/GMT-1")
    raw = tomllib.loads(proposal.toml)
    assert raw["input"]["time_format"] == "excel" and raw["reach"]["sample_time"] == 300
    assert any("1899-12-30" in question for _, question in proposal.questions)
    assert read_text(rows[1].split(separator)[0], "excel") == (1740787500 * MICRO, None)  # 2025-03-01 00:05


@pytest.mark.parametrize(
    ("names", "clock", "time_format"),
    [
        ("Year,Month,Day,Hour,Minute", "%Y,%-m,%-d,%-H,%-M", "%Y %m %d %H %M"),
        ("year,mo,dy,hr,mi", "%Y,%-m,%-d,%-H,%-M", "%Y %m %d %H %M"),
        ("Jahr,Monat,Tag,Zeit", "%Y,%m,%d,%H:%M", "%Y %m %d %H:%M"),
        ("Jahr,Monat,Tag", "%Y,%m,%d", "%Y %m %d"),  # flows like 12.34 are no clock
    ],
)
def test_columns_of_year_month_and_day_are_a_time(names, clock, time_format, tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(wide(f"{names},inflow_m3s,outflow_m3s,level_m", UP, DOWN, LEVEL, clock=clock))
    raw = tomllib.loads(sniff(path, "Etc/GMT-1").toml)
    assert raw["input"]["time"] == names.split(",") and raw["input"]["time_format"] == time_format


@pytest.mark.parametrize("typed", [True, False])
def test_a_proposal_for_parquet_reads_it(typed, tmp_path):
    times = pa.array(TIMES, pa.timestamp("us")) if typed else pa.array([t.isoformat(" ") for t in TIMES])
    columns = {"when": times, "inflow_cfs": UP * 35.3, "outflow_cfs": DOWN * 35.3, "level_ft": LEVEL * 3.3}
    pq.write_table(pa.table(columns), tmp_path / "export.parquet")
    text = sniff(tmp_path / "export.parquet", "Etc/GMT-1").toml
    config = parse(tomllib.loads(text), Config)
    done = ingest([tmp_path / "export.parquet"], tmp_path / "logs", config)
    assert config.input.unit("u_Qi") == "cfs" and [day.status for day in done.days] == ["written"]


def test_parquet_without_rows_or_of_lists_is_refused(tmp_path):
    path = tmp_path / "export.parquet"
    for column in (pa.array([], pa.float64()), pa.array([[1.0, 2.0]])):
        pq.write_table(pa.table({"u": column}), path)
        with pytest.raises(DataError, match=r"export.parquet: "):
            sniff(path)


@pytest.mark.parametrize(
    ("name", "step", "time_format", "sample_time"),
    [
        ("t [s]", 0.05, "unix", 0.05),
        ("time_ms", 50, "unix_ms", 0.05),
        ("Zeit", 1, "unix", 1),
        ("x", 0.3, "unix", 0.3),
    ],
)
def test_seconds_in_equal_steps_from_any_begin_are_times_with_a_question(
    name, step, time_format, sample_time, tmp_path
):
    path = tmp_path / "canal.csv"
    rows = [
        f"{step * k:.6g},{i},{o},{h}"
        for k, (i, o, h) in enumerate(zip(UP, DOWN, LEVEL, strict=True))
        if k != 9
    ]
    path.write_text("\n".join([f"{name},inflow_m3s,outflow_m3s,level_m", *rows]))
    proposal = sniff(path)
    raw = tomllib.loads(proposal.toml)
    assert raw["input"]["time_format"] == time_format and raw["input"].get("time", "time") == name
    assert raw["reach"]["sample_time"] == pytest.approx(sample_time)
    assert any("has no dates" in question for _, question in proposal.questions)


@pytest.mark.parametrize(("name", "step"), [("sample", 1), ("t_min", 5), ("time [h]", 0.25), ("t", -1)])
def test_numbers_of_rows_and_times_in_units_that_no_format_counts_are_refused(name, step, tmp_path):
    path = tmp_path / "canal.csv"
    path.write_text(
        f"{name},inflow_m3s,level_m\n" + "".join(f"{step * k},{100 + k},{k % 7}\n" for k in range(99))
    )
    with pytest.raises(DataError, match="no column reads as times"):
        sniff(path)


def test_numbers_that_are_no_times_are_refused_with_the_formats_of_numbers(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text("storage,inflow_m3s,level_m\n" + "".join(f"{4e8:.0f},{100 + k},{k}\n" for k in range(9)))
    with pytest.raises(DataError, match="unix_ms"):
        sniff(path)


def test_ten_digits_are_a_date_with_its_hour(tmp_path):
    path = tmp_path / "export.csv"
    times = [dt.datetime(2024, 5, 1) + dt.timedelta(hours=k) for k in range(49)]
    path.write_text("date,inflow,level\n" + "".join(f"{t:%Y%m%d%H},{100 + t.hour},5\n" for t in times))
    raw = tomllib.loads(sniff(path, "UTC").toml)
    assert (raw["input"]["time_format"], raw["reach"]["sample_time"]) == ("%Y%m%d%H", 3600)


@pytest.mark.parametrize(("n", "end"), [(3, "c.csv."), (4, "c.csv, ... (4 files).")])
def test_the_proposal_names_its_files_or_their_number(n, end, tmp_path):
    paths = [tmp_path / f"{name}.csv" for name in "abcd"[:n]]
    for path in paths:
        path.write_text(wide("time,inflow_m3s,level_m", UP, LEVEL))
    assert f"Proposed for a.csv, b.csv, {end}" in sniff(paths, "UTC").toml.splitlines()[0]


def test_the_number_of_a_station_is_no_level(tmp_path):
    path = tmp_path / "export.csv"
    path.write_text(
        "agency,site_no,time,00060 [cfs]\n"
        + "".join(f"USGS,09380000,{t:%Y-%m-%d %H:%M},{q}\n" for t, q in zip(TIMES, UP, strict=True))
    )
    lines = [line for line in sniff(path).toml.splitlines() if "site_no" in line]
    assert not [line for line in lines if "left out" not in line]


@pytest.mark.parametrize("text", ['{"t": "2024-05-01", "q": 1}\n{"t": "2024-05-02"}', '[\n {"t": 1}]'])
def test_json_is_refused_by_its_name(text, tmp_path):
    path = tmp_path / "export.json"
    path.write_text(text)
    with pytest.raises(DataError, match="is JSON: expected a table"):
        sniff(path)
