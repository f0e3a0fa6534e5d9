"""Draw the hidden effects of an exam season, their sizes, and the expected answer.

The kind of season is drawn with the probabilities :data:`TYPES`. Sizes are drawn log-uniform from 1 to 16
times 1x, the smallest size at which the effect matters in its world (`benchmarks.exam.sizing`), and end at
:data:`LARGEST`. An effect with a larger 1x than that is not hidden in this world.
"""

import datetime as dt
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from benchmarks.exam import outside
from benchmarks.exam.answering import Logs, record_of
from benchmarks.exam.sizing import (
    NOISES,
    SIZE_OF,
    Reference,
    Unit,
    beyond,
    reference,
    resized,
    size_of,
    unit,
    well_unit,
)
from benchmarks.exam.worlds import Table, World, draw, log_uniform, logs_of, season_of
from benchmarks.measure import table
from rivid.config import Config
from rivid.diagnosis.data import Record
from rivid.effects import CATALOGUE, Effect, changes_of, effect_classes, worlds_of
from rivid.errors import RividError
from rivid.reach.gauge import stilled
from rivid.simulation.season import Season
from rivid.types import Floats

TYPES = {
    "nothing": 0.22, "operators": 0.06, "one": 0.34, "twin": 0.1, "two": 0.12, "outside": 0.08,
    "removed": 0.08,
}  # fmt: skip
"""Probability of each kind of season. `twin` is one effect too, drawn from :data:`TWINS`."""
TWINS = (
    "inflow_gain_error", "outflow_gain_error", "lateral_inflow", "sensor_drift", "unlogged_upstream_release",
)  # fmt: skip
"""Effects that often have a rival. They are hidden more often than others."""
MOST_TIMES = 16.0
TRIES = 40
"""Largest number of draws for a seed. About one world in four has operators that do not hold its level."""

REMOVED: dict[str, tuple[str, ...]] = {
    "seiche": (), "unlogged_downstream_release": (), "clock_offset": ("clock_drift",), "diurnal_inflow": (),
    "rain_inflow": (), "sensor_step": (), "outflow_lag": ("gate_rate_limit",),
}  # fmt: skip
"""Effects that are hidden while the library lacks them, with similar effects that are excluded too."""
EVENTS = {"rain_inflow": ("peak", "peak_m3s"), "unlogged_downstream_release": ("size", "size_m3s")}
"""Effects with drawn events: the parameter that each event has separately, and its key in an event."""
CHANNELED = ("storage_area_slope", "seiche")
"""Effects that every simulated channel has. They are not counted unless hidden: a channel has banks that the
configuration does not describe, and the weather excites its natural period, in one season by 7 mm."""
OUTSIDERS: dict[str, tuple[str, ...]] = {
    "hunting_governor": (), "bent_rating": (), "siphon": (), "silting_well": ("stilling_well",),
}  # fmt: skip
"""Outsiders, with effects of the catalogue that would be a right answer."""


@dataclass(frozen=True, eq=False)
class Planted:
    """A season and its sealed truth.

    Attributes
    ----------
    logs : Logs
    truth : dict
        JSON-compatible; see :func:`plant`.
    season : Season
    """

    logs: Logs
    truth: Table
    season: Season

    @property
    def known(self) -> list[Table] | None:
        """Hidden effects with their drawn events; None if there are none, or if a model cannot have them."""
        hidden = self.season.effects
        if any(e.name not in CATALOGUE or e.found_as == "swing" for e in hidden) or not hidden:
            return None
        found = []
        for effect, world in zip(hidden, worlds_of(hidden, self.season.world), strict=True):
            table = effect.to_table()
            if effect.name in EVENTS:
                key, there = EVENTS[effect.name]
                events = effect.events(world)  # type: ignore[attr-defined]
                table |= {"starts": [e["start_h"] for e in events], key: [e[there] for e in events]}
            found.append(table)
        made: list[Table] = json.loads(json.dumps(found, default=str))
        return made


def plant(seed: int, longest: int = 1000) -> Planted:
    """Simulate the season of a seed with its hidden effects.

    The truth has these keys:

    - `seed`, `attempt`, `kind` (one of :data:`TYPES`), `effects` (tables);
    - `times`: size of each effect in units of 1x;
    - `units`: 1x of each effect, and `by`: the criterion that sets it;
    - `nats`: log-likelihood ratio of the logs with each effect to that without, by the reference; None for an
      effect that is noise;
    - `rivals`: for one or two effects, their lead over each effect confounded with one of them [nats];
    - `allowed`: names that are true of the hydraulics themselves;
    - `excluded`: names that are excluded from the diagnosis;
    - `first_day`, `days`, and `world` (its factors).

    Parameters
    ----------
    seed : int
    longest : int
        Largest number of days of the season.

    Raises
    ------
    RividError
        If no draw of the seed can be simulated.
    """
    for attempt in range(TRIES):
        world = draw(seed, attempt)
        if world.scenario.days > longest:
            shorter = {"days": longest, "missing_days": min(world.scenario.missing_days, longest // 15)}
            world = replace(world, scenario=world.scenario.model_copy(update=shorter))
        try:
            return _planted(world, attempt)
        except RividError:
            continue
    raise RividError(f"seed {seed}: none of {TRIES} worlds can be simulated")


def _planted(world: World, attempt: int) -> Planted:
    rng = np.random.default_rng([world.seed, 42, attempt])
    kind = str(rng.choice(list(TYPES), p=list(TYPES.values())))
    if kind == "operators" and world.kind == "river":
        kind = "nothing"  # a river has no operators
    season, late = season_of(world), None
    tables: list[Table] = []
    units: list[Unit] = []
    times: list[float] = []
    excluded: tuple[str, ...] = ()
    rivals: dict[str, float] = {}
    nats: list[float | None] = []
    catalogue = effect_classes()
    classes = catalogue | outside.classes()
    if kind not in ("nothing", "operators"):
        ref = reference(world, season)
        for name in names_of(kind, rng, possible(world, classes)):
            one, times_one = _sized(name, ref, classes, rng)
            units.append(one)
            times.append(times_one)
            tables.append(resized(one.table, times_one))
        flows = tuple(classes[t["name"]].from_table(t) for t in tables if t["name"] != "silting_well")
        if kind in ("one", "twin", "two"):
            rivals = rivals_of(ref, flows, catalogue, rng)
        nats = [nats_of(ref, effect) for effect in flows]
        near = (REMOVED if kind == "removed" else OUTSIDERS).get(tables[0]["name"], ())
        if kind in ("removed", "outside"):
            excluded = tuple(n for n in (tables[0]["name"], *near) if n in catalogue)
        if flows:
            season = season_of(world, flows)
        if len(flows) < len(tables):
            late = silting(tables[0], season)
    logs = logs_of(world, season, late, excluded)
    if kind == "operators":
        logs = two_crews(logs, world, rng)
    truth = {
        "seed": world.seed, "attempt": attempt, "kind": "one" if kind == "twin" else kind, "effects": tables,
        "times": times,
        "units": [size_of(one.table) for one in units], "by": [one.by for one in units],
        "nats": nats, "rivals": rivals,
        "allowed": list(CHANNELED) if world.kind in ("saint_venant", "box") else [],
        "excluded": list(excluded), "first_day": season.dates[0], "world": world.factors(),
        "days": (season.dates[-1] - season.dates[0]).days + 1,
    }  # fmt: skip
    return Planted(logs, json.loads(json.dumps(truth, default=str)), season)


def sealed(seed: int, longest: int = 1000) -> tuple[Logs, Table]:
    """Return the logs and the truth of a seed, in a form that can be sent between processes.

    The truth has one more key, `known`: the hidden effects as given to the model that knows the truth, or None
    if no model can be given them.
    """
    planted = plant(seed, longest)
    return planted.logs, planted.truth | {"known": planted.known}


def record_of_seed(seed: int) -> tuple[Record, Config, Table]:
    """Return the record of a seed's season, the user's configuration, and the truth."""
    planted = plant(seed)
    return record_of(planted.logs), planted.logs.settings, planted.truth


def possible(world: World, classes: dict[str, type[Effect]]) -> tuple[str, ...]:
    """Return the names of the effects and outsiders that a world can have."""
    if world.kind == "river":
        return tuple(n for n, one in classes.items() if one.acts_on_river and n != "hunting_governor")
    return (*classes, "silting_well")


def names_of(kind: str, rng: np.random.Generator, names: tuple[str, ...]) -> tuple[str, ...]:
    """Draw the names of the hidden effects among the possible ones, for a kind that hides some."""
    pools = {"removed": tuple(REMOVED), "outside": tuple(OUTSIDERS), "twin": TWINS}
    pool = pools.get(kind, tuple(DRAWN))
    known = [name for name in pool if name in names]
    return tuple(str(n) for n in rng.choice(known, 2 if kind == "two" else 1, replace=False))


def _sized(
    name: str, ref: Reference, classes: dict[str, type[Effect]], rng: np.random.Generator
) -> tuple[Unit, float]:
    """Return an effect at 1x, and its drawn size in units of 1x."""
    table = table_of(name, ref.world, rng)
    if name == "silting_well":
        one = well_unit(ref, table, lambda t: silting(t, ref.season))
    else:
        one = unit(ref, table, classes, ends_of(table, ref.season))
    most = abs(LARGEST[name](ref.world) / size_of(one.table))
    most = 1.0 / most if name == "gate_rate_limit" else most
    if most < 1.0:
        raise RividError(f"{name}: 1x is more than such a reach has")
    return one, float(np.exp(rng.uniform(0.0, np.log(min(most, MOST_TIMES)))))


def rivals_of(
    ref: Reference, made: Sequence[Effect], catalogue: dict[str, type[Effect]], rng: np.random.Generator
) -> dict[str, float]:
    """Return the lead of effects over the effects of the catalogue that are confounded with them [nats].

    A rival has the same dates and a free size. It is fitted together with all parameters of a calibration
    and, of two effects, with the other one. Of two effects, each is a rival of the other too. Effects that
    are noise have no rivals.
    """
    changes = [ref.change(changes_of((effect,), ref.season.world)) for effect in made]
    found: dict[str, float] = {}

    def ahead(name: str, z: Floats, *others: Floats) -> None:
        nats = round(0.5 * beyond(ref, z, *others)[1], 1)
        found[name] = min(found.get(name, np.inf), nats)

    for k, (effect, z) in enumerate(zip(made, changes, strict=True)):
        rest = [column for j, column in enumerate(changes) if j != k and made[j].name not in NOISES]
        if effect.name in NOISES:
            continue
        if rest:
            ahead(made[1 - k].name, z, *rest)
        near = near_of(effect, catalogue) & set(possible(ref.world, catalogue))
        for other in sorted(near - {one.name for one in made}):
            column = _rival(ref, effect, other, catalogue, rng)
            if column is not None:
                ahead(other, z, column, *rest)
    return found


def nats_of(ref: Reference, effect: Effect) -> float | None:
    """Return the log-likelihood ratio of an effect to the calibration alone [nats]; None if it is noise."""
    if effect.name in NOISES:
        return None
    return round(0.5 * beyond(ref, ref.change(changes_of((effect,), ref.season.world)))[1], 1)


def near_of(effect: Effect, catalogue: dict[str, type[Effect]]) -> set[str]:
    """Return the names confounded with an effect, declared by either class, that can be hidden.

    Effects with drawn events and noises are left out: they have no fixed course.
    """
    mine = {*effect.confounded_with, *effect.twins}
    return {
        name
        for name, one in catalogue.items()
        if (name in mine or effect.name in {*one.confounded_with, *one.twins})
        and name in DRAWN
        and name not in EVENTS
        and name not in NOISES
    }


def _rival(
    ref: Reference, effect: Effect, name: str, catalogue: dict[str, type[Effect]], rng: np.random.Generator
) -> Floats | None:
    """Return the change of the level by a rival with an effect's dates; None if it changes nothing."""
    table = {key: v for key, v in table_of(name, ref.world, rng).items() if key not in ("dates", "hours")}
    if effect.dates is not None and catalogue[name].windowed:
        table["dates"] = list(effect.dates)
    try:
        column = ref.change(changes_of((catalogue[name].from_table(table),), ref.season.world))
    except RividError:
        return None
    return column if np.abs(column).max() > 0.0 else None


def table_of_units(seeds: Sequence[int], each: int = 9) -> str:
    """Return a table of 1x of every effect over some worlds, with `each` effects in each world."""
    catalogue = effect_classes()
    classes, names = catalogue | outside.classes(), [*DRAWN, *FOREIGN]
    sizes: dict[str, list[float]] = {name: [] for name in names}
    flows: dict[str, list[float]] = {name: [] for name in names}
    asked: dict[str, Counter[str]] = {name: Counter() for name in names}
    for seed in seeds:
        world, ref = referred(seed)
        for k in range(each):
            name = names[(seed * each + k) % len(names)]
            try:
                one, _ = _sized(name, ref, classes, np.random.default_rng([seed, 44, k]))
            except RividError:
                asked[name]["not hidden"] += 1
                continue
            sizes[name].append(abs(size_of(one.table)))
            flows[name].append(100.0 * abs(size_of(one.table)) / world.scenario.flow.mean)
            asked[name][one.by] += 1
    lines = []
    for name in names:
        key = SIZE_OF[name][0]
        unit_ = classes[name].parameters()[key].unit if name in classes else "s"
        values = np.quantile(sizes[name], (0.1, 0.5, 0.9)) if sizes[name] else [np.nan] * 3
        share = f"{np.median(flows[name]):.2g}" if flows[name] and unit_.startswith("m3/s") else "-"
        lines.append([
            name, f"{key} [{unit_}]", *(f"{v:.2g}" for v in values), share,
            ", ".join(f"{by} {n}" for by, n in asked[name].most_common()),
        ])  # fmt: skip
    heads = ["effect", "size", "tenth", "median", "ninetieth", "% of the mean flow", "asked by, worlds"]
    return table(heads, lines)


def referred(seed: int) -> tuple[World, Reference]:
    """Return the world of a seed without hidden effects, and its reference."""
    for attempt in range(TRIES):
        world = draw(seed, attempt)
        try:
            return world, reference(world, season_of(world))
        except RividError:
            continue
    raise RividError(f"seed {seed}: none of {TRIES} worlds can be simulated")


def ends_of(table: Table, season: Season) -> int:
    """Return the number of ends of an effect's dates within the season."""
    if "dates" not in table:
        return 0
    return int(table["dates"][0] > season.dates[0]) + int(table["dates"][1] < season.dates[-1])


def _flow(w: World, share: float) -> float:
    """Return a share of the mean flow [m3/s]."""
    return share * w.scenario.flow.mean


Largest = Callable[[World], float]
_FLOW = {"lateral_inflow": 0.3, "diurnal_inflow": 0.3, "rain_inflow": 1.0, "unlogged_upstream_release": 0.5,
         "unlogged_downstream_release": 0.7, "leakage": 1.0, "gate_deadband": 0.15,
         "hunting_governor": 0.2, "siphon": 0.3}  # fmt: skip
"""Shares of the mean flow; for a leak, per metre of head."""
LARGEST: dict[str, Largest] = {
    **{name: partial(_flow, share=share) for name, share in _FLOW.items()},
    "inflow_gain_error": lambda _: 0.3,
    "outflow_gain_error": lambda _: 0.3,
    "gate_head_effect": lambda _: 0.5,
    "storage_area_slope": lambda _: 0.6,
    "side_storage": lambda w: 2.0 * w.scenario.reach.surface_area,
    "flow_dependent_delay": lambda w: 3.0 * w.travel / w.scenario.flow.mean,
    "wave_attenuation": lambda w: 2.0 * w.travel,
    "outflow_lag": lambda _: 3600.0,
    "clock_offset": lambda _: 7200.0,
    "gate_rate_limit": lambda w: w.scenario.programme.swing / 7200.0,
    "sensor_drift": lambda _: 0.05,
    "sensor_step": lambda _: 0.5,
    "wind_setup": lambda _: 0.3,
    "seiche": lambda _: 0.3,
    "bent_rating": lambda _: 0.6,
    "ice_cover": lambda w: 3.0 * w.travel,
    "silting_well": lambda _: 14_400.0,
}
"""Largest size of each effect that such reaches have."""


def table_of(name: str, world: World, rng: np.random.Generator) -> Table:
    """Draw an effect with a first guess of its size."""
    return (
        {"name": name, **DRAWN[name](world, rng)}
        if name in DRAWN
        else {"name": name, **FOREIGN[name](world, rng)}
    )


def _dates(world: World, rng: np.random.Generator, always: float, least: int = 10) -> Table:
    """Draw dates of `least` days or more, half of them up to the end; none with probability `always`."""
    days, first = world.scenario.days, world.scenario.first_day
    if rng.random() < always:
        return {}
    a = int(rng.integers(0, days - least + 1))
    b = days if rng.random() < 0.5 else int(rng.integers(a + least, days + 1))
    return {"dates": [first + dt.timedelta(days=a), first + dt.timedelta(days=b - 1)]}


def _from_a_date(world: World, rng: np.random.Generator) -> Table:
    """Draw dates with one end within the season, at least a quarter of it from its first and last day."""
    days, first = world.scenario.days, world.scenario.first_day
    a = int(rng.integers(days // 4, 3 * days // 4))
    kept = (a, days) if rng.random() < 0.5 else (0, a)
    return {"dates": [first + dt.timedelta(days=kept[0]), first + dt.timedelta(days=kept[1] - 1)]}


def _place(rng: np.random.Generator) -> Table:
    return {"place": round(float(rng.uniform()), 2)}


def _hours(rng: np.random.Generator) -> Table:
    start, length = int(rng.integers(0, 24)), int(rng.integers(2, 13))
    return {"hours": [float(start), float((start + length) % 24 or 24)]}


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _locks(world: World, rng: np.random.Generator) -> Table:
    """Draw pulses of one size and length or, one time in three, of two sizes with scattered lengths."""
    per_day, duration = log_uniform(rng, 0.5, 12.0), log_uniform(rng, 0.2, 4.0)
    size = _flow(world, 0.05)
    if rng.random() < 2.0 / 3.0:
        return {"size": size, "per_day": per_day, "duration": duration}
    many = max(int(rng.poisson(per_day * world.scenario.days)), 2)
    large = rng.random(many) < 0.5
    starts = np.sort(rng.uniform(0.0, 24.0 * world.scenario.days, many))
    lengths = duration * np.where(large, 1.0, 0.5) * np.exp(0.1 * rng.standard_normal(many))
    return {
        "size": np.where(large, size, 0.5 * size).tolist(), "starts": starts.round(4).tolist(),
        "duration": lengths.round(4).tolist(),
    }  # fmt: skip


def _steps(world: World, rng: np.random.Generator) -> Table:
    """Draw one step of the gauge, or up to six steps of similar size with random signs."""
    many = int(rng.integers(1, 7)) if rng.random() < 0.5 else 1
    start = np.sort(rng.uniform(48.0, 24.0 * world.scenario.days - 48.0, many)).round(4).tolist()
    step = [0.03 * _sign(rng) * float(rng.uniform(0.6, 1.0)) for _ in range(many)]
    return {"step": step, "start": start} if many > 1 else {"step": step[0], "start": start[0]}


def _storage(world: World, rng: np.random.Generator) -> Table:
    area = 0.2 * world.scenario.reach.surface_area
    return _place(rng) | {"area": area, "exchange": area / log_uniform(rng, 1800.0, 21600.0)}


Maker = Callable[[World, np.random.Generator], Table]


DRAWN: dict[str, Maker] = {
    "lateral_inflow": lambda w, r: _place(r) | {"inflow": _flow(w, 0.03)} | _dates(w, r, 0.3),
    "diurnal_inflow": lambda w, r: (
        _place(r) | {"amplitude": _flow(w, 0.02), "hour": float(r.uniform(0.0, 24.0))} | _dates(w, r, 0.5)
    ),
    "rain_inflow": lambda w, r: _place(r) | {
        "peak": _flow(w, 0.1), "per_month": float(r.uniform(3.0, 10.0)), "rise": float(r.uniform(0.3, 3.0)),
        "recession": log_uniform(r, 3.0, 24.0),
    },
    "unlogged_upstream_release": lambda w, r: (
        {"size": _flow(w, 0.05)} | (_hours(r) if r.random() < 0.8 else {}) | _dates(w, r, 0.2)
    ),
    "unlogged_downstream_release": _locks,
    "leakage": lambda w, r: _place(r) | {"loss": _flow(w, 0.1)},
    "inflow_gain_error": lambda w, r: {"error": 0.02 * _sign(r)} | _dates(w, r, 0.5),
    "outflow_gain_error": lambda w, r: {"error": 0.02 * _sign(r)} | _dates(w, r, 0.5),
    "gate_head_effect": lambda w, r: {"gain": 0.1},
    "storage_area_slope": lambda w, r: {"slope": 0.1},
    "side_storage": _storage,
    "flow_dependent_delay": lambda w, r: {"delay": -0.3 * w.travel / w.scenario.flow.mean},
    "wave_attenuation": lambda w, r: {"spread": 0.5 * w.travel},
    "outflow_lag": lambda w, r: {"lag": 300.0} | _dates(w, r, 0.5),
    "clock_offset": lambda w, r: {"offset": 300.0 * _sign(r)} | _from_a_date(w, r),
    "gate_deadband": lambda w, r: {"band": 3.0 * w.scenario.operators.quantum},
    "gate_rate_limit": lambda w, r: {"rate": w.scenario.programme.swing / 1200.0},
    "sensor_drift": lambda w, r: {"drift": 0.005 * _sign(r)} | _dates(w, r, 0.0),
    "sensor_step": _steps,
    "wind_setup": lambda w, r: {"deviation": 0.01, "correlation_time": log_uniform(r, 0.5, 12.0)},
    "seiche": lambda w, r: {
        "amplitude": 0.005, "period": log_uniform(r, 4.0, 30.0) * w.scenario.reach.sample_time,
    },
    "ice_cover": lambda w, r: {
        "late": 0.5 * w.travel, "spread": float(r.uniform(0.3, 0.9)), "growth": float(r.uniform(2.0, 10.0)),
        "breakup": float(r.uniform(1.0, 4.0)),
    } | _dates(w, r, 0.0, 20),
}  # fmt: skip
"""Effects of the catalogue that may be hidden."""
FOREIGN: dict[str, Maker] = {
    "hunting_governor": lambda w, r: {"amplitude": _flow(w, 0.02), "period": log_uniform(r, 900.0, 7200.0)},
    "bent_rating": lambda w, r: {"bend": 0.1 * _sign(r)},
    "siphon": lambda w, r: _place(r) | {
        "size": _flow(w, 0.03), "period": log_uniform(r, 2.0, 20.0), "part": float(r.uniform(0.2, 0.6)),
    },
    "silting_well": lambda w, r: {"lag": 300.0} | _from_a_date(w, r),
}  # fmt: skip
"""Outsiders that may be hidden."""


def silting(table: Table, season: Season) -> Floats:
    """Return the error of a stilling well that silts up evenly over its dates [m], shape (days, n)."""
    first, last = ((date - season.dates[0]).days for date in table["dates"])
    number = np.array([(date - season.dates[0]).days for date in season.dates])
    share = (number - first + 1.0) / (last - first + 1.0)
    clean = season.scenario.level.lag
    lag = clean + table["lag"] * np.where((share > 0.0) & (share <= 1.0), share, 0.0)
    time = np.broadcast_to(season.seconds, season.true_level.shape).copy()
    level = season.true_level
    return stilled(time, level, lag[:, None]) - stilled(time, level, clean)


def two_crews(logs: Logs, world: World, rng: np.random.Generator) -> Logs:
    """Return logs with other operators in the second half, after a day without logs."""
    usual = world.scenario.operators
    trust, slow = float(rng.uniform(0.7, 0.95)), float(rng.uniform(1.2, 2.5))
    other = usual.model_copy(
        update={
            "feedforward": trust, "dead_band": usual.dead_band + float(rng.uniform(0.01, 0.06)),
            "look": (usual.look[0] * slow, usual.look[1] * slow), "level_gain": usual.level_gain / slow,
            "trim_time": usual.trim_time * float(rng.uniform(0.7, 2.0)),
        }
    )  # fmt: skip
    late = World(
        world.seed, world.kind, world.operators, world.programme,
        world.scenario.model_copy(update={"operators": other}), world.off,
    )  # fmt: skip
    second = logs_of(late, season_of(late))
    half = len(logs.dates) // 2
    rows = np.r_[:half, half + 1 : len(logs.dates)]
    parts: dict[str, Any] = {
        key: np.concatenate([getattr(logs, key)[:half], getattr(second, key)[half + 1 :]])
        for key in ("inflow", "outflow", "output")
    }
    return Logs(tuple(logs.dates[i] for i in rows), logs.seconds, config=logs.config, **parts)
