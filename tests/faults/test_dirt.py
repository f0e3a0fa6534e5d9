"""Test logs with errors of every kind and known truth: each error is masked, reported or refused."""

import datetime as dt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rivid.errors import DataError
from rivid.estimators import ESTIMATORS
from rivid.results.read import load_results
from tests import examples
from tests.daily import a_day, text_of, write_days
from tests.logs.helpers import DAY, config, put, read, rows
from tests.run.test_run import rivid

MASKED = ("", "#N/A", "NA", "-")
TEXTS = ("inf", "-inf", "1e999", "Bad", "I/O Timeout", "ERR", "305,5", "1 000", "0x1F", "true", "None", "٣")
FALSE = ("-999", "-9999", "-1000")
DECLARED = {"missing": [*MASKED, "Bad", "I/O Timeout"], "sentinels": [-999, -9999, -1000]}
TRUTH = a_day(DAY)[1:]


@st.composite
def dirty(draw):
    """Draw rows with errors."""
    lines = rows()
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(1, 648))
        column = draw(st.integers(1, 3))
        match draw(st.integers(0, 7)):
            case 0:
                lines[at % len(lines)][column] = draw(
                    st.sampled_from((*MASKED, "Bad", "I/O Timeout", *FALSE))
                )
            case 1:
                lines[at % len(lines)][column] = draw(st.sampled_from(TEXTS))
            case 2:  # a header, or units, among the rows
                lines.insert(at, ["time", "u_Qi", "u_Qo", "h_L"] if column > 1 else ["", "m3/s", "m3/s", "m"])
            case 3:  # a duplicate row, here or elsewhere
                lines.insert(draw(st.integers(0, len(lines))), list(lines[at % len(lines)]))
            case 4:  # the same time with another value
                other = list(lines[at % len(lines)])
                other[column] = "401.5"
                lines.insert(at, other)
            case 5:
                del lines[at % len(lines)]
            case 6:
                k = draw(st.integers(0, len(lines) - 1))
                lines[at % len(lines)], lines[k] = lines[k], lines[at % len(lines)]
            case 7:  # the clock is wrong by some seconds from here on, or right again
                drift = draw(st.integers(-40, 40))
                for line in lines[at : at + draw(st.integers(1, 40))]:
                    try:
                        time = dt.datetime.fromisoformat(line[0])
                    except ValueError:
                        continue
                    line[0] = (time + dt.timedelta(seconds=drift)).isoformat()
    return lines


def logged(lines, column):
    """Return the valid values in a column by their time of day [s]."""
    midnight = dt.datetime.combine(DAY, dt.time(), dt.timezone(dt.timedelta(hours=1)))
    found = {}
    for line in lines:
        try:
            time = (dt.datetime.fromisoformat(line[0]) - midnight).total_seconds()
            value = float(line[column])
        except ValueError:
            continue
        if line[column] not in FALSE and np.isfinite(value):
            found.setdefault(time, []).append(value)
    return found


def test_nothing_is_taken_as_data_that_is_none(tmp_path, tried):
    """Every sample is between the neighbouring logged values; missing values are counted."""
    seen = {"read": 0, "refused": 0}

    @settings(max_examples=examples(200), deadline=None, derandomize=True)
    @given(dirty())
    def attack(lines):
        put(tmp_path, lines)
        try:
            data = read(tmp_path, **DECLARED)
        except DataError as error:
            assert str(error).startswith(f"{DAY}.csv") and len(str(error).splitlines()) == 1
            seen["refused"] += 1
            return
        seen["read"] += 1
        for column, samples in ((1, data.inflow), (2, data.outflow), (3, data.output)):
            found = logged(lines, column)
            assert all(len(set(values)) == 1 for values in found.values()), "a conflict was passed over"
            times = np.array(sorted(found))
            values = np.array([found[t][0] for t in times])
            for k in np.flatnonzero(samples != TRUTH[column - 1]):
                near = np.abs(times - 133 * k) <= config().input.max_gap + 133
                assert values[near].min() - 1e-9 <= samples[k] <= values[near].max() + 1e-9
        if data.n_filled == 0 and len(lines) == 650:
            assert abs(data.inflow - TRUTH[0]).max() < 120

    attack()
    assert min(seen.values()) > sum(seen.values()) // 10
    tried(
        "a log with up to six faults: cells, headers, rows doubled, lost, swapped, clocks off",
        sum(seen.values()),
    )


def spoil(path, cells):
    """Write other cells into a log: ``cells(row number, fields)`` changes the fields."""
    head, *lines = path.read_text().splitlines()
    for k, line in enumerate(lines):
        fields = line.split(",")
        cells(k, fields)
        lines[k] = ",".join(fields)
    path.write_text("\n".join([head, *lines]) + "\n")


CONSTANT = {
    "constant": lambda k: "300",
    "constant but for 1e-9": lambda k: f"{300 + (k % 7) * 1e-9:.12f}",
    "constant but for noise of 1e-9": lambda k: f"{300 + 1e-9 * np.sin(k * k):.12f}",
    "zero": lambda k: "0",
}


@pytest.mark.parametrize(("column", "kind"), [*((1, kind) for kind in CONSTANT), (3, "constant")])
def test_what_does_not_move_is_identified_by_no_estimator(tmp_path, tried, kind, column):
    """A level is logged to the millimetre: it is constant or changes."""
    data, still = tmp_path / "data", 1
    write_days(data, 3)
    date = sorted(data.iterdir())[still]
    spoil(date, lambda k, fields: fields.__setitem__(column, CONSTANT[kind](k)))
    words = [word for name in ESTIMATORS for word in ("--estimator", name)]
    assert rivid("run", data, "--out", tmp_path / "out", "--no-figures", *words)[0] == 0
    for estimator in load_results(tmp_path / "out").estimators:
        assert estimator.status[still] == "unidentifiable", estimator.estimator
        assert np.isnan(estimator.delay[still]) and estimator.messages[still]
        assert {estimator.status[0], estimator.status[2]} <= {"ok", "degenerate"}
    tried(f"{'inflow' if column == 1 else 'level'} {kind}, all estimators", len(ESTIMATORS))


def test_days_without_any_sound_one_still_have_figures(tmp_path, tried):
    data, out = tmp_path / "data", tmp_path / "out"
    dates = write_days(data, 4)
    for date, n in zip(dates, (0, 1, 20, 60), strict=True):
        (data / f"{date}.csv").write_text("".join(text_of(date).splitlines(True)[: n + 1]))
    code, output = rivid("run", data, "--out", out)
    assert code == 3 and "4" in output
    assert load_results(out).estimators[0].status == ["failed"] * 4
    assert (out / "report.html").stat().st_size > 1000
    assert list((out / "figures").glob("*.png"))
    tried("a log of 0, 1, 20 or 60 rows", 4)
