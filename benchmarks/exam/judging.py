"""Judge an answer by the truth: right and wrong names, and the closed share of the gap.

The functions are pure and take plain tables: the answer as in `diagnosis.json`, the truth as returned by
`benchmarks.exam.hiding`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

EXCESS = 0.1
"""A gap exists if the truth would remove more than this share of the squared error."""
LEAST = 0.01
"""Smallest probability of a name that the reliability diagram counts. A lower limit would count every name of
the catalogue."""
AHEAD = 16.0
"""Lead over each rival from which an effect counts as separable [nats]. A probability of 0.95 requires log 19
= 3. The gained log-likelihood scatters by sqrt(2 x 16) = 6, and 3 + 2 x 6 = 15 leaves a margin of two."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Judged:
    """Evaluation of an answer.

    Attributes
    ----------
    kind : str
        `nothing`, `operators`, `separable`, `confounded`, `two`, `two_close` (one of them is confounded),
        `outside`, `removed`.
    times : float or None
        Size of the smallest effect, in units of 1x.
    names : tuple of str
        Names in the answer, in order and without repetition, without the allowed ones.
    verdict : str
        `error` if the diagnosis failed.
    first, alone : bool
        Whether the first name is a hidden effect, and whether there is no other name, alone or as a tie.
    found : bool
        Whether the first name is a hidden effect or tied with one.
    wrong : bool
        Whether the first name is neither a hidden effect nor tied with one, or the diagnosis failed.
    held, close : bool
        Whether all hidden effects are named or tied, and whether there are no names but these and their
        rivals.
    every, extra : bool
        Whether all hidden effects are named, not only as a tie, and whether there is another name.
    unknown : bool
        Whether the verdict is that something without a name is missing.
    growth : float or None
        Largest relative growth of the error on the held-out days over the horizons.
    beyond : float or None
        The same relative to the larger of two errors: without effects, and of the model that knows the truth.
    closed : tuple of float or None
        Share of the gap closed at each horizon; None if there is no gap.
    covered : tuple of (str, bool)
        Parameters with an interval, and whether it contains the planted value.
    chances : tuple of (float, bool)
        Probability of each name of the ranking, and whether it is a hidden effect.
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
        """Median over the horizons with a gap."""
        shares = [share for share in self.closed if share is not None]
        return float(np.median(shares)) if shares else None


def kind_of(truth: Table) -> str:
    """Return the kind of a truth; of effects with rivals, by the lead over the nearest rival."""
    near = min(truth["rivals"].values(), default=np.inf) < AHEAD
    if truth["kind"] == "one":
        return "confounded" if near else "separable"
    return "two_close" if near and truth["kind"] == "two" else str(truth["kind"])


def judge(answer: Table, truth: Table, floor: Sequence[float] | None = None) -> Judged:
    """Judge an answer.

    Parameters
    ----------
    answer : dict
        Content of `diagnosis.json`, or a table with `error`.
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
    stands = verdict != "did_not_hold"  # a withdrawn right name is not found; a withdrawn wrong one counts
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
    """Return the probability of each name, summed over explanations, and whether it is a hidden effect."""
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
    """Return the largest relative growth of the held-out error from the plain model to the answer's.

    With a floor, growth is relative to the larger of the plain model's error and the floor. Operators hold
    the level and respond to the weather, and their response is in the logs, so a model with too large a
    surface area forecasts the level better than one with the true area.
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
    """Return the errors with all effects, with events timed on the day itself if the answer has them."""
    return list(gap.get("rmse_described") or gap["rmse_augmented"])


def closed(answer: Table, floor: Sequence[float] | None) -> tuple[float | None, ...]:
    """Return the closed share of the squared error above the floor, at each horizon."""
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
    """Return `effect.parameter` of each interval, and whether it contains the planted value.

    Effects with events are left out: the answer gives the sizes found, not an interval of their mean.
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
            if p["unit"] == "h" and p["name"] == "hour":  # modulo 24 h
                middle = 0.5 * (low + high)
                value = middle + (value - middle + 12.0) % 24.0 - 12.0
            found.append((f"{e['name']}.{p['name'].split('[')[0]}", bool(low <= value <= high)))
    return found
