"""Compare the accuracy of the estimators with baselines, on simulated years with known delays.

Writes docs/accuracy.md. Three reaches with several seeds each are estimated with the paper's settings and
with sigma_d, d_max and M from the reach's own hydraulics. There are two baselines: always the prior's mode,
and the same estimator on shuffled days (u of one day, y of another), which contain no delay.

Usage: python -m benchmarks.accuracy [--seeds N]
"""

import argparse
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import residual
from benchmarks.measure import table
from rivid.core.fir import PRIOR_ONLY_SPREAD, JmapResult, jmap
from rivid.core.hydraulics import propose_delays
from rivid.core.settings import DEFAULT_ALPHA, JmapSettings
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import load_scenario

ROOT = Path(__file__).parent.parent
SCENARIOS = {"short": "d 2-3", "basse_isere": "d 6-8", "long": "d 10-12"}
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """Shares of the days of one season, for an estimator and a setting."""

    exact: float
    within: float
    prior_only: float
    within_where_sure: float
    at_6_or_7: float


def settings_of(season: Season, own: bool) -> dict[str, JmapSettings]:
    """Return the estimators, with the paper's settings or with the reach's own."""
    base = JmapSettings()
    if own:
        reach = season.scenario.reach
        proposal = propose_delays(
            reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
            sample_time=reach.sample_time,
        )  # fmt: skip
        order = max(proposal.order, proposal.d_max + 5)
        base = JmapSettings(order=order, d_max=proposal.d_max, delay_scale=proposal.delay_scale)
    shape = {"order": base.order, "d_max": base.d_max, "delay_scale": base.delay_scale}
    return {
        "jmap": base,
        "jmap-uniform": JmapSettings(**shape, prior="uniform", alpha=DEFAULT_ALPHA),
        "jmap-uniform-estimated": JmapSettings(**shape, prior="uniform"),
        "jmap-degenerate": JmapSettings(**shape, inverse_gamma=False),
    }


def prior_mode(settings: JmapSettings) -> int:
    """Return the delay of highest prior probability, for the Rayleigh prior alone."""
    d = np.arange(settings.d_min, settings.d_max + 1)
    return int(d[np.argmax(np.log(d) - d**2 / (2 * settings.delay_scale**2))])


def score(delay: Floats, season: Season, prior_only: Iterable[bool]) -> Score:
    """Return the shares of days. If the arrival is near a sampling instant, both neighbours are right."""
    error = np.minimum(np.abs(delay - season.delay), np.abs(delay - season.delay_other))
    flagged = np.asarray(list(prior_only))
    return Score(
        float((error == 0).mean()),
        float((error <= 1).mean()),
        float(flagged.mean()) if len(flagged) else np.nan,
        float((error[~flagged] <= 1).mean()) if len(flagged) and not flagged.all() else np.nan,
        float(np.isin(delay, [6, 7]).mean()),
    )


def one_season(task: tuple[str, int]) -> dict[str, object]:
    """Run all estimators on one seed of one scenario."""
    name, seed = task
    season = simulate(load_scenario(ROOT / "configs" / "scenarios" / f"{name}.toml"), seed=seed)
    u, y = season.inflow - season.inflow[:, :1], season.level - season.level[:, :1]
    elsewhere = np.roll(np.arange(len(u)), len(u) // 3)
    found: dict[tuple[bool, str], Score] = {}
    conditions: Floats = np.empty(0)
    for own in (False, True):
        for estimator, settings in settings_of(season, own).items():
            result: JmapResult = jmap(u, y, settings)
            found[own, estimator] = score(result.delay, season, result.prior_only)
            if estimator == "jmap" and not own:
                conditions = result.condition
            shuffled = jmap(u[elsewhere], y, settings)
            found[own, f"{estimator}, shuffled days"] = score(shuffled.delay, season, shuffled.prior_only)
            if estimator == "jmap":
                mode = np.full(len(u), float(prior_mode(settings)))
                found[own, "always the prior's mode"] = score(mode, season, [])
    return {
        "found": found,
        "condition": np.nanquantile(conditions, [0.1, 0.5, 0.9]),
        "level_range": float(np.ptp(season.level, axis=1).mean()),
        "delays": np.unique(season.delay),
        "settings": {own: settings_of(season, own)["jmap"] for own in (False, True)},
    }


def main() -> None:
    """Run all seeds, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    tasks = [(name, 100 + seed) for name in SCENARIOS for seed in range(seeds)]
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
        answers = list(pool.map(one_season, tasks))
    text = (ROOT / "benchmarks" / "accuracy_head.md").read_text(encoding="utf-8")
    text = text.replace("{seeds}", str(seeds)).replace("{spread}", f"{PRIOR_ONLY_SPREAD:g}")
    for name in SCENARIOS:
        mine = [a for (n, _), a in zip(tasks, answers, strict=True) if n == name]
        text += section(name, mine)
    text += prior_share([a for (n, _), a in zip(tasks, answers, strict=True) if n == "basse_isere"])
    text += findings({n: [a for (m, _), a in zip(tasks, answers, strict=True) if m == n] for n in SCENARIOS})
    (ROOT / "docs" / "accuracy.md").write_text(text, encoding="utf-8")
    print(text)


def section(name: str, seasons: list[dict]) -> str:
    """Return the tables of one scenario."""
    delays = sorted({int(d) for s in seasons for d in s["delays"]})
    low, mid, high = np.median([s["condition"] for s in seasons], axis=0)
    levels = [s["level_range"] for s in seasons]
    text = f"\n## `{name}`: {SCENARIOS[name]}\n\n"
    text += (
        f"True delays {', '.join(map(str, delays))} samples. Level range {np.mean(levels):.2f} m a day "
        f"({min(levels):.2f} to {max(levels):.2f} over seeds). Condition number of U'U, M = 30: "
        f"median {mid:.1e}, 10 to 90 % of days {low:.1e} to {high:.1e}.\n\n"
    )
    for own in (False, True):
        s = seasons[0]["settings"][own]
        which = "sigma_d, d_max and M from `rivid bounds`" if own else "the paper's settings"
        which = which[0].upper() + which[1:]
        text += f"{which}: sigma_d = {s.delay_scale:g}, d {s.d_min}-{s.d_max}, M = {s.order}.\n\n"
        rows = []
        for _, estimator in [key for key in seasons[0]["found"] if key[0] == own]:
            scores = [season["found"][own, estimator] for season in seasons]
            rows.append(
                [estimator, spread(x.exact for x in scores), spread(x.within for x in scores),
                 spread(x.prior_only for x in scores), spread(x.within_where_sure for x in scores)]
            )  # fmt: skip
        head = [
            "estimator",
            "exact [%]",
            "within one sample [%]",
            "`prior_only` [%]",
            "within one, of the others [%]",
        ]
        text += table(head, rows) + "\n"
    return text


def findings(seasons: dict[str, list[dict]]) -> str:
    """Return the conclusions with their numbers."""

    def mean(name: str, own: bool, estimator: str, column: str) -> str:
        return f"{100 * np.mean([getattr(s['found'][own, estimator], column) for s in seasons[name]]):.0f} %"

    table_i, short, long = "basse_isere", "short", "long"
    free, shuffled = "jmap-uniform-estimated", ", shuffled days"
    mode = "always the prior's mode"
    return (
        "\n## What this shows\n\n"
        "- With the Rayleigh prior at 6.5 the reach of Table I gives 6 or 7 on "
        f"{mean(table_i, False, 'jmap', 'at_6_or_7')} of its days, and on {mean(table_i, False, 'jmap' + shuffled, 'at_6_or_7')} of shuffled days, which contain "
        "no delay: the paper's 95 % can be obtained without the reach.\n"
        f"- {mean(table_i, False, 'jmap', 'exact')} of the days are exact. Always answering the prior's mode gives "
        f"{mean(table_i, False, mode, 'exact')}, and shuffled days give "
        f"{mean(table_i, False, 'jmap' + shuffled, 'exact')}.\n"
        f"- Without the prior, the data alone: `{free}` gives 6 or 7 on "
        f"{mean(table_i, False, free, 'at_6_or_7')} of days and is within one sample on "
        f"{mean(table_i, False, free, 'within')}, on shuffled days "
        f"{mean(table_i, False, free + shuffled, 'within')}.\n"
        f"- On other reaches the paper's sigma_d hides the delay: within one sample on "
        f"{mean(short, False, 'jmap', 'within')} of days at d 2-3 and {mean(long, False, 'jmap', 'within')} at d 10-12. "
        f"With sigma_d from the reach's hydraulics it is {mean(short, True, 'jmap', 'within')} and "
        f"{mean(long, True, 'jmap', 'within')}, the prior's mode alone {mean(short, True, mode, 'within')} and "
        f"{mean(long, True, mode, 'within')}: the bounds determine the delay, and the JMAP adds little information.\n"
        f"- `prior_only` marks this day by day: {mean(table_i, False, 'jmap', 'prior_only')} of matched and "
        f"{mean(table_i, False, 'jmap' + shuffled, 'prior_only')} of shuffled days.\n"
        "- Why: the noise and the steps of the gauge hide the jump (below). The candidates' criteria lie within a fraction "
        "of a unit, and the prior's terms span almost three.\n" + residual.section()
    )


def spread(shares: Iterable[float]) -> str:
    """Format the mean over seeds, and the lowest and highest seed, in per cent."""
    values = 100 * np.array(list(shares))
    if np.isnan(values).all():
        return ""
    return f"{np.nanmean(values):.0f} ({np.nanmin(values):.0f}-{np.nanmax(values):.0f})"


def prior_share(seasons: list[dict]) -> str:
    """Return how much of "more than 95 % at 6 or 7" is due to the prior."""
    names = ["jmap", "jmap, shuffled days", "jmap-uniform-estimated", "jmap-uniform-estimated, shuffled days"]
    rows = [[n, spread(s["found"][False, n].at_6_or_7 for s in seasons)] for n in names]
    text = "\n## How much of the paper's 95 % is the prior\n\n"
    text += "Share of days answered 6 or 7 on the reach of Table I.\n\n"
    return text + table(["estimator, paper's settings", "6 or 7 [%]"], rows)


if __name__ == "__main__":
    main()
