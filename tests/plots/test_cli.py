"""Test `rivid figures OUT` from the tables of a run."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from rivid.cli.figures import command
from rivid.errors import LockedError, NoDataError
from rivid.export import law_of
from rivid.plots.paper_data import read_run
from rivid.results.read import SCHEMA_VERSION, load_delays, load_results
from rivid.results.store import SEGMENT, Store, to_table, write_tables
from tests.plots.synthetic import dates_of, results

SAME = (
    "delay", "at_bound", "prior_only", "t50", "alpha", "noise_sd", "roughness_sd", "condition", "mean_inflow",
    "bound_gravity_s", "bound_kinematic_s", "status", "messages",
)  # fmt: skip
NAMED = {
    "delay": "delay_samples",
    "t50": "t50_samples",
    "mean_inflow": "mean_inflow_m3s",
    "messages": "message",
}


def row_of(run, e, i):
    """Return a day of an estimator as a row of a segment."""
    row = {"key": f"{e.dates[i]}", "date": e.dates[i], "reach": run.reach, "estimator": e.estimator}
    row |= {NAMED.get(name, name): np.asarray(getattr(e, name)[i]).item() for name in SAME}
    row["delay_s"] = row["delay_samples"] * run.sample_time
    if e.answered[i]:
        row["fir"] = e.fir[i].tolist()
        if e.candidates.size:
            row |= {"first_candidate": int(e.candidates[0]), "curve": e.criterion[i].tolist()}
    return {
        name: None if isinstance(value, float) and value != value else value for name, value in row.items()
    }


def store_run(run, out):
    """Write the tables and run.json of a run, like `rivid run`."""
    rows = [row_of(run, e, i) for e in run.estimators for i in range(len(e.dates))]
    out.mkdir()
    table = to_table({name: [row.get(name) for row in rows] for name in SEGMENT.names}, SEGMENT)
    write_tables([table], out, spread=False)
    record = {name: getattr(run, name) for name in ("reach", "sample_time", "output_unit", "delay_scale")}
    record |= {"schema_version": SCHEMA_VERSION, "estimators": [e.estimator for e in run.estimators]}
    record |= {"config": {"reach": {"name": run.reach}}, "versions": {"rivid": "0.1.0"}}
    (out / "run.json").write_text(json.dumps(record))


def invoke(*args):
    return CliRunner().invoke(command, [str(a) for a in args], standalone_mode=False)


def test_figures_and_report_come_back_the_same_after_they_were_deleted(tmp_path):
    out = tmp_path / "out"
    store_run(results(("ml",), dates_of(20, missing=3)), out)
    done = invoke(out)
    assert done.exception is None and done.return_value == 0
    assert "2 figures" in done.output and str(out / "report.html") in done.output
    made = {p: p.read_bytes() for p in [*(out / "figures").iterdir(), out / "report.html"]}
    for path in made:
        path.unlink()
    assert invoke(out).exception is None
    assert {p: p.read_bytes() for p in made} == made
    assert "2008-01-01 to 2008-01-23" in (out / "report.html").read_text(encoding="utf-8")


def test_a_day_may_be_chosen(tmp_path):
    out = tmp_path / "out"
    store_run(results(("ml",), dates_of(5), unanswered=0), out)
    assert invoke(out, "--day", "2008-01-02").exception is None
    assert "Impulse responses of 2008-01-02" in (out / "report.html").read_text(encoding="utf-8")


def test_a_directory_without_a_run_is_left_untouched(tmp_path):
    out = tmp_path / "empty"
    with pytest.raises(NoDataError, match="holds no finished run"):
        raise invoke(out).exception
    assert not out.exists()


def test_the_results_of_a_fleet_are_those_of_its_reaches(tmp_path):
    for name in ("upper", "lower"):
        store_run(results(("ml",), dates_of(2), unanswered=0), tmp_path / name)
    one = r"those of lower, upper: give the directory of one, such as .*/lower"
    for read in (load_delays, load_results, read_run, law_of):
        with pytest.raises(NoDataError, match=one):
            read(tmp_path)


def test_a_running_run_is_not_disturbed(tmp_path):
    out = tmp_path / "out"
    store_run(results(("jmap",), dates_of(2)), out)
    with Store(out):
        assert isinstance(invoke(out).exception, LockedError)
