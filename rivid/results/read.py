"""Read the tables of a run as arrays, or as a DataFrame."""

import datetime as dt
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rivid.errors import NoDataError, RividError
from rivid.types import Bools, Floats

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from rivid.config import Config


@dataclass(frozen=True)
class EstimatorResults:
    """Results of one estimator for every day, in date order; NaN where it has none.

    Attributes
    ----------
    estimator : str
        Its name, "jmap" for example.
    dates : list of datetime.date
        One per row, n of them, failed days included.
    status : list of str
        ok, unidentifiable, degenerate, pending or failed, n of them.
    messages : list of str
        Reason of the status and remarks; empty where there are none.
    delay : ndarray, shape (n,)
        Delay d [samples].
    at_bound, prior_only : ndarray of bool, shape (n,)
        The delay is d_min or d_max; the prior, not the data, decides it.
    t50 : ndarray, shape (n,)
        Rivers only: lag by which half of a step has arrived [samples], from the FIR.
    fir : ndarray, shape (n, M)
        Impulse response [output unit per m3/s]; M is 0 where the estimator has none.
    candidates : ndarray, shape (K,)
        The delays tried [samples]; empty where the estimator has none.
    criterion : ndarray, shape (n, K)
        The criterion of each candidate; of CUSUM its g at lag d + 1, large after a change; of an estimator
        with probabilities these, p(d | y).
    alpha, noise_sd, roughness_sd, condition : ndarray, shape (n,)
        The row's columns of the same name in delays.csv.
    mean_inflow : ndarray, shape (n,)
        Mean inflow of the data set [m3/s].
    bound_gravity_s, bound_kinematic_s : ndarray, shape (n,)
        Bounds (5) of the travel time [s].
    probability : ndarray, shape (n,), or None
        Probability of the most probable delay; None where the estimator gives none on any day.
    delay_low, delay_high : ndarray, shape (n,), or None
        Ends of the smallest set of delays that holds 90 % [samples].
    fir_sd : ndarray, shape (n, M), or None
        Standard deviation of `fir`.
    travel_s : ndarray, shape (n,), or None
        Travel time with its fraction of a sample [s]; None where the estimator gives d only.
    """

    estimator: str
    dates: list[dt.date]
    status: list[str]
    messages: list[str]
    delay: Floats
    at_bound: Bools
    prior_only: Bools
    t50: Floats
    fir: Floats
    candidates: Floats
    criterion: Floats
    alpha: Floats
    noise_sd: Floats
    roughness_sd: Floats
    condition: Floats
    mean_inflow: Floats
    bound_gravity_s: Floats
    bound_kinematic_s: Floats
    probability: Floats | None = None
    delay_low: Floats | None = None
    delay_high: Floats | None = None
    fir_sd: Floats | None = None
    travel_s: Floats | None = None

    @property
    def answered(self) -> Bools:
        """Rows of status ok or degenerate."""
        return np.array([s in ("ok", "degenerate") for s in self.status], bool)


@dataclass(frozen=True)
class Results:
    """All of OUT: one :class:`EstimatorResults` per estimator, in the order of the configuration.

    Attributes
    ----------
    reach : str
        Name of the reach.
    sample_time : float
        T_s [s].
    output_unit : str
        m for a pool (level), m3/s for a river (discharge).
    delay_scale : float
        sigma_d in use [samples], the mode of the Rayleigh prior.
    estimators : list of EstimatorResults
        In the order of the configuration.
    assumed : tuple of str
        Keys of the reach's geometry that are not configured: the bounds (5) are NaN then, because they would
        be those of another reach.
    """

    reach: str
    sample_time: float
    output_unit: str
    delay_scale: float
    estimators: list[EstimatorResults]
    assumed: tuple[str, ...] = ()


def load_results(out: Path | str) -> Results:
    """Read delays.parquet, fir.parquet, criterion.parquet and run.json of a run.

    Raises
    ------
    NoDataError
        If `out` holds no finished run.
    RividError
        If its files are damaged, or of a newer rivid.
    """
    import pyarrow.parquet as pq

    out = Path(out)
    try:
        run = _record(out)
        delays, fir, criterion = (
            pq.read_table(out / f"{name}.parquet", page_checksum_verification=True)
            for name in ("delays", "fir", "criterion")
        )
        return _results(run, delays, fir, criterion)
    except FileNotFoundError as error:
        raise NoDataError(
            f"{out} holds no finished run ({Path(error.filename).name} is missing): "
            "run `rivid run DATA_DIR --out OUT` first"
        ) from None
    except KeyError as error:
        raise RividError(f"{out}: results cannot be read (they lack {error}): run again") from None
    except (OSError, ValueError, TypeError) as error:
        raise RividError(f"{out}: results cannot be read ({error}): run again") from None


def brief_results(rows: "pa.Table", config: "Config") -> Results:
    """Return the results of the rows that a run keeps in memory: without responses, curves and other columns.

    Parameters
    ----------
    rows : pyarrow.Table
        Columns :data:`rivid.results.store.SHORT`; absent columns are NaN or empty in the results.
    config : Config
        Of the run.
    """
    import pyarrow as pa

    from rivid.results.tables import DELAYS

    for field in DELAYS:
        if field.name not in rows.column_names:
            rows = rows.append_column(field, pa.nulls(len(rows), field.type))
    columns = {"date": pa.date32(), "estimator": pa.string()}
    columns |= dict.fromkeys(("lag", "value", "delay_samples", "criterion"), pa.float64())
    nothing = pa.schema(list(columns.items())).empty_table()
    run = {
        "reach": config.reach.name,
        "sample_time": config.reach.sample_time,
        "output_unit": "m3/s" if config.reach.kind == "river" else "m",
        "delay_scale": np.nan,
        "estimators": config.run.estimators,
    }
    return _results(run, rows, nothing, nothing)


def _record(out: Path) -> dict[str, Any]:
    """run.json of OUT; refused where a newer rivid wrote it, whose tables may differ."""
    import json

    from rivid.results.tables import SCHEMA_VERSION

    run = json.loads((out / "run.json").read_text(encoding="utf-8"))
    if not isinstance(run, dict):
        raise ValueError("run.json is not a JSON object")
    if run["schema_version"] > SCHEMA_VERSION:
        raise RividError(
            f"{out} was written by a newer rivid (schema {run['schema_version']}, this one knows "
            f"{SCHEMA_VERSION}): upgrade rivid"
        )
    return run


def _results(run: dict[str, Any], delays: "pa.Table", fir: "pa.Table", criterion: "pa.Table") -> Results:
    import pyarrow as pa

    names = delays["estimator"].to_numpy(zero_copy_only=False)
    order = [str(name) for name in run["estimators"]]
    assumed = tuple(str(key) for key in run.get("assumed") or ())
    estimators = []
    for name in order:
        rows = delays.filter(names == name)
        columns = {c: rows[c].to_numpy(zero_copy_only=False) for c in rows.column_names}
        if assumed:
            columns |= {f"bound_{wave}_s": np.full(len(rows), None) for wave in ("gravity", "kinematic")}
        sure = _given(columns["probability"])
        dates: list[dt.date] = rows["date"].to_pylist()
        days = rows["date"].cast(pa.int32()).to_numpy()
        estimators.append(
            EstimatorResults(
                estimator=name,
                dates=dates,
                status=[str(s) for s in columns["status"]],
                messages=[str(s or "") for s in columns["message"]],
                delay=_floats(columns["delay_samples"]),
                at_bound=_bools(columns["at_bound"]),
                prior_only=_bools(columns["prior_only"]),
                t50=_floats(columns["t50_samples"]),
                fir=_matrix(fir, name, days, "lag", "value")[1],
                candidates=(curve := _matrix(criterion, name, days, "delay_samples", "criterion"))[0],
                criterion=curve[1],
                probability=sure,
                travel_s=None if sure is None else _given(columns["delay_s"]),
                delay_low=_given(columns["delay_low"]),
                delay_high=_given(columns["delay_high"]),
                fir_sd=_spread(fir, name, days),
                **{
                    key: _floats(columns[column])
                    for key, column in {
                        "alpha": "alpha",
                        "noise_sd": "noise_sd",
                        "roughness_sd": "roughness_sd",
                        "condition": "condition",
                        "mean_inflow": "mean_inflow_m3s",
                        "bound_gravity_s": "bound_gravity_s",
                        "bound_kinematic_s": "bound_kinematic_s",
                    }.items()
                },
            )
        )
    return Results(
        reach=str(run["reach"]),
        sample_time=float(run["sample_time"]),
        output_unit=str(run["output_unit"]),
        delay_scale=float(run["delay_scale"]),
        estimators=estimators,
        assumed=assumed,
    )


def load_delays(out: Path | str) -> "pd.DataFrame":
    """Read delays.parquet as a pandas DataFrame.

    Parameters
    ----------
    out : Path or str
        OUT of a run.

    Returns
    -------
    pandas.DataFrame
        The columns of delays.csv, a row per day and estimator; `date` as timestamps.

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
        raise NoDataError(f"{path} does not exist: run `rivid run DATA_DIR --out OUT` first")
    with suppress(OSError, ValueError, KeyError, TypeError):  # the table may stand alone
        _record(Path(out))
    frame = pd.read_parquet(path)
    frame["date"] = pd.to_datetime(frame["date"])
    flags = ["at_bound", "prior_only"]  # with missing values, which plain bool cannot hold
    return frame.astype(dict.fromkeys(flags, "boolean"))


def _floats(column: NDArray[np.generic]) -> Floats:
    return np.array([np.nan if v is None else v for v in column], float)


def _bools(column: NDArray[np.generic]) -> Bools:
    return np.array([bool(v) for v in column], bool)


def _given(column: NDArray[np.generic]) -> Floats | None:
    """A column of numbers; None where it is empty."""
    values = _floats(column)
    return values if np.isfinite(values).any() else None


def _spread(table: "pa.Table", estimator: str, days: NDArray[np.int32]) -> Floats | None:
    """Standard deviations of an estimator's responses, where the table has them."""
    if "sd" not in table.column_names:
        return None
    sd = _matrix(table, estimator, days, "lag", "sd")[1]
    return sd if np.isfinite(sd).any() else None


def _matrix(
    table: "pa.Table", estimator: str, days: NDArray[np.int32], axis: str, value: str
) -> tuple[Floats, Floats]:
    """A long table (date, estimator, axis, value) as its axis and a (days, axis) matrix."""
    import pyarrow as pa
    import pyarrow.compute as pc

    rows = table.filter(pc.equal(table["estimator"], estimator))
    at = rows[axis].to_numpy()
    labels = np.unique(at)
    matrix = np.full((len(days), len(labels)), np.nan)
    row = np.searchsorted(days, rows["date"].cast(pa.int32()).to_numpy())  # days are in order
    matrix[row, np.searchsorted(labels, at)] = rows[value].to_numpy()
    return labels.astype(float), matrix
