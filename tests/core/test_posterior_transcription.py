"""Test p(d | y) against brute force: a regression for every day, equation, noise and place of the front."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import expit, log_ndtr, logsumexp
from scipy.stats import logistic

from rivid.core.posterior.daily import posterior
from rivid.core.posterior.front import LAG_TAPS, LAGGED, LAGS, LEAST_LAGGED, MODELS, log_evidence, structures
from rivid.core.posterior.noise import DRIFT_MEMORY, gram, noise_bank, spectral_factor
from rivid.core.settings import GUARD, PosteriorSettings
from tests import examples
from tests.core.posterior_days import commands, linear_days, wave_days

N = 300


def delayed(series, k, rows):
    return series[rows[0] - k : rows[-1] + 1 - k]


def regression(name, y, u, o, one, d, w, rows):
    """Return response and regressors (the front's first) of an equation, from prewhitened series of a day."""

    def v(series, lag):
        return w * delayed(series, lag, rows) + (1 - w) * delayed(series, lag + 1, rows)

    def at(series, lag):
        return delayed(series, lag, rows)

    if name in ("first order", "second order"):
        X = [v(u, d + 1), v(u, d + 2), at(y, 1)]
        X += [at(y, 2)] if name == "second order" else []
        X += [] if o is None else [at(o, 1), at(o, 2)]
        return at(y, 0), np.stack([*X, at(one, 0)], axis=1)
    rho = DRIFT_MEMORY if name == "drifting store" else 0.0
    dy, du, do = (None if s is None else np.append(np.zeros(1), s[1:] - rho * s[:-1]) for s in (y, u, o))
    response = at(dy, 0) - at(dy, 1)
    X = [v(du, d + 1)] + ([] if o is None else [at(do, 1)])
    return response, np.stack([*X, at(one, 0)], axis=1)


def shown(series, lag):
    """Return the reading of a gauge with a lag [samples] for a series that began at rest."""
    left = np.exp(-1.0 / lag)
    taps = lfilter([1 - (1 - left) * lag, (1 - left) * lag - left], [1, -left], np.eye(1, LAG_TAPS)[0])
    taps[-1] += 1 - taps.sum()
    return lfilter(taps, [1.0], series)


def slow_models(y, u, o, structure, first, last, n_lags):
    """Yield every model of an equation: log evidence, noise, lag or None, lagged inflow and outflow, d, w."""
    kinds = list(noise_bank()[structure.noises])
    where = [(d, w) for d in range(first, last + 1) for w in np.arange(10, 0, -1) / 10]
    models = []
    for C in kinds:
        white = whitened(C, y, u, o)
        models += [
            (slow_evidence(*white, structure, len(kinds), d, w, n_lags), C, None, u, o, d, w)
            for d, w in where
        ]
    if o is None or structure.name == "first order":
        return models
    top = [max(m[0] for m in models if m[1] is C) for C in kinds]
    best, worth = kinds[int(np.argmax(top))], logsumexp(top) - max(top)
    models = [(m[0] + np.log(1 - LAGGED), *m[1:]) for m in models]
    for lag in LAGS:
        behind = shown(u, lag), shown(o, lag)
        white = whitened(best, y, *behind)
        for d, w in where:
            if structure.is_store or d >= LEAST_LAGGED:
                log = slow_evidence(*white, structure, len(kinds), d, w, n_lags)
                models.append((log + worth + np.log(LAGGED / len(LAGS)), best, lag, *behind, d, w))
    return models


def whitened(C, *series):
    """Return the series and a constant, prewhitened."""
    return [None if s is None else lfilter([1.0], C, s) for s in (*series, np.ones(len(series[0])))]


def slow_evidence(y, u, o, one, structure, n_kinds, d, w, n_lags):
    """Return -(n/2) ln RSS - (P/2) ln n + ln Phi(t) - ln(kinds), by QR on the prewhitened rows."""
    rows = np.arange(n_lags, len(y))
    response, X = regression(structure.name, y, u, o, one, d, w, rows)
    q, r = np.linalg.qr(X)
    theta = np.linalg.solve(r, q.T @ response)
    rss = np.sum((response - X @ theta) ** 2)
    n = len(rows)
    sd = np.sqrt(rss / n * np.sum(np.linalg.inv(r)[0] ** 2))
    bic = 0.5 * (X.shape[1] + 1) * np.log(n)
    return -0.5 * n * np.log(rss) - bic + log_ndtr(np.clip(theta[0] / sd, -30, 30)) - np.log(n_kinds)


def slow_is_echo(y, u, o, candidate, n_lags):
    """Return whether a front at a third of the delay, with free coefficients of its echo, is more likely.

    The test is one regression for each kind of noise and share.
    """
    first, second = structures(True)[:2]
    n, bank = len(y) - n_lags, noise_bank()
    shares = np.arange(10, 0, -1) / 10
    waves = max(
        slow_evidence(*whitened(C, y, u, o), structure, len(bank[structure.noises]), candidate, w, n_lags)
        for structure in (first, second)
        for C in bank[structure.noises]
        for w in shares
    )

    def rss(response, X):
        return np.sum((response - X @ np.linalg.lstsq(X, response, rcond=None)[0]) ** 2)

    for d in range(2, (n_lags - 4) // 3 + 1):
        if not 3 * d <= candidate <= 3 * d + 3:
            continue
        for C in bank[first.noises]:
            white = whitened(C, y, u, o)
            rows = np.arange(n_lags, len(y))
            echo = np.stack([delayed(white[1], 3 * d + 1 + k, rows) for k in range(4)], axis=1)
            for w in shares:
                response, X = regression("second order", *white, d, w, rows)
                with_echo = np.hstack([X, echo])
                theta = np.linalg.lstsq(with_echo, response, rcond=None)[0]
                both = rss(response, with_echo)
                sd = np.sqrt(both / n * np.linalg.inv(with_echo.T @ with_echo)[0, 0])
                positive = log_ndtr(np.clip(theta[0] / sd, -30, 30))
                alone = slow_evidence(*white, second, len(bank[second.noises]), d, w, n_lags)
                fit = -0.5 * n * np.log(both) - 0.5 * 8 * np.log(n) + positive - np.log(6)
                by_front = 0.5 * n * np.log(rss(response, with_echo[:, 2:]) / both) + positive
                if by_front >= 0.6 * (fit - alone) and fit - 2.0 * np.log(n) > waves:
                    return True
    return False


@pytest.mark.parametrize("seed", range(examples(3, 1)))
@pytest.mark.parametrize("with_outflow", [True, False])
@pytest.mark.parametrize("days", [linear_days, wave_days])
def test_evidence_is_that_of_a_regression_for_each_candidate(days, with_outflow, seed):
    u, y, o, _ = days(2, seed, N)
    u, y, o = (a - a[:, :1] for a in (u, y, o))
    bank, first, last = noise_bank(), 1, 8
    G, n = gram(u, y, o if with_outflow else None, bank, last + 4)
    fronts, _ = log_evidence(G, n, with_outflow, first, last)
    rng = np.random.default_rng(seed)
    for which, structure in enumerate(structures(with_outflow)):
        kinds = bank[structure.noises]
        for _ in range(examples(25, 12)):
            i, k, d, j = (int(rng.integers(m)) for m in (2, len(kinds), last - first + 1, 10))
            out = o[i] if with_outflow else None
            white = whitened(kinds[k], y[i], u[i], out)
            slow = slow_evidence(*white, structure, len(kinds), first + d, (10 - j) / 10, last + 4)
            if np.isinf(fronts[which][k, d, j, i]):
                assert with_outflow and which < 2 and slow_is_echo(y[i], u[i], o[i], first + d, last + 4)
            else:
                assert fronts[which][k, d, j, i] == pytest.approx(slow, abs=1e-4)


def echoing_days(n, seed, N):
    """Return pools of first order in which the front returns, stronger, after three times its travel time."""
    rng = np.random.default_rng(seed)
    u, o = commands(rng, n, N)
    y = np.zeros_like(u)
    for k in range(1, N):
        came = [u[:, max(k - lag, 0)] - 300 for lag in (4, 12)]
        y[:, k] = 0.9 * y[:, k - 1] + 6e-4 * came[0] + 9e-4 * came[1] - 9e-4 * (o[:, k - 1] - 300)
        y[:, k] += 5e-4 * rng.normal(size=n)
    return u, y + 0.002 * rng.normal(size=y.shape), o


def test_an_echo_is_found_by_a_regression_for_each_candidate_and_is_not_taken_for_the_front():
    u, y, o = (a - a[:, :1] for a in echoing_days(1, 3, N))
    first, last = 2, 13
    G, n = gram(u, y, o, noise_bank(), last + 4)
    fronts, _ = log_evidence(G, n, True, first, last)
    is_echo = [bool(np.isinf(fronts[0][:, d, :, 0]).all()) for d in range(last - first + 1)]
    assert is_echo == [slow_is_echo(y[0], u[0], o[0], d, last + 4) for d in range(first, last + 1)]
    assert is_echo[11 - first] and not is_echo[3 - first]
    result = posterior(*echoing_days(4, 3, N))
    assert (result.candidates[np.argmax(result.probability, axis=1)] == 3).all()
    assert (result.probability[:, 8:].sum(axis=1) < 0.01).all()  # the echo's delay is 11


def slow_wave_place(travel, gate, s):
    """Return the place at which the front of a wave is found.

    The share that has passed at the next sample is found at the sample before the arrival, the rest one
    later.
    """
    n, f = divmod(travel, 1.0)
    passed = min((1 - f) / min(gate + s.wave_lag * travel, 1.0), 1.0)
    return passed * n + (1 - passed) * (n + 1)


def slow_below(edges, x, store, s):
    """Return the distribution function of the travel time at rising edges, for a front at x."""
    if store:
        return [expit((edge - x) / s.store_error) for edge in edges]
    first, last = s.d_min - GUARD, s.d_max + GUARD
    travel = np.arange(first + 0.025, last + 1, 0.05)
    likely = s.wave_store * logistic.pdf(travel, x, s.wave_error)
    for gate in np.arange(1, 16, 2) / 16 * s.wave_gate:
        place = [slow_wave_place(t, gate, s) for t in travel]
        likely += (1 - s.wave_store) / 8 * logistic.pdf(place, x, s.wave_error)
    return [likely[travel < edge].sum() / likely.sum() for edge in edges]


def slow_posterior(u, y, o, s):
    """Return weights, places and kinds of every model of a day, by one regression for each."""
    first, last = s.d_min - GUARD, s.d_max + GUARD
    y, u, o = y - y[0], u - u[0], o - o[0]
    within, between, places, stores = [], [], [], []
    for structure in structures(True):
        store = structure.is_store
        logs, priors = [], []
        for log, _, _, _, _, d, w in slow_models(y, u, o, structure, first, last, last + 4 + LAG_TAPS - 1):
            logs.append(log)
            priors.append(0.1 if store else (1 - s.sharp) / 10 + (s.sharp if w == 1 else 0))
            places.append(d + 1 - w)
            stores.append(store)
        logs, priors = np.array(logs), np.array(priors)
        inside = np.exp((logs - logs.max()) / (s.store_temperature if store else s.wave_temperature)) * priors
        within.append(inside / inside.sum())
        between.append(logsumexp(logs / s.between_temperature, b=priors))
    share = np.exp(np.array(between) - logsumexp(between))
    weight = np.concatenate([p * inside for p, inside in zip(share, within, strict=True)])
    return weight, places, stores


@pytest.mark.parametrize("days", [pytest.param(linear_days, marks=pytest.mark.long), wave_days])
def test_probability_is_the_flattened_sum_over_all_models(days):
    u, y, o, _ = days(1, 5, 120)
    s = PosteriorSettings(d_min=3, d_max=5, order=20)
    result = posterior(u, y, o, s)
    weight, places, stores = slow_posterior(u[0], y[0], o[0], s)
    tenths = np.arange(10 * (s.d_min - GUARD) + 1, 10 * (s.d_max + GUARD + 1)) / 10
    each = {front: slow_below(tenths, *front, s) for front in set(zip(places, stores, strict=True))}
    F = weight @ np.array([each[front] for front in zip(places, stores, strict=True)])
    below = dict(zip(tenths.round(1).tolist(), F.tolist(), strict=True))
    p = np.array([below[d + 1.0] - below[float(d)] for d in result.candidates])
    assert np.allclose(result.probability[0], p / p.sum(), atol=1e-4)
    assert result.beyond[0] == pytest.approx([below[s.d_min], 1 - below[s.d_max + 1.0]], abs=1e-4)
    best = result.candidates[np.argmax(p)]
    right = below[round(best + 1.1, 1)] - below[round(best - 0.1, 1)]
    assert result.right[0] == pytest.approx(right, abs=1e-4)
    for place, level in ((result.place, 0.5), (result.place_low, 0.05), (result.place_high, 0.95)):
        assert np.interp(place[0], tenths, F) == pytest.approx(level, abs=1e-3)


@pytest.mark.parametrize("with_outflow", [True, False])
@pytest.mark.parametrize("days", [linear_days, wave_days])
def test_the_response_is_that_of_the_likeliest_models_simulated(days, with_outflow):
    u, y, o, _ = days(1, 9, N)
    s = PosteriorSettings(d_min=3, d_max=6, order=25)
    result = posterior(u, y, o if with_outflow else None, s)
    d_hat = result.candidates[np.argmax(result.probability[0])]
    u, y, o = (a[0] - a[0, 0] for a in (u, y, o))
    models = []
    out = o if with_outflow else None
    n_lags = s.d_max + GUARD + 4 + (LAG_TAPS - 1 if with_outflow else 0)
    for structure in structures(with_outflow):
        for model in slow_models(y, u, out, structure, 1, 8, n_lags):
            if np.floor(model[-2] + 1 - model[-1] + 1e-9) == d_hat:
                models.append((model[0], structure, *model[1:]))
    models = sorted(models, key=lambda m: -m[0])[:MODELS]
    weight = np.exp((np.array([m[0] for m in models]) - models[0][0]) / s.between_temperature)
    weight /= weight.sum()
    h = np.zeros(s.order)
    for share, (_, structure, C, lag, *behind, d, w) in zip(weight, models, strict=True):
        rows = np.arange(n_lags, N)
        response, X = regression(structure.name, *whitened(C, y, *behind), d, w, rows)
        theta = np.linalg.lstsq(X, response, rcond=None)[0]
        front = np.zeros(s.order)
        for tap in range(structure.taps):
            front[d + 1 + tap] += theta[tap] * w
            front[d + 2 + tap] += theta[tap] * (1 - w)
        front = front if lag is None else shown(front, lag)
        a = [-1.0] if structure.is_store else list(-theta[structure.taps :][: structure.order])
        h += share * lfilter([1.0], [1.0, *a], front)
    assert np.allclose(result.fir[0], h, atol=1e-4 * np.abs(h).max())
    assert (result.fir_sd[0][d_hat + 2 :] > 0).all()


@pytest.mark.parametrize("ratio", [1e-4, 0.03, 2.0])
@pytest.mark.parametrize("a", [[1.0, -1.0], [1.0, -1.98, 0.98], [1.0, -0.5, 0.2]])
def test_a_spectral_factor_has_the_spectrum_and_a_stable_inverse(a, ratio):
    C = spectral_factor(np.array(a), ratio)
    z = np.exp(-1j * np.linspace(0.1, np.pi, 50))
    wanted = ratio + abs(np.polyval(a[::-1], z)) ** 2
    had = abs(np.polyval(C[::-1], z)) ** 2
    assert np.allclose(had / had[0], wanted / wanted[0], rtol=1e-6)
    assert (np.abs(np.roots(C)) < 1).all()
