"""Test the library: the same results as the commands, frozen, with a repr and a figure."""

import dataclasses
import datetime as dt
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import rivid
from rivid.api.diagnosis import DiagnosisResult
from rivid.api.estimate import describe_days, describe_delay
from rivid.cli import cli
from rivid.config import Config
from rivid.core.fir import jmap as core_jmap
from rivid.diagnosis.result import VERDICTS
from rivid.effects import effect_classes
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from tests.daily import write_days
from tests.diagnosis.answers import diagnosis, evidence_of

ROOT = Path(__file__).parents[1]
WEEK = ROOT / "sample_data" / "basse_isere_csv"
CONFIG = ROOT / "configs" / "posterior.toml"
SHORT = {"reach": {"sample_time": 900.0}, "days": 20, "seed": 2}


@pytest.fixture(scope="module")
def day():
    return rivid.read_day(WEEK / "2008-03-14.csv", config=CONFIG)


@pytest.fixture(scope="module")
def season():
    return rivid.simulate(days=4, seed=1)


def is_png(figure):
    return figure._repr_png_().startswith(b"\x89PNG")


def test_estimates_equal_those_of_rivid_run(tmp_path):
    argv = [
        "run",
        str(WEEK),
        "--config",
        str(CONFIG),
        "--out",
        str(tmp_path / "out"),
        "--quiet",
        "--no-figures",
    ]
    argv += ["--estimator", "jmap", "--estimator", "posterior"]
    assert CliRunner().invoke(cli, argv).exit_code in (0, None)
    rows = {
        (r["date"], r["estimator"]): r for r in pq.read_table(tmp_path / "out/delays.parquet").to_pylist()
    }
    assert len(rows) == 14
    for date in sorted({date for date, _ in rows})[::3]:
        one = rivid.read_day(WEEK, date, CONFIG)
        run, found = rows[date, "jmap"], rivid.jmap(one)
        assert (run["delay_samples"], run["status"]) == (found.delay, found.status)
        assert run["alpha"] == pytest.approx(found.alpha) and run["prior_only"] == found.prior_only
        run, found = rows[date, "posterior"], rivid.posterior(one)
        assert run["status"] == found.status and run["message"] == str(found.reason)
        assert run["probability"] == pytest.approx(found.probability)
        if found.status == "ok":
            assert (run["delay_samples"], run["delay_low"]) == (found.delay, found.delay_low)
            assert run["delay_s"] == run["travel_time_s"] == pytest.approx(found.travel * one.sample_time)
        run = rows[date, "jmap"]
        assert run["travel_time_s"] == run["delay_s"] + one.sample_time / 2  # in samples d to d + 1


def test_a_day_has_a_repr_and_cannot_be_changed(day):
    assert repr(day) == "Day(2008-03-14, basse-isere: 650 samples of 133 s, inflow 350 to 452 m3/s)"
    assert day.u[0] == day.y[0] == day.o[0] == 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        day.inflow = np.zeros(3)
    with pytest.raises(ValueError, match="read-only"):
        day.inflow[0] = 1.0
    mine = np.arange(5.0)
    copied = rivid.Day(mine, mine)
    mine[0] = 99.0
    assert copied.inflow[0] == 0.0


def test_arrays_and_a_day_give_the_same_estimate(day):
    of_day, of_arrays = rivid.jmap(day), rivid.jmap(day.u, day.y, day.config.jmap_settings())
    core = core_jmap(day.u, day.y, day.config.jmap_settings())
    for name in ("delay", "alpha", "fir", "criterion"):
        np.testing.assert_array_equal(getattr(of_day, name), getattr(core, name))
        np.testing.assert_array_equal(getattr(of_arrays, name), getattr(core, name))
    assert of_day.sample_time == 133.0 and of_arrays.sample_time is None


def test_changes_reach_the_estimators_and_rounding_noise_is_no_motion(day):
    noise = np.random.default_rng(1).standard_normal((2, 650))
    still = rivid.Day(300.0 + 1e-9 * noise[0], noise[1])
    assert not still.u.any() and rivid.jmap(still).status == "unidentifiable"
    assert rivid.jmap(day, prior="uniform", alpha=1e4).alpha == 1e4
    assert rivid.posterior(day, d_max=9).candidates[-1] == 9
    assert rivid.posterior(day, answer_above=1.0).status == "unidentifiable"


def test_a_river_has_its_travel_time_around_the_delay():
    """Regression: of d = 5, which is t50 rounded, it was that of a jump between 5 and 6 samples."""
    rng = np.random.default_rng(3)
    flow = 300.0 + 60.0 * np.repeat(rng.standard_normal(96), 4)
    late = np.convolve(np.r_[np.full(8, flow[0]), flow], [0, 0, 0, 0, 0.3, 0.4, 0.2, 0.1])[8:-7]
    river = {"reach": {"kind": "river", "sample_time": 900}, "posterior": {"d_max": 12}}
    found = rivid.posterior(flow, late + 0.5 * rng.standard_normal(len(flow)), config=river)
    assert abs(found.travel - found.delay) <= 0.5
    low, high = ((found.delay + side) * 15 for side in (-0.5, 0.5))
    assert f"({low:g} to {high:g} min)" in str(found)


def test_posterior_of_arrays_is_that_of_days(season):
    days = [season.day(i) for i in range(4)]
    many = rivid.posterior(*(np.stack([getattr(one, name) for one in days]) for name in "uyo"))
    assert many.probabilities.shape == (4, len(many.candidates))
    for i, one in enumerate(days):
        single = rivid.posterior(one)
        np.testing.assert_allclose(single.probabilities, many.probabilities[i], rtol=1e-9)
        assert single.probabilities.shape == many.candidates.shape
    one = days[0]
    blind = rivid.posterior(one.u, one.y)  # without the outflow
    assert blind.fir.ndim == 1 and not np.array_equal(blind.probabilities, many.probabilities[0])


@pytest.mark.parametrize(
    "call, kind, expected",
    [
        (lambda d: rivid.jmap(d.u), ConfigError, "y is missing"),
        (lambda d: rivid.jmap(d, d.y), ConfigError, "a day has its own series"),
        (lambda d: rivid.posterior(d.u), ConfigError, "the output is missing"),
        (lambda d: rivid.posterior(d, o=d.o), ConfigError, "a day has its own series"),
        (lambda d: rivid.posterior(d, dmax=3), ConfigError, "unknown key posterior.dmax"),
        (lambda d: rivid.posterior(d.u, d.y[:-1]), RividError, "y has shape"),
        (lambda d: rivid.posterior(d.u[:20], d.y[:20]), RividError, "too few"),
        (lambda d: rivid.posterior(d.u, np.full_like(d.y, np.nan)), RividError, "not finite"),
        (lambda d: rivid.read_day(WEEK), ConfigError, "holds 7 days"),
        (lambda d: rivid.read_day(WEEK, "2009-01-01"), NoDataError, "no log of 2009-01-01"),
        (lambda d: rivid.read_day(WEEK, "14 March"), ConfigError, "expected a date like"),
        (lambda d: rivid.read_day(WEEK / "none.csv"), NoDataError, "does not exist"),
        (lambda d: rivid.read_day(WEEK, config={"reach": {"lenght": 1}}), ConfigError, "reach.lenght"),
        (lambda d: rivid.simulate(dayz=3), ConfigError, "dayz"),
        (lambda d: rivid.Day(d.u, d.y[:-1]), RividError, "output has shape"),
        (lambda d: rivid.Day(d.u[None], d.y[None]), RividError, "inflow has shape"),
        (lambda d: rivid.Day(d.u, np.where(d.hours, d.y, np.nan)), RividError, "not finite at sample 0"),
        (lambda d: rivid.simulate(ROOT / "configs/scenarios/cascade.toml"), ConfigError, "cascade"),
    ],
)
def test_errors_are_one_line(day, call, kind, expected):
    with pytest.raises(kind, match=expected) as error:
        call(day)
    assert "\n" not in str(error.value)


def test_consecutive_days_are_one_data_set_and_an_unreadable_log_is_named(tmp_path):
    (tmp_path / "2008-03-14.csv").write_text("time,u_Qi,u_Qo,h_L\n2008-03-14T00:00:00+01:00,x,1,2\n")
    with pytest.raises(DataError, match="2008-03-14.csv"):
        rivid.read_day(tmp_path)
    two = rivid.read_day(WEEK, "2008-03-12", {"run": {"window_days": 2}})
    assert (two.date, len(two.inflow)) == (dt.date(2008, 3, 12), 1300)
    with pytest.raises(NoDataError, match="2008-03-09"):
        rivid.read_day(WEEK, "2008-03-10", {"run": {"window_days": 2}})


def test_a_simulated_season_keeps_its_truth_and_gives_days(season):
    assert set(season.delay.tolist()) == {8}
    assert repr(season).startswith("SimulatedSeason(reach, 4 days from 2008-01-01, seed 1")
    np.testing.assert_array_equal(season.day(2).inflow, season.inflow[2])
    np.testing.assert_array_equal(season.day("2008-01-03").inflow, season.inflow[2])
    assert isinstance(season.config, Config)
    for which in (4, "2010-01-01"):
        with pytest.raises(NoDataError):
            season.day(which)


def test_gaps_of_the_gauge_are_filled_and_counted_and_a_seed_gives_one_season():
    a, b, c = (rivid.simulate(days=2, seed=s, level={"gaps_per_day": 20.0}) for s in (4, 4, 2))
    np.testing.assert_array_equal(a.level, b.level)
    assert not np.array_equal(a.level, c.level)
    gaps = np.isnan(a.level[0])
    one = a.day(0)
    assert one.n_filled == gaps.sum() > 0
    np.testing.assert_array_equal(one.output[~gaps], a.level[0][~gaps])


def test_a_shorter_season_keeps_the_share_of_missing_days():
    year = {"days": 366, "missing_days": 34}
    assert [len(rivid.simulate(year, seed=3, **given).dates) for given in (
        {"days": 12}, {"days": 6, "missing_days": 0}, {"days": 6, "missing_days": 2}
    )] == [11, 6, 4]  # fmt: skip


def test_a_diagnosis_has_a_repr_a_summary_and_a_figure():
    evidence = evidence_of()
    result = DiagnosisResult(diagnosis("explained", evidence), evidence, Config())
    assert repr(result) == "DiagnosisResult(reach: explained, diurnal_inflow)"
    assert str(result).count("\n") > 1 and is_png(result.plot())


@pytest.mark.long
def test_a_diagnosis_of_a_season_with_one_candidate_effect_writes_its_files(tmp_path):
    made = rivid.simulate(SHORT)
    others = sorted(set(effect_classes(None)) - {"leakage"})
    reach = made.config.model_dump(exclude_unset=True)
    result = rivid.diagnose(made, reach | {"diagnose": {"exclude": others, "most_effects": 1}})
    assert result.verdict in VERDICTS and result.evidence.record.days == 20 and is_png(result.plot())
    page = result.write(tmp_path / "out")
    there = {path.name for path in (tmp_path / "out").iterdir()}
    assert page.exists() and {"diagnosis.json", "diagnosis.html", "model.toml"} <= there


def test_days_that_are_left_out_and_why_are_on_the_page_of_a_diagnosis(tmp_path):
    first, *_, last = write_days(tmp_path / "logs", 4)
    copy = (tmp_path / "logs" / f"{first}.csv").read_text().replace(str(first), str(last))
    (tmp_path / "logs" / f"{last}.csv").write_text(copy)
    result = rivid.diagnose(tmp_path / "logs")
    assert result.reason.startswith("2 days can be used") and len(result.notes) == 1
    assert result.notes[0].startswith(f"left out; rivid check finds: {first}, {last} (2 days): the same")
    assert result.notes[0].split("(")[0] in result.write(tmp_path / "out").read_text()
    for date in (first, last):
        (tmp_path / "two").mkdir(exist_ok=True)
        (tmp_path / "two" / f"{date}.csv").write_bytes((tmp_path / "logs" / f"{date}.csv").read_bytes())
    with pytest.raises(NoDataError, match="no day is left; left out; rivid check finds"):
        rivid.diagnose(tmp_path / "two")


def test_too_few_days_give_a_result_and_no_days_an_error(season):
    few = rivid.diagnose(season)
    assert few.verdict == "insufficient_data" and few.evidence is None and is_png(few.plot())
    with pytest.raises(NoDataError, match="no simulated day"):
        rivid.diagnose(season, first="2011-01-01")


def test_every_result_has_a_short_repr_and_a_figure(day, season):
    u, y, o = (np.stack([getattr(season.day(i), name) for i in range(4)]) for name in "uyo")
    still = rivid.posterior(np.zeros(650), day.y)
    assert "does not move" in repr(still)
    for result in (
        day, rivid.jmap(day), rivid.jmap(u, y), rivid.posterior(day), rivid.posterior(u, y, o), still, season,
    ):  # fmt: skip
        assert len(repr(result)) < 160 and "\n" not in repr(result)
        assert is_png(result.plot())
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, dataclasses.fields(result)[0].name, None)


def test_figures_keep_the_settings_of_matplotlib_and_functions_their_names():
    """Modules with the same names as functions do not replace them."""
    code = (
        "import sys, matplotlib, rivid\n"
        # rcParams["backend"] would import pyplot
        "before = dict(dict.items(matplotlib.rcParams))\n"
        f"rivid.read_day({str(WEEK / '2008-03-14.csv')!r}).plot()._repr_png_()\n"
        "print(dict(dict.items(matplotlib.rcParams)) == before, 'matplotlib.pyplot' in sys.modules)\n"
        "import rivid.simulation.season, rivid.diagnosis.workflow, rivid.core.fir, rivid.core.posterior\n"
        "import rivid.cli.simulate, rivid.cli.diagnose\n"
        "print({type(getattr(rivid, name)).__name__ for name in dir(rivid) if name.islower()} - {'str'})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines() == ["True False", "{'function'}"], done.stderr


def test_all_public_names_exist_and_are_documented():
    for name in rivid.__all__:
        assert getattr(rivid, name) is not None
        if name != "__version__":
            assert getattr(rivid, name).__doc__, name
    assert set(dir(rivid)) == set(rivid.__all__)
    with pytest.raises(AttributeError, match="no attribute 'delay'"):
        rivid.delay  # noqa: B018


def test_every_estimator_takes_a_day_or_its_arrays_with_the_same_answer(day):
    same = [
        (rivid.ml(day).fir, rivid.ml(day.inflow, day.output).fir),
        (rivid.map_fir(day, alpha=1e3).fir, rivid.map_fir(day.u, day.output, 30, 1e3).fir),
        (rivid.jmap(day).fir, rivid.jmap(day.inflow, day.output).fir),
        (rivid.direct(day).criterion, rivid.direct(day.inflow, day.outflow, day.output).criterion),
        (rivid.indirect(day).criterion, rivid.indirect(day.inflow, day.output).criterion),
        (rivid.cusum(day).decision, rivid.cusum(rivid.ml(day)).decision),
        (rivid.cusum(day).decision, rivid.cusum(rivid.ml(day).fir).decision),
    ]
    for of_day, of_arrays in same:
        np.testing.assert_array_equal(of_day, of_arrays)


def test_settings_have_the_papers_symbols_and_unknown_ones_are_named(day):
    assert (
        rivid.jmap(day, M=25, sigma_d=9.0).fir.tolist()
        == rivid.jmap(day, order=25, delay_scale=9.0).fir.tolist()
    )
    assert len(rivid.ml(day, M=20).fir) == 20
    for call, words in [
        (lambda: rivid.jmap(day, sigmad=3.0), "unknown setting sigmad.*did you mean sigma_d?"),
        (lambda: rivid.direct(day, dmax=20), "unknown setting dmax.*did you mean d_max?"),
        (lambda: rivid.ml(day, M=20, order=20), "given twice"),
        (lambda: rivid.direct(day.u, day.o), "y is missing: expected direct"),
    ]:
        with pytest.raises(ConfigError, match=words):
            call()
    table = {"jmap": {"M": 25}}
    assert Config.model_validate(table).jmap_settings().order == 25


def test_delays_are_described():
    assert describe_delay(6.0, 133.0) == "d = 6 samples (13.3 to 15.5 min)"
    assert (describe_delay(6.0, None), describe_delay(float("nan"), 133.0)) == ("d = 6 samples", "no delay")
    found = describe_days(np.array(["ok", "ok", "unidentifiable"]), np.array([6.0, 8.0, np.nan]))
    assert found == "3 days: 2 ok, 1 unidentifiable; d median 7, 6 to 8 samples"
