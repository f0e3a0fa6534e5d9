"""Speed of Saint-Venant's equations: simulated days a second, and the growth with cells and days; prints.

Usage: python -m benchmarks.saint_venant
"""

import tracemalloc

import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import functions_in_turn, machine, median, table
from rivid.reach.saint_venant import Channel, Flow, simulate

T_S = 133.0
PER_DAY = 650
RUNS = 5


def commands(days: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times, an inflow in whole steps with a daily wave, and an outflow that follows it."""
    n = days * PER_DAY
    time = T_S * np.arange(n)
    moves = np.random.default_rng(1).integers(-20, 21, n // 25 + 1)
    inflow = 350.0 + 120.0 * np.sin(2 * np.pi * time / 86_400.0) + np.repeat(moves, 25)[:n]
    return time, inflow, np.concatenate([np.full(7, inflow[0]), inflow[:-7]])


def season(channel: Channel, days: int) -> Flow:
    """A continuous season, nudged to one level so that it may be of any length."""
    time, inflow, outflow = commands(days)
    return simulate(channel, time, inflow, outflow, 5.2, observed=np.full(len(time), 5.2))


def measured(cases: dict[str, tuple[int, int]]) -> str:
    """A table of cases: cells and days."""
    channels = {cells: Channel.table_i(cells) for cells, _ in cases.values()}

    def case(cells: int, days: int) -> Flow:
        return season(channels[cells], days)

    seconds = functions_in_turn({name: lambda c=c: case(*c) for name, c in cases.items()}, RUNS)
    rows = []
    for name, (cells, days) in cases.items():
        took = median(seconds[name])
        tracemalloc.start()
        case(cells, days)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        rows.append([str(cells), str(days), f"{took:.3f} s", f"{days / took:,.0f}", f"{peak:.1f} MB"])
    return table(["cells", "days", "time", "simulated days a second", "arrays at most"], rows)


def batch() -> str:
    """Days that know nothing of each other, in one call and one by one."""
    channel, days = Channel.table_i(32), 60
    time, inflow, outflow = (values.reshape(days, PER_DAY) for values in commands(days))
    seconds = functions_in_turn(
        {
            "one call": lambda: simulate(channel, time, inflow, outflow, 5.2),
            "a call a day": lambda: [
                simulate(channel, *day, 5.2) for day in zip(time, inflow, outflow, strict=True)
            ],
            "a call a sample": lambda: by_samples(channel, time[0], inflow[0], outflow[0]),
        },
        RUNS,
    )
    counts = {"one call": days, "a call a day": days, "a call a sample": 1}
    rows = [[name, f"{median(took) / counts[name] * 1e3:.2f} ms"] for name, took in seconds.items()]
    return table(["60 days apart, 32 cells", "time a day"], rows)


def by_samples(channel: Channel, *day: NDArray[np.float64]) -> None:
    """A day in closed loop: the state handed on from sample to sample."""
    time, inflow, outflow = day
    state = simulate(channel, time[:1], inflow[:1], outflow[:1], 5.2).end
    for k in range(1, PER_DAY):
        two = slice(k - 1, k + 1)
        state = simulate(channel, time[two], inflow[two], outflow[two], state).end


def main() -> None:
    """Run all and print."""
    print(
        f"# Saint-Venant, one core\n\nReach of Table I, T_s = {T_S:g} s, {PER_DAY} samples a day; {machine()}.\n"
    )
    print(measured({f"{cells} cells": (cells, 60) for cells in (24, 32, 48, 64, 96)}))
    print(measured({f"{days} days": (32, days) for days in (30, 120, 332)}))
    print(batch())


if __name__ == "__main__":
    main()
