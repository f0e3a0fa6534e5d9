"""The augmented model as a scenario: what was calibrated and named."""

import datetime as dt
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rivid.atomic import write_text
from rivid.config import Config, read_toml
from rivid.core.hydraulics import GRAVITY
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.data import Record
from rivid.diagnosis.result import Diagnosis
from rivid.effects import Effect, build, effect_classes
from rivid.errors import ConfigError


def write_model(
    path: Path, diagnosis: Diagnosis, evidence: Evidence, config: Config, start: Sequence[Effect] = ()
) -> None:
    """Write the calibrated reach and the named effects as a scenario.

    Parameters
    ----------
    path : Path
    diagnosis : Diagnosis
    evidence : Evidence
    config : Config
        Of the diagnosis; its reach.
    start : sequence of Effect
        Effects that were in from the start.

    Notes
    -----
    A pool runs in `rivid simulate` as it stands; a river reach, which that cannot simulate, is written for
    `rivid diagnose --model` alone.
    """
    record, reach = evidence.record, config.reach
    noise = diagnosis.noise or {}
    found = {e.name: e.value for e in diagnosis.reach_parameters}
    daily = record.inflow[:, record.lead :].mean(axis=1)
    level = record.usual_output
    tables: dict[str, dict[str, Any]] = {}
    tables["reach"] = {"name": reach.name, "kind": reach.kind, "sample_time": reach.sample_time}
    tables["reach"]["length"] = found.get("length", reach.length)
    tables["reach"]["width"] = found.get("width", reach.width)
    if record.kind == "pool" and "surface_area" in found:  # a pool without hydraulics
        tables["reach"] |= {"surface_area": found["surface_area"], "inflow_gain": found["inflow_gain"]}
        tables["reach"] |= {"depth": reach.depth, "wave_depth": _wave_depth(config, record, found["delay"])}
    if record.kind == "pool" and "length" in found:
        modes = {k: [v for n, v in found.items() if n.startswith(f"{k}_mode")] for k in ("width", "bed")}
        end_wave = sum(mode * (-1) ** j for j, mode in enumerate(modes["bed"], start=1))
        tables["channel"] = {
            "bed_level": level - found["depth"] - end_wave, "slope": found["fall"] / found["length"],
            "manning": found["manning"], "width_modes": modes["width"], "bed_modes": modes["bed"],
        }  # fmt: skip
    tables["flow"] = {
        "mean": float(np.median(daily)), "lowest": float(daily.min()), "highest": float(daily.max()),
    }  # fmt: skip
    if record.kind == "pool":
        tables["operators"] = {"level_gain": -50.0}
        tables["level"] = {"set_point": level, "drawdown": 0.0, "noise": noise.get("gauge_sd", 0.003)}
        tables["weather"] = {
            "inflow": noise.get("inflow_sd", 0.0), "memory": noise.get("inflow_memory", 3600.0), "place": 0.5,
        }  # fmt: skip
    lines = [
        "# The reach as calibrated, with the effects that a diagnosis named. SI units. The programme and the",
        "# people are the usual ones: what is known here is the water.",
        f'name = "{reach.name}-augmented"',
        f"first_day = {record.dates[0]}",
        f"days = {(record.dates[-1] - record.dates[0]).days + 1}",
    ]
    if config.diagnose.effects_file is not None:
        lines.append(f"effects_file = {_value(str(Path(config.diagnose.effects_file).resolve()))}")
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(f"{key} = {_value(value)}" for key, value in table.items())]
    for effect in [e.to_table() for e in start] + [e.table for e in diagnosis.effects]:
        lines += ["", "[[effects]]", *(f"{key} = {_value(value)}" for key, value in effect.items())]
    write_text(path, "\n".join(lines) + "\n")


def _wave_depth(config: Config, record: Record, delay: float) -> float:
    """Depth at which a wave takes `delay` [s] at the usual flow [m]."""
    reach = config.reach
    celerity = reach.length / delay - record.usual_flow / (reach.width * reach.depth)
    return max(celerity, 0.1) ** 2 / GRAVITY


def read_effects(path: Path, config: Config) -> tuple[Effect, ...]:
    """The effects of an augmented model.

    Raises
    ------
    ConfigError
        Where the file cannot be read or an effect is impossible.
    """
    raw = read_toml(path)
    tables = raw.get("effects", [])
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        raise ConfigError(f"{path}: effects: expected tables [[effects]], as model.toml of a diagnosis has")
    classes = effect_classes(config.diagnose.effects_file)
    # events of the dates that were diagnosed count from that model's first day
    return tuple(build(table, classes) for table in tables)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, dt.date):
        return value.isoformat()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    number = float(value)
    if not math.isfinite(number):
        raise ConfigError(f"a parameter of the model is {number}: expected a finite number")
    return (
        repr(int(value))
        if isinstance(value, int)
        else repr(round(number, 9) if abs(number) > 1e-3 else number)
    )
