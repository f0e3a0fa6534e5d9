"""An answer beside the truth: what was right, what was wrong, and how much of the gap was closed.

Pure functions on plain tables: the answer as `diagnosis.json` has it, the truth as the examiner sealed it.
"""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

HOUR = 3600.0
WORSE_NAMED, WORSE_NOTHING = 0.01, 0.005
"""How much the error on the sealed days may grow, of a named case and with nothing missing."""
EXCESS = 0.1
"""A gap is there where the truth would take away this share of the squared error."""
OVERLAP = 0.8
"""Of windows, from which they are the same."""
MANY = 10
"""Windows are compared so often an hour."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Judged:
    """What an answer was worth.

    Attributes
    ----------
    names : tuple of str
        Given, in order, each once, without those that are allowed.
    verdict : str
        `error` where the diagnosis failed.
    first, alone : bool
        The expected name is the first; and no other is given.
    group : bool
        All expected names are given or said to be tied, and where they are tied, what would tell them apart.
    wrong : bool
        The first name is another than expected, and does not say that it may be the expected one.
    false : bool
        A name is given that is not expected.
    all_named, extra : bool
        Every expected name is given; and one more than these.
    unknown : bool
        It says that something is missing, without a name, and where or what it goes with.
    overlap : float or None
        Of the window of the first expected name with the planted one; None where it was not named.
    growth : float or None
        Largest growth of the error on the sealed days over the horizons, as a share.
    closed : tuple of float or None
        Share of the gap closed at each horizon, events described; None where there is no gap to close.
    covered : tuple of (str, bool)
        Parameters with an interval, and whether the planted value is in it.
    """

    names: tuple[str, ...]
    verdict: str
    first: bool
    alone: bool
    group: bool
    wrong: bool
    false: bool
    all_named: bool
    extra: bool
    unknown: bool
    overlap: float | None
    growth: float | None
    closed: tuple[float | None, ...]
    covered: tuple[tuple[str, bool], ...]

    @property
    def gap_closed(self) -> float | None:
        """Median over the horizons that have a gap."""
        shares = [share for share in self.closed if share is not None]
        return float(np.median(shares)) if shares else None


def judge(
    answer: Table,
    truth: Table,
    expected: Sequence[str],
    allowed: frozenset[str],
    floor: Sequence[float] | None,
) -> Judged:
    """Judge an answer.

    Parameters
    ----------
    answer : dict
        As diagnosis.json; or with `error`.
    truth : dict
        `effects`, `first_day`, `days`.
    expected : sequence of str
        Names to be given; none where nothing is missing, or nothing that has a name here.
    allowed : frozenset of str
        Names that are not counted, unless they are expected.
    floor : sequence of float, optional
        Errors of the model that knows the truth, by horizon.

    Returns
    -------
    Judged
    """
    given: list[Table] = answer.get("effects", [])
    counted = [e for e in given if e["name"] not in allowed or e["name"] in expected]
    names = tuple(dict.fromkeys(e["name"] for e in counted))
    wanted = set(expected)
    planted = {t["name"] for t in truth["effects"]} & wanted or wanted
    first = bool(names) and names[0] in planted
    tied = set(counted[0]["tied_with"]) if counted else set()
    failed = "error" in answer
    unknown = answer.get("unknown")
    return Judged(
        names=names,
        verdict="error" if failed else answer["verdict"],
        first=first,
        alone=first and len(names) == 1,
        group=_as_group(counted, wanted),
        wrong=failed or (bool(names) and not first and not (tied & planted)),
        false=failed or bool(set(names) - wanted),
        all_named=bool(wanted) and wanted <= set(names),
        extra=bool(set(names) - wanted),
        unknown=not names and unknown is not None and _placed(unknown),
        overlap=_window_overlap(counted, truth, planted),
        growth=growth(answer),
        closed=closed(answer, floor),
        covered=tuple(covering(counted, truth)),
    )


def _as_group(given: Sequence[Table], wanted: set[str]) -> bool:
    if not wanted:
        return False
    names = {e["name"] for e in given}
    if wanted <= names:
        return True
    said = names | {name for e in given for name in e["tied_with"]}
    tells = any(e["breaker"] for e in given if {e["name"], *e["tied_with"]} & wanted and e["tied_with"])
    return wanted <= said and tells


def _placed(unknown: Table) -> bool:
    where = unknown.get("where") or {}
    return bool(unknown.get("drivers")) or any(where.get(key) for key in ("hours", "dates", "regime"))


def growth(answer: Table) -> float | None:
    """Largest growth of the error of the sealed days from the plain model to the answer's, over horizons."""
    gap = answer.get("gap")
    if not gap:
        return None
    ends, bases = described(gap), gap["rmse_baseline"]
    shares = [end / base - 1.0 for end, base in zip(ends, bases, strict=True) if base and end is not None]
    return max(shares, default=None)


def described(gap: Table) -> list[float | None]:
    """Errors with all effects, events timed on the day itself where the answer says so."""
    if gap.get("rmse_described"):
        return list(gap["rmse_described"])
    end: list[float | None] = list(gap["rmse_augmented"])
    if gap["steps"] and (last := gap["steps"][-1]).get("rmse_described"):
        end = list(last["rmse_described"])
    return end


def closed(answer: Table, floor: Sequence[float] | None) -> tuple[float | None, ...]:
    """Share of the squared error above the floor that is gone, at each horizon."""
    gap = answer.get("gap")
    if not gap or floor is None:
        return ()
    shares: list[float | None] = []
    for base, end, least in zip(gap["rmse_baseline"], described(gap), floor, strict=True):
        if base is None or end is None or base**2 - least**2 <= EXCESS * base**2:
            shares.append(None)
        else:
            shares.append((base**2 - end**2) / (base**2 - least**2))
    return tuple(shares)


def hours_on(table: Table, first_day: dt.date, days: int) -> np.ndarray:
    """When an effect is there: a truth value for every tenth of an hour of the season.

    Parameters
    ----------
    table : dict
        With `dates` and `hours`, both optional.
    first_day : datetime.date
    days : int

    Returns
    -------
    ndarray of bool, shape (days, 240)
    """
    on = np.ones((days, 24 * MANY), bool)
    if table.get("dates"):
        first, last = (dt.date.fromisoformat(str(d)) for d in table["dates"])
        number = np.arange(days)
        on &= ((number >= (first - first_day).days) & (number <= (last - first_day).days))[:, None]
    if table.get("hours"):
        a, b = table["hours"]
        hour = (np.arange(24 * MANY) + 0.5) / MANY
        on &= ((hour >= a) & (hour < b)) if a < b else ((hour >= a) | (hour < b))
    return on


def overlap_of(given: Table, planted: Table, first_day: dt.date, days: int) -> float:
    """Hours in both windows over hours in either; 1 where both are always there."""
    a, b = (hours_on(table, first_day, days) for table in (given, planted))
    return float((a & b).sum() / max((a | b).sum(), 1))


def _window_overlap(given: Sequence[Table], truth: Table, planted: set[str]) -> float | None:
    """Of all windows given to a planted name, or to one tied with it, with the planted one's."""
    first_day, days = dt.date.fromisoformat(truth["first_day"]), truth["days"]
    for table in truth["effects"]:
        if table["name"] not in planted:
            continue
        whole = np.zeros((days, 24 * MANY), bool)
        for e in given:
            if table["name"] in (e["name"], *e["tied_with"]):
                whole |= hours_on(e["where"], first_day, days)
        if not whole.any():
            return None
        there = hours_on(table, first_day, days)
        return float((whole & there).sum() / (whole | there).sum())
    return None


def covering(given: Sequence[Table], truth: Table) -> list[tuple[str, bool]]:
    """Parameters with an interval: `effect.parameter`, and whether the planted value is within.

    Events are left out: what is said of them are sizes that were found, not an interval of the mean.
    """
    found = []
    planted = {table["name"]: table for table in reversed(truth["effects"])}
    seen: set[str] = set()
    for e in given:
        table = planted.get(e["name"])
        if table is None or e["name"] in seen or e["events"]:
            continue
        seen.add(e["name"])
        count: dict[str, int] = {}
        for p in e["parameters"]:
            root = p["name"].split("[")[0]
            count[root] = count.get(root, 0) + 1
        for p in e["parameters"]:
            root, _, place = p["name"].partition("[")
            value = table.get(root)
            if value is None or p["low"] is None or p["high"] is None or not p["high"] > p["low"]:
                continue
            if isinstance(value, list):
                value = _at_knot(value, int(place[:-1]) if place else 0, count[root], e, table, truth)
            low, high = p["low"], p["high"]
            if p["unit"] == "h" and root == "hour":  # round the clock
                middle = 0.5 * (low + high)
                value = middle + (value - middle + 12.0) % 24.0 - 12.0
            found.append((f"{e['name']}.{root}", bool(low <= value <= high)))
    return found


def _at_knot(values: list[float], k: int, knots: int, given: Table, planted: Table, truth: Table) -> float:
    """A planted size that varies with the date, at the date of the k-th size given."""
    first_day = dt.date.fromisoformat(truth["first_day"])

    def span(dates: Sequence[Any] | None) -> tuple[float, float]:
        if not dates:
            return 0.0, float(truth["days"])
        first, last = (dt.date.fromisoformat(str(d)) for d in dates)
        return float((first - first_day).days), float((last - first_day).days + 1)

    a, b = span(given["where"].get("dates"))
    at = a + (b - a) * (k / (knots - 1) if knots > 1 else 0.5)
    c, d = span(planted.get("dates"))
    return float(np.interp(at, np.linspace(c, d, len(values)), values))
