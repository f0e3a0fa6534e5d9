"""The exam of `rivid diagnose`: effects hidden in simulated seasons, many seeds; writes docs/exam.md.

The truth is the uneven hydraulic reach (trapezoids, width, bed and roughness vary, gates take time, people,
weather, quantised levels); the fitted response is the plain one. The diagnosing process is given logs and
nothing else: what was planted stays with the process that judges.

Usage: python -m benchmarks.exam [--seeds N] [--nothing N] [--only NAME ...] [--shard I/N]

Answers are kept in build/exam: a second call goes on where the first was stopped.
"""

import argparse
import json
import math
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measure import table
from rivid.diagnose.blocks import split
from rivid.diagnose.data import Record, as_record
from rivid.diagnose.fit import Model, calibrate
from rivid.diagnose.hydraulic_response import HydraulicResponse
from rivid.diagnose.linear import evaluate
from rivid.diagnose.workflow import diagnose
from rivid.effects import Effect, effect_classes
from rivid.scenario import Scenario, load_scenario
from rivid.simulate import Season, simulate

ROOT = Path(__file__).parent.parent
SCENARIOS = ROOT / "configs" / "scenarios"
KEPT = ROOT / "build" / "exam"
FIRST_SEED = 1000
"""Seeds below were looked at while the workflow was built."""
ALLOWED_OF_NOTHING = {"wave_attenuation", "flow_dependent_delay"}
"""What a plain response of an uneven reach may truly lack."""
QUANTUM = 0.01
GROUPS = [
    {"inflow_gain_error", "outflow_gain_error", "lateral_inflow"},
    {"leakage", "gate_head_effect"},
    {"lateral_inflow", "sensor_drift"},
    {"outflow_lag", "clock_offset", "gate_rate_limit"},
]
"""Names that the logs of a pool hardly tell apart: one of them, tied with the other, is right."""


def recorded(season: Season) -> Record:
    """The logs of a season, and nothing else of it."""
    return as_record(
        season.dates, season.seconds, season.inflow, season.outflow, season.level,
        sample_time=season.sample_time, delay=8,
    )  # fmt: skip


def nominal(record: Record) -> HydraulicResponse:
    """What a configuration would say of the reach."""
    return HydraulicResponse.nominal(
        8200.0, 81.6, 5.7, record.usual_output, sample_time=record.sample_time, flow=record.usual_flow
    )


def answered(record: Record, exclude: tuple[str, ...] = ()) -> dict[str, Any]:
    """The diagnosis of a record, as plain numbers."""
    classes = {name: c for name, c in effect_classes().items() if name not in exclude}
    answer, _ = diagnose(record, nominal(record), classes, gauge_floor=QUANTUM / math.sqrt(12.0))
    told = asdict(answer)
    return json.loads(json.dumps({k: told[k] for k in ("verdict", "effects", "unknown", "gap")}, default=str))


def floor_of(season: Season) -> list[float]:
    """Errors of the model that is told the effects, on the sealed days."""
    record = recorded(season)
    dealt = split(record.dates)
    told: tuple[Effect, ...] = season.effects
    noisy = any(e.name in ("wind_setup", "seiche") for e in told)
    told = tuple(e for e in told if e.name not in ("wind_setup", "seiche"))
    # what is drawn is told as it was drawn
    from rivid.effects import worlds_of

    fixed: list[Effect] = []
    for effect, world in zip(told, worlds_of(told, season.world), strict=True):
        events = getattr(effect, "events", None)
        if events is not None and (found := events(world)):
            keys = {"rain_inflow": ("peak_m3s", "peak"), "unlogged_downstream_release": ("size_m3s", "size")}
            there, key = keys[effect.name]
            table_ = effect.to_table() | {
                "starts": [e["start_h"] for e in found], key: [e[there] for e in found],
            }  # fmt: skip
            effect = type(effect).from_table(table_)
        fixed.append(effect)
    model = Model(
        nominal(record), None, record.usual_output, record.usual_flow, QUANTUM / math.sqrt(12.0),
        tuple(fixed), ((),) * len(fixed), noisy,
    )  # fmt: skip
    fit = np.flatnonzero(dealt.fit)
    model = calibrate(model, record.take(fit[::3]))
    model = calibrate(model, record.take(fit))
    return [float(v) for v in evaluate(model.linear(record, dealt)).errors.rmse(dealt.sealed)]


def case(name: str, seed: int, exclude: tuple[str, ...]) -> dict[str, Any]:
    """Simulate in this process, diagnose from the logs alone, and put both side by side."""
    season = simulate(load_scenario(SCENARIOS / f"{name}.toml"), seed)
    answer = answered(recorded(season), exclude)
    return {
        "case": name, "seed": seed, "exclude": list(exclude), "answer": answer, "floor": floor_of(season),
        "planted": json.loads(json.dumps([e.to_table() for e in season.effects], default=str)),
    }  # fmt: skip


def tasks(seeds: int, nothing: int, only: list[str] | None) -> list[tuple[str, int, tuple[str, ...]]]:
    """All cases, the quick ones of each kind first."""
    found: list[tuple[str, int, tuple[str, ...]]] = []
    names = sorted(p.stem for p in (SCENARIOS / "effects").glob("*.toml"))
    for k in range(max(seeds, nothing)):
        seed = FIRST_SEED + k
        if k < nothing:
            found.append(("uneven", seed, ()))
        if k < seeds:
            found += [(f"effects/{n}", seed, ()) for n in names]
            found += [(f"pairs/{p.stem}", seed, ()) for p in sorted((SCENARIOS / "pairs").glob("*.toml"))]
            found += [(f"windows/{p.stem}", seed, ()) for p in sorted((SCENARIOS / "windows").glob("*.toml"))]
            found += [("outside/hunting", seed, ()), ("effects/diurnal_inflow", seed, ("diurnal_inflow",))]
    return [t for t in found if not only or any(o in t[0] for o in only)]


def key(name: str, seed: int, exclude: tuple[str, ...]) -> str:
    """File of a case."""
    return f"{name.replace('/', '-')}{'-without' if exclude else ''}-{seed}.json"


def main() -> None:
    """Run what is not done yet, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--nothing", type=int, default=60)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--shard", default="0/1")
    parser.add_argument("--page-only", action="store_true")
    said = parser.parse_args()
    KEPT.mkdir(parents=True, exist_ok=True)
    mine, shards = (int(x) for x in said.shard.split("/"))
    todo = [
        t for i, t in enumerate(tasks(said.seeds, said.nothing, said.only))
        if i % shards == mine and not (KEPT / key(*t)).exists()
    ]  # fmt: skip
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # for the processes to come: two side by side, one thread each
    if todo and not said.page_only:
        with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
            waiting = {pool.submit(case, *t): t for t in todo}
            for n, done in enumerate(as_completed(waiting), 1):
                t = waiting[done]
                try:
                    result = done.result()
                except Exception as error:  # a failed case is a result
                    result = {"case": t[0], "seed": t[1], "exclude": list(t[2]), "error": repr(error)}
                (KEPT / key(*t)).write_text(json.dumps(result), encoding="utf-8")
                print(f"{n}/{len(todo)} {t[0]} {t[1]}: {said_of(result)}", flush=True)
    results = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(KEPT.glob("*.json"))]
    page = written(results)
    (ROOT / "docs" / "exam.md").write_text(page, encoding="utf-8")
    print(page)


def said_of(result: dict[str, Any]) -> str:
    """One line of a case."""
    if "error" in result:
        return str(result["error"])[:200]
    answer = result["answer"]
    return f"{answer['verdict']} {[e['name'] for e in answer['effects']]}"


def names_of(result: dict[str, Any]) -> list[str]:
    """Names that were given, in order, each once."""
    return list(dict.fromkeys(e["name"] for e in result["answer"]["effects"]))


def right(planted: str, result: dict[str, Any]) -> tuple[bool, bool, bool, bool]:
    """First, alone, as a group with what it is tied with, and wrong alone."""
    names = names_of(result)
    tied = {planted} | set().union(*(g for g in GROUPS if planted in g))
    effects = result["answer"]["effects"]
    first = bool(names) and names[0] == planted
    alone = first and len(names) == 1
    group = bool(names) and (first or (names[0] in tied and planted in effects[0]["tied_with"]))
    wrong = bool(names) and not group and planted not in effects[0]["tied_with"]
    return first, alone, group, wrong


def closed(result: dict[str, Any], horizon: int = 1) -> float | None:
    """Share of the gap that was closed at 4 h, described where there are events."""
    gap = result["answer"]["gap"]
    if gap is None:
        return None
    end = gap["rmse_augmented"]
    for step in gap["steps"]:
        if step["rmse_described"] is not None:
            end = step["rmse_described"]
    if gap["steps"] and gap["steps"][-1]["rmse_described"] is None:
        end = gap["rmse_augmented"]
    base, last, floor = gap["rmse_baseline"][horizon], end[horizon], result["floor"][horizon]
    excess = base**2 - floor**2
    return (base**2 - last**2) / excess if excess > 0.1 * base**2 else None


def interval(hits: int, n: int) -> str:
    """Share with Wilson's 95 % interval."""
    if n == 0:
        return "-"
    z = 1.96
    p = hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return f"{hits}/{n} ({max(middle - half, 0):.2f}-{min(middle + half, 1):.2f})"


def written(results: list[dict[str, Any]]) -> str:
    """The page."""
    by: dict[str, list[dict[str, Any]]] = defaultdict(list)
    errors = [r for r in results if "error" in r]
    for r in results:
        if "error" not in r:
            by[r["case"] + ("-without" if r["exclude"] else "")].append(r)
    head = (ROOT / "benchmarks" / "exam_head.md").read_text(encoding="utf-8")
    nothing = by.pop("uneven", [])
    named = [r for r in nothing if set(names_of(r)) - ALLOWED_OF_NOTHING]
    text = head + "\n## Nothing missing\n\n" + table(
        ["seasons", "named something (target: at most 0.02)", "no_gap", "what was named"],
        [[str(len(nothing)), interval(len(named), len(nothing)),
          interval(sum(r["answer"]["verdict"] == "no_gap" for r in nothing), len(nothing)),
          ", ".join(sorted({n for r in named for n in names_of(r)})) or "-"]],
    )  # fmt: skip
    rows, covered = [], [0, 0]
    totals = np.zeros(4, int)
    for name in sorted(n for n in by if n.startswith("effects/") and not n.endswith("-without")):
        planted = name.split("/")[1]
        got = [right(planted, r) for r in by[name]]
        n = len(got)
        shares = [c for r in by[name] if (c := closed(r)) is not None]
        hits, told = covering(by[name])
        covered = [covered[0] + hits, covered[1] + told]
        totals += np.array([n, *(sum(g[i] for g in got) for i in (1, 2, 3))])
        others = sorted({x for r in by[name] for x in names_of(r)} - {planted})
        rows.append([
            planted, interval(sum(g[0] for g in got), n), interval(sum(g[1] for g in got), n),
            interval(sum(g[2] for g in got), n), interval(sum(g[3] for g in got), n),
            f"{np.median(shares):.2f}" if shares else "absorbed", ", ".join(others) or "-",
        ])  # fmt: skip
    text += "\n## One effect\n\n" + table(
        ["planted", "first", "alone", "first or tied with it", "wrong", "gap closed at 4 h, median",
         "other names given"], rows
    )  # fmt: skip
    text += (
        f"\nAll together: alone {interval(totals[1], totals[0])}, first or tied {interval(totals[2], totals[0])}, wrong "
        f"{interval(totals[3], totals[0])}. Intervals at 95 % cover {interval(*covered)} of the planted values.\n"
    )
    text += "\n## Pairs, windows, and what has no name here\n\n" + table(
        ["case", "seasons", "answers"],
        [[n, str(len(rs)), "; ".join(sorted(f"{said_of(r)}" for r in rs))] for n, rs in sorted(by.items())
         if not n.startswith("effects/") or n.endswith("-without")],
    )  # fmt: skip
    if errors:
        text += f"\n{len(errors)} cases failed: " + "; ".join(
            f"{e['case']} {e['seed']}: {e['error'][:120]}" for e in errors
        )
    return text


def covering(results: list[dict[str, Any]]) -> tuple[int, int]:
    """How many intervals of named parameters hold the planted value, and how many there are."""
    hits = told = 0
    for r in results:
        planted = {p["name"]: p for p in r["planted"]}
        for effect in r["answer"]["effects"]:
            if effect["name"] not in planted or effect["events"]:
                continue
            for parameter in effect["parameters"]:
                value = planted[effect["name"]].get(parameter["name"])
                low, high = parameter["low"], parameter["high"]
                if isinstance(value, int | float) and low == low and high > low:
                    told += 1
                    hits += low <= value <= high
    return hits, told


__all__ = ["Scenario", "answered", "main", "recorded"]

if __name__ == "__main__":
    main()
