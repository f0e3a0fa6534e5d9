"""What a finished run says of its days one by one, and which runs' days may be joined."""

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from rivid.errors import ConfigError, NoDataError, RividError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LONGEST = 40_000
"""Calendar days of a season at most: a date that is a slip of the pen must not fill the memory."""


@dataclass(frozen=True)
class SeasonDays:
    """What a run says of its days one by one: every calendar day from the first to the last that is closed.

    Attributes
    ----------
    reach : str
    sample_time : float
        T_s [s].
    river : bool
        The delay is t50, rounded; in a pool travel times from d to d + 1 samples are the delay d.
    window : int
        Days of a data set.
    dates : list of datetime.date
        n of them, without gaps.
    candidates : ndarray of int, shape (D,)
        The delays [samples].
    probability : ndarray, shape (n, D)
        p(d | y) of the day alone; NaN where it says nothing.
    delay : ndarray, shape (n,)
        The day's own answer [samples]; NaN without one.
    travel : ndarray, shape (n,)
        Its travel time [s].
    discharge : ndarray, shape (n,)
        Mean inflow of its data set [m3/s]; NaN where it is not known, or not positive.
    """

    reach: str
    sample_time: float
    river: bool
    window: int
    dates: list[dt.date]
    candidates: NDArray[np.intp]
    probability: Floats
    delay: Floats
    travel: Floats
    discharge: Floats

    def place(self, probability: Floats, share: float) -> Floats:
        """The travel time [samples] that `share` of each row lies below, shape (n,); NaN where that is NaN.

        Within a delay all travel times count alike.
        """
        known: Bools = np.asarray(np.isfinite(probability).all(axis=1))
        p = np.where(known[:, None], probability, 1.0 / probability.shape[1])
        below = np.cumsum(p, axis=1)
        cell = np.argmax(below >= share, axis=1)
        rows = np.arange(len(p))
        part = 1.0 - (below[rows, cell] - share) / p[rows, cell]
        start = self.candidates[cell] - (0.5 if self.river else 0.0)
        return np.where(known, start + np.clip(part, 0.0, 1.0), np.nan)


def read_days(out: Path, record: Mapping[str, Any]) -> SeasonDays:
    """The days of a finished run.

    Parameters
    ----------
    out : Path
        OUT of `rivid run`.
    record : mapping
        Its run.json.

    Raises
    ------
    ConfigError
        Where the run has no posterior, or its pool's outflow is not logged.
    NoDataError
        Where no day has probabilities.
    RividError
        Where the tables cannot be read, or span more than a century.
    """
    if "posterior" not in record["estimators"]:
        raise ConfigError(
            f"{out} has no posterior, only {', '.join(record['estimators'])}: its probabilities are what is "
            "joined: run again with --estimator posterior"
        )
    river = record["config"]["reach"]["kind"] == "river"
    if not river and not record["config"]["input"].get("u_Qo"):
        raise ConfigError(
            f"{out} is of a pool whose outflow is not logged (input.u_Qo): its days all err in the same way, "
            "and joined they would be surer than right: log the outflow, or keep to posterior"
        )
    try:
        delays, posterior = (
            _own(pq.read_table(out / f"{name}.parquet", page_checksum_verification=True))
            for name in ("delays", "posterior")
        )
    except (OSError, ValueError) as error:
        raise RividError(f"{out}: results cannot be read ({error}): run again") from None
    delays = delays.filter(pc.not_equal(delays["status"], "pending"))  # the log of today is not closed
    if not posterior.num_rows:
        raise NoDataError(f"{out}: no day has probabilities: see the messages in delays.csv")
    rows = delays["date"].cast(pa.int32()).to_numpy()
    n = int(rows[-1] - rows[0]) + 1
    if n > LONGEST:
        first, last = delays["date"][0], delays["date"][-1]
        raise RividError(
            f"{out}: days from {first} to {last}: expected {LONGEST} days or fewer: see the dates"
        )
    candidates = np.unique(posterior["delay_samples"].to_numpy()).astype(np.intp)
    probability = np.full((n, len(candidates)), np.nan)
    of_row = posterior["date"].cast(pa.int32()).to_numpy() - rows[0]
    at = np.searchsorted(candidates, posterior["delay_samples"].to_numpy())
    probability[of_row, at] = posterior["probability"].to_numpy()
    delay, travel, discharge = np.full((3, n), np.nan)
    for values, name in ((delay, "delay_samples"), (travel, "delay_s"), (discharge, "mean_inflow_m3s")):
        values[rows - rows[0]] = pc.fill_null(delays[name], np.nan).to_numpy()
    start: dt.date = delays["date"][0].as_py()
    return SeasonDays(
        reach=str(record["reach"]), sample_time=float(record["sample_time"]), river=river,
        window=int(record["config"]["run"]["window_days"]),
        dates=[start + dt.timedelta(days=k) for k in range(n)], candidates=candidates,
        probability=probability, delay=delay, travel=travel,
        discharge=np.where(discharge > 0.0, discharge, np.nan),
    )  # fmt: skip


def _own(table: pa.Table) -> pa.Table:
    return table.filter(pc.equal(table["estimator"], "posterior"))
