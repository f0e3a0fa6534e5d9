"""Test forecasts: coverage of the bands, announced flows, and the output of the command."""

import csv
import datetime as dt
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

import rivid
from rivid.diagnosis.data import activity
from rivid.diagnosis.response.base import kernels_of
from rivid.effects import CATALOGUE
from rivid.errors import ConfigError, NoDataError
from rivid.forecast import (
    LEVELS,
    Series,
    forecast,
    lead_of,
    learnt_quantiles,
    run,
    simulations,
)
from tests.daily import write_days
from tests.diagnosis.responses import river_record
from tests.run.test_run import rivid as command
from tests.test_export import pool, river, written

DAYS, N, T = 45, 96, 900.0
FIRST = dt.date(2024, 5, 1)
ZONE = dt.timezone(dt.timedelta(hours=-7))


def long_river(seed=1, days=DAYS):
    """Return a model, and a series with its own weather and gauge noise; the last day is to be forecast."""
    reach, _ = river()
    rng = np.random.default_rng(seed)
    record = river_record(rng, days=days)
    hours = [0.0]
    for step in rng.normal(0.0, 15.0, days * 24 - 1):
        hours.append(0.97 * hours[-1] + step)
    inflow = 250.0 + np.repeat(hours, 4)[None]
    row = replace(
        record, dates=record.dates[:1], time=T * np.arange(float(inflow.shape[1]))[None], inflow=inflow,
        outflow=0.0 * inflow, output=inflow, used=np.ones(inflow.shape, bool), lead=0,
    )  # fmt: skip
    noise = reach.noise.simulate(1, inflow.shape[1], rng)
    output = reach.model.reach.baseline(row)[0] + noise[0]
    begin = dt.datetime.combine(FIRST, dt.time(), ZONE)
    series = Series(row.time[0], FIRST, inflow[0], 0.0 * inflow[0], output, len(output) - 1 - N, begin)
    return reach, series


@pytest.fixture(scope="module")
def known():
    return long_river()


def cut(series, now):
    """Return the data known at a time: no later output."""
    output = series.output.copy()
    output[now + 1 :] = np.nan
    end = now + 1 + N
    return Series(
        series.time[:end], series.first, series.inflow[:end], series.outflow[:end], output[:end], now,
        series.begin,
    )  # fmt: skip


def test_bands_hold_as_often_as_they_state():
    """Origins of 3 rivers not used for the coefficients. A day counts as one: its errors are correlated."""
    inside, origins = [], 0
    for seed in (2, 3, 4):
        reach, series = long_river(seed, days=75)
        lead, steps = lead_of(reach), np.arange(1, 49)
        train = np.arange(lead + N, 40 * N, 13)
        test = np.arange(44 * N, 73 * N, 37)
        quantiles = []
        for at in (train, test):
            _, X, sd, _ = simulations(reach, series, at, lead, 48, 48)
            quantiles.append((X, sd))
        (X, sd), (X_test, sd_test) = quantiles
        target = series.output[train[:, None] + steps] - series.output[train, None]
        bands = learnt_quantiles(X, target, sd, X_test, sd_test)
        came = series.output[test[:, None] + steps] - series.output[test, None]
        inside.append([(came >= bands[0]) & (came <= bands[4]), (came >= bands[1]) & (came <= bands[3])])
        origins += len(test)
    for share, found in zip((0.9, 0.5), np.concatenate(inside, axis=1), strict=True):
        error = np.sqrt(share * (1.0 - share) / (origins / 2.0))
        assert abs(found.mean() - share) < 4.0 * error


def test_with_announced_flows_it_is_the_simulation_and_the_filter(known):
    """Without any learning data: mean and spread of the noise model, by a slow conditional normal."""
    reach, series = known
    now = 6 * N
    few = cut(series, now)
    lead = lead_of(reach)
    early = Series(
        few.time[now - lead :], few.first, few.inflow[now - lead :], few.outflow[now - lead :],
        few.output[now - lead :], lead, few.moment(now - lead),
    )  # fmt: skip
    found = forecast(reach, early)
    assert found.learnt == 0 and found.announced == N and "0 earlier forecasts" in found.notes[0]
    record = river_record(np.random.default_rng(0), days=1)
    row = replace(
        record, time=early.time[None], inflow=early.inflow[None], outflow=early.outflow[None],
        output=early.output[None], used=np.isfinite(early.output)[None], lead=0,
    )  # fmt: skip
    kernels = kernels_of(reach.model.reach, row)
    row = replace(row, activity=activity(row, kernels["up"], kernels["down"]))
    base = reach.model.reach.baseline(row)[0]
    past, m = slice(0, lead + 1), reach.noise
    t = np.arange(len(base)) * T
    S = m.level_sd**2 * np.exp(-np.abs(t[:, None] - t) / m.level_memory) + m.gauge_sd**2 * np.eye(len(t))
    cross, own = S[:, past], S[past, past]
    mean = base + cross @ np.linalg.solve(own, early.output[past] - base[past])
    var = np.diag(S) - np.einsum("ij,ji->i", cross, np.linalg.solve(own, cross.T))
    later = slice(lead + 1, None)
    np.testing.assert_allclose(found.quantiles[2], mean[later], atol=1e-6)
    wide = found.quantiles[4] - found.quantiles[0]
    np.testing.assert_allclose(wide, 2 * 1.6448536 * np.sqrt(var[later]), rtol=1e-5)


def test_a_gate_with_a_dead_band_rests_where_earlier_commands_left_it():
    """The flow that it keeps is that of a gate without a dead-band at the earlier command."""
    reach, season = pool("none")
    reach = replace(reach, model=replace(reach.model, noise=replace(reach.noise, misfit=0.0)))
    gate = CATALOGUE["gate_deadband"](band=10.0)
    stuck = replace(reach, model=replace(reach.model, effects=(gate,), free=((),)))
    n, T = round(3 * 86400 / reach.sample_time), reach.sample_time
    now, lead, ahead = n - 60, lead_of(reach), 40
    flow = np.full(n, season.usual_flow)
    small = flow + 6.0 * (np.arange(n) >= now - 2 * lead)  # before the row begins
    level = season.usual_output + 1e-3 * np.random.default_rng(0).standard_normal(n)

    def ahead_of(model, outflow):
        given = Series(
            T * np.arange(n), FIRST, flow, outflow, level, now, dt.datetime.combine(FIRST, dt.time(), ZONE)
        )
        return run(model, given, np.array([now]), lead, ahead, ahead, repeat=False)[0][0]

    np.testing.assert_allclose(ahead_of(stuck, small), ahead_of(reach, flow), atol=1e-9)
    assert np.abs(ahead_of(reach, small) - ahead_of(reach, flow)).max() > 0.01  # moved as commanded
    untaken = flow + 6.0 * (np.arange(n) >= now - lead - 20) + 6.0 * (np.arange(n) >= now - lead - 10)
    untaken[now - lead - 5 :] = flow[0] + 6.0  # moved by 12, then back within the band
    np.testing.assert_allclose(ahead_of(stuck, untaken), ahead_of(reach, flow + 12.0), atol=1e-9)


def test_a_forecast_with_announced_flows_is_better_than_one_without(known):
    reach, series = known
    errors = {True: [], False: []}
    for now in range(30 * N, 44 * N, 137):  # all hours of the day
        for announced in errors:
            at = cut(series, now)
            inflow = at.inflow.copy()
            if not announced:
                inflow[now + 1 :] = np.nan
            found = forecast(reach, replace(at, inflow=inflow))
            assert found.announced == (N if announced else 0) and found.learnt >= 72
            assert (found.repeated is None) == announced
            if not announced:
                assert (found.series.inflow[now + 1 :] == inflow[now]).all()
                np.testing.assert_array_equal(found.repeated, series.inflow[now + 1 - N : now + 1])
            assert (np.diff(found.quantiles, axis=0) >= 0.0).all() and len(LEVELS) == len(found.quantiles)
            errors[announced].append(found.quantiles[2] - series.output[now + 1 : now + 1 + N])
    known_, held = (np.sqrt((np.array(errors[k]) ** 2).mean(axis=0)) for k in (True, False))
    assert known_[-1] < 0.3 * held[-1] and abs(known_[3] - held[3]) < 0.3 * held[3]


def test_without_flows_before_the_origin_there_is_none(known):
    reach, series = known
    at = cut(series, 20 * N)
    inflow = at.inflow.copy()
    inflow[20 * N - 5] = np.nan
    with pytest.raises(NoDataError, match="not all logged"):
        forecast(reach, replace(at, inflow=inflow))


def logs(folder, series, announced):
    """Write CSV days of a river; for the last day only the flows, as far as they are announced."""
    folder.mkdir()
    rows = {}
    for k in range(len(series.time)):
        if k > series.now + announced:
            break
        time = series.moment(k)
        output = f"{series.output[k]:.3f}" if k <= series.now else ""
        rows.setdefault(time.date(), []).append(f"{time.isoformat()},{series.inflow[k]:.3f},{output}")
    for date, lines in rows.items():
        (folder / f"{date}.csv").write_text("time,u_Qi,Q_L\n" + "\n".join(lines) + "\n")
    return folder


CONFIG = '[reach]\nname = "gorge"\nkind = "river"\nsample_time = 900\n[input]\ntime_zone = "Etc/GMT+7"\n'


@pytest.fixture
def place(known, tmp_path):
    """Return logs with announced flows of four hours, a configuration and a model."""
    reach, series = known
    logs(tmp_path / "logs", series, 16)
    (tmp_path / "c.toml").write_text(CONFIG)
    written(reach, river()[1], tmp_path)
    return tmp_path


def test_the_command_writes_tables_page_and_json(place, known):
    words = ["forecast", place / "logs", "-c", place / "c.toml", "--model", place]
    code, output = command(*words, "--out", place / "out", "--hours", 12)
    assert code == 0 and "the discharge is" in " ".join(output.split()) and "forecast.html" in output
    table = pq.read_table(place / "out/forecast.parquet").to_pydict()
    assert len(table["time"]) == 48 and sum(table["announced"]) == 16 and table["reach"][0] == "gorge"
    assert table["time"][0] == known[1].moment(known[1].now + 1).astimezone(dt.UTC)
    rows = list(csv.DictReader((place / "out/forecast.csv").read_text().splitlines()))
    assert float(rows[3]["horizon_h"]) == 1.0 and rows[0]["outflow_m3s"] == ""
    page = (place / "out/forecast.html").read_text()
    assert "Hour by hour" in page and '<td class="num">' in page
    for text in ("the flows are not announced: the table has each", "the inflow of the day before (dotted)",
                 "dotted the inflow of the day before"):  # fmt: skip
        assert text in page
    code, output = command(*words, "--out", place / "o", "--hours", 6, "--no-figures", "--json")
    found = [json.loads(line) for line in output.splitlines()]
    assert len(found) == 24 and found[0]["low_90"] < found[0]["median"] < found[0]["high_90"]
    assert not (place / "o/forecast.html").exists()


def test_from_an_earlier_time_it_does_not_use_later_outputs(place):
    words = ["forecast", place / "logs", "-c", place / "c.toml", "--model", place, "--no-figures", "--json"]
    at = "2024-06-10T06:00"
    before = command(*words, "--at", at, "--out", place / "a")[1]
    for path in sorted((place / "logs").glob("*.csv")):
        if path.stem > "2024-06-10":
            lines = path.read_text().splitlines()
            spoilt = [line.rsplit(",", 1)[0] + ",999" for line in lines[1:]]
            path.write_text("\n".join([lines[0], *spoilt]) + "\n")
    assert command(*words, "--at", at, "--out", place / "b")[1] == before


def test_logs_finer_than_the_model_give_means_of_their_flows(place):
    words = ["forecast", place / "logs", "-c", place / "c.toml", "--model", place, "--no-figures", "--json"]
    _, expected = command(*words, "--out", place / "a")
    (place / "c.toml").write_text(CONFIG.replace("900", "300"))
    for path in (place / "logs").glob("*.csv"):
        head, *lines = path.read_text().splitlines()
        finer = [head]
        for line in lines:
            time, flow, output = line.split(",")
            for k in (-1, 0, 1):  # symmetric errors before and after: the mean is the flow
                at = dt.datetime.fromisoformat(time) + dt.timedelta(seconds=300 * (k + 1))
                finer.append(f"{at.isoformat()},{float(flow) + 9 * k:.3f},{output if k < 0 else ''}")
        path.write_text("\n".join(finer) + "\n")
    _, found = command(*words, "--out", place / "b")
    for one, other in zip(expected.splitlines(), found.splitlines(), strict=True):
        assert json.loads(other)["median"] == pytest.approx(json.loads(one)["median"], abs=1e-3)


def test_what_does_not_fit_is_refused(place):
    words = ["forecast", place / "logs", "--model", place, "--out", place / "out"]
    code, output = command(*words)
    assert code == 2 and "the model is of a river at 900 s" in output
    (place / "c.toml").write_text(CONFIG.replace("900", "600"))
    assert command(*words, "-c", place / "c.toml")[0] == 2
    with pytest.raises(ConfigError, match="calibration"):
        (place / "model.toml").write_text('name = "x"\n')
        rivid.load_model(place)
    with pytest.raises(ConfigError, match="nowhere does not exist: .* `rivid diagnose`"):
        rivid.load_model(place / "nowhere")


def test_a_pool_without_logged_outflow_is_refused(tmp_path):
    """Regression: it was simulated with an outflow of zero."""
    reach, record = pool("none")
    write_days(tmp_path / "logs", 1)
    model = rivid.load_model(written(reach, record, tmp_path))
    with pytest.raises(ConfigError, match="a forecast of a pool needs it"):
        model.forecast(tmp_path / "logs", {"input": {"u_Qo": ""}})


def test_from_python(place, known):
    found = rivid.load_model(place).forecast(place / "logs", place / "c.toml", hours=3)
    assert found.quantiles.shape == (5, 12) and found.announced == 12
    assert found.delay_s == pytest.approx(4.0 * 3600, rel=0.3)
