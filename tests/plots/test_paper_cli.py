"""Test `rivid figures OUT --paper` on a finished run."""

import json
import shutil

import click
import pytest
from click.testing import CliRunner

from rivid import load_delays
from rivid.cli import figures as cli
from rivid.cli.run import command as run
from rivid.errors import NoDataError
from rivid.logs.write import write_days
from rivid.plots import paper
from rivid.plots.paper_data import read_run
from tests.plots.years import season


def invoke(command, *args):
    return CliRunner().invoke(command, [str(a) for a in args], standalone_mode=False)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Return OUT of a run of twelve days."""
    place = tmp_path_factory.mktemp("run")
    s = season()
    columns = zip(s.inflow, s.outflow, s.level, strict=True)
    days = [
        (date, {"u_Qi": u, "u_Qo": o, "h_L": h}) for date, (u, o, h) in zip(s.dates, columns, strict=True)
    ]
    write_days(
        place / "logs", days, sample_time=s.sample_time, offset=s.scenario.offset, format="parquet",
        layout="day",
    )  # fmt: skip
    done = invoke(run, place / "logs", "--out", place / "out", "--no-figures", "--quiet")
    assert done.exception is None, done.exception
    return place / "out"


def test_the_figures_of_a_run_come_with_their_page(out, monkeypatch):
    monkeypatch.setattr(paper, "FIGURES", {num: paper.FIGURES[num] for num in ("2", "19")})
    done = invoke(cli.command, out, "--paper", "--cascade", out, "--day", "2008-01-03")
    assert done.exception is None and done.return_value == 0
    assert "2 figures of the paper" in done.output
    assert done.stderr.splitlines() == [
        "reading the logs", "estimating", f"the cascade: {out}", "drawing Fig. 2", "drawing Fig. 19",
        "writing the page",
    ]  # fmt: skip
    page = (out / "paper" / "index.html").read_text(encoding="utf-8")
    assert "12 days" in page and "Fig. 19." in page


def test_a_scenario_gives_the_reaches_of_its_cascade(tmp_path):
    base = cli.Path(__file__).parents[2] / "configs" / "scenarios" / "basse_isere.toml"
    scenario = tmp_path / "two.toml"
    scenario.write_text(
        f'extends = "{base}"\ndays = 4\nmissing_days = 0\n'
        '[[cascade]]\nreach = { name = "upper", length = 4500, surface_area = 3.67e5 }\n'
        "operators = { level_gain = -120 }\n"
        '[[cascade]]\nreach = { name = "lower" }\n'
    )
    upper, lower = cli.simulated_cascade(scenario)
    assert (upper.name, lower.name) == ("upper", "lower")
    assert upper.length == 4500 and len(upper.truth) == len(upper.delay) == 4
    assert upper.nominal < lower.nominal


def test_without_any_cascade_the_reach_is_drawn_alone_and_a_message_names_it(out, monkeypatch):
    monkeypatch.setattr(cli, "CASCADE", out / "no.toml")
    drawn = []
    monkeypatch.setattr(
        "rivid.plots.paper.draw_paper", lambda y, e, reaches, *a, **k: drawn.append(reaches) or []
    )
    done = invoke(cli.command, out, "--paper")
    assert done.exception is None
    assert [len(reaches) for reaches in drawn] == [1]
    assert "Fig. 19 shows reach alone" in done.stderr


def test_logs_that_have_moved_may_be_pointed_to(out, tmp_path, monkeypatch):
    shutil.copytree(out, tmp_path / "out", ignore=shutil.ignore_patterns("paper"))
    record = json.loads((out / "run.json").read_text())
    record["data_dir"] = str(tmp_path / "gone")
    (tmp_path / "out" / "run.json").write_text(json.dumps(record))
    assert isinstance(invoke(cli.command, tmp_path / "out", "--paper").exception, NoDataError)
    monkeypatch.setattr("rivid.plots.paper.draw_paper", lambda y, *a, **k: list(y.dates))
    monkeypatch.setattr("rivid.report.build.write_gallery", lambda *_: None)
    done = invoke(cli.command, tmp_path / "out", "--paper", "--logs", out.parent / "logs", "--cascade", out)
    assert done.exception is None and "12 figures" in done.output


@pytest.mark.parametrize("option", ["--logs", "--cascade"])
def test_options_of_the_paper_go_with_the_paper(option, tmp_path):
    assert isinstance(invoke(cli.command, tmp_path, option, tmp_path).exception, click.UsageError)


def test_a_directory_without_a_run_is_left_untouched(tmp_path):
    assert isinstance(invoke(cli.command, tmp_path / "none", "--paper").exception, NoDataError)
    assert not (tmp_path / "none").exists()


def test_delays_csv_and_the_figures_use_the_same_flow_and_depth(out):
    year, delays = read_run(out), load_delays(out).query("estimator == 'jmap'")
    assert delays["froude"].to_numpy() == pytest.approx(year.bounds.froude)
    assert delays["bound_gravity_s"].to_numpy() == pytest.approx(year.bounds.gravity)
