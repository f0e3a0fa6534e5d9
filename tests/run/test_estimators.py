"""Test the paper's other estimators through `rivid run`: results, limits, and answers at the bounds."""

import csv
import datetime as dt
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from rivid.config import Config, parse
from rivid.core.cusum import cusum
from rivid.core.fir import jmap, map_fir, ml
from rivid.errors import ConfigError
from rivid.estimators import ESTIMATORS, Answer, Days, Estimator, Prepared, build, register
from rivid.results.read import load_results
from tests.daily import FIRST, ZONE, a_day, write_days
from tests.run.test_run import bytes_of, rivid

ALPHA_I, ALPHA_O, K_Q, K_H = 2.0e-4, 2.2e-4, 0.9, -800.0


def programme(rng, n):
    """Return a flow with occasional steps [m3/s]."""
    return 300.0 + np.cumsum((rng.random(n) < 0.15) * rng.normal(scale=12.0, size=n))


def open_loop(d, seed, n=650):
    """Simulate (8), sample by sample, with an outflow independent of the level."""
    rng = np.random.default_rng([seed, d])
    u, o, h = programme(rng, n), programme(rng, n), np.zeros(n)
    for k in range(1, n):
        arrived = u[k - 1 - d] - u[0] if k - 1 - d >= 0 else 0.0
        h[k] = h[k - 1] + ALPHA_I * arrived - ALPHA_O * (o[k - 1] - o[0])
    return u, o, 118.0 + h


def regulated(d, seed, n=650):
    """Simulate (8) and (9), sample by sample, which together are (10)."""
    rng = np.random.default_rng([seed, d])
    u, o, h = programme(rng, n), np.zeros(n), np.zeros(n)
    for k in range(n):
        if k:
            arrived = u[k - 1 - d] - u[0] if k - 1 - d >= 0 else 0.0
            h[k] = h[k - 1] + ALPHA_I * arrived - ALPHA_O * o[k - 1]
        o[k] = K_Q * (u[k] - u[0]) - K_H * h[k]
    return u, o + 300.0, 118.0 + h


def write(folder, days):
    """Write a log of each day with all digits."""
    folder.mkdir()
    for i, columns in enumerate(days):
        date = FIRST + dt.timedelta(days=i)
        midnight = dt.datetime.combine(date, dt.time(), ZONE)
        rows = ["time,u_Qi,u_Qo,h_L"]
        for k, (q, o, h) in enumerate(zip(*columns, strict=True)):
            time = (midnight + dt.timedelta(seconds=133 * k)).isoformat()
            rows.append(f"{time},{float(q)!r},{float(o)!r},{float(h)!r}")
        (folder / f"{date}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


def deviations(columns):
    u, o, h = (np.stack(x) for x in zip(*columns, strict=True))
    return Days(u - u[:, :1], h - h[:, :1], o - o[:, :1], u[:, 0])


def estimator(name, **tables):
    (made,) = build(parse({"run": {"estimators": [name]}, **tables}, Config)).values()
    return made


def rows_of(out):
    with open(out / "delays.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, 6)
    return folder


@pytest.fixture(scope="module")
def all_of_them(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("all") / "out"
    words = [word for name in ESTIMATORS for word in ("--estimator", name)]
    code, output = rivid("run", logs, "--out", out, "--no-figures", *words)
    assert code == 0
    return out, output


@pytest.mark.parametrize(("name", "water"), [("direct", open_loop), ("indirect", regulated)])
def test_the_searches_find_every_delay_of_their_own_model(name, water):
    search = estimator(name)
    for seed in range(2):
        answer = search.estimate(deviations([water(d, seed) for d in range(1, 16)]))
        assert answer.delay.tolist() == list(range(1, 16))
        assert (answer.status == "ok").all()
        assert (answer.noise_variance < 1e-18).all(), "the model is exact: nothing is left over"
    days = deviations([open_loop(20, seed) for seed in range(5)])
    assert (estimator("direct").estimate(days).delay == 15).all(), "the longest candidate"
    assert (estimator("direct", search={"d_max": 25}).estimate(days).delay == 20).all()


@pytest.mark.parametrize(("name", "water"), [("direct", open_loop), ("indirect", regulated)])
def test_delays_found_from_logs_are_marked_at_the_edges_of_the_search(name, water, tmp_path):
    delays = [1, 2, 5, 7, 11, 14, 15]
    data = write(tmp_path / "data", [water(d, 9) for d in delays])
    out = tmp_path / "out"
    assert rivid("run", data, "--out", out, "--estimator", name)[0] == 0
    rows = rows_of(out)
    assert [float(r["delay_samples"]) for r in rows] == delays
    assert [float(r["delay_s"]) for r in rows] == [133.0 * d for d in delays]
    assert [r["status"] for r in rows] == ["ok"] * 7
    assert [r["at_bound"] for r in rows] == ["true", *["false"] * 5, "true"]
    assert [len(r["message"]) > 0 for r in rows] == [True, *[False] * 5, True]
    assert "shortest" in rows[0]["message"] and "longest" in rows[-1]["message"]
    for column in ("prior_only", "alpha", "roughness_sd", "condition", "t50_samples", "probability"):
        assert {r[column] for r in rows} == {""}, column
    assert pq.read_table(out / "fir.parquet").num_rows == 0
    curve = pq.read_table(out / "criterion.parquet").to_pandas().pivot(index="date", columns="delay_samples")
    assert curve["criterion"].idxmin(axis=1).tolist() == delays
    assert [float(r["criterion"]) for r in rows] == curve["criterion"].min(axis=1).tolist()


@pytest.mark.parametrize(("name", "fit"), [("cusum-ml", ml), ("cusum-map", map_fir)])
def test_cusum_rows_are_the_test_on_that_fir(name, fit, all_of_them):
    out, _ = all_of_them
    results = load_results(out)
    found = next(e for e in results.estimators if e.estimator == name)
    columns = [a_day(date) for date in found.dates]
    u, y = (np.stack([c[k] for c in columns]) for k in (1, 3))
    response = fit(u - u[:, :1], y - y[:, :1])
    expected = cusum(response.fir)
    assert found.status == expected.status.tolist() and "ok" in found.status
    days = expected.identifiable
    np.testing.assert_array_equal(found.delay, expected.delay)
    np.testing.assert_array_equal(found.fir[days], response.fir[days])
    np.testing.assert_array_equal(found.criterion[days], expected.decision[days, 2:17])
    edge = np.isin(expected.delay, (1, 15))
    np.testing.assert_array_equal(found.at_bound, edge)
    assert [bool(m) for m in found.messages] == (edge | ~days).tolist()


def test_cusum_takes_its_settings_from_its_table():
    columns = [a_day(FIRST + dt.timedelta(days=k)) for k in range(30)]
    days = deviations([(u, o, h) for _, u, o, h in columns])
    table = {"threshold": 4.0, "drift": 1.0, "mean_lags": 5, "moment": "alarm", "d_min": 2, "d_max": 7}
    answer = estimator("cusum-ml", cusum=table).estimate(days)
    expected = cusum(ml(days.u, days.y).fir, **table)
    np.testing.assert_array_equal(answer.delay, expected.delay)
    np.testing.assert_array_equal(answer.status, expected.status)
    assert 0 < expected.identifiable.sum() < 30
    assert all("beyond d_max = 7" in r or "no change" in r for r in answer.reason[~expected.identifiable])


def test_jmap_uniform_estimated_is_table_vi_without_the_terms_of_the_delay(all_of_them):
    (found,) = [e for e in load_results(all_of_them[0]).estimators if e.estimator == "jmap-uniform-estimated"]
    columns = [a_day(date) for date in found.dates]
    u, y = (np.stack([c[k] for c in columns]) for k in (1, 3))
    u, y = u - u[:, :1], y - y[:, :1]
    np.testing.assert_array_equal(found.delay, jmap(u, y, prior="uniform").delay)
    # except for -2 ln d, such a wide Rayleigh prior changes the criterion by d^2 / sigma_d^2 < 3e-6
    wide = jmap(u, y, delay_scale=1e4)
    low = found.criterion - found.criterion.min(axis=1, keepdims=True)
    terms = -2 * np.log(found.candidates)
    high = wide.criterion - terms
    same = abs(wide.alpha / found.alpha - 1) < 1e-9  # variances depend on the selected delay
    assert same.any()
    np.testing.assert_allclose(
        low[same], (high - high.min(axis=1, keepdims=True))[same], rtol=1e-6, atol=5e-6
    )


def moves(config):
    """Return the lag of the largest move of the level: a poor estimator, to test the needs of a new one."""
    candidates = np.arange(config.jmap.d_min, config.jmap.d_max + 1)

    def estimate(days):
        size = np.abs(np.diff(days.y, axis=1))[:, candidates]
        ok = days.u.any(axis=1)
        return Answer(
            status=np.where(ok, "ok", "unidentifiable"),
            delay=np.where(ok, candidates[np.argmax(size, axis=1)], np.nan),
            candidates=candidates,
            curve=-size,
        )

    return Prepared(estimate, candidates[-1] + 2, "the last candidate", "[jmap] d_max")


def test_a_registered_estimator_runs_from_logs_to_report(logs, tmp_path):
    config, out = tmp_path / "c.toml", tmp_path / "out"
    config.write_text("[run]\nestimators = ['moves', 'jmap']\n")
    register(Estimator("moves", "largest move of the level", moves, has_fir=False, notes_bound=True))
    try:
        with pytest.raises(ValueError, match="exists already"):
            register(ESTIMATORS["moves"])
        assert rivid("run", logs, "--out", out, "--config", config, "--workers", 1)[0] == 0
        found = load_results(out).estimators[0]
        assert found.estimator == "moves" and found.status == ["ok"] * 6
        assert found.delay.tolist() == found.candidates[np.argmin(found.criterion, axis=1)].tolist()
        names = {p.stem for p in (out / "figures").iterdir()}
        assert {"histogram_moves", "delay_map_moves", "delay_discharge_moves"} <= names
        assert "tdr_moves" not in names, "it has no impulse response"
        assert "largest move of the level" in (out / "report.html").read_text(encoding="utf-8")
    finally:
        del ESTIMATORS["moves"]
    assert ESTIMATORS["moves"].words == "moves", "results outlive the estimator that made them"
    with pytest.raises(ConfigError, match="'moves' is not an estimator; valid: ml, map"):
        parse({"run": {"estimators": ["moves"]}}, Config)


def test_figures_and_report_leave_out_what_an_estimator_lacks(logs, tmp_path):
    out, shown = tmp_path / "out", ("direct", "cusum-ml", "ml")
    assert rivid("run", logs, "--out", out, *(w for name in shown for w in ("--estimator", name)))[0] == 0
    names = {p.stem for p in (out / "figures").iterdir()}
    for name in shown:
        assert (f"tdr_{name}" in names) == (name != "direct")
        for kind in ("histogram", "delay_map", "delay_discharge"):
            assert (f"{kind}_{name}" in names) == (name != "ml")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert all(f"<code>{name}</code>" in page for name in shown)


def test_every_estimator_has_rows_and_the_same_bytes_in_any_batches(logs, all_of_them, tmp_path):
    (whole, output), out = all_of_them, tmp_path / "out"
    assert [r["estimator"] for r in rows_of(whole)] == list(ESTIMATORS) * 6
    assert all(f"  {name} " in output for name in ESTIMATORS)
    assert [line for line in output.splitlines() if len(line) > 80 and not line.startswith("delays: ")] == []
    words = [word for name in ESTIMATORS for word in ("--estimator", name)]
    for last in ("2008-03-11", "2008-03-20"):
        rivid("run", logs, "--out", out, "--no-figures", "--to", last, *words)
    assert bytes_of(out) == bytes_of(whole)
    by_name = {e.estimator: e for e in load_results(whole).estimators}
    for name in ("direct", "indirect"):
        assert by_name[name].fir.shape == (6, 0)
        assert by_name[name].candidates.tolist() == list(range(1, 16))
        assert np.isfinite(by_name[name].criterion).all() and np.isfinite(by_name[name].noise_sd).all()
    assert by_name["cusum-ml"].fir.shape == (6, 30)


def test_a_still_level_and_an_outflow_that_copies_the_inflow_are_unidentifiable(tmp_path):
    u, o, h = open_loop(5, 1)
    level, copy = np.full(650, 118.0), np.r_[np.full(5, u[0]), u[:-5]]
    data = write(tmp_path / "data", [(u, o, h), (u, o, level), (u, copy, h), (u, np.full(650, 300.0), h)])
    words = ("--estimator", "direct", "--estimator", "indirect", "--no-figures")
    assert rivid("run", data, "--out", tmp_path / "out", *words)[0] == 0
    direct, indirect = load_results(tmp_path / "out").estimators
    assert direct.status == ["ok", "unidentifiable", "unidentifiable", "unidentifiable"]
    assert "level does not move" in direct.messages[1] and "gauge stuck?" in indirect.messages[1]
    assert "move as one" in direct.messages[2] and "outflow never moves" in direct.messages[3]
    assert indirect.status == ["ok", "unidentifiable", "ok", "ok"]
    assert np.isnan(direct.delay[1:]).all()


def test_a_day_too_short_for_the_longest_delay_fails_and_names_the_key(tmp_path, logs):
    config = tmp_path / "c.toml"
    config.write_text("[search]\nd_max = 700\n[run]\nestimators = ['jmap', 'direct']\n")
    code, output = rivid("run", logs, "--out", tmp_path / "out", "--config", config, "--no-figures")
    assert code == 3
    jmap_rows, direct = load_results(tmp_path / "out").estimators
    assert jmap_rows.status == ["ok"] * 6 and direct.status == ["failed"] * 6
    remedy = "set [run] window_days = 2 or more, or lower [search] d_max"
    assert f"650 samples are too few for d_max = 700: {remedy}" in direct.messages[0]
    assert output.count(" failed: 650 samples") == 1 and "(6 days)" in output


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[reach]\nkind = "river"\n[run]\nestimators = ["map", "indirect"]\n', ["indirect", "river"]),
        ('[input]\nu_Qo = ""\n[run]\nestimators = ["direct"]\n', ["direct", "u_Qo", "outflow"]),
        ('[cusum]\nd_max = 28\n[run]\nestimators = ["cusum-ml"]\n', ["[cusum] d_max = 28", "order >= 31"]),
        ("[search]\nd_min = 9\nd_max = 4\n[run]\nestimators = ['direct']\n", ["[search] d_min = 9"]),
    ],
)
def test_what_cannot_be_estimated_is_refused_before_any_work(text, words, tmp_path, logs):
    config = tmp_path / "c.toml"
    config.write_text(text)
    code, output = rivid("run", logs, "--out", tmp_path / "out", "--config", config)
    assert code == 2 and not (tmp_path / "out").exists()
    assert all(word in output for word in words), output


def test_settings_of_an_estimator_that_is_not_run_repeat_nothing(tmp_path, logs):
    data, config = shutil.copytree(logs, tmp_path / "data"), tmp_path / "c.toml"
    words = ("run", data, "--out", tmp_path / "out", "--no-figures", "--config", config)
    for n, text in (
        (6, ""),
        (0, "[cusum]\nthreshold = 3.0\n[search]\nd_max = 20\n"),
        (6, "[cusum]\nthreshold = 3.0\n[run]\nestimators = ['cusum-ml']\n"),
        (6, "[cusum]\nthreshold = 4.0\n[run]\nestimators = ['cusum-ml']\n"),
    ):
        config.write_text(text)
        assert f"{n} estimated now" in rivid(*words)[1]
