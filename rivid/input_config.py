"""`[input]` of the configuration: what the log files look like, and what cannot be meant."""

import datetime as dt
import re
from typing import Annotated, Any, Literal, get_args
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Column = str | list[str]
Stamp = Literal["instant", "start", "end"]
FLOWS = ("u_Qi", "u_Qo", "Q_L")
"""Canonical columns that are discharges [m3/s]; ``h_L`` is the level [m]."""

UNITS: dict[str, dict[str, float]] = {
    "flow": {"m3/s": 1.0, "cfs": 0.028316846592, "L/s": 1e-3, "m3/h": 1 / 3600},
    "level": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048},
}
"""Factors to m3/s and to m of the units that `[input.units]` knows."""


class Section(BaseModel):
    """A section of the configuration: frozen, and strict about its keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        kinds = _kinds(cls.model_fields[info.field_name or ""].annotation)
        if bool not in kinds and not any(issubclass(kind, BaseModel) for kind in kinds) and _has_truth(value):
            raise ValueError("true and false are no numbers or names")
        return value


def _kinds(annotation: Any) -> set[type]:
    """The classes that an annotation is made of."""
    parts = get_args(annotation)
    if parts:
        return set().union(*(_kinds(part) for part in parts))
    return {annotation} if isinstance(annotation, type) else set()


def _has_truth(value: Any) -> bool:
    """Whether a value, or one within it, is true or false."""
    if isinstance(value, dict):
        value = list(value.values())
    return isinstance(value, bool) or (isinstance(value, list | tuple) and any(map(_has_truth, value)))


class InputConfig(Section):
    """`[input]`: what the log files look like. Nothing is guessed: what is not canonical is said here.

    In the long layout (a row per value), u_Qi, u_Qo, h_L and Q_L name tags, not columns.
    """

    layout: Literal["wide", "long"] = "wide"
    time: Column = "time"
    u_Qi: Column = "u_Qi"
    u_Qo: Column | None = "u_Qo"
    h_L: Column | None = "h_L"
    Q_L: Column | None = "Q_L"
    tag: Column | None = None
    tag_pattern: Annotated[str, Field(max_length=200)] | None = None
    value: Annotated[str, Field(min_length=1)] = "value"
    quality: str | dict[str, Column] | None = None
    good: list[str] = []
    hold: dict[str, Positive] = Field(default_factory=dict)
    units: dict[str, str] = Field(default_factory=dict)
    stamp: dict[str, Stamp] = Field(default_factory=dict)
    interval: dict[str, Positive] = Field(default_factory=dict)
    time_zone: str | None = None
    time_format: str | None = None
    zone_column: str | None = None
    zones: dict[str, str] = Field(default_factory=dict)
    ambiguous: Literal["error", "first", "second", "order"] = "error"
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    thousands: Literal["", ",", ".", " ", "'"] = ""
    encoding: str = "utf-8"
    skip_rows: Annotated[int, Field(ge=0, le=1000)] = 0
    header_rows: Annotated[int, Field(ge=1, le=5)] = 1
    unit_rows: Annotated[int, Field(ge=0, le=10)] = 0
    columns: Annotated[list[str], Field(max_length=1000)] = []
    comment: Annotated[str, Field(max_length=3)] = ""
    ignore: list[str] = []
    repeated_header: Literal["error", "drop"] = "error"
    missing: list[str] = ["", "NA", "N/A", "#N/A", "NaN", "nan", "null", "NULL", "-", "--", "---"]
    sentinels: list[float] = []
    not_sentinels: list[float] = []
    max_gap: Annotated[float, Field(ge=0, le=86_400)] = 600.0
    max_filled: Annotated[float, Field(ge=0, le=1)] = 0.2

    @field_validator("units", "stamp", "interval", "quality", "hold")
    @classmethod
    def _known_columns(cls, value: Any) -> Any:
        valid = ("u_Qi", "u_Qo", "h_L", "Q_L")
        for key in value if isinstance(value, dict) else ():
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

    @model_validator(mode="after")
    def _long_is_whole(self) -> "InputConfig":
        if self.layout == "long":
            if self.tag is not None and self.tag_pattern is not None:
                raise ValueError("tag and tag_pattern both say where the tags are: expected one of them")
            if isinstance(self.quality, dict):
                raise ValueError("quality is a table: expected the name of one column in the long layout")
        elif self.tag is not None or self.tag_pattern is not None:
            raise ValueError(
                'tag and tag_pattern are of the long layout: set layout = "long", or leave them out'
            )
        return self

    @model_validator(mode="after")
    def _flags_and_zones_are_named(self) -> "InputConfig":
        if (self.quality is None) != (not self.good):
            raise ValueError(
                "quality names the column of flags, good lists the flags of values to keep: expected both"
            )
        if (self.zone_column is None) != (not self.zones):
            raise ValueError(
                "zone_column names the column of zones, [input.zones] their offsets: expected both"
            )
        for name in self.hold:
            if self.stamp.get(name) == "end" or name in self.interval:
                raise ValueError(
                    f"{name} is reported by exception ([input.hold]): it has no interval and no stamp, "
                    "leave those out"
                )
        if self.columns and self.header_rows > 1:
            raise ValueError("columns names the columns of files without a header: leave header_rows out")
        return self

    @field_validator("columns")
    @classmethod
    def _each_once(cls, value: list[str]) -> list[str]:
        twice = [name for name in value if name and value.count(name) > 1]
        if twice:
            raise ValueError(f"{twice[0]!r} stands twice: expected each name once")
        return value

    @field_validator("tag_pattern")
    @classmethod
    def _one_group(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                groups = re.compile(value).groups
            except re.error as error:
                raise ValueError(f"no regular expression ({error})") from None
            if groups != 1:
                raise ValueError(f"{groups} groups: expected one, round the tag, like '#REXCHANGE([^|]+)'")
        return value

    @field_validator("zones")
    @classmethod
    def _offsets(cls, value: dict[str, str]) -> dict[str, str]:
        for name, offset in value.items():
            if not re.fullmatch(r"[+-](0\d|1[0-4]):[0-5]\d", offset):
                raise ValueError(f'{name} = {offset!r}: expected an offset like "-07:00"')
        return value

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
