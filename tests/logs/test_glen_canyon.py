"""Test the measured sample data: all days are read, and the configurations name the right columns."""

import csv
from pathlib import Path

import numpy as np
import pytest

from rivid.check import check
from rivid.config import load_config
from rivid.input_config import UNITS
from rivid.logs.days import find_days, read_window

HOME = Path(__file__).parents[2]
LOGS = HOME / "sample_data" / "glen_canyon"


@pytest.fixture(scope="module", params=["glen_canyon", "glen_canyon_rm30"])
def settings(request):
    return load_config(HOME / "configs" / f"{request.param}.toml")


@pytest.mark.parametrize("name", [pytest.param("glen_canyon", marks=pytest.mark.long), "glen_canyon_rm30"])
def test_every_day_is_read(name):
    report = check(LOGS, load_config(HOME / "configs" / f"{name}.toml"))
    assert len(report.days) == 426 and report.exit_code == 0
    assert report.warnings == [] and report.absent == []
    assert sum(day.n_filled for day in report.days) == 0


def test_a_window_holds_what_the_files_hold(settings):
    days = find_days(LOGS, settings).days[100 : 100 + settings.run.window_days]
    data = read_window(LOGS, days, settings)
    table = [row for day in days for row in csv.DictReader((LOGS / f"{day.date}.csv").open())]
    cfs = UNITS["u_Qi"]["cfs"]
    output = np.array([float(row[str(settings.input.Q_L)]) for row in table]) * cfs
    inflow = np.array([float(row[str(settings.input.u_Qi)] or "nan") for row in table]) * cfs
    known = np.isfinite(inflow)
    assert (data.output == output).all() and data.outflow is None
    assert (data.inflow[known] == inflow[known]).all()
    if not known.all():  # hourly values, held for four rows
        assert known[::4].all() and (data.inflow == np.repeat(inflow[::4], 4)).all()


def test_the_bypass_is_a_choice():
    all_release = load_config(HOME / "configs" / "glen_canyon.toml")
    (day,) = [d for d in find_days(LOGS, all_release).days if str(d.date) == "2024-09-01"]
    both = {"u_Qi": ["power_release_cfs", "bypass_release_cfs"]}
    summed = all_release.model_copy(update={"input": all_release.input.model_copy(update=both)})
    total, parts = (read_window(LOGS, [day], c).inflow for c in (all_release, summed))
    np.testing.assert_allclose(total, parts, rtol=1e-12)
    power = all_release.model_copy(
        update={"input": all_release.input.model_copy(update={"u_Qi": "power_release_cfs"})}
    )
    assert read_window(LOGS, [day], power).inflow.mean() < 0.9 * total.mean()
