"""Compute hydraulic travel times, and compare Table VI with its baselines on them; write docs/hydraulic.md.

Usage: python -m benchmarks.hydraulic [--seeds N]
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy import one_season, settings_of, spread
from benchmarks.measure import table
from benchmarks.observables import observables
from rivid.core.fir import jmap
from rivid.core.hydraulics import travel_bounds
from rivid.plots import style
from rivid.reach.saint_venant import Channel, arrival_time
from rivid.reach.saint_venant import simulate as saint_venant
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario
from rivid.simulation.season import Water

ROOT = Path(__file__).parent.parent
SCENARIOS = {"hydraulic_short": "4.5 km", "hydraulic": "8.2 km", "hydraulic_long": "12 km"}
FINE = 240
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TravelTimes:
    """Travel times as a function of the discharge; arrays of shape (flows,).

    Attributes
    ----------
    flow : ndarray
        Discharge [m3/s].
    froude : ndarray
        F_o (4) [-].
    gravity, kinematic : ndarray
        Bounds (5) [s].
    characteristic, simulated : ndarray
        Arrival along the steady profile, and of a small step in the full equations [s].
    sample_time : float
        T_s [s].
    """

    flow: Floats
    froude: Floats
    gravity: Floats
    kinematic: Floats
    characteristic: Floats
    simulated: Floats
    sample_time: float


def draw(times: TravelTimes, path: Path) -> None:
    """Draw the Froude number and the travel time over the discharge as PNG."""
    with style.styled():
        figure, (upper, lower) = style.sheet(
            "Travel time of a wave down the reach",
            "bounds (5), arrival along the steady profile and of a small step in the full equations",
            (1.1, 2.9), gap=(0.0, 0.42), top=0.6,
        )  # fmt: skip
        T = times.sample_time
        upper.plot(times.flow, times.froude, color=style.INK, lw=1.6)
        upper.set_ylabel("Froude number")
        upper.set_ylim(0, 1.15 * float(times.froude.max()))
        upper.tick_params(labelbottom=False)
        top = 1.6 * float(max(times.characteristic.max(), times.gravity.max())) / T
        kinematic = times.kinematic / T
        ends = f"{kinematic.max():.0f} samples at {times.flow[0]:.0f} m³/s"
        ends += f", {kinematic[-1]:.0f} at {times.flow[-1]:.0f}" if (kinematic < top).any() else ""
        blue = {"color": style.WATER}  # a wide line, since arrivals along the profile coincide with it
        lower.plot(
            times.flow, times.gravity / T, label="gravity wave, lower bound (5)", lw=6, alpha=0.4, **blue
        )
        lower.plot(times.flow, times.characteristic / T, color=style.INK, lw=1.8, label="along the profile")
        ring = {"color": style.ACCENT, "mfc": "none", "mew": 1.3}
        style.marks(lower, times.flow, times.simulated / T, "full equations", 5, marker="o", **ring)
        lower.plot(times.flow, kinematic, ls="--", lw=1.4, label=f"kinematic wave: {ends}", **blue)
        lower.set_ylim(0, top)
        lower.set_xlabel("discharge [m³/s]")
        lower.set_ylabel(f"travel time [samples of {T:g} s]")
        for ax in (upper, lower):
            ax.set_xlim(times.flow[0], times.flow[-1])
            ax.grid(True, axis="y")
        style.second_axis(lower, T, "minutes")
        style.key(lower)
        style.save(figure, path)


def travel_times() -> TravelTimes:
    """Compute bounds, characteristic and simulated arrival for a range of discharges."""
    scenario = load_scenario(ROOT / "configs" / "scenarios" / "hydraulic.toml")
    shape, reach, aim = scenario.channel, scenario.reach, scenario.level
    assert shape is not None
    channel = Channel.smooth(
        reach.length, reach.width, shape.slope, shape.manning, FINE, end_bed=shape.bed_level
    )
    flow = np.arange(100.0, 801.0, 50.0)
    level = aim.set_point - aim.drawdown / 100.0 * np.maximum(flow - aim.drawdown_from, 0.0)
    profile = channel.level(
        saint_venant(channel, np.zeros((len(flow), 1)), flow[:, None], flow[:, None], level).end.area
    )
    depth = (profile - channel.bed).mean(axis=1)
    bounds = travel_bounds(flow, length=reach.length, width=reach.width, depth=depth)
    time = 4.0 * np.arange(600)
    seen = []
    for q, z in zip(flow, level, strict=True):
        moved = np.where(time >= 200.0, q + 1.0, q)
        rate = np.diff(saint_venant(channel, time, moved, np.full(600, q), z, gate_time=0.0).level)
        plateau = rate[: np.argmax(rate) + 1].max()
        seen.append(time[np.argmax(rate > 0.5 * plateau)] + 2.0 - 200.0)
    return TravelTimes(
        flow, bounds.froude, bounds.gravity, bounds.kinematic, arrival_time(channel, flow, level),
        np.array(seen), reach.sample_time,
    )  # fmt: skip


def fronts() -> str:
    """Return a table of the rate of rise in the first four samples of a step, over that of the storage."""
    scenario = load_scenario(ROOT / "configs" / "scenarios" / "hydraulic.toml")
    rows = []
    for name in SCENARIOS:
        water = Water(load_scenario(ROOT / "configs" / "scenarios" / f"{name}.toml"))
        assert water.channel is not None
        for q in (150.0, 300.0, 600.0):
            z = water.level - 0.002 * max(q - 400.0, 0.0)
            T = scenario.reach.sample_time
            time = T * np.arange(60)
            moved = np.where(time >= 5 * T, q + 5.0, q)
            level = saint_venant(water.channel, time, moved, np.full(60, q), z).level
            steady = 5.0 * T / water.surface_area
            first = int(np.ceil(water.arrival(np.array([q]), np.array([z]))[0] / T)) + 5
            shares = np.diff(level)[first - 1 : first + 3] / steady
            rows.append([SCENARIOS[name], f"{q:.0f}", *(f"{s:.2f}" for s in shares)])
    return table(["reach", "flow [m3/s]", "lag d + 1", "d + 2", "d + 3", "d + 4"], rows)


def errors_by_flow(name: str, seeds: range) -> str:
    """Return a table of the errors by the day's mean flow, for the reach's own settings."""
    found: list[tuple[float, int]] = []
    for seed in seeds:
        season = simulate(load_scenario(ROOT / "configs" / "scenarios" / f"{name}.toml"), seed=seed)
        u, y = season.inflow - season.inflow[:, :1], season.level - season.level[:, :1]
        delay = jmap(u, y, settings_of(season, True)["jmap"]).delay
        found += list(zip(season.inflow.mean(axis=1), (delay - season.delay).tolist(), strict=True))
    flow, error = np.array([f for f, _ in found]), np.array([e for _, e in found])
    rows = []
    for low, high in ((0, 180), (180, 250), (250, 320), (320, 450), (450, 900)):
        inside = (flow >= low) & (flow < high)
        if inside.any():
            share = [f"{np.mean(error[inside] == k):.2f}" for k in (-1, 0, 1, 2)]
            rows.append([f"{low}-{high}", str(inside.sum()), f"{np.mean(error[inside] < -1):.2f}", *share,
                         f"{np.mean(error[inside] > 2):.2f}"])  # fmt: skip
    return table(["flow [m3/s]", "days", "< -1", "-1", "0", "+1", "+2", "> +2"], rows)


def main() -> None:
    """Run all seeds, draw the picture, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    times = travel_times()
    draw(times, ROOT / "docs" / "pictures" / "travel_time.png")
    worst = float(np.abs(times.simulated / times.characteristic - 1.0).max())
    tasks = [(name, 100 + seed) for name in SCENARIOS for seed in range(seeds)]
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
        answers = list(pool.map(one_season, tasks))
    rows = []
    for name, length in SCENARIOS.items():
        mine = [a for (n, _), a in zip(tasks, answers, strict=True) if n == name]
        for own in (False, True):
            for estimator in ("jmap", "jmap, shuffled days", "always the prior's mode"):
                scores = [a["found"][own, estimator] for a in mine]
                rows.append([
                    length, "the reach's" if own else "the paper's", estimator,
                    spread(s.exact for s in scores), spread(s.within for s in scores),
                ])  # fmt: skip
    season = simulate(load_scenario(ROOT / "configs" / "scenarios" / "hydraulic.toml"))
    text = (
        "# The hydraulic truth\n\nWritten by `make hydraulic-page`. The water of `configs/scenarios/hydraulic.toml` follows "
        "the full Saint-Venant equations (1);\nthe estimators do not use them.\n\n"
        "## Froude number, bounds and arrival agree\n\n![travel time over the discharge](pictures/travel_time.png)\n\n"
        f"Froude number {times.froude.min():.2f} to {times.froude.max():.2f}. The arrival of a small step in the full "
        f"equations and that along the characteristic differ by at most\n{worst:.1%} over 100-800 m3/s; both lie within "
        "the bounds (5), near the gravity wave's.\n\n"
        "## Observables of a season, and of the paper's year\n\n"
        + observables(season).table()
        + "\nThe level moves more than in the paper's year. A dam that passes a step on at once lowers the upstream level "
        "by\nthe step over width times celerity, whatever the storage, until the wave arrives.\n\n"
        f"## Table VI on these seasons\n\n{seeds} seeds of 332 days each; mean, lowest and highest seed. The true delay is the arrival of the "
        "wave.\n\n"
        + table(["reach", "settings", "", "exact [%]", "within one sample [%]"], rows)
        + "\n## Errors\n\nBy the day's flow, the reach's own settings, estimate less truth in samples (share of days), "
        "8.2 km:\n\n"
        + errors_by_flow("hydraulic", range(100, 104))
        + "\n12 km:\n\n"
        + errors_by_flow("hydraulic_long", range(100, 104))
        + "\nThe front of a step is not sharp at the gauge. Rate of rise at the first lags at which it is visible, as a "
        "share of\nthe storage's rate (step / surface):\n\n"
        + fronts()
        + "\nThe wave arrives with most of its height within two lags. The rest follows, spread by friction and reflection."
        "\nIf the front is between two samples, the jump in the response is divided into two parts, and the estimate may be "
        "late\nby one. On 12 km the feedback and the slow oscillation of the level act between departure and arrival, and on some days the\n"
        "estimate is at lags without a response. With the reach's settings, the prior's mode alone is within one sample on nearly all days: the\n"
        "hydraulics determine the delay better than the logs of a day.\n"
    )
    (ROOT / "docs" / "hydraulic.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
