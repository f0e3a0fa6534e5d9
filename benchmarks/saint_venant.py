"""Measure the speed of the Saint-Venant solver: simulated days per second, by cells and days. Prints tables.

Usage: python -m benchmarks.saint_venant
"""

import os
import subprocess
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.exam.answering import Logs, record_of
from benchmarks.measure import PYTHON, functions_in_turn, machine, median, table
from rivid.diagnosis.choice import response_of
from rivid.diagnosis.noise.model import NoiseModel, fit_noise
from rivid.effects import changes_of, effect_classes
from rivid.reach.saint_venant import Channel, Flow, simulate
from rivid.simulation import simulate as closed
from rivid.simulation.scenario import load_scenario

ROOT = Path(__file__).parent.parent

T_S = 133.0
PER_DAY = 650
RUNS = 5
REACH = {"reach": {"name": "pool", "length": 8200.0, "width": 81.6, "bed_level": 124.3}}
"""The user's configuration of the reach to diagnose."""


def commands(days: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times, an inflow in integer steps with a daily wave, and an outflow that follows it."""
    n = days * PER_DAY
    time = T_S * np.arange(n)
    moves = np.random.default_rng(1).integers(-20, 21, n // 25 + 1)
    inflow = 350.0 + 120.0 * np.sin(2 * np.pi * time / 86_400.0) + np.repeat(moves, 25)[:n]
    return time, inflow, np.concatenate([np.full(7, inflow[0]), inflow[:-7]])


def season(channel: Channel, days: int) -> Flow:
    """Simulate a continuous season, nudged to one level so that it may have any length."""
    time, inflow, outflow = commands(days)
    return simulate(channel, time, inflow, outflow, 5.2, observed=np.full(len(time), 5.2))


def measured(cases: dict[str, tuple[int, int]]) -> str:
    """Return a table of cases: cells and days."""
    channels = {cells: Channel.smooth(8200.0, 81.6, 1e-4, 0.025, cells) for cells, _ in cases.values()}

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
    """Compare independent days in one call, in a call a day, and in a call a sample."""
    channel, days = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 32), 60
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


def on(threads: int, task: Callable[[], object]) -> None:
    """Run a task on a number of threads."""
    config: Any = numba.config
    before, config.NUMBA_NUM_THREADS = config.NUMBA_NUM_THREADS, threads
    try:
        task()
    finally:
        config.NUMBA_NUM_THREADS = before


def shared() -> str:
    """Compare one and two cores with the goals: days in rows, and all columns of a diagnosis."""
    channel, days = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 48), 90
    rows = [values.reshape(days, PER_DAY) for values in commands(days)]
    reading = np.full((days, PER_DAY), 5.2)
    plain = load_scenario(ROOT / "configs" / "scenarios" / "effects" / "diurnal_inflow.toml")
    season = closed(plain.model_copy(update={"days": days}), 1)
    logs = Logs(season.dates, season.seconds, season.inflow, season.outflow, season.level, REACH)
    record = record_of(logs)
    response = response_of(logs.settings, record)
    world = record.world(record.usual_output, record.usual_flow)
    trials = [one for effect in effect_classes(None).values() for one in effect.trials(world)]
    effects = [effect for trial in trials if not trial.hourly for effect in trial.effects][:30]

    def nudged() -> None:
        simulate(channel, *rows, 5.2, observed=reading)

    def columns() -> None:
        base = response.baseline(record)
        response.slopes(record, base)
        for effect in effects:
            response.baseline(record, changes_of((effect,), world))

    tasks = {(task, k): lambda t=task, k=k: on(k, t) for task in (nudged, columns) for k in (1, 2)}
    seconds = {key: median(took) for key, took in functions_in_turn(tasks, RUNS).items()}
    goals = {(nudged, 1): "1,500", (nudged, 2): "2,800", (columns, 1): "", (columns, 2): "1.5 s"}
    names = {
        nudged: f"{days} days simulated independently, 48 cells, level relaxed to the measured one: days a second",
        columns: f"baseline and columns of {len(response.parameters)} parameters and {len(effects)} effects, {days} days",
    }
    table_rows = []
    for key, goal in goals.items():
        task, cores = key
        shown = f"{days / seconds[key]:,.0f}" if task is nudged else f"{seconds[key]:.2f} s"
        table_rows.append([names[task], str(cores), shown, goal])
    return table(["what", "cores", "measured", "goal"], table_rows)


def likelihoods() -> str:
    """Measure the noise model on 90 days: a likelihood, and fits from a near and from the usual starts."""
    noise = NoiseModel(2e-3, 1e-4, 2.0, 14_400.0, 0.0, 3600.0, T_S, 6.7e5)
    whole = noise.simulate(90, PER_DAY, np.random.default_rng(0))
    gaps = np.where(np.random.default_rng(1).random(whole.shape) < 0.01, np.nan, whole)
    rows = []
    for name, days in (("no gaps", whole), ("1 % of samples missing", gaps)):
        tasks = {
            "one": lambda d=days: noise.log_likelihood(d),
            "near": lambda d=days: fit_noise(d, T_S, 6.7e5, starts=(noise,), alone=True),
            "usual": lambda d=days: fit_noise(d, T_S, 6.7e5),
        }
        took = {key: median(seconds) for key, seconds in functions_in_turn(tasks, RUNS).items()}
        rows.append(
            [name, f"{took['one'] * 1e3:.2f} ms", f"{took['near'] * 1e3:.0f} ms", f"{took['usual']:.2f} s"]
        )
    return table(
        ["90 days", "likelihood (goal 0.5 ms)", "fit from a near start", "fit from the usual starts"], rows
    )


COMPILED = """
import time
import numpy as np
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario
from benchmarks.exam.answering import Logs, record_of
from rivid.diagnosis.choice import response_of
from benchmarks.saint_venant import REACH, ROOT
from rivid.diagnosis.noise.model import fit_noise
began = time.perf_counter()
s = load_scenario(ROOT / "configs" / "scenarios" / "hydraulic.toml").model_copy(update={"days": 2, "missing_days": 0})
season = simulate(s, 1)
water = time.perf_counter()
logs = Logs(season.dates, season.seconds, season.inflow, season.outflow, season.level, REACH)
record = record_of(logs)
response_of(logs.settings, record).baseline(record)
days = time.perf_counter()
fit_noise(np.random.default_rng(0).normal(size=(4, 650)).cumsum(axis=1) * 1e-3, 133.0, 6.7e5)
print(water - began, days - water, time.perf_counter() - days)
"""


def compiling() -> str:
    """Measure the first use of the compiled loops, with an empty cache, and the second use."""
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        for name in ("first use: compiled", "from then on: loaded"):
            done = subprocess.run(
                [PYTHON, "-c", COMPILED], capture_output=True, text=True, check=True, cwd=ROOT,
                env=os.environ | {"NUMBA_CACHE_DIR": cache},
            )  # fmt: skip
            rows.append([name, *(f"{float(part):.1f} s" for part in done.stdout.split())])
    return table(["", "2 days in closed loop", "the same in rows", "a fit of the noise"], rows)


def by_samples(channel: Channel, *day: NDArray[np.float64]) -> None:
    """Simulate a day in closed loop: the state is passed from sample to sample."""
    time, inflow, outflow = day
    state = simulate(channel, time[:1], inflow[:1], outflow[:1], 5.2).end
    for k in range(1, PER_DAY):
        two = slice(k - 1, k + 1)
        state = simulate(channel, time[two], inflow[two], outflow[two], state).end


def closed_loop() -> str:
    """Measure whole seasons of `rivid simulate`, operators and hydraulics together, by cells and days."""
    plain = load_scenario(ROOT / "configs" / "scenarios" / "hydraulic.toml")
    rows = []
    for cells, days in ((32, 60), (32, 332), (32, 664), (24, 332), (64, 332), (96, 332)):
        assert plain.channel is not None
        other = plain.model_copy(
            update={
                "days": days,
                "missing_days": 0,
                "channel": plain.channel.model_copy(update={"cells": cells}),
            }
        )
        took = median(functions_in_turn({"season": lambda s=other: closed(s)}, 3)["season"])
        rows.append([str(cells), str(days), f"{took:.2f} s", f"{days / took:,.0f}"])
    return table(["cells", "days", "season in closed loop", "simulated days a second"], rows)


def sections() -> str:
    """Return the sections of `make bench` on the simulated world and the noise."""
    return (
        "## The simulated world\n\nOpen loop, level relaxed to the measured one, one core:\n\n"
        + measured({f"{cells} cells": (cells, 60) for cells in (24, 48, 96)})
        + "\n"
        + shared()
        + "\n"
        + closed_loop()
        + "\n## The noise\n\n"
        + likelihoods()
        + "\nThe compiled loops on their first use in an installation:\n\n"
        + compiling()
    )


def main() -> None:
    """Run all cases and print the tables."""
    print(
        f"# Saint-Venant, one core\n\nReach of Table I, T_s = {T_S:g} s, {PER_DAY} samples a day; {machine()}.\n"
    )
    print(measured({f"{cells} cells": (cells, 60) for cells in (24, 32, 48, 64, 96)}))
    print(measured({f"{days} days": (32, days) for days in (30, 120, 332)}))
    print(batch())
    print(shared())
    print(closed_loop())
    print(likelihoods())
    print(compiling())


if __name__ == "__main__":
    main()
