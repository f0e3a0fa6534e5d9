"""`[input]` of the configuration: what the log files look like, and what cannot be meant."""

import datetime as dt
from typing import Annotated, Any, Literal
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

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


class InputConfig(Section):
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
