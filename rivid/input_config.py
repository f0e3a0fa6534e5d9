"""`[input]` of the configuration: what the log files look like; contradictory keys are refused."""

import datetime as dt
import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Column = str | list[str]
FLOWS = ("u_Qi", "u_Qo", "Q_L")
"""Canonical columns that are discharges [m3/s]; ``h_L`` is the level [m]."""

FLOW_UNITS = {
    "m3/s": 1.0, "cfs": 0.028316846592, "kcfs": 28.316846592, "L/s": 1e-3, "m3/h": 1 / 3600, "m3/min": 1 / 60,
    "ML/d": 1e3 / 86400, "MGD": 3785.411784 / 86400,
}  # fmt: skip
LEVEL_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048}
UNITS = {"u_Qi": FLOW_UNITS, "u_Qo": FLOW_UNITS, "h_L": LEVEL_UNITS, "Q_L": FLOW_UNITS}
"""Factors to m3/s, or to m, of the units that `[input.units]` accepts, by canonical column."""


@dataclass(frozen=True)
class Means:
    """Meaning, in Markdown, and unit of a key, as metadata of its type; the reference page shows them."""

    meaning: str
    unit: str = "-"


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


USUAL_ZONES = {
    "pst pdt pacific": "America/Los_Angeles",
    "mst mdt mountain": "America/Denver",
    "cst cdt central": "America/Chicago",
    "est edt eastern": "America/New_York",
    "akst akdt alaska": "America/Anchorage",
    "mez mesz cest": "Europe/Berlin",
    "bst": "Europe/London",
    "brt": "America/Sao_Paulo",
    "ist": "Asia/Kolkata",
    "jst": "Asia/Tokyo",
}
"""Usual names of zones, and a zone of the IANA database for each."""


def _near_zones(name: str) -> str:
    """Names of zones that may be meant, as a part of a message; empty for none."""
    from difflib import get_close_matches
    from zoneinfo import available_timezones

    words = re.findall(r"[a-z]+", name.lower())
    near = [zone for names, zone in USUAL_ZONES.items() if set(names.split()) & set(words)]
    if not near:
        known = {
            zone.rpartition("/")[2].lower(): zone for zone in sorted(available_timezones(), reverse=True)
        }
        text = name.rpartition("/")[2].strip().lower().replace(" ", "_")
        near = [known[place] for place in get_close_matches(text[:40], known, 3, 0.75)]
    return f"; near: {', '.join(near)}" if near else ""


class InputConfig(Section):
    """`[input]`: what the log files look like.

    Nothing is guessed: every departure from the canonical form is set here.
    In the long layout (a row per value), u_Qi, u_Qo, h_L and Q_L name tags, not columns.
    """

    database: Annotated[
        str | None, Means("URL of SQLAlchemy; `$NAME` is a variable of the environment (`rivid ingest` only)")
    ] = None
    query: Annotated[
        str | None,
        Means("SQL for the rows, where no EXPORTS are named; `:first` and `:last` limit its times"),
    ] = None
    layout: Annotated[
        Literal["wide", "long"],
        Means("`wide`: a row per time; `long`: a row per value (`rivid ingest` only)"),
    ] = "wide"
    time: Annotated[Column, Means("column of the time; a list is joined by a space (date and clock)")] = (
        "time"
    )
    u_Qi: Annotated[Column, Means("column, or tag, of the inflow command; a list is a sum")] = "u_Qi"
    u_Qo: Annotated[Column | None, Means('the same of the outflow command; `""` where it is not logged')] = (
        "u_Qo"
    )
    h_L: Annotated[Column | None, Means("the same of the level, of a pool")] = "h_L"
    Q_L: Annotated[Column | None, Means("the same of the discharge at the lower end, of a river")] = "Q_L"
    tag: Annotated[Column | None, Means("long layout: column of the tags; a list is joined by a space")] = (
        None
    )
    tag_pattern: Annotated[
        Annotated[str, Field(max_length=200)] | None,
        Means("long layout: regular expression of the line above the rows with their tag"),
    ] = None
    value: Annotated[str, Field(min_length=1), Means("long layout: column of the values")] = "value"
    quality: Annotated[
        str | dict[str, Column] | None,
        Means("column of flags of the whole row, or a table with a column for each of u_Qi, u_Qo, h_L, Q_L"),
    ] = None
    good: Annotated[list[str], Means('flags of values to keep; `""` for none')] = []
    hold: Annotated[
        dict[str, Positive],
        Means(
            "of values logged when they change: the longest time that one holds (`rivid ingest` only)", "s"
        ),
    ] = {}
    units: Annotated[
        dict[str, str],
        Means("of a column: `" + "`, `".join(FLOW_UNITS) + "`; `" + "`, `".join(LEVEL_UNITS) + "`"),
    ] = {}
    stamp: Annotated[
        dict[str, Literal["instant", "start", "end"]],
        Means("what the time of a value stands for: `instant`, `start` or `end` of its interval"),
    ] = {}
    interval: Annotated[
        dict[str, Positive], Means("time between two values of a column that does not come every T_s", "s")
    ] = {}
    time_zone: Annotated[str | None, Means("zone of a clock without offset, such as `Europe/Paris`")] = None
    time_format: Annotated[
        str | None, Means("format of times that are not ISO 8601 (strptime), `unix`, `unix_ms` or `excel`")
    ] = None
    zone_column: Annotated[str | None, Means("column that names the zone of each row")] = None
    zones: Annotated[dict[str, str], Means('offsets of these names: `MST = "-07:00"`')] = {}
    ambiguous: Annotated[
        Literal["error", "first", "second", "order"],
        Means(
            "the hour that the clock shows twice: refused, its first or second time, or by the order of rows"
        ),
    ] = "error"
    separator: Annotated[
        str, Field(min_length=1, max_length=1), Means("between columns; a space is any number of blanks")
    ] = ","
    decimal: Annotated[Literal[".", ","], Means("decimal mark")] = "."
    thousands: Annotated[Literal["", ",", ".", " ", "'"], Means("mark between thousands")] = ""
    encoding: Annotated[str, Means("of the text")] = "utf-8"
    skip_rows: Annotated[int, Field(ge=0, le=1000), Means("above the names of the columns", "rows")] = 0
    header_rows: Annotated[
        int, Field(ge=1, le=5), Means("that make the names of the columns together", "rows")
    ] = 1
    unit_rows: Annotated[int, Field(ge=0, le=10), Means("between the names and the data", "rows")] = 0
    footer_rows: Annotated[
        int,
        Field(ge=0, le=20),
        Means("last lines of a file that hold no data, at most; a line with a time is none of them", "rows"),
    ] = 0
    columns: Annotated[
        list[str], Field(max_length=1000), Means("names of the columns of files that have none")
    ] = []
    comment: Annotated[str, Field(max_length=3), Means("how lines begin that hold no data")] = ""
    ignore: Annotated[list[str], Means("columns that look like flags and are none")] = []
    repeated_header: Annotated[
        Literal["error", "drop"], Means("a header again between the data: an error, or dropped")
    ] = "error"
    missing: Annotated[list[str], Means("texts that mean not measured")] = [
        "", "NA", "N/A", "#N/A", "NaN", "nan", "null", "NULL", "-", "--", "---"
    ]  # fmt: skip
    sentinels: Annotated[list[float], Means("numbers that mean not measured")] = []
    not_sentinels: Annotated[list[float], Means("numbers that look like it and are measured")] = []
    max_gap: Annotated[
        float, Field(ge=0, le=86_400), Means("longest gap that is bridged; a longer one fails the day", "s")
    ] = 600.0
    max_filled: Annotated[
        float, Field(ge=0, le=1), Means("largest share of a day's samples that may bridge gaps")
    ] = 0.2

    def unit(self, column: str) -> str:
        """Return the declared unit of a canonical column; m3/s or m by default."""
        return self.units.get(column, "m" if column == "h_L" else "m3/s")

    @field_validator("units", "stamp", "interval", "quality", "hold")
    @classmethod
    def _known_columns(cls, value: Any, info: ValidationInfo) -> Any:
        for key in value if isinstance(value, dict) else ():
            if key not in UNITS:
                raise ValueError(f"unknown column {key!r}; valid: {', '.join(UNITS)}")
            if info.field_name == "units" and value[key] not in UNITS[key]:
                raise ValueError(f"{key} = {value[key]!r}; valid units: {', '.join(UNITS[key])}")
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
    def _keys_agree(self) -> "InputConfig":
        if self.separator in '"\r\n' or self.separator.isalnum():
            raise ValueError(
                f"separator {self.separator!r} cannot separate columns; expected one like ; or ,"
            )
        if self.thousands == self.decimal:
            raise ValueError(f"thousands and decimal are both {self.decimal!r}: expected two different marks")
        for name in ("time", *UNITS):
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
                raise ValueError(f"a column occurs twice in {name} = {listed}: expected each once")
        if self.layout == "long":
            if self.tag is not None and self.tag_pattern is not None:
                raise ValueError("tag and tag_pattern both define the tags: expected one of them")
            if isinstance(self.quality, dict):
                raise ValueError("quality is a table: expected the name of one column in the long layout")
        elif self.tag is not None or self.tag_pattern is not None:
            raise ValueError(
                'tag and tag_pattern are of the long layout: set layout = "long", or leave them out'
            )
        if (self.query is None) != (self.database is None):
            raise ValueError("query is SQL, database the URL to ask: expected both")
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
            raise ValueError(f"{twice[0]!r} occurs twice: expected each name once")
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
        if value is None or value in ("unix", "unix_ms", "excel"):
            return value
        moment = dt.datetime(2008, 3, 14, 13, 5, tzinfo=dt.UTC)
        expected = 'expected one like "%d/%m/%Y %H:%M", or "unix", "unix_ms" or "excel"'
        try:
            back = dt.datetime.strptime(moment.strftime(value), value)
        except ValueError as error:
            raise ValueError(f"no format of times ({error}); {expected}") from None
        if back.date() != moment.date():
            raise ValueError(f"lacks year, month or day; {expected}")
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
                    f"{value!r} is not a time zone; expected a name like Europe/Paris, America/Los_Angeles "
                    f"or UTC{_near_zones(value)}; Etc/GMT+8 is 8 h behind UTC"
                ) from None
        return value
