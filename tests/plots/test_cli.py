"""`rivid figures OUT` from the tables that a run leaves."""

import json

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner

from rivid.cli.figures import command
from rivid.errors import LockedError, NoDataError
from rivid.results.store import SCHEMA_VERSION, SEGMENT, Store, to_table, write_tables
from tests.plots.synthetic import dates_of, results


def store_run(run, out):
    """Write the tables and run.json of a run, as `rivid run` does."""
    columns = {field.name: [] for field in SEGMENT}
    for e in run.estimators:
        for i, date in enumerate(e.dates):
            fir = e.fir[i] if e.answered[i] else None
            curve = e.criterion[i] if e.answered[i] and e.candidates.size else None
            row = {
                "key": f"{date}",
                "date": date,
                "reach": run.reach,
                "estimator": e.estimator,
                "status": e.status[i],
                "delay_samples": e.delay[i],
                "delay_s": e.delay[i] * run.sample_time,
                "at_bound": bool(e.at_bound[i]),
                "prior_only": bool(e.prior_only[i]),
                "t50_samples": e.t50[i],
                "alpha": e.alpha[i],
                "noise_sd": e.noise_sd[i],
                "roughness_sd": e.roughness_sd[i],
                "condition": e.condition[i],
                "mean_inflow_m3s": e.mean_inflow[i],
                "bound_gravity_s": e.bound_gravity_s[i],
                "bound_kinematic_s": e.bound_kinematic_s[i],
                "message": e.messages[i],
                "fir": None if fir is None else fir.tolist(),
                "first_candidate": None if curve is None else int(e.candidates[0]),
                "curve": None if curve is None else curve.tolist(),
            }
            for name, values in columns.items():
                values.append(row.get(name))
    table = to_table({k: [None if v is np.nan else v for v in c] for k, c in columns.items()}, SEGMENT)
    assert isinstance(table, pa.Table)
    out.mkdir()
    write_tables([table], out, spread=False)
    record = {
        "schema_version": SCHEMA_VERSION,
        "reach": run.reach,
        "sample_time": run.sample_time,
        "output_unit": run.output_unit,
        "delay_scale": run.delay_scale,
        "estimators": [e.estimator for e in run.estimators],
        "config": {"reach": {"name": run.reach}},
        "versions": {"rivid": "0.1.0"},
    }
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


def test_a_running_run_is_not_disturbed(tmp_path):
    out = tmp_path / "out"
    store_run(results(("jmap",), dates_of(2)), out)
    with Store(out):
        assert isinstance(invoke(out).exception, LockedError)
