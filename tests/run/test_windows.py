"""Test `[run] window`: data sets shorter than a day, at the sample times of a laboratory canal."""

import csv
import datetime as dt
import re
import tomllib

import numpy as np
import pyarrow.parquet as pq
import pytest
import tomli_w

import rivid as package
from rivid.check import check
from rivid.config import Config, parse
from rivid.errors import ConfigError
from rivid.logs.days import find_days, read_window, spans_of
from rivid.logs.exports import ingest
from rivid.run.run import Options, run
from tests.run.test_run import rivid

T_S, DELAY, N = 0.05, 15, 900
START = dt.datetime(2024, 3, 14, 10, 0, 7)
SETTINGS = {
    "reach": {"kind": "river", "sample_time": T_S},
    "input": {"time_zone": "UTC"},
    "run": {"window": "20 s", "estimators": ["posterior"]},
    "jmap": {"d_max": 30, "order": 60},
}


def stretch(seed):
    """Return discharges [m3/s] of a canal: steps, a delay of 0.75 s and a short tail."""
    rng = np.random.default_rng(seed)
    u = 0.01 + 0.002 * np.repeat(rng.normal(size=N // 20), 20)
    h = np.exp(-np.arange(30) / 3.0)
    arrived = np.concatenate([np.full(DELAY, u[0]), u[:-DELAY]])
    y = np.convolve(arrived - u[0], h / h.sum())[:N] + u[0] + rng.normal(0, 2e-5, N)
    return u, y


def write_log(path, stretches, pause=300.0):
    rows = ["time,u_Qi,Q_L"]
    for k, (u, y) in enumerate(stretches):
        for i in range(len(u)):
            at = START + dt.timedelta(seconds=k * pause + i * T_S)
            rows.append(f"{at.isoformat(timespec='milliseconds')},{u[i]:.7f},{y[i]:.7f}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab") / "data"
    write_log(folder / "2024-03-14.csv", [stretch(1), stretch(2)])
    return folder


@pytest.fixture(scope="module")
def done(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "out"
    return out, run(logs, out, parse(SETTINGS, Config), Options(workers=1))


def rows_of(out):
    with open(out / "delays.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_log_is_cut_into_data_sets_from_its_first_row_and_after_each_pause(logs):
    config = parse(SETTINGS, Config)
    (day,) = find_days(logs, config).days
    spans, _ = spans_of(logs, day, config)
    first = dt.datetime.fromtimestamp(spans[0][0] / 1e6, dt.UTC).replace(tzinfo=None)
    begins = [(start - spans[0][0]) / 1e6 for start, _ in spans]
    assert first == START and begins == [0, 20, 300, 320]  # 45 s each: the last 5 s are left out
    data = read_window(logs, [day], config, span=spans[2])
    assert np.allclose(data.inflow, stretch(2)[0][:400], atol=1e-7) and data.n_filled == 0


def test_every_data_set_has_its_row_and_a_travel_time_of_less_than_a_second(done):
    out, summary = done
    rows = rows_of(out)
    assert summary.windows == summary.computed == 4 and summary.failures == 0
    assert [row["start"][11:19] for row in rows] == ["10:00:07", "10:00:27", "10:05:07", "10:05:27"]
    assert {row["status"] for row in rows} == {"ok"}
    true = (DELAY + 2.0) * T_S  # half of a step has arrived two samples after the front
    assert np.allclose([float(row["delay_s"]) for row in rows], true, atol=1.5 * T_S)
    posterior = pq.read_table(out / "posterior.parquet").to_pandas()
    assert np.allclose(posterior.groupby("start")["probability"].sum(), 1.0)
    assert not (out / "report.html").exists()


def test_a_second_run_repeats_nothing_and_new_stretches_only_are_added(done, logs, tmp_path):
    out, _ = done
    again = run(logs, out, parse(SETTINGS, Config), Options(workers=1))
    assert again.computed == 0 and again.reused == 4
    write_log(tmp_path / "data" / "2024-03-14.csv", [stretch(1), stretch(2)])
    write_log(tmp_path / "data" / "2024-03-15.csv", [stretch(3)])
    (tmp_path / "data" / "2024-03-15.csv").write_text(
        (tmp_path / "data" / "2024-03-15.csv").read_text().replace("2024-03-14", "2024-03-15")
    )
    assert run(tmp_path / "data", out, parse(SETTINGS, Config), Options(workers=1)).computed == 2


def test_a_log_shorter_than_a_window_fails_with_the_reason(tmp_path):
    write_log(tmp_path / "data" / "2024-03-14.csv", [stretch(1)])
    settings = parse(SETTINGS | {"run": {"window": "5 min"}}, Config)
    run(tmp_path / "data", tmp_path / "out", settings, Options(workers=1))
    row, _ = rows_of(tmp_path / "out")
    assert row["status"] == "failed" and "holds no 5 min in a row" in row["message"]


def test_an_export_of_a_part_of_a_day_is_ingested_and_checked(logs, tmp_path):
    config = parse(SETTINGS, Config)
    (export,) = logs.iterdir()
    assert ingest([export], tmp_path / "logs", config).exit_code == 0
    (day,) = check(tmp_path / "logs", config).days
    assert day.status == "ok" and "4 data sets of 20 s" in day.notes[0]
    summary = run(tmp_path / "logs", tmp_path / "out", config, Options(workers=1))
    assert summary.windows == 4 and summary.failures == 0


def test_what_needs_whole_days_refuses_in_one_line(done, tmp_path):
    out, _ = done
    for words in (("season", out), ("figures", out)):
        code, output = rivid(*words)
        assert code == 2 and "[run] window" in output and len(output.strip().splitlines()) == 1


def test_a_data_set_too_short_for_the_response_names_the_key(logs, tmp_path):
    settings = SETTINGS | {"run": {"window": "2 s", "estimators": ["jmap"]}}
    summary = run(logs, tmp_path / "out", parse(settings, Config), Options(workers=1))
    assert summary.failures == summary.windows == 44
    message = rows_of(tmp_path / "out")[0]["message"]
    longer = re.search(r'set \[run\] (window = "\d+ s") or longer', message)
    settings["run"] |= tomllib.loads(longer[1])
    assert run(logs, tmp_path / "out", parse(settings, Config), Options(workers=1)).failures == 0


def test_a_log_of_minutes_that_is_read_as_a_day_is_sent_to_the_window(logs, tmp_path):
    settings = {name: value for name, value in SETTINGS.items() if name != "run"}
    (day,) = check(logs, parse(settings, Config)).days
    assert day.status == "failed" and day.reason.endswith("shorter than a day, set [run] window")
    code, output = rivid("sniff", next(logs.iterdir()))
    assert code == 0 and "set [run] window" in " ".join(output.replace("#", " ").split())


def test_the_terminal_counts_data_sets_and_states_that_there_is_no_report(logs, tmp_path):
    (tmp_path / "c.toml").write_text(tomli_w.dumps(SETTINGS))
    code, output = rivid("run", logs, "--config", tmp_path / "c.toml", "--out", tmp_path / "out")
    assert code == 0 and "4 data sets" in output
    assert " day" not in output.partition("no report and no figures")[0] and "rivid check" not in output


@pytest.mark.parametrize("given", [{"window": "0 s"}, {"window": "2 days"}, {"window": "13 h"}])
def test_a_window_is_a_part_of_a_day(given):
    with pytest.raises(ConfigError, match="window"):
        parse({"run": given}, Config)


def test_one_length_of_data_sets_is_given():
    with pytest.raises(ConfigError, match="window_days = 2"):
        parse({"run": {"window": "75 s", "window_days": 2}}, Config)


@pytest.mark.parametrize("sample_time", [0.05, 1.0, 60.0, 3600.0])
def test_a_travel_time_is_the_same_in_samples_at_any_sample_time(sample_time):
    u, y = stretch(5)
    settings = {"reach": {"kind": "river", "sample_time": sample_time}, "jmap": {"d_max": 30, "order": 60}}
    found = package.posterior(u[None, :400], y[None, :400], config=settings)
    assert found.travel[0] == pytest.approx(DELAY + 2.0, abs=1.5)
    assert found.sample_time == sample_time


def test_the_delays_of_short_samples_have_no_digits_of_floating_point(logs, tmp_path):
    settings = SETTINGS | {"jmap": {"d_min": 13, "d_max": 14, "order": 60}}
    settings["run"] = {"window": "20 s", "estimators": ["jmap"]}
    run(logs, tmp_path / "out", parse(settings, Config), Options(workers=1))
    rows = rows_of(tmp_path / "out")
    assert {row["delay_samples"] for row in rows} == {"14"}
    assert {(row["delay_s"], row["travel_time_s"]) for row in rows} == {("0.7", "0.725")}
