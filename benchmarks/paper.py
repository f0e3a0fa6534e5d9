"""Compare the paper's claims with the sample year; write docs/paper.md and docs/pictures/paper_*.png.

Every number is measured here. A claim holds or not by a condition on the measured values. If it does not
hold, other simulated worlds show whether the year or the method is the reason.

Usage: python -m benchmarks.paper [--seeds N]
"""

import argparse
import json
import shutil
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import residual
from benchmarks.accuracy import prior_mode
from benchmarks.measure import table
from benchmarks.paper_claims import Readings, either, hydraulics, one_day, pc, simple_models, spread, the_year
from benchmarks.paper_measures import (
    CALM,
    CLEAN,
    CLOSED,
    MODEL,
    READINGS,
    ROOT,
    SCENARIOS,
    WORLDS,
    World,
    at,
    every_year,
    jmaps,
    measure,
    shuffled,
    table_vi,
    two,
    within,
)
from rivid.cli.figures import simulated_cascade
from rivid.config import Config, JmapConfig, ReachConfig, load_config, parse
from rivid.core.fir import jmap, ml
from rivid.core.settings import JmapSettings
from rivid.plots.paper import draw_paper
from rivid.plots.paper_data import (
    CascadeReach,
    Year,
    estimate,
    of_year,
    read_year,
    shortest,
    year_of,
)
from rivid.simulation import simulate_cascade
from rivid.simulation.scenario import Scenario, load_scenario

PICTURES = {"fig09": "search", "fig12": "day", "fig16": "tdr", "fig18": "histograms", "fig19": "cascade"}
YEAR = "the sample year's kind"
THIRD = 3


def sample_year() -> tuple[Year, World]:
    """Return the year of sample_data, and its truth."""
    year = read_year(ROOT / "sample_data" / "basse_isere", load_config(ROOT / "configs" / "basse_isere.toml"))
    truth = json.loads((ROOT / "sample_data" / "basse_isere_truth.json").read_text(encoding="utf-8"))
    days = {day["date"]: day for day in truth["days"]}
    known = [days[str(date)] for date in year.dates]
    return year, World(
        np.stack(year.inflow), np.stack(year.outflow), np.stack(year.level),
        np.array([float(day["delay_samples"]) for day in known]),
        np.array([float(day["delay_other"]) for day in known]),
    )  # fmt: skip


def prior_part(w: World, others: dict[str, list[float]]) -> str:
    """Return the section on how much of Fig. 18c is due to the prior."""
    rows = []
    for scale in (3.0, 5.0, 6.5, 8.0, 10.0, 13.0):
        r, s = jmap(w.u, w.y, delay_scale=scale), jmap(*shuffled(w), delay_scale=scale)
        pair, share = two(r.delay)
        pair_s, share_s = two(s.delay)
        rows.append([f"{scale:g}", f"{either(pair)}: {pc(share)}", f"{either(pair_s)}: {pc(share_s)}",
                     pc(within(r.delay, w)), pc(float(r.prior_only.mean()))])  # fmt: skip
    j = jmaps(w)
    mode = prior_mode(JmapSettings())
    (pair, share), (of_none, share_none) = two(j["rayleigh"].delay), two(j["shuffled"].delay)
    gain = at(j["estimated"].delay, 6, 7) - at(j["shuffled estimated"].delay, 6, 7)
    moved = [row[1].split(":")[0] for row in rows]
    return (
        "\n## How much of Fig. 18c is the prior\n\n"
        + table(
            [
                "sigma_d",
                "two most frequent delays",
                "on shuffled days",
                "within one of the truth",
                "the data do not decide",
            ],
            rows,
        )
        + "\nShuffled days take u from one day and y from another: they contain no delay. "
        f"With sigma_d = 6.5 the answer is {either(of_none)} on {pc(share_none)} of them, {either(pair)} on {pc(share)} of the real days. The answer follows sigma_d"
        f": {moved[0]} at 3, {moved[2]} at 6.5, {moved[-1]} at 13. Without the prior (alpha estimated, uniform) the answer is 6 or 7 on {pc(at(j['estimated'].delay, 6, 7))}, on shuffled days "
        f"{pc(at(j['shuffled estimated'].delay, 6, 7))}: the data alone give 6 or 7 on {pc(gain)} of days more than chance (other years {spread(others['alpha estimated at 6 or 7'])} and "
        f"{spread(others['alpha estimated at 6 or 7, shuffled days'])} %). Always answering the prior's mode, {mode}, is within one sample on {pc(within(np.full(len(w.truth), float(mode)), w))} of days, Table VI on {pc(within(j['rayleigh'].delay, w))}. "
        "A concentration like that of Fig. 18c can therefore be obtained without the reach: it is due to the prior, at the place of sigma_d from the hydraulics. More in [accuracy.md](accuracy.md).\n"
    )


def read_24(w: World) -> Readings:
    """Return the delays of every third day, for each reading of (24)."""
    ways: dict[str, dict[str, Any]] = {
        "Rayleigh prior": {"scale": 6.5},
        "uniform prior, alpha estimated": {},
        "without the inverse-gamma prior": {"scale": 6.5, "inverse_gamma": False},
    }
    days = range(0, len(w.u), THIRD)
    return {
        reading: {
            name: np.array([table_vi(w.u[i], w.y[i], reading, **how) for i in days], float)
            for name, how in ways.items()
        }
        for reading in READINGS
    }


def equation_24(w: World, readings: Readings) -> str:
    """Return the section on the readings of the lost equation."""
    few = World(w.inflow[::THIRD], None, w.level[::THIRD], w.truth[::THIRD], w.other[::THIRD])
    rows = []
    for reading, found in readings.items():
        free = found["uniform prior, alpha estimated"]
        rows.append([READINGS[reading], pc(at(found["Rayleigh prior"], 6, 7)), pc(within(free, few)), pc(at(free, 1)),
                     pc(at(found["without the inverse-gamma prior"], 1))])  # fmt: skip
    return (
        "\n## Four readings of (24)\n\nTable VI transcribed, every third day of the year. The page with (24) is lost.\n\n"
        + table(
            [
                "D_d",
                "Rayleigh: 6 or 7",
                "uniform: within one of the truth",
                "uniform: d = 1",
                "JMAPdeg: d = 1",
            ],
            rows,
        )
        + "\nSection I describes a response that varies slowly except at the delay, Fig. 10 one with two discontinuities. With jumps at both places d = 1 cannot be the answer: "
        "the rows that D_1 sets to zero are among those of D_2. With a jump at the delay alone JMAPdeg gives d = 1, as the paper reports, "
        f"on {rows[1][4]} of days, but so does the uniform prior, on {rows[1][3]}, unlike Fig. 18b, and it finds the delay on {rows[1][2]} of days instead of {rows[0][2]}: "
        "the response to a dam has its first jump at lag 1, and a single jump is placed there by a delay of 1. With the Rayleigh prior the readings give 6 or 7 on "
        f"{', '.join(row[1] for row in rows)}. "
        "`[jmap] jumps` selects one of the first two; Fig. 10 and Fig. 18b support the first, which is the default. The last two are not settings: they are in benchmarks/paper_measures.py, for this table.\n"
    )


def cascades() -> dict[str, list[CascadeReach]]:
    """Simulate the cascade of Fig. 19: as it is, with linear reaches, and linear without disturbances."""
    path = SCENARIOS / "cascade.toml"
    raw = load_scenario(path).model_dump(exclude_unset=True)
    raw.pop("channel", None)
    for reach in raw["cascade"]:
        reach.pop("channel", None)
    found = {"full equations": simulated_cascade(path)}
    for name, tables in {"linear reaches (7)": {}, "linear, all three": CLEAN | CLOSED | CALM}.items():
        changed = {**raw, **{key: {**raw.get(key, {}), **values} for key, values in tables.items()}}
        found[name] = []
        for season in simulate_cascade(parse(changed, Scenario, "benchmark")):
            reach = ReachConfig(**season.scenario.reach.model_dump(include=set(ReachConfig.model_fields)))
            jmap_config = JmapConfig(order="bounds", d_max="bounds", sigma_d="bounds")
            config = Config(reach=reach, jmap=jmap_config)
            year = year_of(config, season.dates, season.inflow, season.outflow, season.level)
            found[name].append(of_year(year, season.delay.astype(float)))
    return found


def fig_19(found: dict[str, list[CascadeReach]]) -> str:
    """Return the section on the cascade's intervals."""

    def width(pair: tuple[int, int]) -> int:
        return pair[1] - pair[0]

    rows, halved = [], {}
    for name, reaches in found.items():
        for n, r in enumerate(reaches):
            half, wide = shortest(r.delay, 0.5), r.estimated
            halved[name, n] = width(wide) <= width(r.empirical) / 2, width(half) <= width(r.empirical) / 2
            rows.append([name, f"{r.length / 1000:g} km", f"{r.truth.min():.0f}-{r.truth.max():.0f}", "{}-{}".format(*r.empirical),
                         "{}-{}".format(*half), "{}-{}".format(*wide), "{}-{}".format(*shortest(r.posterior)), ", ".join(w for w, yes in zip(("nine of ten", "half"), halved[name, n], strict=True) if yes) or "no"])  # fmt: skip
    first, linear, clear = found
    season = simulate_cascade(load_scenario(SCENARIOS / "cascade.toml"))[2]
    mean = ml(season.inflow - season.inflow[:, :1], season.level - season.level[:, :1]).fir.mean(axis=0)
    spike = mean[1] / mean[2:7].mean()

    def count(name: str, which: int) -> int:
        return sum(halved[name, n][which] for n in range(3))

    sure = sum(width(shortest(r.posterior)) <= width(r.empirical) / 2 for r in found[first])
    verdict = "same" if count(first, 0) == 3 else f"**not**: {count(first, 0)} of three"
    return (
        "\n## Fig. 19: the cascade\n\n"
        f"Paper: with the uniform prior the intervals of the first three reaches are at least halved. Here, for nine days of ten: {verdict} "
        f"({count(first, 1)} of three for half of the days; the paper does not state the level of its intervals).\n\n![the cascade](pictures/paper_cascade.png)\n\n"
        + table(
            [
                "reaches",
                "length",
                "true d",
                "operators",
                "half of the days",
                "nine of ten",
                "posterior, nine of ten",
                "halved for",
            ],
            rows,
        )
        + f"\nThe table also has `posterior`, which is not in the paper: with the full equations its interval is at most half of the operators' on {sure} of {len(found[first])} reaches."
        + "\n\nA simulation has no empirical values of operators. They are replaced by the gravity wave's travel time in the middle of the usual discharges, and three T_s on both sides, "
        "which for 8.2 km is the paper's 5 to 11. With the full equations the dam's own wave is the reason: a release lowers the level upstream of the dam at once, the response of the third reach has a spike at lag 1, "
        f"{spike:.0f} times as deep as the following values, and D_d, which has two jumps only, uses the second for it (d = 2). "
        f"With linear reaches the noise of the year is the reason: {count(linear, 0)} of three are halved as it is, {count(clear, 0)} of three with a perfect gauge, no unlogged inflow and exact operators.\n"
    )


def worlds(seeds: int) -> tuple[str, dict[str, list[float]]]:
    """Return the section on other worlds, and the measures of the sample year's kind."""
    names = [*WORLDS, MODEL]
    with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as pool:
        answers = list(pool.map(every_year, names, [range(101, 101 + seeds)] * len(names)))
    found = dict(zip(names, answers, strict=True))
    rows = [
        [key, *(spread(found[name][key]) if key in found[name] else "" for name in names)]
        for key in found[YEAR]
    ]
    free, alike = "uniform prior, alpha estimated, within one of the truth", "sigma_d 6.5 and 10 agree"
    ramp = ("direct within one of the truth", "direct with a ramp, within one of the truth")
    turn = ("indirect within one of the truth", "indirect with a ramp, within one of the truth")
    rayleigh, nothing = "Rayleigh prior at 6 or 7", "on shuffled days, at 6 or 7"
    first = "h[0] > h[1], JMAP"

    def m_(name: str, key: str) -> float:
        return 100 * float(np.mean(found[name][key]))

    def m(name: str, key: str) -> str:
        return f"{m_(name, key):.0f} %"

    text = (
        "\n## Influence of the simulated year\n\n"
        f"The same measures over {seeds} simulated years of each world, per cent of days, mean with the lowest and highest year. True delays are 6 to 8. "
        '"Operators exact": equal gains, commands and set-points without steps, no differences between shifts. "All three": perfect gauge, no unlogged inflow, exact operators. "Operators at intervals": they act every 10 to 30 minutes or when the inflow changes, with a dead band of 2 cm. In the last column y is (10) itself, with the sample year\'s u, and white noise of 4 mm.\n\n'
        + table(["", *names], rows)
        + f"\n- The direct and the indirect search are at the bounds on more than half of the days in every world with operators. A constant and a ramp in addition to (8) change the direct one from {m(YEAR, ramp[0])} to {m(YEAR, ramp[1])} "
        f"within one sample, from {m('no unlogged inflow', ramp[0])} to {m('no unlogged inflow', ramp[1])} without unlogged inflow: the unbalanced first sample is the reason, then the unlogged inflow. "
        f"The indirect one goes from {m(YEAR, turn[0])} to {m(YEAR, turn[1])}; where the level is (10) itself, from {m(MODEL, turn[0])} to {m(MODEL, turn[1])}.\n"
        f"- The first jump, h[0] > h[1] (JMAP): {m(YEAR, first)} as it is, {m('operators exact', first)} with exact operators, {m('operators at intervals', first)} with operators at intervals, {m(MODEL, first)} where y is (10) itself.\n"
        f"- Uniform prior, alpha estimated, within one sample: {m(YEAR, free)} as it is, {m('perfect gauge', free)} with a perfect gauge, {m('no unlogged inflow', free)} without unlogged inflow, "
        f"{m('operators exact', free)} with exact operators, {m('all three', free)} with all three: [composition of the residual](#composition-of-the-residual-w).\n"
        f"- sigma_d 6.5 and 10 agree on {m(YEAR, alike)} as it is, {m('perfect gauge', alike)} with a perfect gauge, {m('operators exact', alike)} with exact operators, {m('all three', alike)} with all three, "
        f"{m('operators at intervals', alike)} with operators at intervals.\n"
        f"- Rayleigh prior at 6 or 7: {m(YEAR, rayleigh)} as it is, {m('operators at intervals', rayleigh)} with operators at intervals, {m('perfect gauge', rayleigh)} with a perfect gauge.\n"
        f"- Full equations: the front is spread ([hydraulic.md](hydraulic.md)), the answer is 6 or 7 on {m('full equations', rayleigh)}.\n"
        f"- On shuffled days the Rayleigh prior gives 6 or 7 on {min(m_(n, nothing) for n in names):.0f} to {max(m_(n, nothing) for n in names):.0f} %, whatever the world.\n"
    )
    return text, found[YEAR]


def pictures(year: Year, reaches: list[CascadeReach]) -> float:
    """Draw the figures, copy some of them for the page, and return the duration [s]."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        draw_paper(year, estimate(year), reaches, Path(folder))
        for stem, name in PICTURES.items():
            shutil.copy(Path(folder) / f"{stem}.png", ROOT / "docs" / "pictures" / f"paper_{name}.png")
    return time.perf_counter() - began


def main() -> None:
    """Measure, draw, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=10)
    seeds = parser.parse_args().seeds
    (ROOT / "docs" / "pictures").mkdir(exist_ok=True)
    year, w = sample_year()
    compared, others = worlds(seeds)
    found = measure(w)
    row = cascades()
    readings = read_24(w)
    pictures(year, row["full equations"])
    claims = (
        hydraulics(year)
        + simple_models(year, w, found, others)
        + one_day(year, w, readings)
        + the_year(year, w, found, others)
    )
    halved = all(np.ptp(r.estimated) <= np.ptp(r.empirical) / 2 for r in next(iter(row.values()))[:3])
    same = sum(bool(claim.same) for claim in claims)
    text = (
        "# The paper's claims compared with the results of rivid\n\n"
        "Written by `make paper-page`, which measures every number. The year is simulated (`sample_data/basse_isere`, a reach with the character of Table I), its true delays are known, "
        f"{len(w.truth)} data sets of {w.u.shape[1]} samples. It was set up from the paper's information on reach, flows and operators ([how](../sample_data/basse_isere/README.md)), never from the result of an estimator. Shares are of days; in brackets "
        f"{seeds} other simulated years of the same kind, mean with lowest and highest. The figures themselves: `rivid figures OUT --paper`.\n\n"
        "**The rule.** A claim is the same if the condition in the column *same if* holds for the sample year. A number of the paper counts as met within about its own precision, a qualitative observation as "
        "met on most days. The conditions are code, in benchmarks/paper_claims.py. They were fixed before the present sample year was made, with two exceptions: the row of the first jump is new, and the jump of the MAP is measured at the true delay of each day, not at lag 7. The reasons do not affect the verdict.\n\n"
        f"{same + halved} of {len(claims) + 1} claims are the same: {same} of {len(claims)} in the table; that of Fig. 19, in its own section, is {'' if halved else 'not '}the same.\n\n"
        + table(["Fig.", "the paper", "same if", "here", "", "why"], [claim.row for claim in claims])
        + "\n![histograms of the JMAP](pictures/paper_histograms.png)\n\n![one day](pictures/paper_day.png)\n\n"
        "![exhaustive search](pictures/paper_search.png)\n\n![time-day representation](pictures/paper_tdr.png)\n"
        + prior_part(w, others)
        + equation_24(w, readings)
        + fig_19(row)
        + compared
        + residual.section()
        + (ROOT / "benchmarks" / "paper_departures.md").read_text(encoding="utf-8")
    )
    (ROOT / "docs" / "paper.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
