"""A scenario of `rivid simulate`: the reach, its river, its programme and its operators, from TOML.

SI units; an unknown key or an impossible value is an error in one line that names the key.
"""

import datetime as dt
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from rivid.config import NAME, ReachConfig, merged, parse, read_toml
from rivid.effects import Effect, build, effect_classes
from rivid.errors import ConfigError
from rivid.input_config import Means, Positive, Section
from rivid.reach.operators import OperatorSettings

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]


class ReachScenario(ReachConfig):
    """`[reach]`: as in a run's configuration, and parameters of the simulation alone."""

    wave_depth: Annotated[
        Positive,
        Means("depth that gives the wave's celerity, v + sqrt(g depth): a pool is deep near its dam", "m"),
    ] = 4.9
    inflow_gain: Annotated[Positive, Means("K_i: real flow over command at the upstream dam")] = 1.0
    outflow_gain: Annotated[Positive, Means("K_o: the same at the downstream dam")] = 1.0

    @model_validator(mode="after")
    def _a_pool(self) -> "ReachScenario":
        if self.kind != "pool":
            raise ValueError(f"kind = {self.kind!r}: only a pool can be simulated")
        return self


Modes = tuple[Annotated[float, Field(ge=-5, le=5)], ...]


class ChannelScenario(Section):
    """`[channel]`: the sections along the reach; with it the water follows Saint-Venant's equations (1).

    The length and the mean width are those of `[reach]`; modes are amplitudes of cos(j pi x / L).
    """

    bed_level: Annotated[float, Field(allow_inf_nan=False), Means("bed at the downstream dam", "m")] = 124.8
    slope: Annotated[float, Field(ge=-0.01, le=0.05), Means("fall of the bed")] = 1e-4
    manning: Annotated[float, Field(ge=0.005, le=0.2), Means("Manning's n", "s/m^(1/3)")] = 0.025
    side_slope: Annotated[
        float, Field(ge=0, le=20), Means("run of the banks for each metre up; 0 is a rectangle")
    ] = 0.0
    width_modes: Annotated[Modes, Means("modes of the logarithm of the width")] = ()
    bed_modes: Annotated[Modes, Means("modes of the bed's level", "m")] = ()
    manning_modes: Annotated[Modes, Means("modes of the logarithm of n")] = ()
    cells: Annotated[int, Field(ge=4, le=2000), Means("cells along the reach")] = 128
    courant: Annotated[float, Field(gt=0, le=0.6), Means("Courant number of the usual time step")] = 0.5
    step: Annotated[Positive | None, Means("time step; not given: from `courant`", "s")] = None
    gate_time: Annotated[NotNegative, Means("that a gate needs from one command to the next", "s")] = 30.0


class FlowScenario(Section):
    """`[flow]`: the mean discharge of the days."""

    mean: Annotated[Positive, Means("of a usual day of the year", "m3/s")] = 300.0
    lowest: Annotated[Positive, Means("lowest daily mean", "m3/s")] = 100.0
    highest: Annotated[Positive, Means("highest daily mean", "m3/s")] = 800.0
    seasonal: Annotated[
        NotNegative, Means("how far the high-water season lies above the rest, in logarithms")
    ] = 0.35
    peak_day: Annotated[int, Field(ge=1, le=366), Means("of the year, on which high water peaks", "day")] = (
        155
    )
    variability: Annotated[NotNegative, Means("wet and dry spells: standard deviation of the logarithm")] = (
        0.3
    )
    memory_days: Annotated[Positive, Means("how long a spell lasts", "days")] = 8.0

    @model_validator(mode="after")
    def _ordered(self) -> "FlowScenario":
        if not self.lowest <= self.mean <= self.highest:
            raise ValueError(
                f"lowest = {self.lowest:g}, mean = {self.mean:g}, highest = {self.highest:g}: "
                "expected them in this order [m3/s]"
            )
        return self


class ProgrammeScenario(Section):
    """`[programme]`: the commands of the dispatcher of the upstream dam."""

    swing: Annotated[NotNegative, Means("from the night's load to the peaks", "m3/s")] = 110.0
    swing_spread: Annotated[NotNegative, Means("relative, from day to day")] = 0.3
    weekend: Annotated[NotNegative, Means("share of the swing on Saturdays and Sundays")] = 0.7
    jitter: Annotated[NotNegative, Means("by which the load's corners move from day to day", "s")] = 1200.0
    corrections: Annotated[NotNegative, Means("standard deviation of the load-following on top", "m3/s")] = (
        8.0
    )
    correction_memory: Annotated[Positive, Means("time over which its correlation falls to 1/e", "s")] = 600.0
    activity: Annotated[float, Field(gt=0, le=1), Means("share of samples on which the dispatcher acts")] = (
        0.4
    )
    ramp: Annotated[Positive, Means("largest move from one sample to the next", "m3/s")] = 20.0
    quantum: Annotated[Positive, Means("step of the commands", "m3/s")] = 1.0
    lowest: Annotated[NotNegative, Means("smallest command", "m3/s")] = 40.0


class OperatorsScenario(Section):
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
    shift_start: Annotated[float, Field(ge=0, lt=24)] = OperatorSettings.shift_start
    people: Annotated[int, Field(ge=1, le=1000)] = OperatorSettings.people

    @field_validator("look")
    @classmethod
    def _shortest_first(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] > value[1]:
            raise ValueError("expected the shortest and the longest time between looks [s]")
        return value


class LevelScenario(Section):
    """`[level]`: the level aimed at, and the gauge."""

    set_point: Annotated[float, Field(allow_inf_nan=False), Means("level aimed at", "m")] = 130.0
    drawdown: Annotated[
        NotNegative, Means("how much lower it is for flow above `drawdown_from`", "m per 100 m3/s")
    ] = 0.2
    drawdown_from: Annotated[
        Positive, Means("mean flow of the day from which the level is drawn down", "m3/s")
    ] = 400.0
    noise: Annotated[NotNegative, Means("standard deviation of the gauge's white noise", "m")] = 0.003
    quantum: Annotated[NotNegative, Means("step of the gauge", "m")] = 0.01
    lag: Annotated[
        NotNegative, Means("time constant of the stilling well, in the logs; operators see the water", "s")
    ] = 0.0
    set_points_per_week: Annotated[NotNegative, Means("how often the level aimed at changes", "1/week")] = 0.0
    set_point_step: Annotated[
        NotNegative, Means("standard deviation of these levels about the set-point", "m")
    ] = 0.05
    gaps_per_day: Annotated[NotNegative, Means("how often the gauge gives no reading", "1/day")] = 0.0
    gap_length: Annotated[Positive, Means("mean length of a gap", "s")] = 300.0


class WeatherScenario(Section):
    """`[weather]`: a slow inflow that no log holds, an AR(1)."""

    inflow: Annotated[NotNegative, Means("standard deviation", "m3/s")] = 2.0
    memory: Annotated[Positive, Means("time over which its correlation falls to 1/e", "s")] = 21_600.0
    place: Annotated[Share, Means("where it enters: 0 at the upstream dam, 1 at the downstream one")] = 1.0


class OutputScenario(Section):
    """`[output]`: the daily logs."""

    format: Annotated[Literal["csv", "csv.gz", "parquet"], Means("of the files")] = "parquet"
    layout: Annotated[Literal["day", "month"], Means("a file a day, or a file a month")] = "day"


def _an_effect(table: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
    path = info.data.get("effects_file")
    try:
        build(table, effect_classes(path))
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return table


class Scenario(Section):
    """All of a scenario; the defaults are the reach of Table I.

    `effects` are tables of `rivid effects`; `cascade` are tables of what differs from reach to reach, each
    fed by the outflow of the one before.
    """

    name: Annotated[str, Means("of the scenario")] = Field("simulated", pattern=NAME, max_length=80)
    first_day: Annotated[dt.date, Means("date of the first day")] = dt.date(2008, 1, 1)
    days: Annotated[int, Field(ge=1, le=40_000), Means("length of the season", "days")] = 366
    missing_days: Annotated[int, Field(ge=0), Means("without a log, drawn from the seed", "days")] = 0
    utc_offset: Annotated[str, Means("of local time, the same all year")] = "+01:00"
    seed: Annotated[int, Field(ge=0), Means("the same seed gives the same season")] = 0
    reach: ReachScenario = ReachScenario()
    flow: FlowScenario = FlowScenario()
    programme: ProgrammeScenario = ProgrammeScenario()
    operators: OperatorsScenario = OperatorsScenario()
    level: LevelScenario = LevelScenario()
    weather: WeatherScenario = WeatherScenario()
    output: OutputScenario = OutputScenario()
    channel: ChannelScenario | None = None
    effects_file: Annotated[
        Path | None, Means("a Python file with your own effects, next to the scenario")
    ] = None
    effects: Annotated[
        tuple[Annotated[dict[str, Any], AfterValidator(_an_effect)], ...],
        Means("tables `[[effects]]`: what is hidden, see the effects"),
    ] = ()
    calibration: Annotated[
        dict[str, Any] | None,
        Means("table of a diagnosis' model.toml, for `forecast` and `export`; not simulated"),
    ] = None
    cascade: Annotated[
        tuple[dict[str, Any], ...],
        Means("tables `[[cascade]]`: what differs from reach to reach, each fed by the one before"),
    ] = ()

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
                found.append(parse(merged(base, differs), Scenario, f"cascade[{i}]"))
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

    With ``extends = "other.toml"`` its keys replace those of that file in the same directory.

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
    if isinstance(raw.get("effects_file"), str):  # relative to the scenario
        raw["effects_file"] = str(path.parent / raw["effects_file"])
    other = raw.pop("extends", None)
    if other is None:
        return raw
    if not isinstance(other, str):
        raise ConfigError(f"{path}: extends = {other!r}: expected the name of a scenario file")
    return merged(_extended(path.parent / other, (*before, here)), raw)
