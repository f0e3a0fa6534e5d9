"""The configuration: pydantic models over the core's settings, to and from TOML.

Every key has a unit and a default here; an unknown key is an error that lists the valid ones. The
defaults are the reach of Table I and the settings of section VI.
"""

import datetime as dt
import tomllib
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from rivid.core.settings import DEFAULT_ALPHA, EstimatorName, JmapSettings, Prior
from rivid.errors import ConfigError

T = TypeVar("T", bound=BaseModel)
NAME = r"^[A-Za-z0-9._-]+$"
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Discharge = Annotated[float, Field(gt=0, le=1e7)]
Column = str | list[str]
Stamp = Literal["instant", "start", "end"]
FLOWS = ("u_Qi", "u_Qo", "Q_L")
"""Canonical columns that are discharges [m3/s]; ``h_L`` is the level [m]."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class ReachConfig(_Section):
    """`[reach]`: the reach and its geometry (Table I)."""

    name: str = Field("reach", pattern=NAME, max_length=80)
    kind: Literal["pool", "river"] = "pool"
    length: Annotated[float, Field(gt=0, le=1e7)] = 8200.0
    width: Annotated[float, Field(gt=0, le=1e6)] = 81.6
    depth: Annotated[float, Field(gt=0, le=1e4)] = 4.9
    bed_level: float | None = Field(None, allow_inf_nan=False)
    surface_area: Annotated[float, Field(gt=0, le=1e12)] = 6.7e5
    discharge_range: tuple[Discharge, Discharge] = (100.0, 800.0)
    sample_time: Annotated[float, Field(ge=1, le=86_400, allow_inf_nan=False)] = 133.0

    @model_validator(mode="after")
    def _ordered(self) -> "ReachConfig":
        low, high = self.discharge_range
        if low > high:
            raise ValueError(f"discharge_range = [{low}, {high}]: expected lowest, highest [m3/s]")
        return self

    @property
    def output(self) -> str:
        """Canonical column that the estimators explain: the level, or a river's discharge."""
        return "h_L" if self.kind == "pool" else "Q_L"

    @property
    def output_unit(self) -> str:
        """Unit of the output."""
        return "m" if self.kind == "pool" else "m3/s"


MAX_ORDER = 1000
"""Longest FIR [samples]."""


class InputConfig(_Section):
    """`[input]`: what the log files look like. Nothing is guessed: what is not canonical is said here."""

    time: Column = "time"
    u_Qi: Column = "u_Qi"
    u_Qo: Column | None = "u_Qo"
    h_L: Column | None = "h_L"
    Q_L: Column | None = "Q_L"
    units: dict[str, str] = Field(default_factory=dict)
    stamp: dict[str, Stamp] = Field(default_factory=dict)
    interval: dict[str, Positive] = Field(default_factory=dict)
    time_zone: str | None = None
    time_format: str | None = None
    ambiguous: Literal["error", "first", "second", "order"] = "error"
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    thousands: Literal["", ",", ".", " ", "'"] = ""
    encoding: str = "utf-8"
    skip_rows: Annotated[int, Field(ge=0, le=1000)] = 0
    unit_rows: Annotated[int, Field(ge=0, le=10)] = 0
    repeated_header: Literal["error", "drop"] = "error"
    missing: list[str] = ["", "NA", "N/A", "#N/A", "NaN", "nan", "null", "NULL", "-", "--", "---"]
    sentinels: list[float] = []
    not_sentinels: list[float] = []
    max_gap: Annotated[float, Field(ge=0, le=86_400)] = 600.0
    max_filled: Annotated[float, Field(ge=0, le=1)] = 0.2

    @field_validator("units", "stamp", "interval")
    @classmethod
    def _known_columns(cls, value: dict[str, Any]) -> dict[str, Any]:
        valid = ("u_Qi", "u_Qo", "h_L", "Q_L")
        for key in value:
            if key not in valid:
                raise ValueError(f"unknown column {key!r}; valid: {', '.join(valid)}")
        return value

    @field_validator("units")
    @classmethod
    def _known_units(cls, value: dict[str, str]) -> dict[str, str]:
        for column, unit in value.items():
            valid = UNITS["level" if column == "h_L" else "flow"]
            if unit not in valid:
                raise ValueError(f"{column} = {unit!r}; valid units: {', '.join(valid)}")
        return value

    @field_validator("encoding")
    @classmethod
    def _known_encoding(cls, value: str) -> str:
        try:
            "Q".encode(value).decode(value)
        except (LookupError, ValueError):
            raise ValueError(
                f"{value!r} is not a text encoding; expected one like utf-8 or latin-1"
            ) from None
        return value

    @model_validator(mode="after")
    def _distinct_marks(self) -> "InputConfig":
        if self.separator in '"\r\n' or self.separator.isalnum():
            raise ValueError(
                f"separator {self.separator!r} cannot separate columns; expected one like ; or ,"
            )
        if self.thousands == self.decimal:
            raise ValueError(f"thousands and decimal are both {self.decimal!r}: expected two different marks")
        return self

    @model_validator(mode="after")
    def _whole_names(self) -> "InputConfig":
        for name in ("time", "u_Qi", "u_Qo", "h_L", "Q_L"):
            columns = getattr(self, name)
            if columns is None or (name == "u_Qo" and columns == ""):
                continue
            listed = [columns] if isinstance(columns, str) else columns
            if not listed or "" in listed:
                hint = {
                    "u_Qo": ', or "" where the outflow is not logged',
                    "h_L": '; a reach without level is [reach] kind = "river"',
                }.get(name, "")
                raise ValueError(f"empty {name}: expected the name of a column, or a list of names{hint}")
            if len(set(listed)) < len(listed):
                raise ValueError(f"a column stands twice in {name} = {listed}: expected each once")
        return self

    @field_validator("time_format")
    @classmethod
    def _readable_format(cls, value: str | None) -> str | None:
        if value is None or value in ("unix", "unix_ms"):
            return value
        moment = dt.datetime(2008, 3, 14, 13, 5, tzinfo=dt.UTC)
        expected = 'expected one like "%d/%m/%Y %H:%M", or "unix" or "unix_ms"'
        try:
            back = dt.datetime.strptime(moment.strftime(value), value)
        except ValueError as error:
            raise ValueError(f"no format of times ({error}); {expected}") from None
        if back.date() != moment.date():
            raise ValueError(f"does not tell year, month and day; {expected}")
        if back.hour not in (0, moment.hour):
            raise ValueError(f"%I counts hours to 12 and needs %p for AM or PM; {expected}")
        return value

    @field_validator("time_zone")
    @classmethod
    def _known_zone(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                ZoneInfo(value)
            except (ZoneInfoNotFoundError, ValueError, OSError):
                raise ValueError(
                    f"{value!r} is not a time zone; expected a name like Europe/Paris or UTC"
                ) from None
        return value


UNITS: dict[str, dict[str, float]] = {
    "flow": {"m3/s": 1.0, "cfs": 0.028316846592, "L/s": 1e-3, "m3/h": 1 / 3600},
    "level": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048},
}
"""Factors to m3/s and to m of the units that `[input.units]` knows."""


class RunConfig(_Section):
    """`[run]`: which estimators, on data sets of how many days."""

    estimators: list[EstimatorName] = Field(["jmap"], min_length=1)
    window_days: Annotated[int, Field(ge=1, le=31)] = 1
    min_motion: Annotated[float, Field(ge=0, le=1)] = 1e-4

    @field_validator("estimators")
    @classmethod
    def _no_repeats(cls, value: list[str]) -> list[str]:
        return list(dict.fromkeys(value))


class JmapConfig(_Section):
    """`[jmap]`: the settings of :class:`rivid.core.settings.JmapSettings`, with the paper's names."""

    order: Annotated[int, Field(ge=6, le=MAX_ORDER)] | Literal["bounds"] = JmapSettings.order
    d_min: Annotated[int, Field(ge=1)] = JmapSettings.d_min
    d_max: Annotated[int, Field(ge=1)] | Literal["bounds"] = JmapSettings.d_max
    sigma_d: Annotated[float, Field(ge=0.1, le=1e4)] | Literal["bounds"] = JmapSettings.delay_scale
    alpha: Annotated[float, Field(ge=1e-9, le=1e14)] = DEFAULT_ALPHA
    d_init: Annotated[int, Field(ge=1)] = JmapSettings.d_init
    tolerance: Annotated[float, Field(ge=1e-9, lt=1)] = JmapSettings.tolerance
    max_iterations: Annotated[int, Field(ge=2, le=10_000)] = JmapSettings.max_iterations
    start: Literal["rest", "free"] | None = None


class Config(_Section):
    """All of a run's configuration."""

    reach: ReachConfig = ReachConfig()
    input: InputConfig = InputConfig()
    run: RunConfig = RunConfig()
    jmap: JmapConfig = JmapConfig()

    @field_validator("input")
    @classmethod
    def _columns_of_one_role(cls, value: InputConfig, info: ValidationInfo) -> InputConfig:
        reach = info.data.get("reach")
        if reach is None:
            return value  # its own fault is said instead
        roles = ("time", "u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("time", "u_Qi", "Q_L")
        given = {}
        for role in roles:
            columns = getattr(value, role)
            given[role] = {columns or role} - {""} if not isinstance(columns, list) else set(columns)
        if value.u_Qo == "":
            given.pop("u_Qo", None)
        for one, other in combinations(given, 2):
            shared = given[one] & given[other]
            # two discharges may share a part, such as a bypass; nothing else may
            if shared and (given[one] == given[other] or not {one, other} <= set(FLOWS)):
                raise ValueError(
                    f"column {min(shared)!r} stands for {one} and for {other}: expected different columns"
                )
        return value

    def jmap_settings(
        self, prior: Prior = "rayleigh", *, fixed_alpha: bool = False, inverse_gamma: bool = True
    ) -> JmapSettings:
        """The core's settings, with "bounds" taken from the reach's hydraulics.

        Raises
        ------
        ConfigError
            Where the settings contradict each other (d_max beyond the FIR, for example).
        """
        j = self.jmap
        order, d_max, sigma_d = j.order, j.d_max, j.sigma_d
        if "bounds" in (order, d_max, sigma_d):
            from rivid.core.hydraulics import propose_delays

            r = self.reach
            proposal = propose_delays(
                r.discharge_range, length=r.length, width=r.width, depth=r.depth,
                sample_time=r.sample_time, kind=r.kind,
            )  # fmt: skip
            order = proposal.order if order == "bounds" else order
            d_max = proposal.d_max if d_max == "bounds" else d_max
            sigma_d = proposal.delay_scale if sigma_d == "bounds" else sigma_d
        assert not isinstance(order, str) and not isinstance(d_max, str)
        if order > MAX_ORDER:
            raise ConfigError(
                f"the bounds of [reach] ask for an FIR of order {order} at sample_time = "
                f"{self.reach.sample_time:g} s, {MAX_ORDER} is the most: give "
                "[jmap] order and d_max, or a longer sample_time"
            )
        return JmapSettings(
            order=order,
            d_min=j.d_min,
            d_max=d_max,
            prior=prior,
            delay_scale=float(sigma_d),
            alpha=j.alpha if fixed_alpha else None,
            inverse_gamma=inverse_gamma,
            d_init=j.d_init,
            tolerance=j.tolerance,
            max_iterations=j.max_iterations,
            free_start=self.reach.kind == "river" if j.start is None else j.start == "free",
        )


def load_toml(path: Path, model: type[T]) -> T:
    """Read a TOML file into a model.

    Raises
    ------
    ConfigError
        In one line: the file, the key, what came and what is valid.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from None
    return parse(raw, model, str(path))


def parse(raw: dict[str, Any], model: type[T], source: str = "config") -> T:
    """Validate a nested dict; the first fault becomes a one-line :class:`ConfigError`."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(f"{source}: {_explain(first, model, raw)}") from None


def load_config(path: Path | None) -> Config:
    """The configuration in a file, or the defaults (Table I, section VI) without one."""
    return Config() if path is None else load_toml(path, Config)


def _explain(fault: Any, model: type[BaseModel], raw: Any) -> str:
    where = ".".join(_place(fault["loc"], raw))
    if fault["type"] == "extra_forbidden":
        fields = _fields_at(model, fault["loc"][:-1])
        return f"unknown key {where}; valid keys here: {', '.join(fields)}"
    came = repr(fault.get("input"))
    came = came if len(came) <= 60 else came[:57] + "..."
    message = fault["msg"].removeprefix("Value error, ")
    return f"{where} = {came}: {message[:1].lower()}{message[1:]}"


def _place(loc: tuple[int | str, ...], raw: Any) -> list[str]:
    """The part of pydantic's path that stands in the file; the rest names types."""
    place = []
    for part in loc:
        if isinstance(raw, dict) and part in raw or isinstance(raw, list) and isinstance(part, int):
            raw = raw[part]  # type: ignore[index]
            place.append(str(part))
    return place or [str(loc[0])]


def _fields_at(model: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    for part in loc:
        field = model.model_fields.get(str(part))
        if field is not None and isinstance(field.annotation, type):
            if issubclass(field.annotation, BaseModel):
                model = field.annotation
    return sorted(model.model_fields)
