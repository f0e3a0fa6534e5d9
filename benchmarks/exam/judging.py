"""An answer beside the truth: what was right, what was wrong, and how much of the gap was closed.

Pure functions on plain tables: the answer as `diagnosis.json` has it, the truth as `benchmarks.exam.hiding`
seals it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

EXCESS = 0.1
"""A gap is there where the truth would take away this share of the squared error."""
LEAST = 0.01
"""Least probability of a name that the reliability diagram counts: below it are all names of the
catalogue."""
AHEAD = 16.0
"""Nats by which an effect is ahead of each rival where it can be separated: a probability of 0.95 needs log
19 = 3, and what is won scatters by sqrt(2 x 16) = 6, of which 3 + 2 x 6 = 15 leaves room for two."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Judged:
    """What an answer was worth.

    Attributes
    ----------
    kind : str
        `nothing`, `operators`, `separable`, `confounded`, `two`, `two_close` (one of them is confounded),
        `outside`, `removed`.
    times : float or None
        Size of the smallest effect, in units of 1x.
    names : tuple of str
        Given, in order, each once, without those that are allowed.
    verdict : str
        `error` where the diagnosis failed.
    first, alone : bool
        The first name is a planted one; and no other is given, as itself or as a tie.
    found : bool
        A planted name is the first, or tied with it.
    wrong : bool
        The first name is another than planted, and does not say that it may be the planted one.
    held, close : bool
        All planted names are given or tied; and none but these and their rivals.
    every, extra : bool
        Every planted name is given, not only as a tie; and one more.
    unknown : bool
        It says that something is missing, without a name.
    growth : float or None
        Largest growth of the error on the sealed days over the horizons, as a share.
    beyond : float or None
        The same over the greater of two errors, without the effects and of the model that knows the truth.
    closed : tuple of float or None
        Share of the gap closed at each horizon; None where there is no gap to close.
    covered : tuple of (str, bool)
        Parameters with an interval, and whether the planted value is in it.
    chances : tuple of (float, bool)
        Probability of each name of the ranking, and whether it is planted.
    """

    kind: str
    times: float | None
    names: tuple[str, ...]
    verdict: str
    first: bool
    alone: bool
    found: bool
    wrong: bool
    held: bool
    close: bool
    every: bool
    extra: bool
    unknown: bool
    growth: float | None
    beyond: float | None
    closed: tuple[float | None, ...]
    covered: tuple[tuple[str, bool], ...]
    chances: tuple[tuple[float, bool], ...]

    @property
    def gap_closed(self) -> float | None:
        """Median over the horizons that have a gap."""
        shares = [share for share in self.closed if share is not None]
        return float(np.median(shares)) if shares else None


def kind_of(truth: Table) -> str:
    """The kind of a truth; one effect or two by how far the nearest rival is."""
    near = min(truth["rivals"].values(), default=np.inf) < AHEAD
    if truth["kind"] == "one":
        return "confounded" if near else "separable"
    return "two_close" if near and truth["kind"] == "two" else str(truth["kind"])


def judge(answer: Table, truth: Table, floor: Sequence[float] | None = None) -> Judged:
    """Judge an answer.

    Parameters
    ----------
    answer : dict
        As diagnosis.json; or with `error`.
    truth : dict
        See :func:`benchmarks.exam.hiding.plant`.
    floor : sequence of float, optional
        Errors of the model that knows the truth, by horizon.
    """
    failed = "error" in answer
    planted = {t["name"] for t in truth["effects"]} - set(truth["excluded"])
    known = planted if truth["kind"] in ("one", "two") else set[str]()
    allowed = set(truth["allowed"]) - known
    given = [e for e in answer.get("effects", []) if e["name"] not in allowed]
    names = tuple(dict.fromkeys(e["name"] for e in given))
    ties = {name for e in given for name in e["tied_with"]} - allowed
    tied_first = set(given[0]["tied_with"]) if given else set()
    rivals = {name for name, nats in truth["rivals"].items() if nats < AHEAD}
    verdict = "error" if failed else str(answer["verdict"])
    stands = verdict != "did_not_hold"  # a right name that is taken back is not found; a wrong one is there
    right = bool(names) and names[0] in known
    tied = bool(tied_first & known)
    first, found = right and stands, (right or tied) and stands
    return Judged(
        kind=kind_of(truth),
        times=min(truth["times"], default=None),
        names=names,
        verdict=verdict,
        first=first,
        alone=first and len(names) == 1 and not tied_first - allowed,
        found=found,
        wrong=failed or (bool(names) and not right and not tied),
        held=stands and bool(known) and known <= set(names) | ties,
        close=not (set(names) | ties) - known - rivals,
        every=stands and bool(known) and known <= set(names),
        extra=bool(set(names) - known - (rivals if right or tied else set())),
        unknown=not names and verdict == "unknown",
        growth=growth(answer),
        beyond=None if floor is None else growth(answer, floor),
        closed=closed(answer, floor),
        covered=tuple(covering(given, truth)),
        chances=tuple(chances(answer, known, allowed)),
    )


def chances(answer: Table, known: set[str], allowed: set[str]) -> list[tuple[float, bool]]:
    """Probability of each name, summed over the explanations that hold it, and whether it is planted."""
    total: dict[str, float] = {}
    for one in answer.get("ranking") or []:
        for name in set(one["names"]):
            total[name] = total.get(name, 0.0) + float(one["probability"])
    if not total:
        total = {
            e["name"]: float(e["probability"])
            for e in answer.get("effects", [])
            if e.get("probability") is not None
        }
    return [
        (min(p, 1.0), name in known)
        for name, p in sorted(total.items())
        if p >= LEAST and name not in allowed
    ]


def growth(answer: Table, floor: Sequence[float] | None = None) -> float | None:
    """Largest growth of the error of the sealed days from the plain model to the answer's, over horizons.

    With a floor only what exceeds that as well is growth: operators hold the level, and what they do about
    the weather is in the logs, so that too large a surface forecasts the level better than the true one.
    """
    gap = answer.get("gap")
    if not gap:
        return None
    ends, bases = described(gap), gap["rmse_baseline"]
    if floor is not None:
        bases = [base and max(base, least or 0.0) for base, least in zip(bases, floor, strict=True)]
    shares = [end / base - 1.0 for end, base in zip(ends, bases, strict=True) if base and end is not None]
    return max(shares, default=None)


def described(gap: Table) -> list[float | None]:
    """Errors with all effects, events timed on the day itself where the answer says so."""
    return list(gap.get("rmse_described") or gap["rmse_augmented"])


def closed(answer: Table, floor: Sequence[float] | None) -> tuple[float | None, ...]:
    """Share of the squared error above the floor that is gone, at each horizon."""
    gap = answer.get("gap")
    if not gap or floor is None:
        return ()
    shares: list[float | None] = []
    for base, end, least in zip(gap["rmse_baseline"], described(gap), floor, strict=True):
        if None in (base, end, least) or base**2 - least**2 <= EXCESS * base**2:
            shares.append(None)
        else:
            shares.append((base**2 - (end or 0.0) ** 2) / (base**2 - least**2))
    return tuple(shares)


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
        for p in e["parameters"]:
            value = table.get(p["name"].split("[")[0])
            if value is None or isinstance(value, list) or p["low"] is None or p["high"] is None:
                continue
            if not p["high"] > p["low"]:
                continue
            low, high = p["low"], p["high"]
            if p["unit"] == "h" and p["name"] == "hour":  # round the clock
                middle = 0.5 * (low + high)
                value = middle + (value - middle + 12.0) % 24.0 - 12.0
            found.append((f"{e['name']}.{p['name'].split('[')[0]}", bool(low <= value <= high)))
    return found
