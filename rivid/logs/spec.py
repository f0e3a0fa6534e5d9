"""The specification of a log by the configuration, and the times and bytes of its file.

`[input]` and the signals of `[reach]` make the specification by which a file is read.
"""

import datetime as dt
import gzip
import io
import os
import re
import stat
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from rivid.config import Config
from rivid.errors import ConfigError, DataError, printable
from rivid.input_config import UNITS, InputConfig
from rivid.logs import suffix_of
from rivid.types import ONE_DAY, Ints

# microseconds in a second: times are whole microseconds of UTC since 1970, exact and fast to compare
MICRO = 1_000_000

ON_TIME = 0.01  # a sample this part of T_s late still counts for its instant: clocks are rounded to ms or s


@dataclass(frozen=True)
class Signal:
    """One canonical column and the columns of the log it is the sum of."""

    name: str  # u_Qi, u_Qo, h_L or Q_L
    sources: tuple[str, ...]  # columns of the log
    factor: float  # from the log's unit to m3/s or m
    shift: int  # subtracted from its times [us]: the interval where the stamp is at its end
    spacing: int  # expected time between two values [us]
    held: bool  # a command holds until the next one; a measured quantity is interpolated
    # whether the shift is T_s only because no interval is declared: the log must then come every T_s
    supposed: bool = False
    hold: int = 0  # longest time that a value logged by exception holds [us]; 0: values are logged regularly


@dataclass(frozen=True)
class Spec:
    """All that reading a log needs; equal specifications read a file alike."""

    input: InputConfig
    signals: tuple[Signal, ...]
    output: str  # the canonical column of the output, h_L or Q_L
    period: float  # T_s [s]
    # whether `[reach] sample_time` is declared; for messages only
    period_set: bool = field(default=True, repr=False, compare=False)

    def __hash__(self) -> int:
        return hash((self.period, self.input.time_zone))  # few specifications live at a time

    @cached_property
    def time(self) -> tuple[str, ...]:
        """Columns of the time, joined by a space."""
        return _listed(self.input.time)

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Columns of numbers that are read, or tags of the long layout, each once."""
        return tuple(dict.fromkeys(name for signal in self.signals for name in signal.sources))

    @cached_property
    def tags(self) -> tuple[str, ...]:
        """Columns of the tag of the long layout, joined by a space; empty where lines or names hold it."""
        return _listed(self.input.tag)

    @cached_property
    def flags(self) -> dict[str, str]:
        """Column of flags of each source; under "" the one of the whole row."""
        quality = self.input.quality
        if isinstance(quality, str):
            return {"": quality}
        flags: dict[str, str] = {}
        for signal in self.signals if quality else ():
            columns = _listed((quality or {}).get(signal.name))
            if columns and len(columns) != len(signal.sources):
                raise ConfigError(
                    f"[input.quality] {signal.name} has {len(columns)} columns of flags for the "
                    f"{len(signal.sources)} of [input] {signal.name}: expected one for each"
                )
            flags |= dict(zip(signal.sources, columns, strict=False))
        return flags

    @cached_property
    def long(self) -> bool:
        """Whether a row has one value and its tag."""
        return self.input.layout == "long"

    @cached_property
    def plain(self) -> bool:
        """Whether a log has one header line, no comments, and no flags or zones of rows."""
        given = self.input
        odd = given.header_rows > 1 or given.columns or given.comment
        return not (self.long or odd or self.flags or given.zone_column)

    @cached_property
    def tolerance(self) -> int:
        """How late a sample may be and still count for its instant [us]."""
        return int(ON_TIME * self.period * MICRO)

    @cached_property
    def max_gap(self) -> int:
        """Longest gap that is bridged [us]."""
        return round(self.input.max_gap * MICRO)

    @cached_property
    def latest(self) -> int:
        """How long after a day's end its values may be stamped [us]."""
        return max(signal.shift for signal in self.signals)

    @cached_property
    def digest(self) -> str:
        """Changes whenever a file would be read otherwise."""
        return sha256(repr(self).encode()).hexdigest()


_last: tuple[Config, Spec] | None = None


def spec_of(config: Config) -> Spec:
    """The specification in `config`, kept for the next call; ConfigError if flags do not match columns."""
    global _last
    if _last is None or _last[0] is not config:
        spec = _build(config)
        if _last and (spec, spec.period_set) == (_last[1], _last[1].period_set):
            spec = _last[1]  # of a batch's copy of the configuration: kept logs are found by identity
        _last = (config, spec)
    return _last[1]


def _build(config: Config) -> Spec:
    given, reach = config.input, config.reach
    signals = []
    for name in ("u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("u_Qi", "Q_L"):
        column = getattr(given, name)
        if name == "u_Qo" and not column:
            continue  # `u_Qo = ""`: the outflow is not logged
        interval = given.interval.get(name)
        spacing = round((interval or reach.sample_time) * MICRO)
        ends = given.stamp.get(name) == "end"
        signals.append(
            Signal(
                name=name,
                sources=_listed(column or name),
                factor=UNITS[name][given.unit(name)],
                shift=spacing if ends else 0,
                spacing=spacing,
                held=name in ("u_Qi", "u_Qo"),
                supposed=ends and interval is None,
                hold=round(given.hold.get(name, 0.0) * MICRO),
            )
        )
    declared = "sample_time" in reach.model_fields_set
    spec = Spec(given, tuple(signals), reach.output, reach.sample_time, declared)
    _ = spec.flags  # checks their number
    return spec


def _listed(columns: str | list[str] | None) -> tuple[str, ...]:
    return () if not columns else (columns,) if isinstance(columns, str) else tuple(columns)


def seconds_of(offset: str) -> int:
    """Seconds of an offset like Z, +01, +0100 or -07:00."""
    digits = offset[1:].replace(":", "").ljust(4, "0")
    seconds = int(digits[:2]) * 3600 + int(digits[2:]) * 60
    return -seconds if offset[0] == "-" else seconds


EPOCH = dt.datetime(1970, 1, 1)
FIRST, LAST = (int((dt.datetime(y, 1, 1) - EPOCH).total_seconds()) * MICRO for y in (1850, 2200))
"""Times beyond these are damage, not history [us]."""
_QUARTER = 900 * MICRO  # offsets change at quarters of an hour only
_DAY = 86_400 * MICRO
_MICROSECOND = dt.timedelta(microseconds=1)
_HOUR_24 = re.compile(r"(?<![\d:])24(?=:?00(?::?00(?:[.,]0+)?)?(?![\d:]))")
# times that are numbers: steps in one, length of a step [us], and the number of 1970. They are UTC; those of
# spreadsheets are days of a local clock, in steps of a second, since they have some five decimals
COUNTS = {"unix": (MICRO, 1, 0), "unix_ms": (1000, 1, 0), "excel": (86_400, MICRO, 25_569)}


@lru_cache(maxsize=4096)
def day_bounds(date: dt.date, zone: dt.tzinfo) -> tuple[int, int]:
    """First instant of a local day and of the next one [us UTC]; 23 or 25 h apart when clocks change."""
    midnights = (dt.datetime.combine(day, dt.time(), zone) for day in (date, date + ONE_DAY))
    start, end = (round(midnight.timestamp()) * MICRO for midnight in midnights)
    return start, end


def local(time: int, zone: dt.tzinfo) -> dt.datetime:
    """A time [us UTC] on the local clock."""
    return dt.datetime.fromtimestamp(time // MICRO, zone)


def clock(time: int, zone: dt.tzinfo, with_date: bool = False) -> str:
    """A local time for messages: 13:05, or with its date."""
    moment = local(time, zone)
    text = f"{moment:%H:%M:%S}" if moment.second else f"{moment:%H:%M}"
    return f"{moment.date()} {text}" if with_date else text


def to_utc(naive: Ints, zone: dt.tzinfo, ambiguous: str) -> tuple[Ints, list[tuple[int, str]]]:
    """UTC (n,) [us] of local times (n,) [us since 1970 on that clock], and the refused rows with reasons.

    `ambiguous` states which turn of the hour that occurs twice is meant: "error", "first", "second", or
    "order": the second turn begins where the log steps back.
    """
    day = naive // _DAY
    days = np.unique(day)
    edges = np.array([[_offset(int(d + k) * _DAY, zone) for k in (0, 1)] for d in days])
    row = np.searchsorted(days, day)
    first, second, later = edges[row, 0], edges[row, 0], np.full(len(naive), ambiguous == "second")
    change = np.flatnonzero(edges[row, 0] != edges[row, 1])
    quarters, at = np.unique(naive[change] // _QUARTER * _QUARTER, return_inverse=True)
    turns = [[_offset(quarter, zone, fold) for quarter in quarters.tolist()] for fold in (0, 1)]
    first[change], second[change] = np.array(turns, np.int64)[:, at]
    twice, moments = np.flatnonzero(first > second), naive.astype("M8[us]")
    for d in np.unique(day[twice]) if ambiguous == "order" else ():
        rows = twice[day[twice] == d]
        later[rows] = np.maximum.accumulate(np.r_[False, np.diff(naive[rows]) < 0])
    refused = [
        (i, f"{moments[i].item()} does not exist in {zone} (clocks go forward){_fixed(edges[row[i], 0])}")
        for i in np.flatnonzero(first < second).tolist()
    ]
    advice = 'clocks go back): log offsets, or set [input] ambiguous = "first", "second" or "order"'
    if ambiguous == "error":
        refused += [(i, f"{moments[i].item()} occurs twice in {zone} ({advice}") for i in twice.tolist()]
    return naive - np.where(later, second, first), refused


def _fixed(offset: int) -> str:
    """Advice for a clock that keeps a UTC offset [us] of whole hours."""
    hours, rest = divmod(-int(offset), 3600 * MICRO)
    return (
        "" if rest else f': if the clock has no daylight saving, set [input] time_zone = "Etc/GMT{hours:+d}"'
    )


def _offset(naive: int, zone: dt.tzinfo, fold: int = 0) -> int:
    """UTC offset of a local time [us]."""
    moment = (EPOCH + naive * _MICROSECOND).replace(tzinfo=zone, fold=fold)
    offset = moment.utcoffset()
    assert offset is not None
    return round(offset.total_seconds()) * MICRO


def clocks_change(date: dt.date) -> bool:
    """Whether clocks change on that day somewhere: on Sundays, in these months."""
    return date.weekday() == 6 and date.month in (3, 4, 9, 10, 11)


def clock_turns_back(texts: Iterable[str], time_format: str | None, time_zone: str) -> bool:
    """Whether times of a local clock go through an hour twice, as that zone's do when summer ends."""
    moments = [time for text in texts if (time := read_text(text, time_format)) and time[1] is None]
    naive, zone = np.array([time for time, _ in moments], np.int64), ZoneInfo(time_zone)
    if not len(naive) or not to_utc(naive, zone, "error")[1]:
        return False
    utc, refused = to_utc(naive, zone, "order")
    return not refused and bool((np.diff(utc) > 0).all()) and bool((np.diff(naive) < 0).any())


def read_text(text: str, time_format: str | None) -> tuple[int, int | None] | None:
    """A time's text as (microseconds, offset [s]); None where it is no such time or in a year of no log.

    With an offset the time is [us UTC], without (None) [us] on the local clock. `time_format` is that of
    strptime, None for ISO 8601, "unix" or "unix_ms" for UTC, or "excel". Hour 24:00 is the next day's 00:00.
    """
    text, later = text.strip(), 0
    if time_format in COUNTS:
        steps, length, begin = COUNTS[time_format]
        try:
            time = round((float(text.replace(",", ".")) - begin) * steps) * length
        except (ValueError, OverflowError):
            return None
        return (time, None if time_format == "excel" else 0) if FIRST <= time < LAST else None
    moment = _moment(text, time_format)
    if moment is None and _HOUR_24.search(text):
        moment, later = _moment(_HOUR_24.sub("00", text, count=1), time_format), _DAY
    if moment is None:
        return None
    offset = moment.utcoffset()
    time = (moment.replace(tzinfo=None) - EPOCH) // _MICROSECOND + later
    if not FIRST <= time < LAST:
        return None
    if offset is None:
        return time, None
    seconds = round(offset.total_seconds())
    return time - seconds * MICRO, seconds


def _moment(text: str, time_format: str | None) -> dt.datetime | None:
    try:
        return dt.datetime.strptime(text, time_format) if time_format else dt.datetime.fromisoformat(text)
    except ValueError:
        return None


_DAY_NAME = re.compile(r"\d{4}-\d\d-\d\d")
# bytes that are read at a time where the size is not known: small next to any limit of memory
CHUNK = 1 << 20


class CutError(DataError):
    """A log that ends too early: of today's it means that it is still being written."""


DAY = 64 << 20, 2_000_000
"""Most bytes, unpacked, and rows of a file of one day: a day logged every 0.1 s is about half of it."""
MANY = 512 << 20, 20_000_000
"""Most bytes and rows of a file of many days: some thirty years at T_s = 133 s."""


def stem_of(name: str) -> str:
    """A file's name without its endings: its tag in the long layout, where nothing else states one."""
    plain = name[:-3] if name.lower().endswith(".gz") else name
    return plain.rpartition(".")[0] or plain


@lru_cache(maxsize=4096)
def is_day_file(path: str) -> bool:
    """Whether a log is of one day by its name."""
    suffix = suffix_of(path)
    return suffix is not None and _DAY_NAME.fullmatch(path[: -len(suffix)]) is not None


def shown(name: str) -> str:
    """A file's name as it can be printed: bytes that are not UTF-8 and control characters are escaped."""
    return printable(os.fsencode(name).decode("utf-8", "backslashreplace"))


def read_bytes(path: Path, name: str, most: int) -> tuple[bytes, str]:
    """The unpacked content of a log and the SHA-256 of its file; DataError beyond `most` bytes or unreadable.

    CutError for a packed file that ends too early.
    """
    try:
        with open(path, "rb", buffering=0) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise DataError(f"{name} is not a regular file")
            refuse_size(name, status.st_size, most)
            content = packed = _in_chunks(file, status.st_size + 1, most)
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    if packed and name.lower().endswith(".gz"):
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(packed)) as unpacked:
                content = _in_chunks(unpacked, CHUNK, most)
        except EOFError:
            raise CutError(f"{name} is cut off: the gzip stream does not end") from None
        except (OSError, zlib.error) as error:
            raise DataError(f"{name} is not a sound gzip file: {error}") from None
    refuse_size(name, len(content), most)
    if not content:
        raise CutError(f"{name} is empty")
    return content, sha256(packed).hexdigest()


def _in_chunks(file: io.FileIO | gzip.GzipFile, chunk: int, most: int) -> bytes:
    """The bytes of a file, `most` + 1 of a longer one; memory is taken as they come."""
    content = io.BytesIO()
    while part := file.read(min(chunk, most + 1 - content.tell())):
        content.write(part)
    return content.getvalue()


def refuse_size(name: str, size: int, most: int) -> None:
    """Raise DataError for a file that is too large, before it is read."""
    if size > most:
        limit = f"limit {most >> 20} MB, unpacked"
        raise DataError(f"{name} is too large for a log: {size / 2**20:.0f} MB ({limit})")


def refuse_rows(name: str, rows: int, most: int) -> None:
    """Raise DataError for too many rows, before they are unpacked."""
    if rows > most:
        raise DataError(f"{name} has too many rows for a log: {rows:,} (limit {most:,})")
