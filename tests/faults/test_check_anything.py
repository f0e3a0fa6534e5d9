"""Test `rivid check` on arbitrary data: a report or a line, never a traceback or an invalid number."""

import datetime as dt
import json
import warnings

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rivid.check import check, check_days
from rivid.check.findings import render
from rivid.config import Config, parse
from rivid.errors import RividError
from rivid.logs.days import DataSet
from tests import examples
from tests.daily import write_days
from tests.faults.test_config_attacks import DEEP
from tests.faults.test_mutations import CSV, REACH, mutated
from tests.logs.helpers import DAY, config
from tests.run.test_run import command

LARGEST = 1e6
"""Largest number that the reader accepts."""


@st.composite
def series(draw, n):
    """Draw a column of a day: steps, noise, a spike, nothing, at any readable scale and offset."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = np.cumsum((rng.random(n) < 0.1) * rng.normal(size=n))
    noise, k = rng.normal(size=n), np.arange(n)
    kinds = [steps, noise, k == n // 2, k / n, 0.0 * k, 1 + 1e-13 * noise, np.where(k % 2, 1.0, -1.0)]
    values = draw(st.sampled_from(kinds))
    values = 10.0 ** draw(st.integers(-30, 5)) * (values + draw(st.sampled_from([0.0, 1.0, -1.0, 1e3])))
    return np.clip(values, -LARGEST, LARGEST)


@st.composite
def records(draw):
    """Draw days of any content and length, with missing days between them."""
    kind = draw(st.sampled_from(["pool", "pool", "river", "no outflow"]))
    days = []
    for k in sorted(draw(st.sets(st.integers(0, 12), min_size=1, max_size=9))):
        n = draw(st.sampled_from([96, 96, 96, 92, 100, 1, 2, 25]))
        inflow, outflow, output = (draw(series(n)) for _ in range(3))
        if days and draw(st.integers(0, 5)) == 0 and len(days[-1].inflow) == n:
            inflow, output = days[-1].inflow, days[-1].output
        days.append(
            DataSet(DAY + dt.timedelta(k), inflow, outflow if kind == "pool" else None, output, 0, "")
        )
    reach = {"sample_time": draw(st.sampled_from([900, 900, 133, 10, 3600])), "bed_level": 3.0}
    reach |= {"kind": "river"} if kind == "river" else {}
    given_ = {"u_Qo": ""} if kind == "no outflow" else {}
    return days, parse({"reach": reach, "input": given_}, Config)


def test_any_finite_days_give_finite_findings(tried):
    found = seen = 0

    @settings(
        max_examples=examples(250, 62),
        deadline=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(records())
    def holds(record):
        nonlocal found, seen
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            findings = check_days(*record)
        for finding in findings:
            words = str(finding).lower()
            assert "nan" not in words.split() and "inf" not in words.split() and "\n" not in words
            assert set(finding.days) <= {day.date for day in record[0]}
        json.dumps([finding.to_json() for finding in findings], allow_nan=False)
        found += bool(findings)
        seen += 1

    holds()
    assert found > 50
    tried("days of any finite numbers, lengths and gaps, to `check`", seen)


def test_any_bytes_checked(tmp_path, tried):
    path, seen = tmp_path / f"{DAY}.csv", 0

    @settings(
        max_examples=examples(150), deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
    )
    @given(mutated(CSV))
    def attack(content):
        nonlocal seen
        path.write_bytes(content)
        try:
            report = check(tmp_path, config(REACH))
        except RividError as error:
            assert len(str(error).splitlines()) == 1
        else:
            json.dumps(report.to_json(), allow_nan=False)
            assert render(report, "x")
        seen += 1

    attack()
    tried("mutations of a log, to `check`", seen)


def test_a_hostile_configuration_of_a_check_is_one_line(tmp_path, tried):
    write_days(tmp_path / "data", 1)
    (tmp_path / "c.toml").write_text(DEEP["half open"])
    done = command("check", tmp_path / "data", "--config", tmp_path / "c.toml")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and not done.stdout
    tried("rivid check with a half open table")
