"""Test `posterior` through `rivid run`: rows equal those of the core; days without a result have a reason."""

import csv
import datetime as dt
import json
import re

import numpy as np
import pyarrow.parquet as pq
import pytest

import rivid as rivid_package
from rivid.core.posterior.blind import posterior_blind
from rivid.core.posterior.daily import posterior
from rivid.core.posterior.river import posterior_river
from rivid.core.settings import GUARD, PosteriorSettings, RiverSettings, lags_of
from rivid.errors import RividError
from rivid.results.read import load_delays, load_results
from tests.daily import FIRST, a_day, text_of, write_days
from tests.run.test_estimators import deviations, estimator, open_loop, regulated, write
from tests.run.test_run import rivid

N_DAYS = 24
ASKED = ("--estimator", "posterior")
JMAP = ("--estimator", "jmap")


def rows_of(out, name="posterior"):
    with open(out / "delays.csv", encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["estimator"] == name]


def cell(value):
    """Return a cell as a number; NaN if it is empty."""
    return float(value) if value else np.nan


def noisy(columns, seed, size=1e-3):
    u, o, h = columns
    return u, o, h + size * np.random.default_rng(seed).normal(size=len(h))


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, N_DAYS)
    return folder


@pytest.fixture(scope="module")
def both(logs, tmp_path_factory):
    """Return OUT of a run of posterior and jmap, and the core's result of the same days."""
    out = tmp_path_factory.mktemp("both") / "out"
    assert rivid("run", logs, "--out", out, "--no-figures", *ASKED, "--estimator", "jmap")[0] == 0
    days = [a_day(FIRST + dt.timedelta(days=k)) for k in range(N_DAYS)]
    u, o, y = (np.stack([day[k] for day in days]) for k in (1, 2, 3))
    return out, posterior(u, y, o)


def test_a_row_equals_the_result_of_the_core(both):
    out, core = both
    rows = rows_of(out)
    assert "ok" in core.status and len(rows) == N_DAYS
    for row, i in zip(rows, range(N_DAYS), strict=True):
        ok = core.status[i] == "ok"
        assert row["status"] == ("ok" if ok else "unidentifiable")
        np.testing.assert_equal(cell(row["delay_samples"]), core.delay[i])
        np.testing.assert_equal(cell(row["delay_s"]), 133.0 * core.place[i] if ok else np.nan)
        assert cell(row["probability"]) == core.right[i]
        assert bool(row["message"]) == (not ok)
        for column in ("prior_only", "alpha", "noise_sd", "condition", "criterion"):
            assert row[column] == "", column


def test_the_set_is_the_smallest_that_holds_nine_tenths(both):
    out, core = both
    for row, p in zip(rows_of(out), core.probability, strict=True):
        held, mass = [], 0.0
        for d in sorted(core.candidates, key=lambda d, p=p: -p[d - 1]):
            held.append(int(d))
            mass += p[d - 1]
            if mass >= 0.9:
                break
        assert (float(row["delay_low"]), float(row["delay_high"])) == (min(held), max(held))
        assert not row["delay_samples"] or min(held) <= float(row["delay_samples"]) <= max(held)


def test_probabilities_and_the_spread_of_responses_have_their_tables(both):
    out, core = both
    ok = core.status == "ok"
    table = pq.read_table(out / "posterior.parquet").to_pandas()
    assert list(table.columns) == ["date", "reach", "estimator", "delay_samples", "probability"]
    assert set(table["estimator"]) == {"posterior"}
    wide = table.pivot(index="date", columns="delay_samples", values="probability")
    np.testing.assert_array_equal(wide.to_numpy(), core.probability)
    np.testing.assert_allclose(wide.sum(axis=1), 1.0, rtol=1e-12)
    fir = pq.read_table(out / "fir.parquet").to_pandas()
    assert fir[fir["estimator"] == "jmap"]["sd"].isna().all()
    found, jmap = load_results(out).estimators
    np.testing.assert_array_equal(found.criterion, core.probability)
    np.testing.assert_array_equal(found.probability, core.right)
    np.testing.assert_array_equal(found.fir[ok], core.fir[ok])
    np.testing.assert_array_equal(found.fir_sd[ok], core.fir_sd[ok])
    assert np.isnan(found.fir_sd[~ok]).all()
    assert (jmap.probability, jmap.delay_low, jmap.delay_high, jmap.fir_sd) == (None,) * 4
    assert load_delays(out)["probability"].notna().sum() == N_DAYS


def test_without_posterior_the_tables_have_no_probabilities(both, logs, tmp_path):
    out = tmp_path / "out"
    assert rivid("run", logs, "--out", out, "--no-figures", "--estimator", "jmap")[0] == 0
    assert pq.read_table(out / "posterior.parquet").num_rows == 0
    assert pq.read_table(out / "fir.parquet").column_names == ["date", "reach", "estimator", "lag", "value"]
    assert rows_of(out, "jmap") == rows_of(both[0], "jmap")
    assert "posterior" not in json.loads((out / "run.json").read_text())["config"]


def test_a_delay_outside_the_range_is_no_answer_but_a_bound(tmp_path):
    planted = [18, 20, 2, 7]
    data = write(tmp_path / "data", [noisy(open_loop(d, 30 + d), d) for d in planted])
    config = tmp_path / "c.toml"
    config.write_text("[posterior]\nd_min = 4\n")
    code, output = rivid("run", data, "--out", tmp_path / "out", "--config", config, *ASKED, "--no-figures")
    assert code == 0, "a day without an answer is no failure"
    rows = rows_of(tmp_path / "out")
    assert [r["status"] for r in rows] == ["unidentifiable"] * 3 + ["ok"]
    assert [r["at_bound"] for r in rows] == ["true"] * 3 + ["false"]
    assert [r["delay_samples"] + r["delay_s"] + r["probability"] for r in rows[:3]] == [""] * 3
    assert "d_max = 15" in rows[0]["message"] and "d_min = 4" in rows[2]["message"]
    assert rows[3]["delay_samples"] == "7"
    output = " ".join(output.split())
    assert "searched delays on 2 days: the delay is longer than d_max = 15: raise" in output
    assert "searched delays on 1 day: the delay is shorter than d_min = 4: lower" in output
    config.write_text("[posterior]\nd_max = 25\n")
    rivid("run", data, "--out", tmp_path / "out", "--config", config, *ASKED, "--no-figures")
    assert [r["delay_samples"] for r in rows_of(tmp_path / "out")] == [str(d) for d in planted]


def test_days_without_motion_or_front_are_unidentifiable(tmp_path):
    u, o, h = noisy(open_loop(6, 1), 1)
    rest, chance = np.full(650, 300.0), 118.0 + np.random.default_rng(5).normal(size=650)
    data = write(tmp_path / "data", [(u, o, h), (u, o, np.full(650, 118.0)), (rest, o, h), (u, o, chance)])
    assert rivid("run", data, "--out", tmp_path / "out", *ASKED, "--no-figures")[0] == 0
    rows = rows_of(tmp_path / "out")
    assert [r["status"] for r in rows] == ["ok"] + ["unidentifiable"] * 3
    assert "level does not move" in rows[1]["message"] and "inflow does not move" in rows[2]["message"]
    assert "no front" in rows[3]["message"]
    assert {r["probability"] for r in rows[1:]} == {""}


def test_a_day_below_answer_above_keeps_its_probabilities(logs, tmp_path):
    config = tmp_path / "c.toml"
    config.write_text("[posterior]\nanswer_above = 1.0\n")
    rivid("run", logs, "--out", tmp_path / "out", "--config", config, *ASKED, "--no-figures")
    rows = rows_of(tmp_path / "out")
    unsure = [r for r in rows if r["status"] == "unidentifiable"]
    assert unsure
    for row in unsure:
        assert "right with a probability below 1 ([posterior] answer_above)" in row["message"]
        assert float(row["probability"]) < 1 and row["delay_low"] and not row["delay_samples"]
    assert pq.read_table(tmp_path / "out" / "posterior.parquet").num_rows == 15 * N_DAYS


def test_it_works_without_the_outflow(tmp_path):
    data = write(tmp_path / "data", [noisy(regulated(6, seed), seed) for seed in range(6)])
    config = tmp_path / "c.toml"
    config.write_text('[input]\nu_Qo = ""\n')
    out = tmp_path / "out"
    assert rivid("run", data, "--out", out, "--config", config, *ASKED, "--no-figures")[0] == 0
    days = deviations([noisy(regulated(6, seed), seed) for seed in range(6)])
    core = posterior_blind(days.u, days.y)
    assert [cell(r["probability"]) for r in rows_of(out)] == pytest.approx(core.right, rel=1e-6)


@pytest.mark.parametrize("d_max", [5, 15, 27])
def test_a_day_is_long_enough_exactly_where_the_core_takes_it(d_max):
    made = estimator("posterior", posterior={"d_max": d_max})
    shortest = made.min_samples
    settings = PosteriorSettings(d_max=d_max)
    u, o, h = (values[None, :shortest] for values in noisy(open_loop(4, 2), 2))
    assert posterior(u, h, o, settings).status.shape == (1,)
    with pytest.raises(RividError, match=f"needs {shortest}"):
        posterior(u[:, 1:], h[:, 1:], o[:, 1:], settings)
    assert (made.needed_for, made.key) == (
        f"d_max = {d_max}",
        "[posterior] d_max",
    ) and shortest > d_max + GUARD


def test_a_river_has_the_probability_of_its_t50(tmp_path):
    """Three days with water 5 samples later and slightly spread: high flows are as fast as low ones."""
    rng = np.random.default_rng(3)
    lags = np.array([0, 0, 0, 0, 0.3, 0.4, 0.2, 0.1])
    flow = 300.0 + 60.0 * np.repeat(rng.standard_normal(3 * 24), 4)
    arrives = np.convolve(np.r_[np.full(len(lags), flow[0]), flow], lags)[len(lags) : len(lags) + len(flow)]
    arrives += 0.5 * rng.standard_normal(len(flow))
    data = tmp_path / "data"
    data.mkdir()
    for day in range(3):
        rows = ["time,u_Qi,Q_L"]
        for k in range(96):
            at = 96 * day + k
            rows.append(
                f"2024-05-0{day + 1}T{k // 4:02d}:{15 * (k % 4):02d}:00,{flow[at]:.3f},{arrives[at]:.3f}"
            )
        (data / f"2024-05-0{day + 1}.csv").write_text("\n".join(rows) + "\n")
    config, out = tmp_path / "c.toml", tmp_path / "out"
    config.write_text(
        '[reach]\nkind = "river"\nsample_time = 900\n[input]\ntime_zone = "Etc/GMT+7"\n'
        "[run]\nwindow_days = 3\n[posterior]\nd_max = 12\n"
    )
    assert rivid("run", data, "--out", out, "--config", config, *ASKED, "--no-figures")[0] == 0
    (row,) = (r for r in rows_of(out) if r["status"] == "ok")
    settings = RiverSettings(d_max=12, warm=lags_of(12), day=96)
    core = posterior_river(np.round(flow, 3)[None], np.round(arrives, 3)[None], settings)
    assert cell(row["delay_s"]) == pytest.approx(900.0 * core.place[0], rel=1e-6)
    assert row["t50_samples"] and cell(row["t50_samples"]) == pytest.approx(core.place[0], rel=1e-6)
    assert cell(row["delay_samples"]) == core.delay[0] == np.floor(core.place[0] + 0.5)
    assert cell(row["probability"]) == pytest.approx(core.right[0], rel=1e-6)
    assert core.place[0] == pytest.approx(4.5, abs=0.7)  # half has arrived between lags 4 and 5


def test_settings_of_posterior_repeat_only_its_own_work(logs, tmp_path):
    config = tmp_path / "c.toml"
    words = ("run", logs, "--out", tmp_path / "out", "--no-figures", "--to", "2008-03-13", "--config", config)
    for n, text, more in ((4, "", JMAP), (0, "0.9", JMAP), (4, "0.9", ASKED), (4, "0.8", ASKED)):
        config.write_text(f"[posterior]\nanswer_above = {text}\n" if text else "")
        assert f"{n} estimated now" in rivid(*words, *more)[1]


@pytest.mark.parametrize(("stamp", "doubt"), [({}, True), ({"u_Qi": "end"}, False)])
def test_an_hourly_pool_with_a_delay_below_one_sample_names_the_doubt_of_its_stamps(stamp, doubt):
    rng = np.random.default_rng(1)
    u, T, lag = 300 + np.repeat(rng.normal(0, 60, 120), 60), 3600, 50  # minutes
    arrived = np.roll(u, lag)
    o = np.roll(arrived, 30) + rng.normal(0, 5, u.size)
    level = 100 + np.cumsum((arrived - o) * 60 / 2e6)
    series = [x[::60][None, 1:] for x in (u, level + rng.normal(0, 0.003, u.size), o)]
    found = rivid_package.posterior(
        *series, config={"reach": {"sample_time": T}, "input": {"stamp": stamp}}, d_max=4
    )
    assert found.status[0] == "unidentifiable"
    assert "about one sample or less" in found.reason[0] and "shorter than" not in found.reason[0]
    assert ("3600 s longer if u_Qi is stamped" in found.reason[0]) is doubt


def test_a_length_that_is_ten_times_too_short_is_doubted(logs, tmp_path):
    """The doubt is on the terminal if there are delays; in the reason if the delay is beyond d_max."""
    (tmp_path / "short.toml").write_text("[reach]\nlength = 820\nwidth = 81.6\ndepth = 4.9\n")
    given = ("run", logs, "--config", tmp_path / "short.toml", "--no-figures", *ASKED)
    assert "by [reach] a wave takes 1.5 to 1.9 min: check length" in rivid(*given, "--out", tmp_path / "a")[1]
    with open(tmp_path / "short.toml", "a") as file:
        file.write("[posterior]\nd_max = 4\n")
    rivid(*given, "--out", tmp_path / "b")
    assert "check length, width and depth in [reach]" in rows_of(tmp_path / "b")[0]["message"]


def test_the_terminal_states_a_step_of_the_delay_with_its_date(tmp_path):
    """Regression: a clock that was changed in the fourth week was "delay 5 or 8 samples" alone."""
    logs = tmp_path / "logs"
    logs.mkdir()
    dates = [FIRST + dt.timedelta(days=k) for k in range(40)]
    for k, date in enumerate(dates):
        (logs / f"{date}.csv").write_text(text_of(date, delay=5 if k < 26 else 8), encoding="utf-8")
    asked = ("run", logs, "--out", tmp_path / "out", "--no-figures", "--estimator", "posterior")
    output = " ".join(rivid(*asked)[1].split())
    assert re.search(
        rf"delay moved: \d samples \([^)]*\) since {dates[26]}, \d samples \([^)]*\) before", output
    ), output
    few = " ".join(rivid(*asked[:3], tmp_path / "few", *asked[4:], "--to", dates[20])[1].split())
    assert "posterior" in few and "moved" not in few
