"""The augmented model as a scenario: what was calibrated and named."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from rivid.atomic import write_text
from rivid.config import Config, read_toml
from rivid.core.hydraulics import GRAVITY
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.data import Record
from rivid.diagnosis.result import Diagnosis
from rivid.effects import Effect, build, effect_classes
from rivid.errors import ConfigError

HEAD = """\
# The calibrated reach with the effects that a diagnosis found, in SI units. Only the water is known: the
# programme and the operators are the default ones.
"""


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
    file = config.diagnose.effects_file
    document = {
        "name": f"{reach.name}-augmented",
        "first_day": record.dates[0],
        "days": (record.dates[-1] - record.dates[0]).days + 1,
        **({} if file is None else {"effects_file": str(Path(file).resolve())}),
        **tables,
        "effects": [e.to_table() for e in start] + [e.table for e in diagnosis.effects],
    }
    write_text(path, HEAD + tomli_w.dumps(_rounded(document)))


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


def _rounded(value: Any) -> Any:
    """Values for TOML: numbers to nine decimals, and none that is not finite."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    if not isinstance(value, float | np.number):
        return value
    number = float(value)
    if not math.isfinite(number):
        raise ConfigError(f"a parameter of the model is {number}: expected a finite number")
    return round(number, 9) if abs(number) > 1e-3 else number
