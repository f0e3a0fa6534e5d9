"""What the configuration declares about the logs, as one small hashable value."""

from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Literal

from rivid.config import FLOWS, UNITS, Config, InputConfig
from rivid.errors import ConfigError

MICRO = 1_000_000
"""Times are whole microseconds of UTC since 1970: exact, and quick to compare."""

ON_TIME = 0.01
"""A sample this part of T_s late still counts for its instant: clocks are rounded to ms or s."""


@dataclass(frozen=True)
class Signal:
    """One canonical column and the columns of the log it is the sum of.

    Attributes
    ----------
    name : str
        u_Qi, u_Qo, h_L or Q_L.
    sources : tuple of str
        Columns of the log.
    factor : float
        From the log's unit to m3/s or m.
    shift : int
        What to take off its times [us]: the interval where the stamp stands at its end.
    spacing : int
        Expected time between two values [us].
    held : bool
        A command holds until the next one; a measured quantity is interpolated.
    supposed : bool
        Whether the shift is T_s only because no interval is declared: the log must then come every T_s.
    hold : int
        How long a value that is reported only when it changes holds at most [us]; 0: it comes regularly.
    """

    name: str
    sources: tuple[str, ...]
    factor: float
    shift: int
    spacing: int
    held: bool
    supposed: bool = False
    hold: int = 0


@dataclass(frozen=True)
class Dialect:
    """What only exports of other systems have, and rivid's own logs never; all of it declared.

    Attributes
    ----------
    long : bool
        A row per value: the sources of the signals are tags.
    tag : tuple of str
        Columns that tell the tag, joined by a space; empty where a header line or the file's name does.
    tag_pattern : str
        Regular expression whose group is the tag of the rows below the line that has it; may be empty.
    value : str
        Column of the values of the long layout.
    quality : tuple of (str, str)
        Source and its column of flags; ("", column) for the one column that counts for the whole row.
    good : tuple of str
        Flags of values to keep.
    zone_column : str
        Column that names the zone of each row's time; may be empty.
    zones : tuple of (str, int)
        Such names and their offsets from UTC [s].
    columns : tuple of str
        Names for a file without a header; empty where it has one.
    header_rows : int
        Rows whose cells together make the names.
    comment : str
        How lines begin that hold no data; empty for none.
    ignore : tuple of str
        Columns that may be passed over although they look like flags.
    units : tuple of str
        Canonical columns whose unit is said: a name that speaks of another unit is no contradiction.
    """

    long: bool = False
    tag: tuple[str, ...] = ()
    tag_pattern: str = ""
    value: str = "value"
    quality: tuple[tuple[str, str], ...] = ()
    good: tuple[str, ...] = ()
    zone_column: str = ""
    zones: tuple[tuple[str, int], ...] = ()
    columns: tuple[str, ...] = ()
    header_rows: int = 1
    comment: str = ""
    ignore: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    @property
    def plain(self) -> bool:
        """Whether a log of this dialect is read without looking at it."""
        return self == _PLAIN or replace(self, ignore=(), units=()) == _PLAIN


_PLAIN = Dialect()


@dataclass(frozen=True)
class Spec:
    """All that reading needs to know; equal specs read a file alike.

    `period_said` is for messages only: whether `[reach] sample_time` is declared, or `period` its default.
    """

    signals: tuple[Signal, ...]
    output: str
    time: tuple[str, ...]
    time_format: str | None
    time_zone: str | None
    ambiguous: Literal["error", "first", "second", "order"]
    separator: str
    decimal: str
    thousands: str
    encoding: str
    skip_rows: int
    unit_rows: int
    repeated_header: Literal["error", "drop"]
    missing: tuple[str, ...]
    sentinels: tuple[float, ...]
    not_sentinels: tuple[float, ...]
    period: float
    max_gap: int
    max_filled: float
    dialect: "Dialect" = Dialect()
    footer_rows: int = field(default=0, repr=False)
    period_said: bool = field(default=True, repr=False, compare=False)

    def __hash__(self) -> int:
        return hash((self.time, self.period, self.time_zone))  # quick: few specs live at a time

    @property
    def sources(self) -> list[str]:
        """Columns of numbers that are read, each once."""
        return list(dict.fromkeys(name for signal in self.signals for name in signal.sources))

    @property
    def tolerance(self) -> int:
        """How late a sample may be and still count for its instant [us]."""
        return int(ON_TIME * self.period * MICRO)

    @property
    def latest(self) -> int:
        """How long after a day's end its values may be stamped [us]."""
        return max(signal.shift for signal in self.signals)

    @property
    def digest(self) -> str:
        """Changes whenever a file would be read otherwise."""
        footer = f"footer_rows={self.footer_rows}" if self.footer_rows else ""
        return sha256((repr(self) + footer).encode()).hexdigest()


_last: tuple[Config, Spec] | None = None


def spec_of(config: Config) -> Spec:
    """What `config` declares; the last answer is kept, as a batch asks for the same one all the time."""
    global _last
    if _last is None or _last[0] is not config:
        _last = (config, _build(config))
    return _last[1]


def _build(config: Config) -> Spec:
    given, reach = config.input, config.reach
    names = ("u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("u_Qi", "Q_L")
    signals = []
    for name in names:
        column = getattr(given, name)
        if name == "u_Qo" and not column:
            continue  # `u_Qo = ""`: the outflow is not logged
        sources = (column or name,) if isinstance(column or name, str) else tuple(column)
        interval = given.interval.get(name)
        spacing = round((interval or reach.sample_time) * MICRO)
        ends = given.stamp.get(name) == "end"
        unit = given.units.get(name, "m" if name == "h_L" else "m3/s")
        signals.append(
            Signal(
                name=name,
                sources=sources,
                factor=UNITS["flow" if name in FLOWS else "level"][unit],
                shift=spacing if ends else 0,
                spacing=spacing,
                held=name in ("u_Qi", "u_Qo"),
                supposed=ends and interval is None,
                hold=round(given.hold.get(name, 0.0) * MICRO),
            )
        )
    return Spec(
        signals=tuple(signals),
        output=reach.output,
        time=(given.time,) if isinstance(given.time, str) else tuple(given.time),
        time_format=given.time_format,
        time_zone=given.time_zone,
        ambiguous=given.ambiguous,
        separator=given.separator,
        decimal=given.decimal,
        thousands=given.thousands,
        encoding=given.encoding,
        skip_rows=given.skip_rows,
        unit_rows=given.unit_rows,
        repeated_header=given.repeated_header,
        missing=tuple(given.missing),
        sentinels=tuple(given.sentinels),
        not_sentinels=tuple(given.not_sentinels),
        period=reach.sample_time,
        max_gap=round(given.max_gap * MICRO),
        max_filled=given.max_filled,
        dialect=_dialect(given, signals),
        footer_rows=given.footer_rows,
        period_said="sample_time" in reach.model_fields_set,
    )


def _dialect(given: InputConfig, signals: list[Signal]) -> Dialect:
    quality: list[tuple[str, str]] = []
    if isinstance(given.quality, str):
        quality = [("", given.quality)]
    elif given.quality is not None:
        for signal in signals:
            columns = _listed(given.quality.get(signal.name))
            if columns and len(columns) != len(signal.sources):
                raise ConfigError(
                    f"[input.quality] {signal.name} has {len(columns)} columns of flags for the "
                    f"{len(signal.sources)} of [input] {signal.name}: expected one for each"
                )
            quality += zip(signal.sources, columns, strict=False)
    return Dialect(
        long=given.layout == "long",
        tag=_listed(given.tag),
        tag_pattern=given.tag_pattern or "",
        value=given.value,
        quality=tuple(quality),
        good=tuple(given.good),
        zone_column=given.zone_column or "",
        zones=tuple((name, _seconds(offset)) for name, offset in given.zones.items()),
        columns=tuple(given.columns),
        header_rows=given.header_rows,
        comment=given.comment,
        ignore=tuple(given.ignore),
        units=tuple(given.units),
    )


def _listed(columns: str | list[str] | None) -> tuple[str, ...]:
    return () if not columns else (columns,) if isinstance(columns, str) else tuple(columns)


def _seconds(offset: str) -> int:
    """Of "-07:00"."""
    seconds = int(offset[1:3]) * 3600 + int(offset[4:]) * 60
    return -seconds if offset[0] == "-" else seconds
