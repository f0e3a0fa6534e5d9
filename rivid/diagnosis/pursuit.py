"""Compiled matching pursuit on whitened steps of flow.

An atom consists of whitened steps W_s, one for each sample s at which a flow may begin. A search needs only
the Gram matrix of the steps and their products with the whitened row, so each atom costs n operations in a
row of n samples, whatever its duration. An event that begins at x and lasts D is

    (1 - u) W_s + u W_{s+1} - (1 - v) W_e - v W_{e+1},    x = s + u,    x + D = e + v,

which is exact, as flows are means over samples. For an event without an end D is infinite.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from rivid.types import Bools, Floats, Ints


class Steps(NamedTuple):
    """Whitened steps of one pattern of missing samples."""

    W: Floats  # (S, n): row s is a step that starts at sample s - before
    before: int  # number of starts before the row
    gram: Floats  # (S, S): filled row by row as needed
    have: Bools  # (S,): rows of `gram` that are computed


def steps_of(W: Floats, before: int, whole: bool = False) -> Steps:
    """Return steps with their Gram matrix, either still empty or `whole`."""
    return Steps(W, before, W @ W.T if whole else np.empty((len(W), len(W))), np.full(len(W), whole))


@njit(cache=True, error_model="numpy")
def receding(W: Floats, samples: float, rise: int) -> Floats:
    """Transform steps that start at each sample (S, n) to rises that recede exponentially.

    The flow rises linearly to 1 over `rise` samples, then falls by 1/e in `samples`; means over samples:

        e_s = q (W_s - W_{s+1}) + rho e_{s+1},    rho = exp(-1 / samples),    q = samples (1 - rho),
        (1 / rise) (W_s / 2 + W_{s+1} + ... + W_{s+rise-1} - (rise - 1/2) W_{s+rise}) + e_{s+rise}.
    """
    S, n = W.shape
    out = np.zeros((S, n))
    keep = np.exp(-1.0 / samples)
    first = samples * (1.0 - keep)
    out[S - 1] = first * W[S - 1]
    for s in range(S - 2, -1, -1):
        for t in range(n):
            out[s, t] = first * (W[s, t] - W[s + 1, t]) + keep * out[s + 1, t]
    if rise > 0:
        between = np.zeros(n)  # sum of the steps from s + 1 to s + rise - 1
        for j in range(1, min(rise, S)):
            between += W[j]
        for s in range(S):  # upwards: later rows do not have their rise yet
            end = s + rise
            for t in range(n):
                out[s, t] = (0.5 * W[s, t] + between[t]) / rise
                if end < S:
                    out[s, t] += out[end, t] - (1.0 - 0.5 / rise) * W[end, t]
                if rise > 1 and s + 1 < S:
                    between[t] += (W[end, t] if end < S else 0.0) - W[s + 1, t]
    return out


@njit(cache=True, error_model="numpy")
def _product(W: Floats, before: int, i: int, j: int) -> float:
    first = max(max(i, j) - before, 0)  # zero before its start
    return float(np.dot(W[i, first:], W[j, first:]))


@njit(cache=True, error_model="numpy")
def squares(W: Floats, before: int, D: float) -> Floats:
    """Compute squared norms (S,) of atoms that start at each sample and last D samples."""
    S = len(W)
    out = np.empty(S)
    whole = min(np.floor(D), S) if D < S else S
    m, v = int(whole), D - whole if D < S else 0.0
    for s in range(S):
        e = s + m
        a = _product(W, before, s, s)
        if e < S:
            a += (1.0 - v) * ((1.0 - v) * _product(W, before, e, e) - 2.0 * _product(W, before, s, e))
        if v > 0.0 and e + 1 < S:
            a += v * (v * _product(W, before, e + 1, e + 1) - 2.0 * _product(W, before, s, e + 1))
            a += 2.0 * v * (1.0 - v) * _product(W, before, e, e + 1)
        out[s] = max(a, 0.0)
    return out


@njit(cache=True, error_model="numpy")
def _row(steps: Steps, s: int) -> Floats:
    """Return the products of all steps with step s, (S,)."""
    if not steps.have[s]:
        for j in range(len(steps.W)):
            steps.gram[s, j] = _product(steps.W, steps.before, s, j)
        steps.have[s] = True
    row: Floats = steps.gram[s]
    return row


@njit(cache=True, error_model="numpy")
def _place(at: float, D: float, S: int, index: Ints, share: Floats) -> None:
    """Write the four steps of an event and their shares; steps beyond the row have the share 0."""
    index[:], share[:] = 0, 0.0
    s = int(np.floor(at))
    for i, k, w in ((0, s, 1.0 - (at - s)), (1, s + 1, at - s)):
        if 0 <= k < S:
            index[i], share[i] = k, w
    if at + D < S:
        e = int(np.floor(at + D))
        v = at + D - e
        for i, k, w in ((2, e, v - 1.0), (3, e + 1, -v)):
            if 0 <= k < S:
                index[i], share[i] = k, w


@njit(cache=True, error_model="numpy")
def _products(steps: Steps, index: Ints, share: Floats, out: Floats) -> None:
    """Write the products of all steps with an event, (S,)."""
    out[:] = 0.0
    for i in range(4):
        if share[i] != 0.0:
            row = _row(steps, index[i])
            for j in range(len(out)):
                out[j] += share[i] * row[j]


@njit(cache=True, error_model="numpy")
def _with(index: Ints, share: Floats, values: Floats) -> float:
    """Return the product of an event with a row, from the products of all steps with that row."""
    total = 0.0
    for i in range(4):
        total += share[i] * values[index[i]]
    return total


@njit(cache=True, error_model="numpy")
def _inner(steps: Steps, one: Ints, a: Floats, two: Ints, b: Floats) -> float:
    """Return the product of two events."""
    total = 0.0
    for i in range(4):
        if a[i] != 0.0:
            total += a[i] * _with(two, b, _row(steps, one[i]))
    return total


class Rows(NamedTuple):
    """The events of a row during the fit; arrays have room for more than the present number."""

    at: Floats  # (room,): starts, as indices of steps
    D: Floats  # (room,): durations [samples]
    step: Ints  # (room, 4): steps of each event
    share: Floats  # (room, 4)
    product: Floats  # (room, S): products of the event with all steps
    size: Floats  # (room,)
    mean: Floats  # (room,): prior mean and precision of the size
    precision: Floats


@njit(cache=True, error_model="numpy")
def _put(rows: Rows, k: int, at: float, D: float, steps: Steps) -> None:
    rows.at[k], rows.D[k] = at, D
    _place(at, D, len(steps.W), rows.step[k], rows.share[k])
    _products(steps, rows.step[k], rows.share[k], rows.product[k])


@njit(cache=True, error_model="numpy")
def _factor(rows: Rows, K: int) -> Floats:
    """Return the Cholesky factor (K, K) of the information matrix of the sizes."""
    L = np.empty((K, K))
    for k in range(K):
        for i in range(k + 1):
            total = _with(rows.step[i], rows.share[i], rows.product[k])
            if i == k:
                total = total * (1.0 + 1e-9) + rows.precision[k] + 1e-300
            for j in range(i):
                total -= L[k, j] * L[i, j]
            L[k, i] = np.sqrt(max(total, 1e-300)) if i == k else total / L[i, i]
    return L


@njit(cache=True, error_model="numpy")
def _fit(rows: Rows, K: int, c: Floats) -> float:
    """Fit the sizes; return the log-likelihood above that without events."""
    if K == 0:
        return 0.0
    L = _factor(rows, K)
    y = np.empty(K)
    gain = 0.0
    for k in range(K):
        y[k] = _with(rows.step[k], rows.share[k], c) + rows.precision[k] * rows.mean[k]
        gain -= 0.5 * rows.precision[k] * rows.mean[k] ** 2
        for j in range(k):
            y[k] -= L[k, j] * y[j]
        y[k] /= L[k, k]
        gain += 0.5 * y[k] * y[k]
    for k in range(K - 1, -1, -1):
        for j in range(k + 1, K):
            y[k] -= L[j, k] * y[j]
        y[k] /= L[k, k]
        rows.size[k] = y[k]
    return gain


@njit(cache=True, error_model="numpy")
def _wrong(rows: Rows, old: int, K: int, sign: int) -> bool:
    """Return whether a new event has a size of the wrong sign, or 0."""
    for k in range(old, K):
        if sign != 0 and sign * rows.size[k] <= 0.0:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _variances(rows: Rows, K: int) -> Floats:
    """Return the variances of the sizes (K,): the diagonal of the inverse information."""
    L = _factor(rows, K)
    out = np.zeros(K)
    for k in range(K):
        column = np.zeros(K)
        for i in range(k, K):
            column[i] = 1.0 if i == k else 0.0
            for j in range(k, i):
                column[i] -= L[i, j] * column[j]
            column[i] /= L[i, i]
        for i in range(K - 1, k - 1, -1):
            for j in range(i + 1, K):
                column[i] -= L[j, i] * column[j]
            column[i] /= L[i, i]
        out[k] = column[k]
    return out


@njit(cache=True, error_model="numpy")
def _rest(rows: Rows, K: int, c: Floats, x: Floats) -> None:
    """Write the products (S,) of all steps with the row minus its events."""
    x[:] = c
    for k in range(K):
        a, product = rows.size[k], rows.product[k]
        for s in range(len(x)):
            x[s] -= a * product[s]


@njit(cache=True, error_model="numpy")
def _best(
    x: Floats, durations: Floats, unit: Floats, apart: float, sign: int, rows: Rows, K: int, without: int,
    refused: Bools, low: Ints, high: int,
) -> tuple[float, int, int]:  # fmt: skip
    """Return the best atom from `low` to before `high`: root of twice its gain, start, index of duration."""
    # `x` (S,) is of the row minus its events; event `without` is added back.
    S = len(x)
    most, where, which = 0.0, -1, 0
    own = x.copy() if without >= 0 else x
    near = np.empty(S, np.bool_)
    for i in range(len(durations)):
        first = low[i]
        whole = min(np.floor(durations[i]), S) if durations[i] < S else S
        m, v = int(whole), durations[i] - whole if durations[i] < S else 0.0
        if without >= 0:
            for part, end in ((first, high), (first + m, high + m + 1)):
                for s in range(min(part, S), min(end, S)):
                    own[s] = x[s] + rows.size[without] * rows.product[without, s]
        near[first:high] = refused[i, first:high]
        for k in range(K):
            if k != without:
                a = max(int(np.ceil(rows.at[k] - apart + 1e-9)), first)
                near[a : max(min(int(np.ceil(rows.at[k] + apart - 1e-9)), high), a)] = True
        for s in range(first, high):
            if near[s] or unit[i, s] == 0.0:
                continue
            value = own[s]
            if s + m < S:
                value -= (1.0 - v) * own[s + m]
            if s + m + 1 < S:
                value -= v * own[s + m + 1]
            value = unit[i, s] * (sign * value if sign != 0 else abs(value))
            if value > most:
                most, where, which = value, s, i
    return most, where, which


@njit(cache=True, error_model="numpy")
def _ratio(n0: float, n1: float, q0: float, q1: float, q2: float) -> float:
    """Return u between 0 and 1 at which ``(n0 + u n1)^2 / (q0 + 2 u q1 + u^2 q2)`` is largest."""
    below = n0 * q2 - n1 * q1
    u = (n1 * q0 - n0 * q1) / below if below != 0.0 else 0.0
    best, value = 0.0, n0 * n0 / q0 if q0 > 0.0 else 0.0
    for other in (u, 1.0):
        q = q0 + 2.0 * other * q1 + other * other * q2
        if 0.0 < other <= 1.0 and q > 0.0 and (n0 + other * n1) ** 2 / q > value:
            best, value = other, (n0 + other * n1) ** 2 / q
    return best


@njit(cache=True, error_model="numpy")
def _moved(
    steps: Steps, rows: Rows, k: int, x: Floats, low: float, near: float, end: bool
) -> tuple[float, float]:
    """Return the best start (or end) of event k between samples, within `near`; x is the row without it."""
    at, D = rows.at[k], rows.D[k]
    best, best_at, best_D = -1.0, at, D
    one, two = np.empty(4, np.int64), np.empty(4, np.int64)
    a, b = np.empty(4), np.empty(4)
    first = np.floor((at + D if end else at) - near)
    for j in range(int(2.0 * near) + 1):
        x0 = first + j
        if end:
            at0, at1, D0, D1 = at, at, x0 - at, x0 + 1.0 - at
        else:
            at0, at1, D0, D1 = x0, x0 + 1.0, D, D
        if at0 < low or at1 > len(x) - 1 or D0 < 1.0:
            continue
        _place(at0, D0, len(x), one, a)
        _place(at1, D1, len(x), two, b)
        n0, n1 = _with(one, a, x), _with(two, b, x)
        q00, q01, q11 = (
            _inner(steps, one, a, one, a), _inner(steps, one, a, two, b), _inner(steps, two, b, two, b)
        )  # fmt: skip
        u = _ratio(n0, n1 - n0, q00, q01 - q00, q00 - 2.0 * q01 + q11)
        norm = q00 + 2.0 * u * (q01 - q00) + u * u * (q00 - 2.0 * q01 + q11)
        value = (n0 + u * (n1 - n0)) ** 2 / norm if norm > 0.0 else 0.0
        if value > best:
            best = value
            best_at = at0 + u * (at1 - at0)
            best_D = D0 + u * (D1 - D0)
    return best_at, best_D


AROUND = 8.0  # an event moves by at most this plus its duration after others are found [samples]
ROUNDS = 6  # maximum number of passes over the starts of a row; two or three are usual
STILL = 0.02  # largest move at which the passes end [samples]: a fiftieth of a sample changes no likelihood
NEAR = 2.0  # farthest move of a start in a pass [samples]


@njit(cache=True, error_model="numpy")
def _timed(
    steps: Steps, rows: Rows, K: int, old: int, c: Floats, sign: int, low: float, ends: bool,
    gain: float, moves: Bools,
) -> float:  # fmt: skip
    """Move the starts, or ends too, of the events in `moves` (K,) until they converge; return the gain."""
    x = np.empty(len(c))
    for _ in range(ROUNDS):
        far = 0.0
        for k in range(old, K):
            if not moves[k]:
                continue
            for end in range(2 if ends and np.isfinite(rows.D[k]) else 1):
                at, D = rows.at[k], rows.D[k]
                _rest(rows, K, c, x)
                x += rows.size[k] * rows.product[k]
                new_at, new_D = _moved(steps, rows, k, x, low, NEAR, end == 1)
                if abs(new_at - at) + abs(new_D - D if end else 0.0) < 1e-6:
                    continue
                _put(rows, k, new_at, new_D, steps)
                now = _fit(rows, K, c)
                if now < gain or _wrong(rows, old, K, sign):
                    _put(rows, k, at, D, steps)
                    _fit(rows, K, c)
                else:
                    far = max(far, abs(new_at - at), abs(new_D - D) if end else 0.0)
                    gain = now
        if far < STILL:
            break
    return gain


@njit(cache=True, error_model="numpy")
def _merged(
    steps: Steps, rows: Rows, K: int, old: int, c: Floats, sign: int, price: float, gain: float
) -> tuple[int, float]:  # fmt: skip
    """Merge consecutive events if this costs less than a price; return the number left and the gain."""
    k = old
    while k < K:
        for m in range(old, K):
            gap = rows.at[m] - rows.at[k] - rows.D[k]
            if m == k or rows.at[m] < rows.at[k] or not np.isfinite(rows.D[k]) or gap > AROUND:
                continue
            at, D = rows.at[:K].copy(), rows.D[:K].copy()
            _put(rows, k, at[k], max(at[m] + D[m], at[k] + D[k]) - at[k], steps)
            if m < K - 1:  # move the last one to m
                _put(rows, m, rows.at[K - 1], rows.D[K - 1], steps)
            now = _fit(rows, K - 1, c)
            wrong = _wrong(rows, old, K - 1, sign)
            if now > gain - price and not wrong:
                K, gain, k = K - 1, now, old - 1
                break
            _put(rows, k, at[k], D[k], steps)
            _put(rows, m, at[m], D[m], steps)
        k += 1
    return K, _fit(rows, K, c)


@njit(cache=True, error_model="numpy")
def _dropped(
    steps: Steps, rows: Rows, K: int, old: int, c: Floats, sign: int, low: float, ends: bool,
    price: float, gain: float,
) -> tuple[int, float]:  # fmt: skip
    """Remove events if this costs less than a price after moving those near; return number left and gain."""
    # The first pulse found of two that overlap lies between them, and a third one corrects it.
    k = old
    while k < K:
        at, D = rows.at[:K].copy(), rows.D[:K].copy()
        near = np.zeros(K, np.bool_)
        for m in range(old, K):
            last = D[m] if np.isfinite(D[m]) else AROUND
            near[m] = m != k and at[m] <= at[k] + D[k] + AROUND and at[m] + last + AROUND >= at[k]
        if near.any():
            if k < K - 1:
                _put(rows, k, at[K - 1], D[K - 1], steps)
            near[k] = near[K - 1]
            now = _fit(rows, K - 1, c)
            if not _wrong(rows, old, K - 1, sign):
                now = _timed(steps, rows, K - 1, old, c, sign, low, ends, now, near)
            if now > gain - price:
                K, gain = K - 1, now
                continue
            for m in range(old, K):
                if rows.at[m] != at[m] or rows.D[m] != D[m]:
                    _put(rows, m, at[m], D[m], steps)
            _fit(rows, K, c)
        k += 1
    return K, gain


@njit(cache=True, error_model="numpy")
def pursue(
    steps: Steps,
    c: Floats,  # (S,): products of the steps with the row
    durations: Floats,  # (L,): possible durations of an event [samples]
    unit: Floats,  # (L, S): 1 over the norms of the atoms; atoms with 0 are never chosen
    low: Ints,  # (L,): first start to consider
    apart: float,  # least distance of two starts [samples]
    sign: int,  # of all sizes; 0 allows either
    price: float,  # of an event [nats]
    most: int,  # maximum number of new events
    carried: Floats,  # (k, 4): events of the previous row: start, duration, size, standard error; no price
    timed: int,  # 1: starts between samples as well; 2: events that the others can replace are removed
    ends: bool,  # whether each event may have its own end time
) -> tuple[Floats, float]:
    """Find the events of a whitened row, after those carried over from the previous row.

    Returns start, duration, size and its variance of each event, (k + new, 4), and the gain of all over none
    minus the prices of the new ones [nats].
    """
    S, old = len(c), len(carried)
    room = old + most + 1
    rows = Rows(
        np.empty(room), np.empty(room), np.zeros((room, 4), np.int64), np.zeros((room, 4)),
        np.empty((room, S)), np.zeros(room), np.zeros(room), np.zeros(room),
    )  # fmt: skip
    for k in range(old):
        rows.mean[k], rows.precision[k] = carried[k, 2], 1.0 / max(carried[k, 3], 1e-12) ** 2
        _put(rows, k, carried[k, 0], carried[k, 1], steps)
    K = old
    gain = _fit(rows, K, c)
    refused = np.zeros((len(durations), S), np.bool_)
    free = np.zeros((len(durations), S), np.bool_)
    window, x = np.empty(len(durations), np.int64), np.empty(S)
    tries = 0
    while K - old < most and tries < 3 * most:
        tries += 1
        _rest(rows, K, c, x)
        worth, s, i = _best(x, durations, unit, apart, sign, rows, K, -1, refused, low, S)
        # With the others refitted an atom gains more than this: twice as much if it overlaps with them.
        if s < 0 or worth * worth < price:
            break
        at, D = rows.at[:K].copy(), rows.D[:K].copy()
        _put(rows, K, float(s), durations[i], steps)
        now = _fit(rows, K + 1, c)
        _rest(rows, K + 1, c, x)
        for k in range(old, K + 1 if K > old else K):  # move each to its best start nearby
            was_at, was_D = rows.at[k], rows.D[k]
            reach = AROUND + (was_D if was_D < S else 0.0)
            window[:] = np.maximum(low, int(was_at - reach))
            high = min(int(was_at + reach) + 1, S)
            _, s_k, i_k = _best(x, durations, unit, apart, sign, rows, K + 1, k, free, window, high)
            if s_k < 0 or (s_k == was_at and durations[i_k] == was_D):
                continue
            _put(rows, k, float(s_k), durations[i_k], steps)
            other = _fit(rows, K + 1, c)
            if other > now:
                now = other
            else:
                _put(rows, k, was_at, was_D, steps)
                _fit(rows, K + 1, c)
            _rest(rows, K + 1, c, x)
        if _wrong(rows, old, K + 1, sign) or now - gain < price:
            refused[i, s] = True
            for k in range(old, K):
                if rows.at[k] != at[k] or rows.D[k] != D[k]:
                    _put(rows, k, at[k], D[k], steps)
            _fit(rows, K, c)
        else:
            K, gain = K + 1, now
    for turn in range(timed):
        gain = _timed(steps, rows, K, old, c, sign, float(low.min()), ends, gain, np.ones(K, np.bool_))
        if turn == 0 and ends:
            K, gain = _merged(steps, rows, K, old, c, sign, price, gain)
        if turn == 1:
            K, gain = _dropped(steps, rows, K, old, c, sign, float(low.min()), ends, price, gain)
    variance = _variances(rows, K)
    kept = old
    for k in range(old, K):  # what is lost without it, exact: the log-likelihood is quadratic
        if 0.5 * rows.size[k] ** 2 / max(variance[k], 1e-300) >= price:
            if kept != k:
                _put(rows, kept, rows.at[k], rows.D[k], steps)
            kept += 1
    if kept < K:
        K = kept
        gain = _fit(rows, K, c)
        variance = _variances(rows, K)
    found = np.stack((rows.at[:K], rows.D[:K], rows.size[:K], variance), axis=1)
    return found, gain - price * (K - old)
