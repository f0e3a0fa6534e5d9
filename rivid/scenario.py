"""A scenario of `rivid simulate`: the reach, its river, its programme and its people, to and from TOML.

SI units; an unknown key or an impossible value is an error in one line that names the key.
"""

import datetime as dt
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from rivid.config import NAME, ReachConfig, parse, read_toml
from rivid.effects import Effect, build, effect_classes
from rivid.errors import ConfigError
from rivid.input_config import Positive
from rivid.reach.operators import OperatorSettings

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Hour = Annotated[float, Field(ge=0, lt=24)]
Format = Literal["csv", "csv.gz", "parquet"]
Layout = Literal["day", "month"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReachScenario(ReachConfig):
    """`[reach]`: as in a run's configuration, and what only the simulated water knows."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    wave_depth: Positive = 4.9
    inflow_gain: Positive = 1.0
    outflow_gain: Positive = 1.0

    @model_validator(mode="after")
    def _a_pool(self) -> "ReachScenario":
        if self.kind != "pool":
            raise ValueError(f"kind = {self.kind!r}: only a pool can be simulated")
        return self


Modes = tuple[Annotated[float, Field(ge=-5, le=5)], ...]


class ChannelScenario(_Section):
    """`[channel]`: the sections along the reach; with it the water follows Saint-Venant's equations (1).

    The length and the mean width are those of `[reach]`; modes are amplitudes of cos(j pi x / L).
    """

    bed_level: Annotated[float, Field(allow_inf_nan=False)] = 124.8
    slope: Annotated[float, Field(ge=-0.01, le=0.05)] = 1e-4
    manning: Annotated[float, Field(ge=0.005, le=0.2)] = 0.025
    side_slope: Annotated[float, Field(ge=0, le=20)] = 0.0
    width_modes: Modes = ()
    bed_modes: Modes = ()
    manning_modes: Modes = ()
    cells: Annotated[int, Field(ge=4, le=2000)] = 32
    courant: Annotated[float, Field(gt=0, le=0.6)] = 0.5
    step: Positive | None = None
    gate_time: NotNegative = 30.0


class FlowScenario(_Section):
    """`[flow]`: the mean discharge of the days."""

    mean: Positive = 300.0
    lowest: Positive = 100.0
    highest: Positive = 800.0
    seasonal: NotNegative = 0.35
    peak_day: Annotated[int, Field(ge=1, le=366)] = 155
    variability: NotNegative = 0.3
    memory_days: Positive = 8.0

    @model_validator(mode="after")
    def _ordered(self) -> "FlowScenario":
        if not self.lowest <= self.mean <= self.highest:
            raise ValueError(
                f"lowest = {self.lowest:g}, mean = {self.mean:g}, highest = {self.highest:g}: "
                "expected them in this order [m3/s]"
            )
        return self


class ProgrammeScenario(_Section):
    """`[programme]`: what the dispatcher of the upstream dam makes of the day."""

    swing: NotNegative = 110.0
    swing_spread: NotNegative = 0.3
    weekend: NotNegative = 0.7
    jitter: NotNegative = 1200.0
    corrections: NotNegative = 8.0
    correction_memory: Positive = 600.0
    activity: Annotated[float, Field(gt=0, le=1)] = 0.4
    ramp: Positive = 20.0
    quantum: Positive = 1.0
    lowest: NotNegative = 40.0


class OperatorsScenario(_Section):
    """`[operators]`: see :class:`rivid.reach.operators.OperatorSettings`."""

    feedforward: NotNegative = OperatorSettings.feedforward
    feedforward_spread: NotNegative = OperatorSettings.feedforward_spread
    level_gain: Annotated[float, Field(lt=0, allow_inf_nan=False)] = OperatorSettings.level_gain
    level_gain_spread: NotNegative = OperatorSettings.level_gain_spread
    dead_band: NotNegative = OperatorSettings.dead_band
    set_point_spread: NotNegative = OperatorSettings.set_point_spread
    trim_time: Positive = OperatorSettings.trim_time
    look: tuple[Positive, Positive] = OperatorSettings.look
    notice: NotNegative = OperatorSettings.notice
    quantum: NotNegative = OperatorSettings.quantum
    lowest: NotNegative = OperatorSettings.lowest
    shift_start: Hour = OperatorSettings.shift_start
    people: Annotated[int, Field(ge=1, le=1000)] = OperatorSettings.people

    @field_validator("look")
    @classmethod
    def _shortest_first(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] > value[1]:
            raise ValueError("expected the shortest and the longest time between looks [s]")
        return value


class LevelScenario(_Section):
    """`[level]`: the level aimed at, and the gauge."""

    set_point: Annotated[float, Field(allow_inf_nan=False)] = 130.0
    drawdown: NotNegative = 0.2
    drawdown_from: Positive = 400.0
    noise: NotNegative = 0.003
    quantum: NotNegative = 0.01
    set_points_per_week: NotNegative = 0.0
    set_point_step: NotNegative = 0.05
    gaps_per_day: NotNegative = 0.0
    gap_length: Positive = 300.0


class WeatherScenario(_Section):
    """`[weather]`: a slow inflow that no log holds, an AR(1)."""

    inflow: NotNegative = 2.0
    memory: Positive = 21_600.0
    place: Share = 1.0


class OutputScenario(_Section):
    """`[output]`: the daily logs."""

    format: Format = "parquet"
    layout: Layout = "day"


def _an_effect(table: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
    path = info.data.get("effects_file")
    try:
        build(table, effect_classes(path))
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return table


class Scenario(_Section):
    """All of a scenario; the defaults are the reach of Table I.

    `effects` are tables of `rivid effects`; `cascade` are tables of what differs from reach to reach, each
    fed by the outflow of the one before.
    """

    name: str = Field("simulated", pattern=NAME, max_length=80)
    first_day: dt.date = dt.date(2008, 1, 1)
    days: Annotated[int, Field(ge=1, le=40_000)] = 366
    missing_days: Annotated[int, Field(ge=0)] = 0
    utc_offset: str = "+01:00"
    seed: Annotated[int, Field(ge=0)] = 0
    reach: ReachScenario = ReachScenario()
    flow: FlowScenario = FlowScenario()
    programme: ProgrammeScenario = ProgrammeScenario()
    operators: OperatorsScenario = OperatorsScenario()
    level: LevelScenario = LevelScenario()
    weather: WeatherScenario = WeatherScenario()
    output: OutputScenario = OutputScenario()
    channel: ChannelScenario | None = None
    effects_file: Path | None = None
    effects: tuple[Annotated[dict[str, Any], AfterValidator(_an_effect)], ...] = ()
    cascade: tuple[dict[str, Any], ...] = ()

    @field_validator("utc_offset")
    @classmethod
    def _an_offset(cls, value: str) -> str:
        found = re.fullmatch(r"[+-](\d\d):(\d\d)", value)
        if not found or int(found[1]) > 14 or int(found[2]) > 59:
            raise ValueError("expected an offset from UTC like +01:00")
        return value

    @field_validator("days")
    @classmethod
    def _within_the_calendar(cls, value: int, info: ValidationInfo) -> int:
        first = info.data.get("first_day", dt.date.min)
        if value > (dt.date.max - first).days:
            raise ValueError(f"passes the end of the calendar after {first}")
        return value

    @field_validator("missing_days")
    @classmethod
    def _some_days_left(cls, value: int, info: ValidationInfo) -> int:
        days = info.data.get("days", value + 1)
        if value >= days:
            raise ValueError(f"leaves no day of {days}")
        return value

    @model_validator(mode="after")
    def _a_cascade_of_reaches(self) -> "Scenario":
        names = [reach.reach.name for reach in self.reaches()]
        if len(set(names)) < len(names):
            raise ValueError(f"cascade has reaches {names}: expected a reach.name of its own for each")
        return self

    def reaches(self) -> tuple["Scenario", ...]:
        """A scenario for each reach of the cascade, from the top; only this one where there is none."""
        if not self.cascade:
            return (self,)
        base = self.model_dump(exclude={"cascade"}, exclude_unset=True)
        found = []
        for i, differs in enumerate(self.cascade):
            try:
                found.append(parse(_merged(base, differs), Scenario, f"cascade[{i}]"))
            except ConfigError as error:
                raise ValueError(str(error)) from None
        return tuple(found)

    def planted(self) -> tuple[Effect, ...]:
        """The effects, built."""
        classes = effect_classes(self.effects_file)
        return tuple(build(table, classes) for table in self.effects)

    @property
    def offset(self) -> dt.timedelta:
        """The offset of local time from UTC."""
        hours, minutes = int(self.utc_offset[1:3]), int(self.utc_offset[4:6])
        return (-1 if self.utc_offset[0] == "-" else 1) * dt.timedelta(hours=hours, minutes=minutes)


def load_scenario(path: Path | str) -> Scenario:
    """Read a scenario from a TOML file.

    A file may say ``extends = "other.toml"``, beside itself: what it says itself goes over that.

    Raises
    ------
    ConfigError
        In one line: the file, the key, what came and what is valid.
    """
    return parse(_extended(Path(path)), Scenario, str(path))


def _extended(path: Path, before: tuple[Path, ...] = ()) -> dict[str, Any]:
    """The tables of a scenario file and of those that it extends."""
    here = path.resolve()
    if here in before:
        raise ConfigError(f"{path}: extends itself, by way of {before[-1].name}")
    raw = read_toml(path)
    if isinstance(raw.get("effects_file"), str):  # beside the scenario, wherever the command is given
        raw["effects_file"] = str(path.parent / raw["effects_file"])
    other = raw.pop("extends", None)
    if other is None:
        return raw
    if not isinstance(other, str):
        raise ConfigError(f"{path}: extends = {other!r}: expected the name of a scenario file")
    return _merged(_extended(path.parent / other, (*before, here)), raw)


def _merged(base: dict[str, Any], differs: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in differs.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = _merged(base[key], value) if both else value
    return merged
