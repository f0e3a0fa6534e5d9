"""Evaluate t50 with its probability on simulated and measured rivers; write docs/accuracy_river.md.

Usage: python -m benchmarks.posterior_river [--rivers N]
"""

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import gamma

from benchmarks.glen_canyon import CFS, DATA, ROOT, correlation_lag, data_sets
from benchmarks.measure import table
from rivid.config import Config, load_config
from rivid.core.fir import jmap
from rivid.core.posterior.response import hastened
from rivid.core.posterior.river import posterior_river
from rivid.core.settings import RiverSettings

Floats = NDArray[np.float64]
DAY, FINE, STEADY = 96, 3, 4
"""Samples per day, simulation steps per sample, and days before the first one that is used."""
KINDS = ("diffusive wave", "with exchange", "storage cascade")
REACHES = (
    ("Lees Ferry to mile 30", "glen_canyon_rm30", {}, 26),
    ("mile 30 to mile 61", "glen_canyon_rm30", {"u_Qi": "rm30_cfs", "Q_L": "rm61_cfs"}, 30),
    ("dam to Lees Ferry", "glen_canyon", {}, 16),
)
GAP = 8
"""Samples beyond twice the usual lag up to which the cross-correlation is searched."""


def releases(rng: np.random.Generator, days: int, mean: float) -> Floats:
    """Draw hydropeaking releases: flows held for a time, ramps between them, a daily cycle, a slow drift."""
    n = days * DAY * FINE
    swing, regular = rng.uniform(0.15, 0.45), rng.uniform(0.2, 0.9)
    target = np.empty(n)
    k = 0
    while k < n:
        held = int(rng.integers(6, 80))
        hour = (k / (DAY * FINE) * 24.0) % 24.0
        rhythm = np.sin(2.0 * np.pi * (hour - 9.0) / 24.0) + 0.5 * np.sin(4.0 * np.pi * (hour - 7.0) / 24.0)
        target[k : k + held] = np.clip(regular * rhythm + (1.2 - regular) * rng.normal(0.0, 0.5), -1.0, 1.0)
        k += held
    ramp = int(rng.integers(2, 15))
    smooth = np.convolve(np.concatenate([np.full(ramp, target[0]), target]), np.ones(ramp) / ramp)[
        ramp : ramp + n
    ]
    slow = np.interp(np.arange(n), np.arange(days + 1) * DAY * FINE, rng.normal(0.0, 0.12, days + 1))
    return np.asarray(np.maximum(mean * (1.0 + swing * smooth + slow), 0.15 * mean))


def linear_river(rng: np.random.Generator, u: Floats, exchange: bool) -> tuple[Floats, float]:
    """Route the inflow by a diffusive wave, some held back if `exchange`: outflow, t50 in fine steps."""
    mean, cv = FINE * rng.uniform(4.0, 30.0), rng.uniform(0.06, 0.5)
    t = np.arange(1.0, 12.0 * mean + 50.0)
    h = np.exp(-((t - mean) ** 2) / (2.0 * cv**2 * mean * t)) / t**1.5
    h /= h.sum()
    if exchange:
        share, held = rng.uniform(0.1, 0.4), rng.uniform(0.3, 0.9) * mean
        slow = np.exp(-np.arange(len(h)) / held)
        h = (1.0 - share) * h + share * np.convolve(h, slow / slow.sum())[: len(h)]
    F = np.cumsum(h) - 0.5 * h
    longer = np.concatenate([np.full(len(h), u[0]), u])
    size = len(longer) + len(h)
    y = np.fft.irfft(np.fft.rfft(longer, size) * np.fft.rfft(h, size), size)[len(h) : len(longer)]
    return rng.uniform(0.92, 1.04) * y, float(np.interp(0.5, F, t)) - 1.0  # h[0] is at time 1, which is lag 0


def cascade(rng: np.random.Generator, u: Floats, lateral: Floats, flow: Floats) -> tuple[Floats, Floats]:
    """Route the inflow by non-linear stores, ``Q = (S / k)^m``, after a lag.

    Return the outflow, and t50 in fine steps at each flow.
    """
    mean, cells, m = float(np.median(u)), int(rng.integers(4, 40)), rng.uniform(1.2, 5.0 / 3.0)
    total = FINE * rng.uniform(4.0, 28.0)
    lag = int(rng.uniform(0.0, 0.4) * total)
    k = (total - lag) / cells * m * mean ** (1.0 - 1.0 / m)  # dS/dQ at the mean is (total - lag) / cells
    S, out, parts = k * np.full(cells, u[0]) ** (1.0 / m), np.empty(len(u)), 4
    late = np.concatenate([np.full(lag, u[0]), u, u[-1:]])
    for i in range(len(u)):
        out[i] = (S[-1] / k) ** m
        for j in range(parts):
            Q = (S / k) ** m
            entering = late[i] + (j + 0.5) / parts * (late[i + 1] - late[i])
            S = np.maximum(S + (np.append(entering, Q[:-1]) + lateral[i] / cells - Q) / parts, 1e-6)
    store = k / m * flow ** (1.0 / m - 1.0)
    return out, lag + gamma.ppf(0.5, cells) * store - 0.5 / parts  # the explicit step is early by 0.5 / parts


def river(kind: str, seed: int, days: int = 22) -> tuple[Floats, Floats, Floats]:
    """Return measured inflow and outflow [m3/s], and the true t50 [samples] of each day from the last of the warm-up on."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    mean = rng.uniform(60.0, 350.0)
    u = releases(rng, days + STEADY, mean)
    n = len(u) // FINE
    size = float(rng.choice([0.003, 0.01, 0.03])) * mean
    memory = np.exp(-1.0 / (DAY * rng.uniform(0.3, 1.5)))
    wander = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.normal(0.0, size, n))
    if rng.random() < 0.3:
        wander += size * np.cos(2.0 * np.pi * (np.arange(n) / DAY - rng.random()))
    lateral = np.repeat(wander + 0.02 * mean, FINE)
    flow = np.array([np.mean(u[(STEADY + j) * DAY * FINE :][: DAY * FINE]) for j in range(-1, days)])
    if kind == KINDS[2]:
        y, fine = cascade(rng, u, lateral, flow)
        t50 = fine / FINE
    else:
        y, half = linear_river(rng, u, kind == KINDS[1])
        y, t50 = y + lateral, np.full(len(flow), half / FINE)
    u, y = (x[::FINE] * (1.0 + rng.normal(0.0, 0.004, n)) for x in (u, y))
    step = float(rng.choice([0.0, 0.005, 0.012])) * mean
    return (u, y, t50) if step == 0.0 else (np.round(u / step) * step, np.round(y / step) * step, t50)


def windows(u: Floats, y: Floats, days: int, starts: range) -> tuple[Floats, Floats]:
    """Return windows of `days` days, each with a day of history, shape (windows, N)."""
    cut = [slice((STEADY + j - 1) * DAY, (STEADY + j + days) * DAY) for j in starts]
    return np.stack([u[c] for c in cut]), np.stack([y[c] for c in cut])


def simulated(n_rivers: int) -> str:
    """Return the tables of errors and band coverage on new rivers, by the length of the window."""
    s = RiverSettings()
    rows, other = [], []
    for days, starts in ((1, range(0, 20, 5)), (3, range(0, 20, 6)), (7, range(0, 16, 7))):
        found: dict[str, list[Floats]] = {kind: [] for kind in KINDS}
        seconds, last = [], None
        for seed in range(n_rivers):
            for kind in KINDS:
                u, y, truth = river(kind, 9000 + seed)
                U, Y = windows(u, y, days, starts)
                t50 = np.array([truth[j : j + days + 1].mean() for j in starts])
                began = time.process_time()
                p = posterior_river(U, Y, s)
                seconds.append((time.process_time() - began) / len(U))
                simple = correlation_lag(U, Y, s.n_lags)
                found[kind].append(
                    np.stack([p.place - t50, simple - t50, p.status == "ok", p.place_low <= t50, t50 <= p.place_high,
                              p.place_high - p.place_low])
                )  # fmt: skip
                if last is not None:
                    q = posterior_river(last, Y, s)
                    other.append([days, np.mean(q.status == "ok"), np.mean(q.link >= 0.5), len(U)])
                last = U
        every = np.concatenate([part for kind in KINDS for part in found[kind]], axis=1)
        for name, part in [(kind, np.concatenate(found[kind], axis=1)) for kind in KINDS] + [("all", every)]:
            e, c, ok = np.abs(part[0]), np.abs(part[1]), part[2] > 0
            held = ((part[3] > 0) & (part[4] > 0))[ok]
            rows.append([f"{days} d", name, str(len(e)), f"{np.median(e):.2f}", f"{np.mean(e <= 1):.2f}", f"{ok.mean():.2f}",
                         f"{np.mean(e[ok] <= 1):.2f}", f"{held.mean():.2f}", f"{np.median(part[5][ok]):.1f}",
                         f"{np.median(c):.2f}", f"{np.mean(c <= 1):.2f}", f"{np.mean(seconds):.3f}"])  # fmt: skip
    head = ["window", "river", "windows", "median error [samples]", "within 1", "answered", "within 1 of these", "90 % band holds",
            "its width [samples]", "cross-correlation: median error [samples]", "within 1", "s a window"]  # fmt: skip
    null = []
    for days in (1, 3, 7):
        mine = np.array([row for row in other if row[0] == days])
        null.append(
            [f"{days} d", f"{mine[:, 3].sum():.0f}", f"{mine[:, 2].mean():.2f}", f"{mine[:, 1].mean():.2f}"]
        )
    return (
        table(head, rows)
        + "\nInflow of another river, unrelated to the outflow:\n\n"
        + table(["window", "windows", "linked", "answered"], null)
    )


def law(flow: Floats, hours: Floats) -> tuple[float, float, float]:
    """Fit ``t50 = a Q^b`` by least absolute errors of the logarithm: a, b, median error [h]."""
    X, z = np.stack([np.ones(len(flow)), np.log(flow)], axis=1), np.log(hours)
    weight = np.ones(len(z))
    for _ in range(50):
        theta = np.linalg.solve(X.T @ (weight[:, None] * X), X.T @ (weight * z))
        weight = 1.0 / np.maximum(np.abs(z - X @ theta), 1e-4)
    return float(np.exp(theta[0])), float(theta[1]), float(np.median(np.abs(hours - np.exp(X @ theta))))


def read(name: str, changes: dict[str, str], days: int) -> tuple[Floats, Floats, Config]:
    """Return windows of the measured river [m3/s]."""
    config = load_config(ROOT / "configs" / f"{name}.toml")
    if changes:
        columns = config.input.model_copy(update=changes | {"units": dict.fromkeys(changes, "cfs")})
        config = config.model_copy(update={"input": columns})
    return *data_sets(config, days), config


def measured() -> str:
    """Return the tables of t50 as a function of the flow, and of the errors of the next day."""
    s = RiverSettings()
    rows, foretold = [], []
    for title, name, changes, usual in REACHES:
        U, Y, config = read(name, changes, 5)  # history, three days, and the day to be predicted
        past = slice(0, 4 * DAY)
        began = time.process_time()
        p = posterior_river(U[:, past], Y[:, past], s)
        seconds = (time.process_time() - began) / len(U)
        flow, ok = np.mean(U[:, past], axis=1) / CFS / 1e4, p.status == "ok"
        a, b, error = law(flow[ok], p.place[ok] / 4.0)
        lag = correlation_lag(U[:, past], Y[:, past], 2 * usual + GAP) / 4.0
        c, d, other = law(flow, np.maximum(lag, 0.25))
        rows.append([title, str(len(U)), f"{ok.mean():.2f}", f"{a:.2f} h Q^{b:.2f}", f"{error:.2f}",
                     f"{np.median(p.place_high - p.place_low) / 4:.2f}", f"{np.median(p.gain):.2f}",
                     f"{c:.2f} h Q^{d:.2f}", f"{other:.2f}", f"{seconds:.3f}"])  # fmt: skip
        errors = foretell(U, Y, config, p.fir, p.lead, 2 * usual + GAP)
        foretold.append(
            [title, *(f"{np.median(e):.1f} ({np.quantile(e, 0.9):.1f})" for e in errors.values())]
        )
    head = ["reach", "windows", "answered", "t50, Q in 10,000 cfs", "median error of the law [h]", "width of the 90 % band [h]", "gain",
            "cross-correlation", "median error of its law [h]", "s a window"]  # fmt: skip
    return (
        table(head, rows)
        + "\nPrediction of the day after each window, with known inflow and unknown output: median of the days' root mean square error "
        "[m3/s], nine days in ten in brackets. Every model has the same offset correction: its mean error on the window's last day.\n\n"
        + table(["reach", *errors], foretold)
    )


def foretell(
    U: Floats, Y: Floats, config: Config, fir: Floats, lead: Floats, longest: int
) -> dict[str, Floats]:
    """Return the root mean square error of the last day, for each model fitted to the days before [m3/s]."""
    past = U.shape[1] - DAY
    settings = config.jmap_settings()
    u, y = U[:, :past] - U[:, :1], Y[:, :past] - Y[:, :1]
    models = {
        "t50's response": [np.convolve(a, h)[: len(a)] for a, h in zip(U, fir, strict=True)],
        "t50's response, faster at higher flow": [
            np.convolve(hastened(a, float(np.mean(a[:past])), q), h)[: len(a)]
            for a, h, q in zip(U, fir, lead, strict=True)
        ],
        "JMAP's response": [
            np.convolve(a, h)[: len(a)] for a, h in zip(U, jmap(u, y, settings).fir, strict=True)
        ],
        "prewhitened cross-correlation": [shifted(a, b, past, longest) for a, b in zip(U, Y, strict=True)],
        "ARX(2,2), simulated": [arx(a, b, past, longest) for a, b in zip(U, Y, strict=True)],
    }
    errors = {}
    for name, found in models.items():
        path = np.stack(found)
        offset = np.mean(Y[:, past - DAY : past] - path[:, past - DAY : past], axis=1)
        errors[name] = np.sqrt(np.mean((Y[:, past:] - path[:, past:] - offset[:, None]) ** 2, axis=1))
    errors["the day before"] = np.sqrt(np.mean((Y[:, past:] - Y[:, past - DAY : past]) ** 2, axis=1))
    return errors


def shifted(u: Floats, y: Floats, past: int, longest: int, order: int = 8) -> Floats:
    """Shift u by the lag of highest prewhitened cross-correlation, and fit a gain."""
    du, dy = np.diff(u[:past]), np.diff(y[:past])
    X = np.stack([du[order - k : len(du) - k] for k in range(1, order + 1)], axis=1)
    a = np.append(1.0, -np.linalg.lstsq(X, du[order:], rcond=None)[0])
    v, z = lfilter(a, [1.0], du)[order:], lfilter(a, [1.0], dy)[order:]
    lag = int(np.argmax([v[: len(v) - k] @ z[k:] for k in range(longest)]))
    moved = np.concatenate([np.full(lag, u[0]), u])[: len(u)]
    x, w = moved[DAY:past], y[DAY:past]
    return np.asarray(np.polyfit(x, w, 1)[0] * moved)


def arx(u: Floats, y: Floats, past: int, longest: int) -> Floats:
    """Simulate the ARX(2,2) model with the delay of the least one-step error.

    It has two lags of y, and two of u after the delay. The simulation starts with the last known day.
    """
    rows = np.arange(max(longest + 2, 2), past)
    best: tuple[float, Floats, int] = (np.inf, np.zeros(5), 0)
    for d in range(longest):
        X = np.stack([y[rows - 1], y[rows - 2], u[rows - d], u[rows - d - 1], np.ones(len(rows))], axis=1)
        theta = np.linalg.lstsq(X, y[rows], rcond=None)[0]
        rss = float(np.sum((y[rows] - X @ theta) ** 2))
        if rss < best[0]:
            best = (rss, theta, d)
    _, theta, d = best
    path = y.copy()
    for k in range(past - DAY, len(u)):
        path[k] = theta @ [path[k - 1], path[k - 2], u[k - d], u[k - d - 1], 1.0]
    return path


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rivers", type=int, default=40, help="of each kind")
    n = parser.parse_args().rivers
    assert DATA.is_dir()
    text = (Path(__file__).parent / "posterior_river_head.md").read_text(encoding="utf-8")
    text = text.format(rivers=n, kinds=", ".join(KINDS), simulated=simulated(n), measured=measured())
    (ROOT / "docs" / "accuracy_river.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
