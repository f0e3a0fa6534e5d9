"""Days of a finished run joined over a season, the law of delay and discharge, and their tables."""

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from rivid.atomic import write_text
from rivid.core.law import DelayLaw, delay_law
from rivid.core.season import season
from rivid.core.settings import RiverSettings
from rivid.errors import ConfigError, NoDataError, RividError
from rivid.estimators import stamp_doubt
from rivid.results.read import matrix, refuse_parts
from rivid.results.store import described, digest, finite, to_table, write_both, write_csv
from rivid.types import Bools, Floats

LONGEST = 40_000  # most calendar days of a season: one wrong date in a log must not exhaust the memory


@dataclass(frozen=True)
class SeasonDays:
    """Results of `posterior` for each of the n calendar days from the first to the last complete one."""

    reach: str
    sample_time: float  # T_s [s]
    river: bool  # the delay is t50, rounded; in a pool travel times from d to d + 1 samples are the delay d
    window: int  # days of a data set
    dates: list[dt.date]
    candidates: NDArray[np.intp]  # delays [samples], (D,)
    # of the day alone, NaN where it has none
    probability: Floats  # p(d | y), (n, D)
    delay: Floats  # [samples]
    travel: Floats  # travel time [s]
    discharge: Floats  # mean inflow of its data set [m3/s], if positive
    # by how much all travel times may be too long, and too short [s]: stamps that are not declared
    doubt: tuple[float, float] = (0.0, 0.0)
    settings: str = ""  # digest of the run's settings: see settings_of

    def place(self, probability: Floats, share: float) -> Floats:
        """Quantile `share` of the travel time [samples] of each row, shape (n,); NaN where the row is NaN.

        Travel times within a delay are equally probable.
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
    """The days of a finished run into `out`; `record` is its run.json.

    ConfigError if the run has no posterior, or the outflow of its pool is not logged; NoDataError if no day
    has probabilities; RividError if the tables cannot be read, or span too many days.
    """
    refuse_parts(record, out)
    if "posterior" not in record["estimators"]:
        raise ConfigError(
            f"{out} has no posterior, only {', '.join(record['estimators'])}: its probabilities are what is "
            "joined: run again with --estimator posterior"
        )
    river = record["config"]["reach"]["kind"] == "river"
    if not river and not record["config"]["input"].get("u_Qo"):
        raise ConfigError(
            f"{out} is of a pool, and its outflow is not logged (input.u_Qo): all its days have the same "
            "error, and joined they would be surer than right: log the outflow, or use posterior alone"
        )
    try:
        delays, posterior = (
            pq.read_table(out / f"{name}.parquet", page_checksum_verification=True).filter(
                pc.equal(pc.field("estimator"), "posterior")
            )
            for name in ("delays", "posterior")
        )
    except (OSError, ValueError) as error:
        raise RividError(f"{out}: results cannot be read ({error}): run again") from None
    delays = delays.filter(pc.not_equal(delays["status"], "pending"))  # today's log is not complete
    if not posterior.num_rows:
        raise NoDataError(f"{out}: no day has probabilities: see the messages in delays.csv")
    rows = delays["date"].cast(pa.int32()).to_numpy()
    n = int(rows[-1] - rows[0]) + 1
    if n > LONGEST:
        first, last = delays["date"][0], delays["date"][-1]
        raise RividError(
            f"{out}: days from {first} to {last}: expected {LONGEST} days or fewer: see the dates"
        )
    calendar = np.arange(rows[0], rows[-1] + 1, dtype=np.int32)
    candidates, probability = matrix(posterior, calendar, "delay_samples", "probability")
    delay, travel, discharge = np.full((3, n), np.nan)
    for values, name in ((delay, "delay_samples"), (travel, "delay_s"), (discharge, "mean_inflow_m3s")):
        values[rows - rows[0]] = pc.fill_null(delays[name], np.nan).to_numpy()
    start: dt.date = delays["date"][0].as_py()
    return SeasonDays(
        reach=str(record["reach"]), sample_time=float(record["sample_time"]), river=river,
        window=int(record["config"]["run"]["window_days"]),
        dates=[start + dt.timedelta(days=k) for k in range(n)], candidates=candidates.astype(np.intp),
        probability=probability, delay=delay, travel=travel,
        discharge=np.where(discharge > 0.0, discharge, np.nan),
        doubt=stamp_doubt(record["config"]["input"], float(record["sample_time"]), river=river),
        settings=settings_of(record),
    )  # fmt: skip


def settings_of(record: Mapping[str, Any]) -> str:
    """Digest of the settings in a run.json by which travel times change; empty without a run."""
    config = record.get("config")
    return (
        digest(record["reach"], *(config[key] for key in ("input", "reach", "posterior"))) if config else ""
    )


@dataclass(frozen=True)
class Joined:
    """Results of posterior-season for n days."""

    direction: str  # "forward" or "both"
    probability: Floats  # p(d | days), (n, D)
    delay: Floats  # [samples]; NaN where no delay is probable enough
    travel: Floats  # travel time [s]
    sure: Floats  # probability of the most probable delay, of a river of its rounded t50
    low: Floats  # ends of the smallest set of delays that holds 90 % [samples]
    high: Floats
    observed: Bools  # the day alone has probabilities
    related: float  # probability, after the last day, that the delays of consecutive days are related


def join(days: SeasonDays, both_ways: bool = False) -> Joined:
    """Estimate posterior-season from the days of a run.

    Without `both_ways` a day uses the days before it only, so that no result changes when days are added.
    ConfigError for a river both ways: errors of its days are correlated, and on simulated rivers the 90 %
    band then held 81 %.
    """
    if both_ways and days.river:
        raise ConfigError(
            "--both-ways on a river: its days err alike, and joined both ways they are surer than right: "
            "leave it out"
        )
    n = len(days.dates)
    parts = [np.arange(first, n, days.window) for first in range(min(days.window, n))]
    found = [
        season(
            days.probability[part], None, days.discharge[part], d_min=int(days.candidates[0]),
            both_ways=both_ways,
        )
        for part in parts
    ]  # fmt: skip
    order = np.argsort(np.concatenate(parts))
    p, in_set, observed, delay, sure = (
        np.concatenate([getattr(one, name) for one in found])[order]
        for name in ("probability", "in_set", "observed", "delay", "sure")
    )
    related = 1.0 - float(found[(n - 1) % days.window].independent[-1])
    middle = days.place(p, 0.5)
    if days.river:
        delay, sure = _river_answer(days, p, middle)
    own = delay == days.delay  # the day alone has a finer fraction of a sample
    travel = np.where(own, days.travel, np.where(np.isfinite(delay), middle * days.sample_time, np.nan))
    low = days.candidates[np.argmax(in_set, axis=1)].astype(float)
    high = days.candidates[::-1][np.argmax(in_set[:, ::-1], axis=1)].astype(float)
    direction = "both" if both_ways else "forward"
    return Joined(direction, p, delay, travel, sure, low, high, observed, related)


def _river_answer(days: SeasonDays, p: Floats, t50: Floats) -> tuple[Floats, Floats]:
    """Delay and its probability for a river, where the 90 % band of t50 is narrow enough; else NaN."""
    wide = days.place(p, 0.95) - days.place(p, 0.05)
    first, last = days.candidates[0], days.candidates[-1]
    rounded = np.clip(np.floor(t50 + 0.5), first, last)
    sure = p[np.arange(len(p)), (rounded - first).astype(int)]
    return np.where(wide <= RiverSettings().widest + 0.5 * t50, rounded, np.nan), sure


def law_of(days: SeasonDays) -> DelayLaw:
    """Fit the law to the travel times of the days alone, in seconds.

    In a pool the fraction of a sample counts as far as it follows the discharge. On a river a profile over
    many samples shows the fraction of t50. The scatter about the law includes the errors of the
    days, so the interval of a single day is rather wide. The doubt of stamps that are not declared is added
    to the intervals of times: it is common to all days.
    """
    samples: dict[str, Any] = {}
    if not days.river:
        edges = days.sample_time * np.r_[days.candidates, days.candidates[-1] + 1]
        samples = {"probability": days.probability, "edges": edges}
    ordinals = np.array([day.toordinal() for day in days.dates])
    law = delay_law(days.discharge, days.travel, day=ordinals, **samples)
    long, short = days.doubt
    t = law.table
    table = replace(
        t, low=np.maximum(t.low - long, 0.0), high=t.high + short,
        day_low=np.maximum(t.day_low - long, 0.0), day_high=t.day_high + short,
    )  # fmt: skip
    low, high = max(law.T0_low - long, 0.0), law.T0_high + short
    return replace(law, T0_low=low, T0_high=high, table=table, doubt=days.doubt)


NAME = "posterior-season"

SCHEMA, MEANINGS = described("""
date | date | | the calendar day, with a log or without
reach | text | | its name
estimator | text | | `posterior-season`
delay_samples | number | samples | most probable delay, the days joined; empty where it is not probable enough
delay_s | number | s | the travel time, of a river t50
probability | number | | probability of this delay
delay_low | number | samples | shortest delay of the 90 % set
delay_high | number | samples | longest delay of the 90 % set
observed | flag | | the day alone has probabilities
direction | text | | `forward`: from the days before; `both`: from all days
""")
"""season.csv and season.parquet: a row per calendar day."""
LAW_SCHEMA, LAW_MEANINGS = described("""
discharge_low_m3s | number | m3/s | lower edge of the class
discharge_high_m3s | number | m3/s | upper edge of the class
discharge_m3s | number | m3/s | median discharge of its days
delay_s | number | s | travel time by the law; of a river t50
delay_low_s | number | s | lower end of the law's 90 % interval
delay_high_s | number | s | upper end of it
day_low_s | number | s | lower end of the 90 % interval of a single day
day_high_s | number | s | upper end of it
observed_s | number | s | median travel time of the days alone
n | whole | days | in the class
""")
"""delay_law.csv: a row per class of discharge."""


def write_season(days: SeasonDays, joined: Joined, law: DelayLaw, out: Path) -> None:
    """Write season.csv, season.parquet, delay_law.csv and delay_law.json into OUT, each atomically."""
    n = len(days.dates)
    columns: dict[str, Any] = {
        "date": days.dates, "reach": [days.reach] * n, "estimator": [NAME] * n, "delay_samples": joined.delay,
        "delay_s": joined.travel, "probability": joined.sure, "delay_low": joined.low,
        "delay_high": joined.high, "observed": joined.observed, "direction": [joined.direction] * n,
    }  # fmt: skip
    write_both(to_table(columns, SCHEMA), out / "season")
    classes = dict(zip(LAW_SCHEMA.names, vars(law.table).values(), strict=True))
    write_csv(to_table(classes, LAW_SCHEMA), out / "delay_law.csv")
    values = {name: v for name, v in asdict(law).items() if name not in ("table", "doubt")}
    values["covariance"] = law.covariance.tolist() if law.status == "ok" else None
    units = {"T0": "s", "Q0": "m3/s", "b": "-", "scatter": "-", "covariance": "of (ln T0, b)"}
    record = finite(values) | {
        "reach": days.reach, "estimator": "posterior", "law": "T = T0 (Q / Q0)^-b", "units": units,
        "quantity": "t50" if days.river else "travel time", "sample_time": days.sample_time,
        "stamp_doubt_s": list(days.doubt), "settings": days.settings,
        "first": str(days.dates[0]), "last": str(days.dates[-1]),
    }  # fmt: skip
    write_text(out / "delay_law.json", json.dumps(record, indent=2, sort_keys=True) + "\n")
