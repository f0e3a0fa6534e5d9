"""Matching pursuit of events in one row of a residual: responses to a pulse or a recession of flow.

The response of the output to a unit step of flow that starts at sample s is h_{t-s}. Whitening W is linear,
so one whitened step for each start gives every atom without whitening again:

    pulse of D samples:  W p_s = W h_s - W h_{s+D},
    recession:           W e_s = (W h_s - W h_{s+1}) + rho W e_{s+1},    rho = exp(-T_s / recession).

Starts before the row are events under way. Pati, Rezaiifar and Krishnaprasad (1993): take the atom that
gains most, fit all amplitudes again, go on until the next one is not worth its price.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from rivid.types import Bools, Floats

Shape = Literal["pulse", "recession"]
Whiten = Callable[[Floats, Floats], Floats]
"""Columns (..., days, n) and a row each that is NaN where a sample is missing, to whitened columns."""

VISIBLE = 0.05
"""Atoms with less than this share of the largest norm are not looked for: the row hardly sees them."""

LASTS = 2.5
"""Recessions for which rain is carried from day to day; after them 8 % of its peak flow is left."""

APART = 2
"""Samples between the starts of two recessions."""

PATTERNS = 2
"""Patterns of missing samples whose atoms are kept: most days have the same."""


@dataclass(frozen=True)
class Found:
    """An event in a row.

    Attributes
    ----------
    start : int
        Sample of the row; negative before its first one.
    size, size_se : float
    gain : float
        Log-likelihood lost without it, the others fitted again [nats].
    """

    start: int
    size: float
    size_se: float
    gain: float


def extended(kernel: Floats, length: int) -> Floats:
    """A step response (m,) of some length, going on as it ended: a pool rises, a river stays."""
    if len(kernel) >= length:
        return np.asarray(kernel[:length])
    slope = kernel[-1] - kernel[-2]
    beyond = kernel[-1] + slope * np.arange(1, length - len(kernel) + 1)
    return np.asarray(np.concatenate([kernel, beyond]), float)


def response(kernel: Floats, shape: Shape, samples: float, length: int) -> Floats:
    """Response (length,) of the output to a unit pulse or recession of some samples that starts at 0."""
    h = extended(kernel, length)
    if shape == "pulse":
        D = round(samples)
        return np.asarray(h - np.concatenate([np.zeros(min(D, length)), h[: max(length - D, 0)]]), float)
    flow = np.exp(-np.arange(length) / samples)
    size = 2 * length
    spread = np.fft.irfft(np.fft.rfft(np.diff(h, prepend=0.0), size) * np.fft.rfft(flow, size), size)
    return np.asarray(spread[:length], float)


class Atoms:
    """Whitened atoms of one kind for rows of n samples, whatever is missing in them.

    Parameters
    ----------
    kernel : ndarray, shape (m,)
        h, the output's change to a unit step of flow.
    shape : {"pulse", "recession"}
    grid : tuple of float
        Durations or recessions [samples].
    n : int
        Samples of a row.
    whiten : callable
    """

    def __init__(self, kernel: Floats, shape: Shape, grid: tuple[float, ...], n: int, whiten: Whiten) -> None:
        self.shape, self.grid, self.n, self.whiten = shape, grid, n, whiten
        self.before = int(np.ceil(max(grid) * (LASTS if shape == "recession" else 1.0)))
        """Starts before the row: index k of an atom is the start k - before."""
        h = extended(kernel, n + self.before)
        lag = np.arange(n) - (np.arange(self.before + n) - self.before)[:, None]
        self.steps: Floats = np.where(lag >= 0, h[np.maximum(lag, 0)], 0.0)
        self.first = tuple(max(self.before - int(np.ceil(x)) + 1, 0) for x in grid)
        """First atom to look for, for each of the grid: what is over before the row, or long past its peak,
        is not."""
        self._kept: dict[bytes, list[tuple[Floats, Floats]]] = {}

    def whitened(self, there: Bools) -> list[tuple[Floats, Floats]]:
        """For each of the grid: atoms (starts, n) and their norms (starts,), 0 where hardly visible."""
        key = there.tobytes()
        if key not in self._kept:
            while len(self._kept) >= PATTERNS:
                self._kept.pop(next(iter(self._kept)))
            like = np.where(there, 0.0, np.nan)[None]
            W = self.whiten(self.steps[:, None], like)[:, 0]
            self._kept[key] = [self._atoms(W, samples) for samples in self.grid]
        return self._kept[key]

    def _atoms(self, W: Floats, samples: float) -> tuple[Floats, Floats]:
        A = W.copy()
        if self.shape == "pulse":
            D = round(samples)
            A[: len(A) - D] -= W[D:]
        else:
            A[:-1] -= W[1:]
            rho = np.exp(-1.0 / samples)
            for s in range(len(A) - 2, -1, -1):
                A[s] += rho * A[s + 1]
        norm = np.sqrt((A * A).sum(1))
        norm[norm < VISIBLE * norm.max(initial=0.0)] = 0.0
        return A, norm


def pursue(
    A: Floats,
    norm: Floats,
    r: Floats,
    *,
    first: int,
    sign: int,
    apart: int,
    price: float,
    most: int,
    weight: float,
    carried: list[tuple[int, float, float]],
) -> tuple[list[Found], list[Found], float]:
    """Events of one sign in a whitened row.

    Parameters
    ----------
    A, norm : ndarray, shapes (starts, n) and (starts,)
        Atoms and their norms; 0 is never chosen.
    r : ndarray, shape (n,)
        Whitened residual.
    first : int
        Atoms before this one are not looked for.
    sign : {-1, 1}
    apart : int
        Least distance of two starts [samples].
    price : float
        Of an event [nats].
    most : int
        Events at most.
    weight : float
        Of the row's log-likelihood.
    carried : list of (int, float, float)
        Events of the row before: index, size and its standard error; they are free and cost nothing.

    Returns
    -------
    new, carried : list of Found
        `start` is an index of A.
    gain : float
        Of all, over none, prices of the new ones paid [nats].
    """
    told = [(a, 1.0 / max(se, 1e-12) ** 2) for _, a, se in carried]
    old = len(carried)
    fit = _fit(A, r, weight, [k for k, _, _ in carried], told)
    none = -0.5 * weight * float(r @ r)
    unit = np.where(norm > 0.0, sign * np.sqrt(weight) / np.where(norm > 0.0, norm, 1.0), 0.0)
    unit[:first] = 0.0
    refused = np.zeros(len(norm), bool)
    tries = 0
    while len(fit.starts) - old < most and tries < 3 * most and weight > 0.0:
        tries += 1
        worth = unit * (A @ fit.rest)
        worth[refused | _near(fit.starts, len(norm), apart)] = 0.0
        k = int(np.argmax(worth))
        # With the others fitted again an atom gains more than this, twice as much where it leans on them.
        if worth[k] ** 2 < price:
            break
        more = _settled(A, r, weight, unit, _fit(A, r, weight, [*fit.starts, k], told), old, apart, told)
        if (sign * more.size[old:] <= 0.0).any() or more.likelihood - fit.likelihood < price:
            refused[k] = True
        else:
            fit = more
    gains = 0.5 * fit.size**2 / np.maximum(fit.variance, 1e-300)  # exact: the likelihood is a parabola
    if len(fit.starts) > old and gains[old:].min() < price:
        kept = [k for i, k in enumerate(fit.starts) if i < old or gains[i] >= price]
        fit = _fit(A, r, weight, kept, told)
        gains = 0.5 * fit.size**2 / np.maximum(fit.variance, 1e-300)
    every = [
        Found(k, float(a), float(np.sqrt(v)), float(g))
        for k, a, v, g in zip(fit.starts, fit.size, fit.variance, gains, strict=True)
    ]
    return every[old:], every[:old], fit.likelihood - none - price * (len(every) - old)


class _Fit(NamedTuple):
    """Amplitudes of the atoms that start at `starts`: sizes, their variances, and what is left of the row."""

    starts: list[int]
    size: Floats
    variance: Floats
    likelihood: float
    rest: Floats


def _fit(A: Floats, r: Floats, weight: float, starts: list[int], told: list[tuple[float, float]]) -> _Fit:
    """Least squares; the first atoms have a mean and a precision from the row before."""
    if not starts:
        return _Fit([], np.zeros(0), np.zeros(0), -0.5 * weight * float(r @ r), r)
    X = A[starts]
    mean, precision = np.zeros(len(starts)), np.zeros(len(starts))
    if told:
        mean[: len(told)], precision[: len(told)] = np.array(told).T
    G = weight * (X @ X.T) + np.diag(precision)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(G), 1e-300))
    inverse = np.linalg.pinv(G * np.outer(scale, scale), rcond=1e-10, hermitian=True) * np.outer(scale, scale)
    size = inverse @ (weight * (X @ r) + precision * mean)
    rest = r - size @ X
    likelihood = -0.5 * (weight * float(rest @ rest) + float(precision @ (size - mean) ** 2))
    return _Fit(starts, size, np.diag(inverse).copy(), likelihood, rest)


def _near(starts: list[int], many: int, apart: int) -> Bools:
    """Starts that would share a sample with an event that is there."""
    near = np.zeros(many, bool)
    for k in starts:
        near[max(k - apart + 1, 0) : k + apart] = True
    return near


def _settled(
    A: Floats,
    r: Floats,
    weight: float,
    unit: Floats,
    fit: _Fit,
    old: int,
    apart: int,
    told: list[tuple[float, float]],
) -> _Fit:
    """Each new event at its best start given the others, once round: the first ones were chosen without."""
    if len(fit.starts) - old < 2:
        return fit
    starts = list(fit.starts)
    for i in range(old, len(starts)):
        others = starts[:i] + starts[i + 1 :]
        worth = unit * (A @ (fit.rest + fit.size[i] * A[starts[i]]))
        worth[_near(others, len(unit), apart) | (unit == 0.0)] = -np.inf
        k = int(np.argmax(worth))
        if k == starts[i]:
            continue
        moved = _fit(A, r, weight, [*starts[:i], k, *starts[i + 1 :]], told)
        if moved.likelihood > fit.likelihood:
            fit, starts[i] = moved, k
    return fit
