"""The outcome of one reach, stored in OUT/.rivid/outcomes: shards of a fleet run in other processes."""

import datetime as dt
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rivid.atomic import write_text
from rivid.fleet.band import WEEK, Band, band

if TYPE_CHECKING:
    from rivid.config import Config
    from rivid.run.run import Summary

FOLDER = Path(".rivid", "outcomes")
WORST_FIRST = (1, 2, 11, 10, 3, 0)
"""Exit codes, the worst first: failure, wrong configuration, held by another run, no data, days
failed in this run, all well."""

MOST_FAILURES = 5
"""Most failed days of the last week that are listed for a reach."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of the run of one reach.

    Attributes
    ----------
    reach : str
    code : int
        Exit code of `rivid run` of this reach alone.
    error : str
        Why it could not be run; empty otherwise.
    data_sets, computed, dropped : int
        Data sets of its logs; those estimated in its last run; those of earlier runs whose logs are gone.
    failures, new_failures, bad_files : int
        Days that failed; those of them reported for the first time; files that are no logs.
    content : str
        Digest of the results: it changes with them.
    first, last : str
        ISO dates of the record.
    estimator, quantity : str
        Estimator and quantity (delay or t50) of the band.
    sample_time : float
        T_s [s].
    answered_week, days_week : int
        Days of its last week with an answer, and with a row at all.
    band : Band, or None
    recent : list of (date, message)
        Failed days of its last week.
    """

    reach: str
    code: int
    error: str = ""
    data_sets: int = 0
    computed: int = 0
    dropped: int = 0
    failures: int = 0
    new_failures: int = 0
    bad_files: int = 0
    content: str = ""
    first: str = ""
    last: str = ""
    estimator: str = ""
    quantity: str = ""
    sample_time: float = 0.0
    answered_week: int = 0
    days_week: int = 0
    band: Band | None = None
    recent: list[tuple[str, str]] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """As a JSON object; null for NaN."""
        value = asdict(self)
        if value["band"] is not None and math.isnan(value["band"]["week_median"]):
            value["band"]["week_median"] = None
        return value

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> "Outcome":
        """The inverse of :meth:`to_json`."""
        given = dict(value)
        if given.get("band") is not None:
            raw = dict(given["band"])
            raw["week_median"] = math.nan if raw["week_median"] is None else raw["week_median"]
            given["band"] = Band(**raw)
        given["recent"] = [(str(day), str(message)) for day, message in given.get("recent", [])]
        return cls(**given)


def worst(codes: Iterable[int]) -> int:
    """The exit code of a fleet: the worst of its reaches, in the order of :data:`WORST_FIRST`.

    Examples
    --------
    >>> worst([0, 3, 10, 0]), worst([])
    (10, 0)
    """
    return min(codes, key=lambda code: WORST_FIRST.index(code) if code in WORST_FIRST else -1, default=0)


def outcome_of(reach: str, config: "Config", summary: "Summary", content: str) -> Outcome:
    """Summarise the run of a reach."""
    dates = summary.rows["date"]
    estimator, quantity, days, values = _leading(config, summary)
    last = int(days[-1]) if len(days) else 0
    week = days > last - WEEK
    start = dt.date.fromordinal(max(last - WEEK + 1, 1))
    recent: dict[str, str] = {}
    if summary.failures:
        columns = (summary.rows[name].to_pylist() for name in ("date", "status", "message"))
        for date, status, message in zip(*columns, strict=True):
            if status == "failed" and date >= start:
                recent.setdefault(str(date), message or "")
    ends = (dates[0].as_py(), dates[-1].as_py()) if len(dates) else ("", "")
    return Outcome(
        reach=reach,
        code=summary.exit_code,
        data_sets=summary.windows,
        computed=summary.computed,
        dropped=summary.dropped,
        failures=summary.failures,
        new_failures=summary.new_failures,
        bad_files=len(summary.bad_files),
        content=content,
        first=str(ends[0]),
        last=str(ends[1]),
        estimator=estimator,
        quantity=quantity,
        sample_time=config.reach.sample_time,
        answered_week=int(np.isfinite(values[week]).sum()),
        days_week=int(week.sum()),
        band=band(days, values),
        recent=list(recent.items())[-MOST_FAILURES:],
    )


def _leading(
    config: "Config", summary: "Summary"
) -> tuple[str, str, np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Main estimator of a reach, quantity, day numbers, and values [samples]; NaN where the prior decides."""
    import pyarrow as pa
    import pyarrow.compute as pc

    rows = summary.rows
    names = [str(name) for name in config.run.estimators]
    river = config.reach.kind == "river"
    order = ("map", "jmap", "ml") if river else ("posterior", "jmap")
    column = "t50_samples" if river else "delay_samples"
    for name in sorted(names, key=lambda name: order.index(name) if name in order else len(order)):
        of = rows.filter(pc.equal(rows["estimator"], name))
        values = np.array(pc.fill_null(of[column], np.nan).to_numpy(), float)
        good = pc.is_in(of["status"], value_set=pa.array(["ok"])).to_numpy(zero_copy_only=False)
        if not river:
            good = good & ~pc.fill_null(of["prior_only"], False).to_numpy(zero_copy_only=False)
        values[~np.asarray(good, bool)] = np.nan
        if np.isfinite(values).any() or name == names[-1]:
            epoch = dt.date(1970, 1, 1).toordinal()
            days = np.asarray(of["date"].cast(pa.int32()).to_numpy(), np.int64) + epoch
            return name, "t50" if river else "delay", days, values
    return "", "", np.zeros(0, np.int64), np.zeros(0)


def keep(out: Path, outcome: Outcome) -> None:
    """Store an outcome under OUT of the fleet."""
    write_text(out / FOLDER / f"{outcome.reach}.json", json.dumps(outcome.to_json(), sort_keys=True) + "\n")


def kept(out: Path) -> list[Outcome]:
    """All stored outcomes, by reach; those that cannot be read are left out."""
    found = []
    for path in sorted((out / FOLDER).glob("*.json")):
        try:
            found.append(Outcome.from_json(json.loads(path.read_text(encoding="utf-8"))))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue  # of another version, or damaged: the next run writes it again
    return found


def forget(out: Path, reaches: Iterable[str]) -> None:
    """Drop outcomes of reaches that are gone; their results stay."""
    for name in reaches:
        (out / FOLDER / f"{name}.json").unlink(missing_ok=True)
