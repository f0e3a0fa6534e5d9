"""Test `rivid season`: rows equal those of the core, earlier results remain, refusals give their reason."""

import csv
import datetime as dt
import json
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from scipy.special import ndtr, stdtrit

from rivid.config import Config, parse
from rivid.core.law import BULK, delay_law
from rivid.core.season import season
from rivid.results.season import LAW_SCHEMA, SCHEMA, join, law_of, read_days
from rivid.results.store import DELAYS, to_table, write_parquet
from tests.daily import FIRST, write_days
from tests.run.test_run import rivid

FILES = ("season.csv", "season.parquet", "delay_law.csv", "delay_law.json")
GONE = (7, 8, 15)
N_DAYS = 22
T_S = 133.0


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def cells(rows, column):
    return np.array([float(row[column]) if row[column] else np.nan for row in rows])


def ask(data, out, *words):
    return rivid("run", data, "--out", out, "--no-figures", "--estimator", "posterior", *words)


def made(out, travel, flow, *, p=None, kind="pool", window=1, T_s=T_S, status=None, u_Qo="u_Qo"):
    """Write a finished run as tables and run.json: travel times [samples] and discharges, per day."""
    n = len(travel)
    config = parse(
        {"reach": {"name": "made", "kind": kind, "sample_time": T_s}, "run": {"estimators": ["posterior"]}},
        Config, "made",
    ).as_used()  # fmt: skip
    config["run"]["window_days"], config["input"]["u_Qo"] = window, u_Qo
    if p is None:
        p = np.full((n, 15), 0.02 / 14)
        p[np.arange(n), np.clip(np.nan_to_num(travel, nan=5.5).astype(int) - 1, 0, 14)] = 0.98
    dates = [FIRST + dt.timedelta(days=k) for k in range(n)]
    status = status or ["ok" if np.isfinite(x) else "unidentifiable" for x in travel]
    columns = {
        "date": dates, "reach": ["made"] * n, "estimator": ["posterior"] * n, "status": status,
        "delay_samples": (np.floor(travel + 0.5) if kind == "river" else np.floor(travel)).tolist(),
        "delay_s": (T_s * travel).tolist(), "mean_inflow_m3s": np.asarray(flow, float).tolist(),
    }  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    table = to_table(columns, DELAYS)
    write_parquet(table, out / "delays.parquet")
    pa.csv.write_csv(table, out / "delays.csv")
    rows, at = np.nonzero(np.isfinite(p))
    long = {
        "date": pa.array([dates[i] for i in rows], pa.date32()),
        "reach": ["made"] * len(rows),
        "estimator": ["posterior"] * len(rows),
        "delay_samples": pa.array(at + 1, pa.int64()),
        "probability": p[rows, at],
    }
    write_parquet(pa.table(long), out / "posterior.parquet")
    record = {
        "schema_version": 1, "reach": "made", "sample_time": T_s, "estimators": ["posterior"],
        "outputs": {"delays.parquet": "x"}, "config": config,
    }  # fmt: skip
    (out / "run.json").write_text(json.dumps(record))
    return out


def record_of(out):
    return json.loads((out / "run.json").read_text(encoding="utf-8"))


def law_days(seed, n=210, b=0.3, scatter=0.02):
    rng = np.random.default_rng(seed)
    Q = 300.0 * np.exp(0.5 * np.sin(np.arange(n) / 9.0 + rng.uniform(0, 6)) + 0.1 * rng.standard_normal(n))
    T = 7.0 * (Q / 300.0) ** -b * np.exp(scatter * rng.standard_normal(n))
    return T, Q


LONG = pytest.mark.long


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season") / "data"
    for k, date in enumerate(write_days(folder, N_DAYS)):
        if k in GONE:
            (folder / f"{date}.csv").unlink()
    return folder


@pytest.fixture(scope="module")
def done(data, tmp_path_factory):
    out = tmp_path_factory.mktemp("done") / "out"
    assert ask(data, out)[0] == 0
    code, output = rivid("season", out)
    assert code == 0
    return out, output


def test_each_calendar_day_has_the_row_of_the_core(done):
    out, _ = done
    rows = rows_of(out / "season.csv")
    assert list(rows[0]) == SCHEMA.names and len(rows) == N_DAYS
    assert [row["date"] for row in rows] == [str(FIRST + dt.timedelta(days=k)) for k in range(N_DAYS)]
    reach = record_of(out)["reach"]
    assert {(r["reach"], r["estimator"], r["direction"]) for r in rows} == {
        (reach, "posterior-season", "forward")
    }
    table = pq.read_table(out / "posterior.parquet").to_pandas()
    wide = table.pivot(index="date", columns="delay_samples", values="probability")
    p, Q = np.full((N_DAYS, 15), np.nan), np.full(N_DAYS, np.nan)
    at = [(date - FIRST).days for date in wide.index]
    p[at] = wide.to_numpy()
    delays = pq.read_table(out / "delays.parquet").to_pandas()
    Q[[(date - FIRST).days for date in delays["date"]]] = delays["mean_inflow_m3s"]
    core = season(p, None, Q)
    np.testing.assert_array_equal(cells(rows, "delay_samples"), core.delay)
    np.testing.assert_array_equal(cells(rows, "probability"), core.sure)
    assert [row["observed"] == "true" for row in rows] == core.observed.tolist()
    assert not core.observed[list(GONE)].any() and core.observed.sum() > 15
    for row, held in zip(rows, core.in_set, strict=True):
        held = core.candidates[held]
        assert (float(row["delay_low"]), float(row["delay_high"])) == (held.min(), held.max())


def test_parquet_and_csv_agree(done):
    out, _ = done
    table = pq.read_table(out / "season.parquet", page_checksum_verification=True)
    assert table.schema.equals(SCHEMA)
    rows = rows_of(out / "season.csv")
    for column in ("delay_samples", "delay_s", "probability", "delay_low", "delay_high"):
        np.testing.assert_array_equal(
            cells(rows, column), table[column].to_numpy(zero_copy_only=False).astype(float)
        )


def test_a_travel_time_lies_in_its_delay_and_is_the_days_own_where_that_agrees(done):
    out, _ = done
    rows = rows_of(out / "season.csv")
    delay, travel = cells(rows, "delay_samples"), cells(rows, "delay_s") / T_S
    np.testing.assert_array_equal(np.isfinite(delay), np.isfinite(travel))
    answered = np.isfinite(delay)
    assert (np.abs(travel - delay - 0.5)[answered] <= 0.6).all()  # alone, a tenth beyond its sample is right
    alone = {r["date"]: r for r in rows_of(out / "delays.csv")}
    agree = [r for r in rows if r["date"] in alone and r["delay_samples"]
             and float(r["delay_samples"]) == float(alone[r["date"]]["delay_samples"] or "nan")]  # fmt: skip
    assert len(agree) > 5
    assert all(r["delay_s"] == alone[r["date"]]["delay_s"] for r in agree)


def test_yesterdays_answers_stay_to_the_byte_when_days_are_added(tmp_path):
    whole, some, out = tmp_path / "whole", tmp_path / "some", tmp_path / "out"
    dates = write_days(whole, 18)
    some.mkdir()
    before = b""
    for first, last in ((0, 11), (11, 12), (12, 18)):
        for date in dates[first:last]:
            (some / f"{date}.csv").write_bytes((whole / f"{date}.csv").read_bytes())
        assert ask(some, out)[0] == 0 and rivid("season", out)[0] == 0
        text = (out / "season.csv").read_bytes()
        assert text.startswith(before) and text.count(b"\n") == last + 1
        before = text


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=LONG), 2])
def test_forward_answers_stay_to_the_byte_on_vague_days_of_any_discharge(seed, tmp_path):
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(15, 0.4), 70)
    p[rng.random(70) < 0.15] = np.nan
    Q = np.where(rng.random(70) < 0.2, np.nan, rng.uniform(100.0, 700.0, 70))
    Q[:seed] = np.nan
    travel = rng.uniform(3.0, 9.0, 70)
    before = b""
    for n in (33, 34, 70):
        out = made(tmp_path / "out", travel[:n], Q[:n], p=p[:n])
        assert rivid("season", out, "-q") == (0, "")
        text = (out / "season.csv").read_bytes()
        assert text.startswith(before)
        before = text


def test_both_ways_a_day_uses_the_later_ones(tmp_path):
    p = np.full((40, 15), 0.02 / 14)
    p[:, 4] = 0.98
    p[:3] = 1.0 / 15.0
    out = made(tmp_path / "out", np.full(40, 5.5), np.full(40, 300.0), p=p)
    assert rivid("season", out)[0] == 0
    forward = rows_of(out / "season.csv")
    assert forward[0]["delay_samples"] == "" and forward[0]["direction"] == "forward"
    code, output = rivid("season", out, "--both-ways")
    both = rows_of(out / "season.csv")
    assert code == 0 and "each day from all days" in output
    assert {row["direction"] for row in both} == {"both"} and both[0]["delay_samples"] == "5"


def test_today_is_left_out_until_its_log_is_closed(tmp_path):
    status = ["ok"] * 9 + ["pending"]
    p = np.full((10, 15), 1.0 / 15.0)
    p[9] = np.nan
    out = made(tmp_path / "out", np.r_[np.full(9, 6.5), np.nan], np.full(10, 300.0), p=p, status=status)
    assert rivid("season", out)[0] == 0
    assert len(rows_of(out / "season.csv")) == 9


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=LONG) for k in range(1, 6))])
def test_the_law_is_the_cores_and_holds_what_was_planted(seed, tmp_path):
    T, Q = law_days(seed)
    T[::17] = np.nan
    out = made(tmp_path / "out", T, Q)
    assert rivid("season", out, "-q")[0] == 0
    law = json.loads((out / "delay_law.json").read_text())
    p = read_days(out, record_of(out)).probability
    core = delay_law(Q, T_S * T, probability=p, edges=T_S * np.arange(1.0, 17.0))
    assert (law["T0"], law["b"], law["Q0"]) == pytest.approx((core.T0, core.b, core.Q0), rel=1e-12)
    plain = delay_law(Q, T_S * T)
    assert (core.b, core.b_high) == pytest.approx((plain.b, plain.b_high), rel=1e-3)
    assert law["status"] == "ok" and law["quantity"] == "travel time"
    sd = (law["b_high"] - law["b_low"]) / 3.29
    assert abs(law["b"] - 0.3) < 4.0 * sd and sd < 0.02
    assert law["scatter"] == pytest.approx(0.02, rel=0.3)
    table = rows_of(out / "delay_law.csv")
    assert list(table[0]) == LAW_SCHEMA.names and sum(int(r["n"]) for r in table) == core.days
    Q_class, delay = cells(table, "discharge_m3s"), cells(table, "delay_s")
    np.testing.assert_array_equal(delay, core.table.delay)
    # the medians of two days are means, of ln Q for the law and of Q for the column: they differ slightly
    np.testing.assert_allclose(delay, core.T0 * (Q_class / core.Q0) ** -core.b, rtol=1e-3)
    order = ["day_low_s", "delay_low_s", "delay_s", "delay_high_s", "day_high_s"]
    assert (np.diff([cells(table, name) for name in order], axis=0) > 0.0).all()
    assert (cells(table, "discharge_low_m3s")[1:] > cells(table, "discharge_high_m3s")[:-1]).all()


def test_new_days_lie_in_the_interval_of_a_single_day_as_often_as_its_tails_make_them():
    """Days follow the law with normal scatter: Student's t with the same bulk excludes less than a tenth."""
    held = []
    for seed in range(12):
        T, Q = law_days(seed)
        law = delay_law(Q, T)
        new, flow = law_days(seed + 100)
        share = np.interp(np.log(flow), np.log(law.table.discharge), law.table.day_high / law.table.delay)
        held.append(np.mean(np.abs(np.log(new / law.delay(flow)[0])) < np.log(share)))
    expected = 2.0 * ndtr(stdtrit(4.0, 0.95) * BULK) - 1.0
    assert 0.9 < expected < 0.93
    assert np.mean(held) == pytest.approx(expected, abs=4.0 * np.std(held, ddof=1) / np.sqrt(len(held)))


def test_without_a_law_the_table_is_empty_and_the_json_says_why(done):
    out, output = done
    assert rows_of(out / "delay_law.csv") == []
    law = json.loads((out / "delay_law.json").read_text())
    assert law["status"] == "too_few_days" and law["T0"] is None and law["covariance"] is None
    assert f"no law: {law['message']}" in output


def test_the_printed_summary_fits_eighty_columns(tmp_path):
    T, Q = law_days(1)
    T[40:42] = np.nan
    out = made(tmp_path / "out", T, Q)
    code, output = rivid("season", out)
    law = json.loads((out / "delay_law.json").read_text())
    assert code == 0
    assert max(map(len, output.splitlines()[:-1])) <= 80
    alone, joined = (
        np.isfinite(cells(rows_of(out / f), "delay_samples")) for f in ("delays.csv", "season.csv")
    )
    assert alone.sum() == 208 and joined[40:42].all()
    assert f"answered  208 alone, {joined.sum()} joined" in output
    assert f"{(joined & ~alone).sum()} new, {(alone & ~joined).sum()} gone" in output
    assert f"T = {law['T0']:.0f} s (Q / {law['Q0']:.0f})^-{law['b']:.2f}, {law['b_low']:.2f} to" in output
    assert len([line for line in output.splitlines() if " to " in line and line.startswith("   ")]) == 5


def test_a_run_keeps_the_files_of_season(data, tmp_path):
    out = tmp_path / "out"
    ask(data, out)
    before = record_of(out)
    assert rivid("season", out)[0] == 0
    assert record_of(out) == before
    wrote = {
        name: (out / name).read_bytes() for name in (*FILES, "figures/season.png", "figures/delay_law.png")
    }
    assert "0 estimated now" in ask(data, out)[1]
    assert rivid("run", data, "--out", out, "--estimator", "posterior")[0] == 0  # this draws its own figures
    assert rivid("figures", out)[0] == 0
    assert {name: (out / name).read_bytes() for name in wrote} == wrote
    assert rivid("season", out)[0] == 0
    assert {name: (out / name).read_bytes() for name in wrote} == wrote, "the same run, the same bytes"


def test_a_run_without_posterior_or_without_a_logged_outflow_is_refused(data, tmp_path):
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures", "--to", str(FIRST), "--estimator", "jmap")
    code, output = rivid("season", out)
    assert code == 2 and "has no posterior, only jmap" in output and "--estimator posterior" in output
    config = tmp_path / "c.toml"
    config.write_text('[input]\nu_Qo = ""\n')
    assert ask(data, out, "--config", config, "--to", FIRST)[0] == 0
    code, output = rivid("season", out)
    assert code == 2 and "outflow is not logged" in output and "surer than right" in output
    assert not (out / "season.csv").exists()


def test_what_is_no_finished_run_is_refused_and_nothing_is_made(tmp_path):
    assert rivid("season", tmp_path / "none")[0] == 10 and not (tmp_path / "none").exists()
    out = made(tmp_path / "out", np.full(5, 6.5), np.full(5, 300.0))
    (out / "run.json").write_text(json.dumps(record_of(out) | {"outputs": {}}))
    code, output = rivid("season", out)
    assert code == 10 and "did not finish" in output
    silent = made(tmp_path / "silent", np.full(5, np.nan), np.full(5, 300.0), p=np.full((5, 15), np.nan))
    assert rivid("season", silent)[0] == 10


def test_a_damaged_table_and_a_date_far_away_are_refused(tmp_path):
    out = made(tmp_path / "out", np.full(5, 6.5), np.full(5, 300.0))
    (out / "posterior.parquet").write_bytes(b"PAR1 no more")
    code, output = rivid("season", out)
    assert code == 1 and "run again" in output
    far = made(tmp_path / "far", np.full(2, 6.5), np.full(2, 300.0))
    table = pq.read_table(far / "delays.parquet")
    dates = pa.array([dt.date(1024, 5, 1), dt.date(2024, 5, 1)], pa.date32())
    write_parquet(table.set_column(0, "date", dates), far / "delays.parquet")
    code, output = rivid("season", far)
    assert code == 1 and "1024-05-01" in output


def test_a_reach_of_a_fleet_is_asked_for_by_name(tmp_path):
    for name in ("upper", "lower"):
        made(tmp_path / "fleet" / name, np.full(5, 6.5), np.full(5, 300.0))
    code, output = rivid("season", tmp_path / "fleet")
    assert code == 2 and "lower, upper" in output
    assert rivid("season", tmp_path / "fleet", "--reach", "../fleet/upper")[0] == 2
    assert rivid("season", tmp_path / "fleet", "--reach", "upper")[0] == 0
    assert (tmp_path / "fleet/upper/season.csv").exists()
    assert not (tmp_path / "fleet/lower/season.csv").exists()
    assert rivid("season", tmp_path / "fleet/upper", "--reach", "lower")[0] == 2


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=LONG) for k in (1, 2))])
@pytest.mark.parametrize("river", [False, True])
def test_a_place_is_the_quantile_of_travel_times_drawn_from_the_probabilities(seed, river, tmp_path):
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(15, 0.6), 3)
    kind = "river" if river else "pool"
    out = made(tmp_path / "out", np.full(3, 6.2), np.full(3, 300.0), p=p, kind=kind)
    days = read_days(out, record_of(out))
    n = 200_000
    for row, share in enumerate((0.05, 0.5, 0.95)):
        drawn = rng.choice(days.candidates, n, p=p[row]) + rng.uniform(0.0, 1.0, n) - 0.5 * river
        at = days.place(p, share)[row]
        assert np.mean(drawn <= at) == pytest.approx(share, abs=5.0 * np.sqrt(share * (1 - share) / n))


def test_windows_that_overlap_are_not_joined_with_each_other(tmp_path):
    rng = np.random.default_rng(5)
    p = rng.dirichlet(np.full(15, 0.5), 31)
    Q = rng.uniform(200.0, 400.0, 31)
    out = made(tmp_path / "out", np.full(31, 6.2), Q, p=p, kind="river", window=3)
    joined = join(read_days(out, record_of(out)))
    for first in range(3):
        alone = season(p[first::3], None, Q[first::3])
        np.testing.assert_array_equal(joined.probability[first::3], alone.probability)


def test_a_river_is_answered_by_its_t50_where_the_band_is_narrow(tmp_path):
    """Days of t50 between 9.2 and 9.8 have no delay that is probable enough for a pool's answer."""
    p = np.full((30, 15), 1e-9)
    p[:, [8, 9]] = 0.5
    p[12] = 1.0  # and a day without information
    p /= p.sum(axis=1, keepdims=True)
    out = made(tmp_path / "out", np.full(30, 9.45), np.full(30, 300.0), p=p, kind="river", T_s=900.0)
    days = read_days(out, record_of(out))
    joined = join(days)
    middle = days.place(joined.probability, 0.5)
    assert np.isfinite(joined.delay).sum() > 25
    answered = np.isfinite(joined.delay)
    np.testing.assert_array_equal(joined.delay[answered], np.floor(middle + 0.5)[answered])
    assert (np.abs(joined.travel[answered] / 900.0 - joined.delay[answered]) <= 0.5).all()
    law = law_of(days)
    assert law.status == "too_few_days"


def test_a_river_is_not_joined_both_ways(tmp_path):
    out = made(tmp_path / "out", np.full(6, 9.4), np.full(6, 300.0), kind="river", T_s=900.0)
    code, output = rivid("season", out, "--both-ways")
    assert code == 2 and "surer than right" in output and not (out / "season.csv").exists()
    code, output = rivid("season", out)
    assert code == 0 and "a river's days alone are as good" in output
    assert max(map(len, output.splitlines()[:-1])) <= 80
    assert json.loads((out / "delay_law.json").read_text())["quantity"] == "t50"


@pytest.mark.parametrize(
    ("given", "long", "short"),
    [
        ({}, T_S, T_S),
        ({"stamp": {"u_Qi": "end", "h_L": "instant"}}, 0.0, 0.0),
        ({"stamp": {"h_L": "instant"}, "interval": {"u_Qi": 3600.0}}, 0.0, 3600.0),
    ],
)
def test_the_doubt_of_stamps_that_are_not_declared_is_in_the_intervals(tmp_path, given, long, short):
    out = made(tmp_path, *law_days(1))
    record = record_of(out)
    record["config"]["input"] |= given
    days = read_days(out, record)
    law, alone = law_of(days), law_of(replace(days, doubt=(0.0, 0.0)))
    assert days.doubt == (long, short) and law.T0 == alone.T0 and law.b_low == alone.b_low
    assert law.T0_low == pytest.approx(alone.T0_low - long)
    assert law.T0_high == pytest.approx(alone.T0_high + short)
    assert np.allclose(law.table.high, alone.table.high + short)
    assert np.allclose(law.table.day_low, alone.table.day_low - long)
    at = law.table.discharge
    assert np.allclose(law.delay(at)[1], np.maximum(alone.delay(at)[1] - long, 0.0))
    assert np.allclose(law.delay(at)[2], alone.delay(at)[2] + short)
    assert np.allclose(law.delay(at), [law.table.delay, law.table.low, law.table.high], rtol=1e-3)
