"""Compare the season of the sample year with its true delays; print the last paragraph of docs/season.md.

Usage: python -m benchmarks.season_year [--laws N]

With --laws, print how often the intervals of N random laws contain the truth.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

import rivid
from rivid.core.law import delay_law
from rivid.core.posterior.daily import candidates_of, fold, places, wave_place
from rivid.core.posterior.front import SHARES
from rivid.core.settings import PosteriorSettings

ROOT = Path(__file__).parent.parent


S = PosteriorSettings(d_max=40, order=60)


def related(rng, n, memory):
    """Return an AR(1) process of unit variance with this memory [days]."""
    rho = np.exp(-1.0 / memory) if memory else 0.0
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(n + 200))[200:]


def random_law(seed):
    """Return a law's b, its T0 at 1 m3/s, and discharges, delays and probabilities as of `posterior`."""
    rng = np.random.default_rng([seed, 77])
    n, wave = int(rng.integers(84, 331)), rng.random() < 0.5
    b, T0 = rng.uniform(0.0, 0.4), np.exp(rng.uniform(0.1, np.log(25.0)))
    x = rng.uniform(0.12, 0.6) * related(rng, n, rng.choice([1.0, 8.0, 20.0]))
    scatter = np.exp(rng.uniform(np.log(0.002), np.log(0.03))) * related(rng, n, rng.choice([0.0, 0.0, 3.0]))
    T = T0 * np.exp(-b * x + scatter)
    wrong = rng.random(n) < rng.choice([0.0, 0.0, 0.03, 0.06])
    T[wrong] *= np.exp(rng.choice([-1.0, 1.0], wrong.sum()) * rng.uniform(0.2, 0.8, wrong.sum()))
    noise, gate = rng.uniform(0.02, 0.15), rng.uniform(0.0, S.wave_gate)
    inside = (T > 1.0) & (T < S.d_max - 1.0)
    T = np.clip(T, 1.01, S.d_max - 1.1)
    at = wave_place(T, gate, S) if wave else T
    at = at + noise * (rng.uniform(0.1, 1.0) if wave else 1.0) * rng.standard_normal(n)
    q = np.exp(-0.5 * ((places(S)[..., None] - at) / max(noise, 0.04)) ** 2)
    if wave:
        q[:, 0] *= S.sharp + (1.0 - S.sharp) / len(SHARES)
        q[:, 1:] *= (1.0 - S.sharp) / len(SHARES)
    p, right, (median, _, _) = fold([q / q.sum(axis=(0, 1))], [not wave], S)
    p = p[S.d_min - candidates_of(S)[0] :][: S.d_max + 1 - S.d_min]
    sure = inside & (right.max(axis=0) >= S.answer_above)
    return b, T0, np.exp(x), np.where(sure, median, np.nan), (p / p.sum(axis=0)).T


def laws(n):
    """Print how often the intervals contain the truth, with the samples and from a line through the delays."""
    edges, found = np.arange(S.d_min, S.d_max + 2.0), []
    for seed in range(n):
        b, T0, Q, delay, p = random_law(seed)
        if np.isfinite(delay).sum() < 40:
            continue
        span = np.ptp(np.nanquantile(delay, [0.05, 0.95]))
        law, line = delay_law(Q, delay, probability=p, edges=edges), delay_law(Q, delay)
        if law.status != "ok":
            continue
        row = [span]
        for one in (law, line):
            at = T0 * one.Q0**-b
            row += [one.b_low <= b <= one.b_high, one.T0_low <= at <= one.T0_high, one.b_high - one.b_low]
        found.append(row)
    rows = np.array(found, float)
    for name, use in (("all", rows[:, 0] >= 0), ("< 1", rows[:, 0] < 1.0), ("> 1", rows[:, 0] >= 1.0)):
        held, wide = rows[use][:, [1, 2, 4, 5]].mean(axis=0), np.median(rows[use][:, [3, 6]], axis=0)
        print(
            f"delays over {name} samples: {use.sum()} laws; b, T0 contained: {held[:2].round(2)}, width of b "
            f"{wide[0]:.3f}; line: {held[2:].round(2)}, {wide[1]:.3f}"
        )


def main() -> None:
    """Run, combine, and compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--laws", type=int, default=0)
    if n := parser.parse_args().laws:
        laws(n)
        return
    truth = json.loads((ROOT / "sample_data" / "basse_isere_truth.json").read_text(encoding="utf-8"))["days"]
    days = pd.DataFrame(truth).set_index("date")
    with tempfile.TemporaryDirectory() as out:
        run = [
            "run",
            "sample_data/basse_isere",
            "-c",
            "configs/posterior.toml",
            "-o",
            out,
            "-q",
            "--no-figures",
        ]
        for words in (run, ["season", out]):
            subprocess.run([sys.executable, "-m", "rivid", *words], cwd=ROOT, check=True, capture_output=True)
        delays = rivid.load_delays(out).query("estimator == 'posterior'")
        alone = delays.set_index(delays["date"].astype(str).str[:10])
        combined = pd.read_csv(Path(out) / "season.csv", index_col="date")["delay_samples"]
        law = json.loads((Path(out) / "delay_law.json").read_text(encoding="utf-8"))
    both = (
        pd.DataFrame({"alone": alone["delay_samples"], "combined": combined}).dropna().join(days, how="inner")
    )
    right = {
        name: int(((both[name] == both["delay_samples"]) | (both[name] == both["delay_other"])).sum())
        for name in ("alone", "combined")
    }
    flow = alone["mean_inflow_m3s"].to_numpy() / law["Q0"]
    b, T0 = np.polyfit(np.log(flow), np.log(days.loc[alone.index, "travel_time_s"]), 1)
    print(
        f"On the sample year, a simulated season that was not used to choose anything here, {len(both)} days have a delay "
        f"both alone and combined: {right['alone']} of them are correct alone, {right['combined']} combined forward. The law "
        f"is T = {law['T0']:.0f} s (Q / {law['Q0']:.0f})^-{law['b']:.3f} ({law['b_low']:.3f} to {law['b_high']:.3f}); a line "
        f"through the true travel times gives {np.exp(T0):.0f} s and {-b:.3f}."
    )


if __name__ == "__main__":
    main()
