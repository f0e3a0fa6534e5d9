"""Read the tables of a run as arrays or as a DataFrame, and classify the days of an estimator."""

import datetime as dt
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rivid.errors import ConfigError, NoDataError, RividError
from rivid.estimators import ESTIMATORS
from rivid.types import Bools, Floats

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


RECORD = "run.json"  # the record of a run: settings, counts and versions, and the hashes of its files
SCHEMA_VERSION = 1  # version of the results contract; a reader refuses a newer one


@dataclass(frozen=True)
class EstimatorResults:
    """Results of one estimator by day, in date order: n rows, failed days included; NaN where it has none.

    A field is None where no day has a value. One without comment is the column of that name in delays.csv.
    """

    estimator: str
    dates: list[dt.date]
    status: list[str]  # ok, unidentifiable, degenerate, pending or failed
    messages: list[str]  # reasons and remarks, or empty
    delay: Floats  # [samples]
    at_bound: Bools
    prior_only: Bools
    t50: Floats  # of rivers: lag by which half of a step has arrived, [samples]
    fir: Floats  # (n, M) [output unit per m3/s]; M is 0 without impulse responses
    candidates: Floats  # delays tried [samples], (K,)
    criterion: Floats  # of each, (n, K): of CUSUM g at lag d + 1, high after a change; of posteriors p(d|y)
    alpha: Floats
    noise_sd: Floats
    roughness_sd: Floats
    condition: Floats
    mean_inflow: Floats  # [m3/s]
    bound_gravity_s: Floats  # bounds (5) of the travel time [s]
    bound_kinematic_s: Floats
    probability: Floats | None = None
    delay_low: Floats | None = None  # ends of the smallest set of delays that holds 90 % [samples]
    delay_high: Floats | None = None
    fir_sd: Floats | None = None  # standard deviation of `fir`, (n, M)
    travel_s: Floats | None = None  # travel time with a fraction of a sample [s]
    half_s: Floats | None = None  # the same with the gauge's lag [s]

    @property
    def answered(self) -> Bools:
        """Rows of status ok or degenerate."""
        return np.array([s in ("ok", "degenerate") for s in self.status], bool)

    @property
    def degenerate(self) -> Bools:
        """Rows of status degenerate."""
        return np.array([s == "degenerate" for s in self.status], bool)


@dataclass(frozen=True)
class Results:
    """All of OUT: one :class:`EstimatorResults` per estimator, in the order of the configuration."""

    reach: str
    sample_time: float  # T_s [s]
    output_unit: str  # m for a pool (level), m3/s for a river (discharge)
    delay_scale: float  # sigma_d in use [samples], the mode of the Rayleigh prior
    estimators: list[EstimatorResults]
    # keys of the geometry that are not configured: the bounds (5) are NaN then, those of another reach
    assumed: tuple[str, ...] = ()
    note: str = ""  # a line about the data

    def of(self, name: str) -> EstimatorResults:
        """The results of one estimator; StopIteration where it was not applied."""
        return next(e for e in self.estimators if e.estimator == name)


def load_results(out: Path | str) -> Results:
    """Read delays.parquet, fir.parquet, criterion.parquet and run.json of a run.

    Raises
    ------
    NoDataError
        If `out` holds no finished run.
    RividError
        If its files are damaged, or of a newer rivid.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    out = Path(out)
    try:
        (out / RECORD).stat()  # the first to be missing
        run = last_record(out)
        refuse_parts(run, out)
        delays, fir, criterion = (
            # not read_table: it imports pyarrow.dataset, which takes as long as reading a year
            pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True).read()
            for data in [(out / f"{name}.parquet").read_bytes() for name in ("delays", "fir", "criterion")]
        )
        return results_of(run, delays, fir, criterion)
    except FileNotFoundError as error:
        raise no_run(out, Path(error.filename).name) from None
    except KeyError as error:
        raise RividError(f"{out}: results cannot be read (they lack {error}): run again") from None
    except (OSError, ValueError, TypeError) as error:
        raise RividError(f"{out}: results cannot be read ({error}): run again") from None


def reaches_in(out: Path) -> list[str]:
    """The reaches of a fleet that have been run into OUT."""
    return sorted(path.parent.name for path in out.glob(f"*/{RECORD}"))


def no_run(out: Path, lacks: str = RECORD) -> NoDataError:
    """The error for a directory without the results of a run; of a fleet's OUT it names the reaches."""
    if names := reaches_in(out):
        listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
        return NoDataError(
            f"{out} holds no run of its own but those of {listed}: give the directory of one, "
            f"such as {out / names[0]}"
        )
    return NoDataError(
        f"{out} holds no finished run ({lacks} is missing): run `rivid run DATA_DIR --out OUT` first"
    )


def refuse_parts(run: Mapping[str, Any], out: Path) -> None:
    """Raise ConfigError where a run's data sets are shorter than a day."""
    if window := run.get("config", {}).get("run", {}).get("window"):
        raise ConfigError(
            f"{out} holds data sets of {window} ([run] window): expected whole days. Its results are in "
            "delays.csv and the Parquet tables, by `start`"
        )


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file; empty where it cannot be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def last_record(out: Path) -> dict[str, Any]:
    """The record of the last run into OUT; empty without one. RividError if a newer rivid wrote it."""
    record = read_json(out / RECORD)
    version = record.get("schema_version", 0)
    if not isinstance(version, int):
        return {}
    if version > SCHEMA_VERSION:  # its tables may differ
        raise RividError(
            f"{out} was written by a newer rivid (schema {version}, this one knows {SCHEMA_VERSION}): "
            "upgrade rivid, or give another OUT"
        )
    return record


NUMBERS = {"delay": "delay_samples", "t50": "t50_samples", "mean_inflow": "mean_inflow_m3s"} | {
    name: name
    for name in ("alpha", "noise_sd", "roughness_sd", "condition", "bound_gravity_s", "bound_kinematic_s")
}
"""Attributes of :class:`EstimatorResults`, and the columns of these numbers."""


def results_of(run: dict[str, Any], delays: "pa.Table", fir: "pa.Table", criterion: "pa.Table") -> Results:
    """The results in tables with the columns of a run's, and in keys of its record."""
    import pyarrow as pa
    import pyarrow.compute as pc

    names = delays["estimator"].to_numpy(zero_copy_only=False)
    assumed = tuple(str(key) for key in run.get("assumed") or ())
    estimators = []
    for name in map(str, run["estimators"]):
        rows = delays.filter(names == name)
        columns = {c: rows[c].to_numpy(zero_copy_only=False) for c in rows.column_names}
        if assumed:
            columns |= {f"bound_{wave}_s": np.full(len(rows), np.nan) for wave in ("gravity", "kinematic")}
        sure = _given(columns["probability"].astype(float))
        travel = columns.get("travel_time_s", columns["delay_s"])
        half = columns.get("half_response_s", np.full(len(rows), np.nan))
        days = rows["date"].cast(pa.int32()).to_numpy()
        own = [table.filter(pc.equal(table["estimator"], name)) for table in (fir, criterion)]
        candidates, curve = matrix(own[1], days, "delay_samples", "criterion")
        estimators.append(
            EstimatorResults(
                estimator=name, dates=rows["date"].to_pylist(), status=[str(s) for s in columns["status"]],
                messages=[str(s or "") for s in columns["message"]], 
                at_bound=columns["at_bound"].astype(bool),
                prior_only=columns["prior_only"].astype(bool),
                fir=matrix(own[0], days, "lag", "value")[1],
                fir_sd=_given(matrix(own[0], days, "lag", "sd")[1]) if "sd" in fir.column_names else None,
                candidates=candidates, criterion=curve, probability=sure,
                travel_s=None if sure is None else _given(travel.astype(float)),
                half_s=_given(half.astype(float)),
                delay_low=_given(columns["delay_low"].astype(float)),
                delay_high=_given(columns["delay_high"].astype(float)),
                **{name: columns[column].astype(float) for name, column in NUMBERS.items()},
            )
        )  # fmt: skip
    return Results(
        reach=str(run["reach"]), sample_time=float(run["sample_time"]), output_unit=str(run["output_unit"]),
        delay_scale=float(run["delay_scale"]), estimators=estimators, assumed=assumed,
        note=str(run.get("config", {}).get("reach", {}).get("note", "")),
    )  # fmt: skip


def load_delays(out: Path | str) -> "pd.DataFrame":
    """Read delays.parquet of `out` as a DataFrame: a row per day and estimator, `date` as timestamps.

    Raises
    ------
    NoDataError
        If `out` holds no run.
    RividError
        If a newer rivid wrote it.
    """
    import pandas as pd

    path = Path(out) / "delays.parquet"
    if not path.exists():
        raise no_run(path.parent, path.name)
    last_record(Path(out))  # refuses a newer one; the table may stand alone
    frame = pd.read_parquet(path)
    frame["date"] = pd.to_datetime(frame["date"])
    flags = ["at_bound", "prior_only"]  # with missing values, which plain bool cannot hold
    return frame.astype(dict.fromkeys(flags, "boolean"))


def _given(values: Floats) -> Floats | None:
    """Numbers; None where all are missing."""
    return values if np.isfinite(values).any() else None


def matrix(table: "pa.Table", days: NDArray[np.int32], axis: str, value: str) -> tuple[Floats, Floats]:
    """A long table (date, axis, value) as its axis and a (days, axis) matrix; `days` are in order."""
    import pyarrow as pa

    at = table[axis].to_numpy()
    labels = np.unique(at)
    found = np.full((len(days), len(labels)), np.nan)
    row = np.searchsorted(days, table["date"].cast(pa.int32()).to_numpy())
    found[row, np.searchsorted(labels, at)] = table[value].to_numpy()
    return labels.astype(float), found


def estimates_delay(estimator: EstimatorResults) -> bool:
    """Whether an estimator answers with delays, even where no day has one."""
    return estimator.candidates.size > 0 or ESTIMATORS[estimator.estimator].has_delay


def candidates(estimator: EstimatorResults) -> Floats:
    """Candidate delays [samples], shape (K,); the estimated ones where the table has none."""
    if estimator.candidates.size:
        return estimator.candidates
    return np.unique(estimator.delay[found(estimator)])


def rounded(results: Results, estimator: EstimatorResults) -> bool:
    """Whether a delay d is a t50 between d - 1/2 and d + 1/2: that of a river's posterior.

    Others are travel times between d and d + 1.
    """
    return results.output_unit != "m" and ESTIMATORS[estimator.estimator].has_probability


def found(estimator: EstimatorResults) -> Bools:
    """Days with a delay, shape (n,)."""
    return ~np.isnan(estimator.delay) & estimator.answered


def decided(estimator: EstimatorResults) -> Bools:
    """Days with a delay that the data decide, shape (n,): neither prior_only nor degenerate by fault."""
    e = estimator
    fault = e.degenerate & (not ESTIMATORS[e.estimator].degenerates)
    return np.asarray(found(e) & ~e.prior_only & ~fault)


def kinds(estimator: EstimatorResults) -> dict[str, Bools]:
    """Days of each reliability class, shape (n,); a day is in the most severe class that applies."""
    e, days = estimator, found(estimator)
    edge, doubt = days & e.at_bound, days & e.degenerate & ~e.at_bound
    prior = days & e.prior_only & ~(edge | doubt)
    sure = days & ~(edge | doubt | prior)
    return {"data decide": sure, "data do not decide": prior, "degenerate": doubt, "at a bound": edge}


def day_numbers(dates: Sequence[dt.date]) -> Floats:
    """Ordinal numbers of dates, shape (n,)."""
    return np.array([date.toordinal() for date in dates], float)


def rayleigh(delays: Floats, scale: float) -> Floats:
    """Rayleigh prior (26), sigma_d = `scale`, on the candidates [samples], shape (K,), summing to one.

    (26) is lost in the paper's copy; its terms in (27) and (35) give it back.
    """
    logs = np.log(delays) - delays**2 / (2 * scale**2)
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


MOST = 0.8  # the share of days that a range holds: four days in five
FEW = 9  # with fewer days, no thirds and no range of four days in five
CLEAR = 0.7  # t50 falls with the flow where low flow has the longer t50 in this share of pairs of days


@dataclass(frozen=True)
class Thirds:
    """t50 by thirds of the mean inflow."""

    edges: tuple[float, ...]  # mean inflows [m3/s]: lowest, end of lower and begin of upper third, highest
    medians: tuple[float, ...]  # of t50 [samples] in the lower, middle and upper third
    longer: float  # share of pairs of a day of the lower and one of the upper third where the lower has more


@dataclass(frozen=True)
class Passage:
    """t50 over the record."""

    days: int
    with_t50: int  # of the days
    median: float  # [samples]
    low: float  # range of four days in five, of all days if they are few [samples]
    high: float
    thirds: Thirds | None  # None where too few days have a mean inflow, or all the same
    bounded: int  # days with both bounds (5)
    between: int  # of these, with a t50 between them


def has_t50(estimator: EstimatorResults) -> Bools:
    """Days with a t50, shape (n,)."""
    return np.isfinite(estimator.t50) & estimator.answered


def leading_response(results: Results) -> EstimatorResults | None:
    """Return the estimator with a t50 that has the highest rank, or else without; None in a pool."""
    if results.output_unit == "m":
        return None
    having = (e for e in results.estimators if e.dates)
    return max(having, key=lambda e: (has_t50(e).any(), ESTIMATORS[e.estimator].t50_rank), default=None)


def passage(results: Results, estimator: EstimatorResults) -> Passage:
    """Condense the t50 of one estimator; NaN where no day has one."""
    e, days = estimator, has_t50(estimator)
    t50 = e.t50[days]
    tails = (1 - MOST) / 2 if t50.size > FEW else 0.0
    low, median, high = (
        (float(q) for q in np.quantile(t50, (tails, 0.5, 1 - tails))) if t50.size else (np.nan,) * 3
    )
    seconds = e.t50 * results.sample_time
    bounded = days & np.isfinite(e.bound_gravity_s) & np.isfinite(e.bound_kinematic_s)
    inside = bounded & (seconds >= e.bound_gravity_s) & (seconds <= e.bound_kinematic_s)
    counts = {"with_t50": int(days.sum()), "bounded": int(bounded.sum()), "between": int(inside.sum())}
    return Passage(days=len(e.dates), median=median, low=low, high=high, thirds=thirds(e), **counts)


def thirds(estimator: EstimatorResults) -> Thirds | None:
    """t50 by thirds of the mean inflow of the days that have both; None where they are too few."""
    e = estimator
    days = has_t50(e) & np.isfinite(e.mean_inflow)
    Q, t50 = e.mean_inflow[days], e.t50[days]
    if Q.size < FEW or Q.min() == Q.max():
        return None
    edges = np.quantile(Q, (0, 1 / 3, 2 / 3, 1))
    third = np.searchsorted(edges[1:3], Q)
    parts = [t50[third == k] for k in range(3)]
    if min(part.size for part in parts) < FEW // 3:
        return None
    lower, upper = parts[0], np.sort(parts[2])
    # Mann and Whitney's count of pairs, equal ones by halves
    shorter = np.searchsorted(upper, lower, "left") + np.searchsorted(upper, lower, "right")
    medians = tuple(float(np.median(part)) for part in parts)
    return Thirds(tuple(edges.tolist()), medians, float(shorter.mean() / 2 / upper.size))
