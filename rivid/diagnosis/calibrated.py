"""Read and write model.toml: the calibrated reach as a scenario and, in `[calibration]`, as it was fitted.

`[calibration]` holds the fields of the response, so that the model read equals the fitted one.
"""

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from rivid import __version__
from rivid.atomic import write_text
from rivid.config import Config, read_toml
from rivid.core.hydraulics import GRAVITY
from rivid.diagnosis.data import Kind, Record
from rivid.diagnosis.fit import Model
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.response.base import FreeParameter, Response, step_responses
from rivid.diagnosis.response.hydraulic import HydraulicResponse, bed_width
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.response.river import RiverResponse
from rivid.diagnosis.result import Diagnosis
from rivid.effects import Effect, build, effect_classes
from rivid.errors import ConfigError, RividError
from rivid.types import DAY, Floats

SETTLED = 4.0 * DAY
"""Length of a step response after which it has its final value, in a pool its final rate [s]."""
RESPONSES: tuple[type[Any], ...] = (HydraulicResponse, LinearPool, RiverResponse)


@dataclass(frozen=True, eq=False)
class ReachModel:
    """A calibrated reach: response, noise and effects."""

    name: str  # name of the reach
    model: Model
    sample_time: float  # T_s [s]
    origin: dict[str, Any]  # origin of the model: days, verdict, version, intervals of its parameters

    @property
    def kind(self) -> Kind:
        """Kind of the reach: "pool", with a level as output, or "river", with a discharge."""
        return "river" if self.model.reach.surface_area is None else "pool"

    @property
    def noise(self) -> NoiseModel:
        """Noise of the residual; a calibrated model has one."""
        assert self.model.noise is not None
        return self.model.noise

    def kernels(self, samples: int) -> dict[str, Floats]:
        """Return the output (samples,) after 1 m3/s more u_Qi (`up`) or u_Qo (`down`) at the usual flow."""
        model = self.model
        return step_responses(model.reach, samples, self.sample_time, model.level, model.flow)

    @cached_property
    def half_time(self) -> float:
        """Time in which half of a small wave arrives at the usual flow [s].

        A river: half of the step response. A pool: the time tau after which a front of the height J and the
        final rise, by s in each sample, have the level and the area below it of the step response where its
        front ends, at the sample m: J + s x and J x + s x^2 / 2, x = m - tau. A front within one sample is
        known to a third of it.
        """
        up = self.kernels(max(round(SETTLED / self.sample_time), 2))["up"]
        if self.kind == "river":
            return reached(up, 0.5) * self.sample_time
        rate = np.diff(up)
        s = rate[-1]
        first = int(np.argmax(rate >= 0.5 * s))
        peak = first + int(np.argmax(np.diff(rate[first:]) <= 0.0))
        m = peak + 1 + int(np.argmax(rate[peak + 1 :] < 0.5 * rate[peak]))  # never: a rise without a front
        level, area = up[m], np.trapezoid(up[: m + 1])
        x = (level - math.sqrt(max(level**2 - 2.0 * s * area, 0.0))) / s
        return float(m - x) * self.sample_time


def reached(up: Floats, share: float) -> float:
    """Return when a step response (n,) reaches a share of its last value [samples], linear between them."""
    after = max(int(np.argmax(up >= share * up[-1])), 1)
    before = up[after - 1]
    return after - 1 + float((share * up[-1] - before) / (up[after] - before))


def calibration(model: Model) -> dict[str, Any]:
    """Return the table `[calibration]` of a model: its response, noise and references."""
    reach, noise = model.reach, model.noise
    assert noise is not None
    own = {
        f.name: value
        for f in fields(reach)
        if f.init and f.name != "parameters" and (value := getattr(reach, f.name)) is not None
    }
    return {
        "response": type(reach).__name__,
        "settings": own,
        "parameters": {p.name: p.natural for p in reach.parameters},
        "noise": {name: value for name, value in vars(noise).items() if value is not None},
        "level": model.level,
        "flow": model.flow,
        "gauge_floor": model.gauge_floor,
    }


def load_model(path: Path | str) -> ReachModel:
    """Read the calibrated reach of `rivid diagnose` from model.toml or the directory that contains it."""
    path = Path(path)
    path = path / "model.toml" if path.is_dir() else path
    if not path.exists():
        raise ConfigError(f"{path} does not exist: expected the model.toml of `rivid diagnose`; run it first")
    raw = read_toml(path)
    table = raw.get("calibration")
    if not isinstance(table, Mapping):
        raise ConfigError(
            f"{path}: no table [calibration]: expected the model.toml of `rivid diagnose`, version 0.2 or "
            "later; run the diagnosis again"
        )
    try:
        reach = _response(table)
        noise = NoiseModel(**{"surface_area": None, **table["noise"]})
        classes = effect_classes(raw.get("effects_file"))
        effects = tuple(build(one, classes) for one in raw.get("effects", []))
        model = Model(
            reach, noise, float(table["level"]), float(table["flow"]), float(table["gauge_floor"]), effects,
            ((),) * len(effects),
        )  # fmt: skip
        return ReachModel(
            str(raw["reach"]["name"]), model, float(raw["reach"]["sample_time"]), dict(table["origin"])
        )
    except (KeyError, TypeError, ValueError) as error:
        what = f"{type(error).__name__}: {error}"
        raise ConfigError(
            f"{path}: [calibration] is not complete ({what}): run the diagnosis again"
        ) from None
    except RividError as error:
        raise ConfigError(f"{path}: {error}") from None


def _response(table: Mapping[str, Any]) -> Response:
    classes = {one.__name__: one for one in RESPONSES}
    if table["response"] not in classes:
        raise ConfigError(f"response = {table['response']!r}: expected one of {', '.join(classes)}")
    parameters = tuple(
        FreeParameter(name, "", float(v), float(v), 0.0, float(v), float(v))
        for name, v in table["parameters"].items()
    )
    own = {k: tuple(v) if isinstance(v, list) else v for k, v in table["settings"].items()}
    response: Response = classes[table["response"]](parameters=parameters, **own)
    return response


MODEL_COMMENT = """\
# The calibrated reach with the effects that a diagnosis named, SI units; flow programme and operators are the
# default ones.
"""


def write_model(
    path: Path,
    diagnosis: Diagnosis,
    record: Record,
    config: Config,
    start: Sequence[Effect] = (),
    model: Model | None = None,
) -> None:
    """Write the calibrated reach and the named effects, after those known from the start, as a scenario.

    `model` is stored in `[calibration]`; without it the file is only a scenario. `rivid simulate` runs the
    scenario of a pool; that of a river reach is for `diagnose --model`, `forecast` and `export`.
    """
    reach = config.reach
    noise = diagnosis.noise or {}
    found = {e.name: e.value for e in diagnosis.reach_parameters}
    daily = record.inflow[:, record.lead :].mean(axis=1)
    level = record.usual_output
    tables: dict[str, dict[str, Any]] = {}
    tables["reach"] = {
        "name": reach.name, "kind": reach.kind, "sample_time": record.sample_time,
        "length": found.get("length", reach.length), "width": found.get("width", reach.width),
    }  # fmt: skip
    if record.kind == "pool" and "surface_area" in found:  # a pool without hydraulics
        tables["reach"] |= {"surface_area": found["surface_area"], "inflow_gain": found["inflow_gain"]}
        # the depth at which a wave takes the delay at the usual flow
        celerity = reach.length / found["delay"] - record.usual_flow / (reach.width * reach.depth)
        tables["reach"] |= {"depth": reach.depth, "wave_depth": max(celerity, 0.1) ** 2 / GRAVITY}
    if record.kind == "pool" and "length" in found:
        modes = {k: [v for n, v in found.items() if n.startswith(f"{k}_mode")] for k in ("width", "bed")}
        modes["bed"] = [0.0, *modes["bed"]]  # the first mode is the fall
        tables["reach"]["width"] = bed_width(found["width"], found["bank"], found["depth"])
        tables["channel"] = {
            "bed_level": level - found["depth"] - 0.5 * found["fall"],
            "slope": found["fall"] / found["length"],
            "manning": found["manning"], "side_slope": found["bank"], "gate_time": found["gate_time"],
            "width_modes": modes["width"], "bed_modes": modes["bed"],
        }  # fmt: skip
    tables["flow"] = {
        "mean": float(np.median(daily)), "lowest": float(daily.min()), "highest": float(daily.max()),
    }  # fmt: skip
    if record.kind == "pool":
        tables["operators"] = {"level_gain": -50.0}
        tables["level"] = {"set_point": level, "drawdown": 0.0, "noise": noise.get("gauge_sd", 0.003)}
        tables["level"]["lag"] = found.get("gauge_lag", 0.0)
        tables["weather"] = {
            "inflow": noise.get("inflow_sd", 0.0), "memory": noise.get("inflow_memory", 3600.0), "place": 0.5,
        }  # fmt: skip
    document: dict[str, Any] = {
        "name": f"{reach.name}-augmented", "first_day": record.dates[0],
        "days": (record.dates[-1] - record.dates[0]).days + 1,
    }  # fmt: skip
    if config.diagnose.effects_file is not None:
        document["effects_file"] = str(Path(config.diagnose.effects_file).resolve())
    document |= tables
    if model is not None:
        document["calibration"] = calibration(model) | {
            "origin": {
                "first": record.dates[0], "last": record.dates[-1], "days": record.days,
                "verdict": diagnosis.verdict, "rivid": __version__,
                "intervals": {e.name: [e.low, e.high] for e in diagnosis.reach_parameters},
            }
        }  # fmt: skip
    if effects := [e.to_table() for e in start] + [e.table for e in diagnosis.effects]:
        document["effects"] = effects
    write_text(path, MODEL_COMMENT + tomli_w.dumps(_rounded(document)))


def read_effects(path: Path, config: Config) -> tuple[Effect, ...]:
    """Read the effects of an augmented model."""
    raw = read_toml(path)
    tables = raw.get("effects", [])
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        raise ConfigError(f"{path}: effects: expected tables [[effects]], as model.toml of a diagnosis has")
    classes = effect_classes(config.diagnose.effects_file)
    return tuple(build(table, classes) for table in tables)


def _rounded(value: Any) -> Any:
    """Return TOML values with plain numbers, those above 1e-3 rounded to nine decimals."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    if isinstance(value, bool | str | int | dt.date):
        return value
    number = float(value)
    if not math.isfinite(number):
        raise ConfigError(f"a parameter of the model is {number}: expected a finite number")
    return round(number, 9) if abs(number) > 1e-3 else number
