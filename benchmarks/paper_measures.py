"""Compute the measures behind the paper's claims, on simulated years with known delays."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from rivid.config import parse
from rivid.core.cusum import cusum
from rivid.core.fir import JmapResult, jmap, map_fir, ml
from rivid.core.search import direct, indirect
from rivid.core.settings import ALPHA_CAP, DEFAULT_ALPHA
from rivid.reach.integrator import theoretical_fir
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario, load_scenario

ROOT = Path(__file__).parent.parent
SCENARIOS = ROOT / "configs" / "scenarios"
Floats = NDArray[np.float64]

CLEAN = {"level": {"noise": 0.0, "quantum": 0.0}}
CLOSED = {"weather": {"inflow": 0.0}}
CALM = {
    "operators": {
        "feedforward_spread": 0.0, "level_gain_spread": 0.0, "dead_band": 0.0, "set_point_spread": 0.0,
        "look": [60.0, 60.0], "notice": 0.0, "quantum": 0.0,
    }
}  # fmt: skip

WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "the sample year's kind": ("basse_isere", {}),
    "perfect gauge": ("basse_isere", CLEAN),
    "no unlogged inflow": ("basse_isere", CLOSED),
    "operators exact": ("basse_isere", CALM),
    "all three": ("basse_isere", CLEAN | CLOSED | CALM),
    "operators at intervals": ("intermittent", {"reach": {"wave_depth": 4.9}}),
    "full equations": ("hydraulic", {}),
}
"""Simulated worlds: name, scenario, and changes of the scenario."""

MODEL = "the model itself: (10) and white noise"
MODEL_NOISE = 0.004
"""Standard deviation of the white noise of :data:`MODEL` [m]: that of the sample year's gauge, its resolution
included."""


@dataclass(frozen=True, eq=False)
class World:
    """Days of logs and true delays; arrays of shape (days, N), truth (days,)."""

    inflow: Floats
    outflow: Floats | None
    level: Floats
    truth: Floats
    other: Floats

    @property
    def u(self) -> Floats:
        """Inflow deviations [m3/s]."""
        return self.inflow - self.inflow[:, :1]

    @property
    def y(self) -> Floats:
        """Level deviations [m]."""
        return self.level - self.level[:, :1]


def changed(scenario: Scenario, tables: dict[str, dict[str, Any]]) -> Scenario:
    """Return a scenario with some settings changed."""
    raw = scenario.model_dump(exclude_unset=True)
    for name, values in tables.items():
        raw[name] = {**raw.get(name, {}), **values}
    return parse(raw, Scenario, "benchmark")


def of_season(season: Season) -> World:
    """Return the world of a simulated season."""
    return World(
        season.inflow,
        season.outflow,
        season.level,
        season.delay.astype(float),
        season.delay_other.astype(float),
    )


def world(name: str, seed: int) -> World:
    """Simulate one year of a world."""
    if name == MODEL:
        season = simulate(load_scenario(SCENARIOS / "basse_isere.toml"), seed)
        reach, people = season.scenario.reach, season.scenario.operators
        alpha = reach.sample_time / reach.surface_area
        rng = np.random.default_rng([seed, 99])
        u = season.inflow - season.inflow[:, :1]
        y = np.empty_like(u)
        for i, d in enumerate(season.delay):
            h = theoretical_fir(200, int(d), alpha, alpha, people.feedforward, people.level_gain)
            y[i] = np.convolve(u[i], h)[: u.shape[1]]
        y += MODEL_NOISE * rng.standard_normal(y.shape)
        truth = season.delay.astype(float)
        return World(season.inflow, None, y, truth, truth)
    scenario, tables = WORLDS[name]
    return of_season(simulate(changed(load_scenario(SCENARIOS / f"{scenario}.toml"), tables), seed))


def at(delay: Floats, *values: int) -> float:
    """Return the share of days at these delays."""
    return float(np.isin(delay, values).mean())


def between(delay: Floats, low: int, high: int) -> float:
    """Return the share of days between two delays, both included."""
    return float(((delay >= low) & (delay <= high)).mean())


def two(delay: Floats) -> tuple[tuple[int, int], float]:
    """Return the two most frequent delays, and their share of days."""
    values, days = np.unique(delay[np.isfinite(delay)], return_counts=True)
    top = np.argsort(-days, kind="stable")[:2]
    pair = sorted(int(v) for v in values[top])
    return (pair[0], pair[-1]), float(days[top].sum() / len(delay))


def within(delay: Floats, w: World, by: int = 1) -> float:
    """Return the share of days within `by` samples of the truth."""
    error = np.minimum(np.abs(delay - w.truth), np.abs(delay - w.other))
    return float((error <= by).mean())


def largest_jump(fir: Floats, d_max: int = 15) -> Floats:
    """Return the delay, of 1 to d_max, at which a response rises most between two lags."""
    return 1.0 + np.argmax(np.diff(fir, axis=1)[:, 1 : d_max + 1], axis=1)


def first_jump(fir: Floats) -> float:
    """Return the share of days on which h[0] > h[1]."""
    return float((fir[:, 0] > fir[:, 1]).mean())


def with_line(w: World, order: int = 30) -> Floats:
    """Return the ML response with a constant and a ramp of the level in addition to (16)."""
    line = np.stack([np.ones(w.u.shape[1]), np.linspace(-1.0, 1.0, w.u.shape[1])], axis=1)
    rows = []
    for u, y in zip(w.u, w.y, strict=True):
        beside = np.concatenate([toeplitz(u, np.zeros(order)), line], axis=1)
        rows.append(np.linalg.lstsq(beside, y, rcond=None)[0][:order])
    return np.stack(rows)


def by_eye(fir: Floats, days: int = 15) -> Floats:
    """Return :func:`largest_jump` of the mean response of neighbouring days, as in a visual inspection."""
    padded = np.pad(fir, ((days // 2, days // 2), (0, 0)), mode="edge")
    smooth = np.stack([padded[i : i + days].mean(axis=0) for i in range(len(fir))])
    return largest_jump(smooth)


def shuffled(w: World) -> tuple[Floats, Floats]:
    """Return u of one day with y of another, which contain no delay."""
    elsewhere = np.roll(np.arange(len(w.u)), len(w.u) // 3)
    return w.u[elsewhere], w.y


def jmaps(w: World) -> dict[str, JmapResult]:
    """Estimate the JMAP with each prior."""
    u, y = w.u, w.y
    return {
        "uniform": jmap(u, y, prior="uniform", alpha=DEFAULT_ALPHA),
        "estimated": jmap(u, y, prior="uniform"),
        "rayleigh": jmap(u, y),
        "wide": jmap(u, y, delay_scale=10.0),
        "degenerate": jmap(u, y, inverse_gamma=False),
        "shuffled": jmap(*shuffled(w)),
        "shuffled estimated": jmap(*shuffled(w), prior="uniform"),
    }


def measure(w: World) -> dict[str, float]:
    """Compute the shares of days of the paper's claims."""
    j = jmaps(w)
    straight = ml(w.u, w.y)
    found: dict[str, float] = {}
    if w.outflow is not None:
        d = direct(w.inflow, w.outflow, w.level).delay
        found |= {"direct at 1": at(d, 1), "direct at 15": at(d, 15)}
        found["direct within one of the truth"] = within(d, w)
        d = with_ramp(w, "direct")
        found |= {
            "direct with a ramp, at 1 or 15": at(d, 1, 15),
            "direct with a ramp, within one of the truth": within(d, w),
        }
    d = indirect(w.inflow, w.level).delay
    found |= {"indirect at 1": at(d, 1), "indirect at 15": at(d, 15)}
    found["indirect within one of the truth"] = within(d, w)
    found["indirect with a ramp, within one of the truth"] = within(with_ramp(w, "indirect"), w)
    found["h[0] > h[1], ML"] = first_jump(straight.fir)
    found["h[0] > h[1], JMAP"] = first_jump(j["rayleigh"].fir)
    found["ML, largest jump at 6-7"] = at(largest_jump(straight.fir), 6, 7)
    found["ML, by eye at 6-7"] = at(by_eye(straight.fir), 6, 7)
    found["ML, CUSUM within one of the truth"] = within(cusum(straight.fir).delay, w)
    found["MAP, CUSUM within one of the truth"] = within(cusum(map_fir(w.u, w.y).fir).delay, w)
    found["uniform prior at 5-7"] = between(j["uniform"].delay, 5, 7)
    found["uniform prior, alpha estimated, at 5-7"] = between(j["estimated"].delay, 5, 7)
    found["uniform prior, alpha estimated, within one of the truth"] = within(j["estimated"].delay, w)
    found["Rayleigh prior, two most frequent delays"] = two(j["rayleigh"].delay)[1]
    found["Rayleigh prior at 6 or 7"] = at(j["rayleigh"].delay, 6, 7)
    found["Rayleigh prior, within one of the truth"] = within(j["rayleigh"].delay, w)
    found["on shuffled days, at 6 or 7"] = at(j["shuffled"].delay, 6, 7)
    found["alpha estimated at 6 or 7"] = at(j["estimated"].delay, 6, 7)
    found["alpha estimated at 6 or 7, shuffled days"] = at(j["shuffled estimated"].delay, 6, 7)
    found["Rayleigh prior, the data do not decide"] = float(j["rayleigh"].prior_only.mean())
    found["sigma_d 6.5 and 10 agree"] = float((j["rayleigh"].delay == j["wide"].delay).mean())
    found["JMAPdeg, alpha at its cap"] = float((j["degenerate"].status == "degenerate").mean())
    found["JMAPdeg at d = 1"] = at(j["degenerate"].delay, 1)
    return found


def with_ramp(w: World, approach: str, d_max: int = 15) -> Floats:
    """Estimate delays by the direct (8) or the indirect approach (10) with a constant and a ramp.

    Both approaches assume that the day's first sample is stationary. If in- and outflow are not balanced
    then, the difference accumulates to a ramp of the (filtered) level, which the filtered inflow at another
    lag can imitate.
    """
    u = np.cumsum(w.u, axis=1)
    n, N = u.shape
    if approach == "direct":
        assert w.outflow is not None
        target, beside = w.y, [np.cumsum(w.outflow - w.outflow[:, :1], axis=1)]
    else:
        target = np.cumsum(w.y, axis=1)
        beside = [target, u]
    line = [np.ones(N), np.arange(N) / N]
    cost = np.empty((n, d_max))
    for i in range(n):
        shared, _ = np.linalg.qr(np.stack([*(np.r_[0.0, x[i, :-1]] for x in beside), *line], axis=1))
        late = np.stack([np.r_[np.zeros(d + 1), u[i, : -d - 1]] for d in range(1, d_max + 1)], axis=1)
        left = target[i] - shared @ (shared.T @ target[i])
        rest = late - shared @ (shared.T @ late)
        cost[i] = -((rest.T @ left) ** 2) / np.einsum("nd,nd->d", rest, rest)
    return 1.0 + np.argmin(cost, axis=1)


def _integrated(inflow: Floats, outflow: Floats, delay: int, alpha: float) -> Floats:
    """Integrate equation (8), with zero flows before the first sample."""
    late = np.concatenate([np.zeros(delay + 1), inflow])[: len(inflow)]
    before = np.concatenate([[0.0], outflow])[: len(outflow)]
    return np.asarray(alpha * np.cumsum(late - before))


def reach_alone(w: World, noise: float = MODEL_NOISE) -> World:
    """Return the same commands with the level of (8): balanced at the first sample, with white noise."""
    assert w.outflow is not None
    alpha = 133.0 / 6.7e5
    rng = np.random.default_rng(1)
    o = w.outflow - w.outflow[:, :1]
    y = np.stack([_integrated(w.u[i], o[i], int(d), alpha) for i, d in enumerate(w.truth)])
    return World(w.inflow, w.outflow, y + noise * rng.standard_normal(y.shape), w.truth, w.truth)


READINGS = {
    "free": "both rows across a jump are zero, at lags 1 and d + 1 (ours)",
    "delay": 'the same at d + 1 only (`jumps = "delay"`)',
    "slope": "the slope after a jump is penalised",
    "restart": "the response starts from zero after each jump",
}
"""Readings of (24), on a page that is lost."""


def freed(order: int, delay: int, reading: str) -> Floats:
    """Return D_d of (24) in one of :data:`READINGS`."""
    D = np.eye(order) - 2 * np.eye(order, k=-1) + np.eye(order, k=-2)
    if reading == "delay":
        D[delay + 1 : delay + 3] = 0.0
        return D
    if reading != "restart":
        D[0] = 0.0
    for first in (1, delay + 1):
        D[first : first + 2] = 0.0
        if reading == "slope":
            D[first + 1, first : first + 2] = -1.0, 1.0
        elif reading == "restart":
            D[first, first], D[first + 1, first : first + 2] = 1.0, (-2.0, 1.0)
    return D


def table_vi(
    u: Floats, y: Floats, reading: str, *, inverse_gamma: bool = True, scale: float = np.inf, order: int = 30
) -> int:
    """Return the delay by a transcription of Table VI for a reading of (24); `scale` inf: uniform prior."""
    U = toeplitz(u, np.zeros(order))
    G, b, d_max = U.T @ U, U.T @ y, 15
    D = {d: freed(order, d, reading) for d in range(1, d_max + 1)}
    h, d, before = np.linalg.solve(G, b), 10, (np.inf, np.inf)
    beta = np.sum(np.convolve(h, (1.0, -2.0, 1.0))[:order] ** 2) / 2 if inverse_gamma else 0.0
    shape = 2 * order + 2 if inverse_gamma else order
    penalty = {k: 0.0 if np.isinf(scale) else k**2 / scale**2 - 2 * np.log(k) for k in D}
    for _ in range(200):
        s_w = np.sum((y - U @ h) ** 2) / len(u)
        s_h = max((np.sum((D[d] @ h) ** 2) + 2 * beta) / shape, s_w / ALPHA_CAP)
        tried = {k: np.linalg.solve(G + s_w / s_h * Dk.T @ Dk, b) for k, Dk in D.items()}
        cost = {
            k: np.sum((y - U @ g) ** 2) / s_w + np.sum((D[k] @ g) ** 2) / s_h + penalty[k]
            for k, g in tried.items()
        }
        d = min(cost, key=lambda k: cost[k])
        h = tried[d]
        if abs(s_w / before[0] - 1) < 1e-3 and abs(s_h / before[1] - 1) < 1e-3:
            break
        before = (s_w, s_h)
    return d


def every_year(name: str, seeds: range) -> dict[str, list[float]]:
    """Return each measure for the years of a world."""
    found: dict[str, list[float]] = {}
    for seed in seeds:
        for key, value in measure(world(name, seed)).items():
            found.setdefault(key, []).append(value)
    return found


def rank_correlation(a: Floats, b: Floats) -> float:
    """Return Spearman's rank correlation, with mean ranks for ties."""
    from scipy.stats import spearmanr

    return float(spearmanr(a, b).statistic)
