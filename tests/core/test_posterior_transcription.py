"""p(d | y) against brute force: one regression for every day, equation, noise and place of the front."""

from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

from rivid.core.posterior import GUARD, PosteriorSettings, posterior
from rivid.core.posterior_front import log_evidence, structures
from rivid.core.posterior_gram import gram
from rivid.core.posterior_noise import DRIFT_MEMORY, noise_bank, prewhiten, spectral_factor
from tests.core.posterior_days import linear_days, wave_days

N = 300


def mixture(edge, centres, widths, weight):
    return weight @ (1 / (1 + np.exp((centres - edge) / widths)))


def delayed(series, k, rows):
    return series[rows[0] - k : rows[-1] + 1 - k]


def regression(name, y, u, o, one, d, w, rows):
    """Response, regressors (the front's first) of one equation, from prewhitened series of one day."""

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


def slow_evidence(y, u, o, structure, C, n_kinds, d, w, n_lags):
    """By QR on the rows themselves: -(n/2) ln RSS - (P/2) ln n + ln Phi(t) - ln(kinds)."""
    y, u, o, one = (None if s is None else lfilter([1.0], C, s) for s in (y, u, o, np.ones(len(y))))
    rows = np.arange(n_lags, len(y))
    response, X = regression(structure.name, y, u, o, one, d, w, rows)
    q, r = np.linalg.qr(X)
    theta = np.linalg.solve(r, q.T @ response)
    rss = np.sum((response - X @ theta) ** 2)
    n = len(rows)
    sd = np.sqrt(rss / n * np.sum(np.linalg.inv(r)[0] ** 2))
    bic = 0.5 * (X.shape[1] + 1) * np.log(n)
    return -0.5 * n * np.log(rss) - bic + norm.logcdf(np.clip(theta[0] / sd, -30, 30)) - np.log(n_kinds)


@pytest.mark.parametrize("seed", range(3))
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
        for _ in range(25):
            i, k, d, j = (int(rng.integers(m)) for m in (2, len(kinds), last - first + 1, 10))
            out = o[i] if with_outflow else None
            slow = slow_evidence(
                y[i], u[i], out, structure, kinds[k], len(kinds), first + d, (10 - j) / 10, last + 4
            )
            assert fronts[which][k, d, j, i] == pytest.approx(slow, abs=1e-4)


@pytest.mark.parametrize("days", [linear_days, wave_days])
def test_probability_is_the_flattened_sum_over_all_models(days):
    u, y, o, _ = days(2, 5, N)
    s = PosteriorSettings(d_min=2, d_max=6, order=20)
    result = posterior(u, y, o, s)
    bank, first, last = noise_bank(), s.d_min - GUARD, s.d_max + GUARD
    for i in range(2):
        logs, places, spreads = [], [], []
        for structure in structures(True):
            kinds = bank[structure.noises]
            wave = structure.taps == 2
            for C in kinds:
                for d in range(first, last + 1):
                    for w in np.arange(10, 0, -1) / 10:
                        value = slow_evidence(
                            *(a[i] - a[i, 0] for a in (y, u, o)), structure, C, len(kinds), d, w, last + 4
                        )  # fmt: skip
                        prior = (1 - s.sharp) / 10 + (s.sharp if w == 1 else 0) if wave else 0.1
                        logs.append(value / s.temperature + np.log(prior))
                        x = d + 1 - w
                        places.append((x + s.wave_lead) / (1 + s.wave_lag) if wave else x)
                        spreads.append(s.edge_wave if wave else s.edge_store)
        weight = np.exp(np.array(logs) - max(logs))
        weight /= weight.sum()

        centres, widths = np.array(places), np.array(spreads)
        below = partial(mixture, centres=centres, widths=widths, weight=weight)

        p = np.array([below(d + 1) - below(d) for d in result.candidates])
        assert np.allclose(result.probability[i], p / p.sum(), atol=1e-4)
        assert result.beyond[i, 0] == pytest.approx(below(s.d_min), abs=1e-4)
        assert result.beyond[i, 1] == pytest.approx(1 - below(s.d_max + 1), abs=1e-4)
        assert below(result.place[i]) == pytest.approx(0.5, abs=0.03)
        assert below(result.place_low[i]) == pytest.approx(0.05, abs=0.03)
        assert below(result.place_high[i]) == pytest.approx(0.95, abs=0.03)


def test_prewhitening_is_the_recursive_filter():
    series = np.random.default_rng(0).normal(size=(3, 2, 137))
    bank = noise_bank()
    fast = prewhiten(series, bank)
    for k, C in enumerate(bank):
        assert np.allclose(
            fast[:, k], lfilter([1.0], C, series), rtol=0, atol=1e-10 * np.abs(fast[:, k]).max()
        )


@pytest.mark.parametrize("ratio", [1e-4, 0.03, 2.0])
@pytest.mark.parametrize("a", [[1.0, -1.0], [1.0, -1.98, 0.98], [1.0, -0.5, 0.2]])
def test_a_spectral_factor_has_the_spectrum_and_a_stable_inverse(a, ratio):
    C = spectral_factor(np.array(a), ratio)
    z = np.exp(-1j * np.linspace(0.1, np.pi, 50))
    wanted = ratio + abs(np.polyval(a[::-1], z)) ** 2
    had = abs(np.polyval(C[::-1], z)) ** 2
    assert np.allclose(had / had[0], wanted / wanted[0], rtol=1e-6)
    assert (np.abs(np.roots(C)) < 1).all()
