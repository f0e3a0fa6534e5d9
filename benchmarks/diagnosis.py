"""Measure time, memory and simulations of `rivid diagnose` on hard cases and on a library of candidates.

Each case runs in a process of its own, ``python -m benchmarks.diagnosis TASK LOGS RESULT``, which receives
logs and a configuration. Counts and shares of time come from functions that the process wraps.
"""

import functools
import json
import pickle
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.exam.answering import Logs, answer, record_of
from benchmarks.exam.worlds import World, logs_of, season_of
from benchmarks.measure import PYTHON, Usage, median, process, table
from rivid.diagnosis import search, workflow
from rivid.diagnosis.choice import library_of, response_of
from rivid.diagnosis.explanation import fitted
from rivid.diagnosis.fit import Model
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.response import hydraulic
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.response.river import RiverResponse
from rivid.simulation.scenario import load_scenario

SCENARIOS = Path(__file__).parent.parent / "configs" / "scenarios"
LOCK = {"name": "unlogged_downstream_release", "size": 30.0, "duration": 25.0 / 60.0, "per_day": 7.0}
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "nothing hidden": ("uneven", {}),
    "one effect": ("effects/diurnal_inflow", {}),
    "two effects": ("pairs/day_and_bypass", {}),
    "7 pulses a day": ("uneven", {"effects": (LOCK,)}),
    "an outsider": ("outside/hunting", {}),
    "one effect, 60 s": ("effects/diurnal_inflow", {"sample_time": 60.0}),
    "one effect, 600 s": ("effects/diurnal_inflow", {"sample_time": 600.0}),
    "a river, one effect": ("exam/river_bypass", {}),
    "one effect, 332 days": ("effects/diurnal_inflow", {"days": 332}),
}
"""Scenario of each case, and its changes."""
GOALS = {60: "12 s, median 8 s", 332: "60 s, 600 MB"}
"""Goals by the number of days, for samples of 133 s."""
QUICK = ("one effect, 600 s", "a river, one effect")
CANDIDATES = 30


def case(name: str) -> Logs:
    """Return the logs of a case, with a configuration of the exact geometry."""
    place, changes = CASES[name]
    scenario = load_scenario(SCENARIOS / f"{place}.toml")
    T, usual = changes.get("sample_time", scenario.reach.sample_time), scenario.reach.sample_time
    activity = min(scenario.programme.activity * T / usual, 1.0)  # keeps the number of commands per hour
    changed = {
        "days": changes.get("days", 60), "missing_days": 0,
        "effects": changes.get("effects", scenario.effects),
        "reach": scenario.reach.model_copy(update={"sample_time": T}),
        "programme": scenario.programme.model_copy(update={"activity": activity}),
    }  # fmt: skip
    scenario = scenario.model_copy(update=changed)
    kind = "river" if place.startswith("exam/river") else "saint_venant"
    world = World(1, kind, "crew", "peaking", scenario, dict.fromkeys(("length", "width", "depth"), 0.0))
    return logs_of(world, season_of(world))  # the effects are part of the scenario


PARTS: dict[str, tuple[tuple[Any, str], ...]] = {
    "water": tuple(
        (kind, name)
        for kind in (HydraulicResponse, LinearPool, RiverResponse)
        for name in ("baseline", "simulate", "slopes")
    ),
    "noise": tuple((NoiseModel, name) for name in ("whiten", "log_likelihood", "forecast_errors", "smooth"))
    + ((Model, "fit_noise"),),
    "events": ((search, "find_events"),),
    "waiting": ((workflow, "side_by_side"),),
}
"""Functions of each part. Time in a nested function of another part counts for that part."""
SHOWN = ("water", "noise", "events", "rest")
RUNS: tuple[tuple[Any, str], ...] = (
    (hydraulic, "simulate"),
    (LinearPool, "baseline"),
    (RiverResponse, "baseline"),
)


class Watch:
    """Time by part, and days of each simulation. Wraps the functions for the rest of the process.

    Each thread counts its own time; waiting for other threads is a part as well.
    """

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.runs: list[int] = []
        self._own = threading.local()
        self.turn()
        for part, functions in PARTS.items():
            for holder, name in functions:
                setattr(holder, name, self._timed(part, getattr(holder, name)))
        for holder, name in RUNS:
            setattr(holder, name, self._counted(getattr(holder, name)))

    def turn(self) -> list[str]:
        """Add the time since the thread's last call to the current part; return the stack of parts."""
        now = time.perf_counter()
        inside: list[str] = vars(self._own).setdefault("inside", ["rest"])
        self.seconds[inside[-1]] += now - vars(self._own).setdefault("since", now)
        self._own.since = now
        return inside

    def _timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def timed(*given: Any, **named: Any) -> Any:
            self.turn().append(part)
            try:
                return function(*given, **named)
            finally:
                self.turn().pop()

        return timed

    def _counted(self, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def counted(*given: Any, **named: Any) -> Any:  # a response and a record, or a channel and times
            self.runs.append(len(getattr(given[1], "time", given[1])))
            return function(*given, **named)

        return counted


def diagnosed(logs: Logs) -> dict[str, Any]:
    """Diagnose logs, and return the time and the number of simulations."""
    watch = Watch()
    began, used = time.perf_counter(), time.process_time()
    answered = answer(logs)
    watch.turn()
    seconds, cpu = time.perf_counter() - began, time.process_time() - used
    if "error" in answered:
        raise SystemExit(answered["error"])
    busy = {part: watch.seconds[part] for part in SHOWN}
    shares = {part: one / sum(busy.values()) for part, one in busy.items()}
    seasons = sum(watch.runs) / len(logs.dates)
    names = ", ".join(effect["name"] for effect in answered["effects"]) or answered["verdict"]
    return {
        "seconds": seconds, "cpu": cpu, "simulations": len(watch.runs), "seasons": seasons,
        "shares": shares, "names": names,
    }  # fmt: skip


def candidates(logs: Logs) -> dict[str, Any]:
    """Measure the columns of the first candidates, and their innovations relative to a fit without them."""
    record, settings = record_of(logs), logs.settings
    model = Model(response_of(settings, record), None, record.usual_output, record.usual_flow, 0.0)
    base = fitted(model, record, np.ones(record.days, bool), steps=1)
    classes, count, world = {}, 0, record.world()
    for name, effect in library_of(settings).items():
        trials = [trial for trial in effect.trials(world) if not trial.hourly]
        if trials and count < CANDIDATES:
            classes[name], count = effect, count + sum(len(trial.effects) for trial in trials)
    began = time.perf_counter()
    library = search.Library.of(base.model, record, classes)
    columns = time.perf_counter() - began
    search.screened(base, library, record)
    screened = time.perf_counter() - began - columns
    return {"count": count, "columns": columns, "screened": screened}


TASKS: dict[str, Callable[[Logs], dict[str, Any]]] = {"diagnosed": diagnosed, "candidates": candidates}


def alone(task: str, logs: Logs, work: Path) -> tuple[dict[str, Any], Usage]:
    """Run a task in a process of its own."""
    given, result = work / "logs.pickle", work / "result.json"
    given.write_bytes(pickle.dumps(logs))
    used = process([PYTHON, "-m", "benchmarks.diagnosis", task, str(given), str(result)])
    return json.loads(result.read_text(encoding="utf-8")), used


def section(work: Path, quick: bool = False) -> str:
    """Return the tables of all or of the short cases, and of the candidates."""
    for name in QUICK:  # compile and cache the loops
        alone("diagnosed", case(name), work)
    rows, usual = [], []
    for name in QUICK if quick else CASES:
        logs = case(name)
        found, used = alone("diagnosed", logs, work)
        days, T = len(logs.dates), logs.settings.reach.sample_time
        goal = GOALS[days] if T == 133.0 else ""
        usual += [found["seconds"]] if T == 133.0 and days == 60 else []
        shares = [f"{100 * found['shares'][part]:.0f} %" for part in SHOWN]
        rows.append(
            [name, f"{days} x {T:g} s", f"{found['seconds']:.1f} s", goal, f"{found['cpu']:.1f} s",
             f"{used.peak_mb:.0f} MB", f"{found['simulations']:,}", f"{found['seasons']:,.0f}", *shares,
             found["names"]]
        )  # fmt: skip
    head = ["case", "days, samples", "wall time", "goal", "processor time", "peak memory", "simulations",
            "in seasons", *SHOWN, "answer"]  # fmt: skip
    text = "## The diagnosis\n\nLogs in memory, two cores, a process for each case:\n\n" + table(head, rows)
    if usual:
        text += f"\nMedian of 60 days of 133 s: {median(usual):.1f} s. "
    text += (
        "Simulations are runs of any response over some days; in seasons, their days divided by the days of the "
        "logs. Water, noise, events and the rest are shares of the busy time of both threads.\n\n"
    )
    found, used = alone("candidates", case("one effect, 332 days"), work)
    row = [f"{found['columns']:.1f} s", f"{found['screened']:.1f} s", f"{used.peak_mb:.0f} MB", "600 MB"]
    head = [f"332 days, {found['count']} candidates", "their columns", "innovations, best windows",
            "peak memory", "goal"]  # fmt: skip
    return text + table(head, [["", *row]])


def main() -> None:
    """Run one task, for :func:`alone`."""
    task, given, result = sys.argv[1:]
    found = TASKS[task](pickle.loads(Path(given).read_bytes()))
    Path(result).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
