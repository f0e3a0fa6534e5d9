"""The law of delay and discharge, ``T = T0 (Q / Q0)^-b``: its posterior on a grid, under Student's t.

Far days count less, and days that err alike widen the intervals: blocks of neighbours replace single days.

Within a sample a delay may be more of a reading than a measurement: a wave that passes between two samples
gives one fraction for all travel times of that sample. The law therefore has one hypothesis for each share
of the travel time's fraction that a delay's fraction shows, and its moments are averaged over them:

- a share of 1: the delays are the travel times, each with an error;
- less: the same, with the fractions drawn together, so that the delay jumps from sample to sample;
- none: only the sample is known, by the day's probabilities, and the fractions follow one distribution.

A part of the place's error is common to all days and concerns T0.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.special import stdtrit

from rivid.errors import RividError
from rivid.types import Floats

LEVEL = 0.9
"""Probability of the intervals."""

TAILS = 4.0
"""Degrees of freedom of Student's t: the fewer, the less a far day pulls. The closed forms are those of 4."""

BULK = 0.8310034937840101
"""Scale m of this t that fits a normal variable z of unit variance best: E[5 z^2 / (4 m^2 + z^2)] = 1. The
bulk of the days is normal, the tails are for days that are wrong."""

BLOCK = 14
"""Smallest number of calendar days that are left out together; more where the residuals are correlated for
longer than a quarter of that, as long as :data:`LEAST_BLOCKS` remain."""

LEAST_BLOCKS = 6
"""Fewer blocks give no law."""

LEAST_RANGE = 0.1
"""Smallest range of ln Q [-]."""

CLASSES = 5
"""Rows of the table."""

IN_A_BLOCK = 4.0
"""Length of a block over the correlation time: the correlation lost between two blocks is then small."""

STEEPEST = 1.0
"""Largest |b|: at a constant section the velocity of the water grows as the discharge, and no wave's more."""

SCATTERS = 1e-3, 0.5
"""Scales of ln T about the law that are tried [-]: below and above those of any record."""

SHARES = 1.0, 0.5, 0.25
"""Shares of the fraction of a sample that the delays may show, beside none."""

PLACE = 0.15
"""Error of the place of a front that all days have in common [samples]: docs/accuracy_posterior.md."""

GRID = 25, 25, 13
"""Points of the grid in ln T0, b and ln scatter, of which each round keeps what matters."""

FINE = 500
"""Travel times at which the likelihood of a day is computed; in between it is interpolated. With 8,000 the
intervals of 28 simulated records are the same within 0.3 %."""

ROUNDS = 12
"""Largest number of rounds; three to five are usual."""

NATS = 10.0
"""What is less likely than the best point by more does not matter."""

FRACTIONS = 1000
"""Points of the distribution of the fractions of a sample."""

WORKED = 512
"""Days worked on together, which bounds the memory."""

Likelihood = Callable[[slice, Floats, float], Floats]
"""Log likelihood of some days at travel times whose ln is given, shape (G,), and a scale: shape (G, days)."""


class Days(NamedTuple):
    """What is known of n days; with samples the delays are in samples."""

    x: Floats  # ln(Q / Q0)
    T: Floats
    day: NDArray[np.intp]
    probability: Floats | None = None  # of each sample, (n, D)
    edges: Floats | None = None  # between the samples, (D + 1,)


class Posterior(NamedTuple):
    """Moments under one hypothesis."""

    mean: Floats  # of (ln T0, b)
    covariance: Floats
    square: float  # of the scale of ln T
    evidence: float  # log
    blocks: int  # of days


def shown(days: Days, share: float) -> Likelihood:
    """The delays show a share of the fraction of a sample, drawn together to the place where they lie."""
    turn = complex(np.exp(2j * np.pi * days.T).mean())
    centre = 0.5 if share == 1.0 else float(np.angle(turn)) / (2.0 * np.pi) % 1.0

    def log_likelihood(rows: slice, m: Floats, s: float) -> Floats:
        T = np.exp(m)
        whole = np.floor(T) if share < 1.0 else T - 0.5
        q = np.maximum(whole + centre + share * (T - whole - 0.5), 1e-3)
        log_p = _log_pdf(np.log(days.T[rows]) / s - np.log(q)[:, None] / s)
        log_p -= np.log(s * days.T[rows])
        return log_p

    return log_likelihood


def hidden(days: Days) -> Likelihood:
    """The delays show their sample alone, as probable as the day has it.

    Their fractions follow one distribution: a kernel on a circle, of the width that predicts each fraction
    best from the others.
    """
    assert days.probability is not None and days.edges is not None
    at = (days.T % 1.0 * FRACTIONS).astype(int) % FRACTIONS
    count, around = np.fft.rfft(np.bincount(at, minlength=FRACTIONS)), np.arange(FRACTIONS) / FRACTIONS
    tried = []
    for width in np.geomspace(SCATTERS[0], SCATTERS[1], 12):
        kernel = np.exp(_log_pdf(np.minimum(around, 1.0 - around) / width))
        kernel *= FRACTIONS / kernel.sum()
        others = np.fft.irfft(count * np.fft.rfft(kernel), FRACTIONS)[at] - kernel[0]
        tried.append(np.log(np.maximum(others / max(len(at) - 1, 1), 1e-12)))
    fraction = max(tried, key=np.sum)
    with np.errstate(divide="ignore"):
        edges = np.log(np.maximum(days.edges, 0.0))
    # over the likeliest: a day's doubt of its sample is often that of all days, and no chance of each
    p = days.probability / days.probability.max(axis=1, keepdims=True)
    steps = -np.diff(np.pad(p, [(0, 0), (1, 1)]), axis=1)  # by parts: a factor of each edge

    def log_likelihood(rows: slice, m: Floats, s: float) -> Floats:
        z = np.clip((edges - m[:, None]) / s, -1e6, 1e6)  # an edge may be at zero
        r = z / np.sqrt(TAILS + z * z)
        below = 0.5 + 0.25 * r * (3.0 - r * r)
        return np.asarray(np.log(np.maximum(below @ steps[rows].T, 1e-300)) + fraction[rows])

    return log_likelihood


def _log_pdf(z: Floats) -> Floats:
    """Log density of Student's t of 4."""
    w = z * z  # in place: new arrays of this size take most of the time of the law
    w += TAILS
    np.log(w, out=w)
    w *= -2.5
    w += np.log(0.375) + 2.5 * np.log(TAILS)
    return w


def posterior(days: Days, log_likelihood: Likelihood) -> Posterior:
    """Moments of (ln T0, b) from even priors of ln T0, b and ln scatter.

    The grid shrinks to what matters, a round at a time. Days that err alike widen the covariance: by how much
    the sums of the scores over blocks vary more than the posterior has it.
    """
    x, T = days.x, days.T
    step = 0.0 if days.edges is None else 1.0
    ends = np.log([max(T.min() - step, 0.5 * T.min()), T.max() + step]) + [-SCATTERS[0], SCATTERS[0]]
    whole = np.array([ends, [-STEEPEST, STEEPEST], np.log(SCATTERS)])
    box = whole.copy()
    parts = [slice(first, first + WORKED) for first in range(0, len(x), WORKED)]
    for _ in range(ROUNDS):
        a, b, scale = (np.linspace(low, high, n) for (low, high), n in zip(box, GRID, strict=True))
        reach = np.abs(x).max() * np.abs(b).max()
        m = np.linspace(a[0] - reach, a[-1] + reach, FINE)
        log_p = np.zeros(GRID)
        for rows in parts:
            at = (a[:, None, None] - b[:, None] * x[rows] - m[0]) / (m[1] - m[0])
            gathered = _weights(at, FINE)
            for k, s in enumerate(np.exp(scale)):
                log_p[..., k] += (gathered @ log_likelihood(rows, m, s).ravel()).reshape(GRID[:2])
        matters = log_p > log_p.max() - NATS
        before = box.copy()
        for axis, points in enumerate((a, b, scale)):
            some = points[matters.any(axis=tuple({0, 1, 2} - {axis}))]
            more = points[1] - points[0]
            box[axis] = max(some[0] - more, box[axis, 0]), min(some[-1] + more, box[axis, 1])
        if (np.ptp(box, axis=1) > 0.75 * np.ptp(before, axis=1)).all():
            break
    p = np.exp(log_p - log_p.max())
    evidence = log_p.max() + np.log(p.mean()) + np.log(np.ptp(before, axis=1) / np.ptp(whole, axis=1)).sum()
    p /= p.sum()
    theta = np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1).reshape(-1, 2)
    line = p.sum(axis=2).ravel()
    mean = line @ theta
    V = (theta - mean).T * line @ (theta - mean)
    square = float(p.sum(axis=(0, 1)) @ np.exp(2.0 * scale))
    m, s = mean[0] - mean[1] * x, float(np.sqrt(square))
    score = np.concatenate([_score(log_likelihood, rows, m[rows], s) for rows in parts])
    block = _blocks(days.day, _length(days.day, score))
    sums = np.stack([np.bincount(block, score), np.bincount(block, -x * score)])
    wider = np.sqrt(np.maximum(np.diag(V @ (sums @ sums.T) @ V) / np.diag(V), 1.0))
    return Posterior(mean, V * np.outer(wider, wider), square, float(evidence), int(block.max()) + 1)


def _weights(at: Floats, G: int) -> csr_array:
    """Weights of values, shape (G, days), in the sums over days of those at fractional rows, (..., days)."""
    days = at.shape[-1]
    row = np.clip(at.astype(np.int32), 0, G - 2)
    first, part = row * days + np.arange(days, dtype=np.int32), at - row
    pairs = (np.stack(pair, axis=-1).ravel() for pair in ((1.0 - part, part), (first, first + days)))
    ends = np.arange(0, 2 * at.size + 1, 2 * days, dtype=np.int32)
    return csr_array((*pairs, ends), shape=(at.size // days, G * days))


def _score(log_likelihood: Likelihood, rows: slice, m: Floats, s: float) -> Floats:
    """Derivative of each day's log likelihood by ln T; Student's t has none beyond 1.25 / s, a jump may."""
    ends = np.linspace(m.min() - s, m.max() + s, FINE)
    values = log_likelihood(rows, ends, s).T
    low, high = (
        np.array([np.interp(at, ends, day) for at, day in zip(m + d, values, strict=True)])
        for d in (-0.5 * s, 0.5 * s)
    )
    return np.asarray(np.clip((high - low) / s, -1.25 / s, 1.25 / s))


def alike(days: NDArray[np.intp], score: Floats) -> float:
    """Correlation time of the scores [days]: 1 for unrelated days.

    One and twice the sum of the correlations between days so far apart, up to the first that is not positive.
    """
    pull = np.full(int(days[-1] - days[0]) + 1, np.nan)
    pull[days - days[0]] = score
    known = np.isfinite(pull)
    pull = np.where(known, pull, 0.0)
    size, total = float((pull**2).sum() / known.sum()), 1.0
    for lag in range(1, len(pull) // 4):
        pairs = int((known[lag:] & known[:-lag]).sum())
        related = float(pull[lag:] @ pull[:-lag]) / (size * pairs) if pairs and size > 0.0 else 0.0
        if related <= 0.0:
            break
        total += 2.0 * related
    return total


def _length(days: NDArray[np.intp], score: Floats) -> int:
    """Length of the blocks [days]."""
    longest = max((int(days[-1] - days[0]) + 1) // LEAST_BLOCKS, BLOCK)
    return int(np.clip(np.ceil(IN_A_BLOCK * alike(days, score)), BLOCK, longest))


@dataclass(frozen=True)
class DelayTable:
    """The law at a few discharges, one row for each class of as many days; arrays of shape (classes,)."""

    discharge_low: Floats  # edges of the class [m3/s]
    discharge_high: Floats
    discharge: Floats  # median of its days [m3/s]; the law is given there
    delay: Floats  # by the law [unit of the delays], and its interval
    low: Floats
    high: Floats
    day_low: Floats  # interval of the delay of a single day
    day_high: Floats
    observed: Floats  # median of the days' own delays
    n: NDArray[np.intp]  # days


@dataclass(frozen=True)
class DelayLaw:
    """``T = T0 (Q / Q0)^-b``; NaN where the status is not "ok", which `message` then explains."""

    status: str  # "ok", "too_few_days" or "even_discharge"
    message: str
    days: int  # that count
    blocks: int  # of days
    table: DelayTable  # without rows where there is no law
    T0: float = np.nan  # delay at Q0 [unit of the delays], and its interval
    T0_low: float = np.nan
    T0_high: float = np.nan
    b: float = np.nan  # power by which the delay falls as the discharge grows [-], and its interval
    b_low: float = np.nan
    b_high: float = np.nan
    Q0: float = np.nan  # geometric mean of the days' discharges [m3/s]
    covariance: Floats = field(default_factory=lambda: np.full((2, 2), np.nan))  # of (ln T0, b)
    scatter: float = np.nan  # standard deviation of ln T about the law, wrong days apart [-]
    level: float = LEVEL  # probability of the intervals
    # by how much all delays may be too long, and too short: its intervals of delays include it
    doubt: tuple[float, float] = (0.0, 0.0)

    def delay(self, discharge: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Delay by the law at any discharge [m3/s], and its interval, each of the discharge's shape.

        Outside the range of the discharges this is an extrapolation.
        """
        x = np.log(np.asarray(discharge, float) / self.Q0)
        middle = np.log(self.T0) - self.b * x
        V = self.covariance
        sd = np.sqrt(np.maximum(V[0, 0] - 2.0 * x * V[0, 1] + x * x * V[1, 1], 0.0))
        half = _factor(self.blocks) * sd
        long, short = self.doubt
        return np.exp(middle), np.maximum(np.exp(middle - half) - long, 0.0), np.exp(middle + half) + short


def delay_law(
    discharge: ArrayLike, delay: ArrayLike, *, day: ArrayLike | None = None,
    probability: ArrayLike | None = None, edges: ArrayLike | None = None,
) -> DelayLaw:  # fmt: skip
    """Delay against discharge.

    `discharge` [m3/s] and `delay` [samples, or any unit of time] have shape (days,); a day with a NaN, or
    with a value that is not positive, does not count. `day` is the number of the calendar day, rising, which
    shows what days are neighbours; without it, the row. `probability`, shape (days, D), is that of each
    sample on each day, and `edges`, shape (D + 1,), the even times between the samples [unit of the delays]:
    with them the fractions of a sample count as far as they follow the discharge. RividError for shapes that
    do not fit, or days that do not rise.

    Source: weights of Student's t, K. L. Lange et al., "Robust statistical modeling using the t
    distribution", JASA 84 (1989), 881-896; a posterior widened by the scores of blocks, M. Ribatet et al.,
    "Bayesian inference from composite likelihoods", Statistica Sinica 22 (2012), 813-845.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> Q = rng.uniform(100.0, 800.0, 90)
    >>> law = delay_law(Q, 8.0 * (Q / 300.0) ** -0.3 * np.exp(0.01 * rng.normal(size=90)))
    >>> round(law.b, 2), law.b_low < 0.3 < law.b_high, law.table.n.tolist()
    (0.3, True, [18, 18, 18, 18, 18])
    """
    Q, T, days, p = _checked(discharge, delay, day, probability)
    n, blocks = len(Q), len(np.unique(_blocks(days, BLOCK)))
    if blocks < LEAST_BLOCKS:
        why = f"{n} days in {blocks} block{'s' * (blocks != 1)} of {BLOCK} days: {LEAST_BLOCKS} blocks"
        return DelayLaw("too_few_days", f"{why} are needed", n, blocks, _table([], []))
    Q0 = float(np.exp(np.log(Q).mean()))
    x = np.log(Q / Q0)
    if np.ptp(x) < LEAST_RANGE:
        why = f"the discharge goes from {Q.min():.4g} to {Q.max():.4g} m3/s: too constant for a law"
        return DelayLaw("even_discharge", why, n, blocks, _table([], []))
    unit, common, known, prior = 1.0, 0.0, Days(x, T, days), [1.0]
    if p is None or edges is None:
        hypotheses = [shown(known, 1.0)]
    else:
        bounds = np.asarray(edges, float)
        unit, common = float(bounds[1] - bounds[0]), PLACE
        known = Days(x, T / unit, days, p, bounds / unit)
        hypotheses = [hidden(known), *(shown(known, share) for share in SHARES)]
        # days of one sample fit b / share as well as b, so that an even prior of b would prefer the least
        prior = [1.0, *SHARES]
    found = [posterior(known, one) for one in hypotheses]
    evidence = np.log(prior) + [one.evidence for one in found]
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    blocks = found[int(np.argmax(weight))].blocks
    mean = weight @ np.array([one.mean for one in found])
    away = np.array([one.mean for one in found]) - mean
    V = np.tensordot(weight, [one.covariance for one in found], 1) + (away.T * weight) @ away
    V[0, 0] += (common / np.exp(mean[0])) ** 2
    T0, b = unit * float(np.exp(mean[0])), float(mean[1])
    scatter = float(np.sqrt(weight @ [one.square for one in found])) / BULK
    half = _factor(blocks) * np.sqrt(np.diag(V))

    classes, rows = np.array_split(np.argsort(Q, kind="stable"), min(CLASSES, n)), []
    for take in classes:
        at = np.array([1.0, -float(np.median(x[take]))])
        middle, variance = np.log(unit) + float(at @ mean), float(at @ V @ at)
        sure = _factor(blocks) * np.sqrt(variance)
        single = _student(TAILS) * np.sqrt(variance + (BULK * scatter) ** 2)
        band = np.exp([middle, middle - sure, middle + sure, middle - single, middle + single])
        rows.append([Q[take].min(), Q[take].max(), np.median(Q[take]), *band, np.median(T[take])])
    return DelayLaw(
        "ok", "", n, blocks, _table(rows, [len(take) for take in classes]),
        T0=T0, T0_low=T0 * float(np.exp(-half[0])), T0_high=T0 * float(np.exp(half[0])), b=b,
        b_low=b - float(half[1]), b_high=b + float(half[1]), Q0=Q0, covariance=V, scatter=scatter,
    )  # fmt: skip


def _checked(
    discharge: ArrayLike, delay: ArrayLike, day: ArrayLike | None, probability: ArrayLike | None
) -> tuple[Floats, Floats, NDArray[np.intp], Floats | None]:
    """The days that count."""
    Q, T = np.asarray(discharge, float), np.asarray(delay, float)
    if Q.ndim != 1:
        raise RividError(f"discharge has shape {Q.shape}: expected (days,)")
    days = np.arange(len(Q)) if day is None else np.asarray(day, np.intp)
    for name, shape in (("delay", T.shape), ("day", days.shape)):
        if shape != Q.shape:
            raise RividError(f"{name} has shape {shape}: expected {Q.shape}, that of the discharge")
    if (np.diff(days) <= 0).any():
        raise RividError("day does not rise from row to row: sort the days, and give each once")
    with np.errstate(invalid="ignore"):
        good = np.isfinite(Q) & (Q > 0.0) & np.isfinite(T) & (T > 0.0)
    if probability is None:
        return Q[good], T[good], days[good], None
    p = np.asarray(probability, float)
    if p.ndim != 2 or len(p) != len(Q):
        raise RividError(f"probability has shape {p.shape}: expected ({len(Q)}, D), a row for each day")
    good &= np.isfinite(p).all(axis=1)
    return Q[good], T[good], days[good], p[good]


def _blocks(days: NDArray[np.intp], length: int) -> NDArray[np.intp]:
    """Number of the block of each day: blocks of calendar days, from 0, none empty."""
    return np.asarray(np.unique((days - days[:1]) // length, return_inverse=True)[1], np.intp)


def _student(freedom: float) -> float:
    """Half width of the interval of Student's t."""
    return float(stdtrit(freedom, 0.5 + 0.5 * LEVEL))


def _factor(blocks: int) -> float:
    """Half width of the law's interval in standard deviations: two of the blocks are spent on the line."""
    return _student(max(blocks - 2, 1))


def _table(rows: list[list[float]], n: list[int]) -> DelayTable:
    a, b, middle, delay, low, high, day_low, day_high, observed = np.array(rows).reshape(-1, 9).T
    return DelayTable(a, b, middle, delay, low, high, day_low, day_high, observed, np.array(n, np.intp))
