"""The examiner's desk: a case and a seed become logs, and a truth that stays here.

Runs in processes of their own, which never diagnose what they planted without being told of it.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.exam.answering import Logs, record_of, responses
from benchmarks.exam.cases import Case
from rivid.diagnosis.blocks import split
from rivid.diagnosis.choice import gauge_floor_of
from rivid.diagnosis.fit import Model, calibrate, evaluate
from rivid.diagnosis.workflow import TRIM
from rivid.effects import Effect, worlds_of
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario, load_scenario

SCENARIOS = Path(__file__).parent.parent.parent / "configs" / "scenarios"
NOISES = ("wind_setup", "seiche")
"""Effects that are drawn anew at every sample: the model that is told of them has a noise for them."""
DRAWN = {"rain_inflow": ("peak", "peak_m3s"), "unlogged_downstream_release": ("size", "size_m3s")}
"""Effects whose events are drawn: the parameter that each event has for itself, and its key among them."""


@dataclass(frozen=True, eq=False)
class Planted:
    """A season, and what is sealed of it.

    Attributes
    ----------
    logs : Logs
    truth : dict
        `effects`: tables of what was planted; `first_day`, `days`.
    told : tuple of Effect
        What the model that knows everything is given: drawn events as they were drawn.
    """

    logs: Logs
    truth: dict[str, Any]
    told: tuple[Effect, ...]


def scenario_of(case: Case) -> Scenario:
    """The scenario of a case, its effects at the case's size."""
    said = load_scenario(SCENARIOS / f"{case.scenario}.toml")
    return said.model_copy(update={"effects": tuple(case.sized(table) for table in said.effects)})


def plant(case: Case, seed: int) -> Planted:
    """Simulate a case.

    Parameters
    ----------
    case : Case
    seed : int

    Returns
    -------
    Planted
    """
    if case.river:
        from benchmarks.exam.river import flow_down

        return flow_down(case, seed)
    scenario = scenario_of(case)
    season = simulate(scenario, seed)
    parts = [season]
    rows = [np.arange(len(season.dates))]
    if case.then is not None:  # a day without logs lies between the two crews
        parts.append(simulate(load_scenario(SCENARIOS / f"{case.then}.toml"), seed))
        half = len(season.dates) // 2
        rows = [np.arange(half), np.arange(half + 1, len(season.dates))]
    inflow, outflow, level = (
        np.concatenate([getattr(part, name)[kept] for part, kept in zip(parts, rows, strict=True)])
        for name in ("inflow", "outflow", "level")
    )
    logs = Logs(
        tuple(season.dates[i] for i in np.concatenate(rows)), season.seconds, inflow, outflow, level,
        configured(scenario, case.without),
    )  # fmt: skip
    return Planted(logs, truth_of(season), told_of(season))


def configured(scenario: Scenario, without: Sequence[str] = ()) -> dict[str, Any]:
    """The configuration that a user of this reach would write: its nominal geometry, nothing of the truth."""
    reach = scenario.reach.model_dump(
        include={"name", "length", "width", "depth", "surface_area", "discharge_range", "sample_time"}
    )
    if scenario.channel is not None:
        reach["bed_level"] = scenario.channel.bed_level
    return {"reach": reach | {"name": "reach"}, "diagnose": {"exclude": list(without)}}


def truth_of(season: Season) -> dict[str, Any]:
    """What was planted, as plain values."""
    return {
        "effects": plain(season.effects), "first_day": season.dates[0].isoformat(),
        "days": (season.dates[-1] - season.dates[0]).days + 1,
    }  # fmt: skip


def plain(effects: Sequence[Effect]) -> list[dict[str, Any]]:
    """Effects as tables of plain values, dates as text."""
    found: list[dict[str, Any]] = json.loads(
        json.dumps([effect.to_table() for effect in effects], default=str)
    )
    return found


def told_of(season: Season) -> tuple[Effect, ...]:
    """The planted effects with their draws given."""
    found: list[Effect] = []
    for effect, world in zip(season.effects, worlds_of(season.effects, season.world), strict=True):
        if effect.name in DRAWN and (events := effect.events(world)):  # type: ignore[attr-defined]
            key, there = DRAWN[effect.name]
            table = effect.to_table() | {
                "starts": [e["start_h"] for e in events], key: [e[there] for e in events],
            }  # fmt: skip
            effect = type(effect).from_table({k: v for k, v in table.items() if k not in ("dates", "hours")})
        found.append(effect)
    return tuple(found)


def sealed(case: Case, seed: int) -> tuple[Logs, dict[str, Any]]:
    """Logs and truth of a case, fit to be sent from process to process."""
    planted = plant(case, seed)
    return planted.logs, planted.truth


def floor_of(case: Case, seed: int, response: str) -> list[float]:
    """Errors on the sealed days, at each horizon, of a model that is told what was planted.

    Parameters
    ----------
    case : Case
    seed : int
    response : str
        Name of the response that the diagnosis took: the floor is under the same one.
    """
    planted = plant(case, seed)
    record, settings = record_of(planted.logs), planted.logs.settings
    candidates = responses(planted.logs, record)
    nominal = next((one for one in candidates if one.name == response), candidates[0])
    fixed = tuple(effect for effect in planted.told if effect.name not in NOISES)
    model = Model(
        nominal, None, record.usual_output, record.usual_flow, gauge_floor_of(settings, record), fixed,
        ((),) * len(fixed), len(fixed) < len(planted.told),
    )  # fmt: skip
    dealt = split(record.dates)
    fit = np.flatnonzero(dealt.fit)
    for rows in (fit[::3], fit):
        model = calibrate(model, record.take(rows), trim=TRIM[record.kind])
    return [float(v) for v in evaluate(model.linear(record, dealt)).errors.rmse(dealt.sealed)]
